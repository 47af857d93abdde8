"""Which rows of a log are captures of their own: coasts, holds of the speed, rests between them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.numerics.plateaus import true_runs

Array = NDArray[np.float64]

ZERO_SHARE = 0.02
"""Share of the largest current or speed below which it counts as none: offsets are below it."""
NOISE_MULTIPLE = 5.0
"""Standard deviations of white noise that a reading of zero stays within."""
FALL_SHARE = 0.5
"""Share of its speed that a coast loses at least: less says little of friction."""
FAST_SHARE = 0.2
"""Share of the log's highest speed that a coast begins at least at."""
HELD_SHARE = 0.01
"""Share of the log's highest speed within which it counts as held."""
LEAST_ROWS = 20
LEAST_HELD_S = 2.0
MOST_PARTS = 60
"""More parts are no set of tests: such a log starts and stops as it works."""
_SPEED, _ANGLE, _CURRENT = "omega_mech_rad_s", "theta_mech_rad", "iq_a"
_TESTS = {"coast": "spin_down", "hold": "torque_map", "drive": "drive", "rest": None}


@dataclass(frozen=True, slots=True)
class PartSeen:
    """Rows `first` to `last` of a file that seem to be of one test, and `why`; a rest has none."""

    file: str
    first: int
    last: int
    test: str | None
    why: str

    @property
    def line(self) -> str:
        """The part as an item of a map's `captures`."""
        name = self.file.replace("'", "''")
        return f"- {{files: ['{name}'], rows: {self.first}-{self.last}, test: {self.test}}}"


def parts_of(file: str, columns: Mapping[str, Array]) -> tuple[PartSeen, ...]:
    """The parts of a log that holds several tests.

    Parameters
    ----------
    file
        Its name.
    columns
        Columns of the contract [n] in SI units, as far as they are known.

    Returns
    -------
    tuple of PartSeen
        Every row is in one; empty where the whole log is of one kind, or where current and motion
        are not both there: a shaft that slows down under a current does not coast.

    """
    if not {"t_s", _CURRENT} <= columns.keys() or columns["t_s"].size < LEAST_ROWS:
        return ()
    time, speed = columns["t_s"], _speed_of(columns)
    if speed is None:
        return ()
    none = _zero_of(columns[_CURRENT])
    free = np.abs(columns[_CURRENT]) <= none
    kind = _kinds(time, speed, free, transducer="torque_shaft_nm" in columns)
    if not np.isin(kind, ("coast", "hold")).any():
        return ()
    ends = np.flatnonzero(kind[1:] != kind[:-1])
    parts = []
    for first, last in zip([0, *(ends + 1)], [*ends, kind.size - 1], strict=True):
        a, b, one = int(first), int(last), str(kind[first])
        test, why = _TESTS[one], _why(one, time[a : b + 1], speed[a : b + 1], none)
        if test is not None and b - a < LEAST_ROWS:
            test, why = None, "too short for a test"
        parts.append(PartSeen(file, a, b, test, why))
    return tuple(parts) if 1 < len(parts) <= MOST_PARTS else ()


def _speed_of(columns: Mapping[str, Array]) -> Array | None:
    """Speed [n, rad/s] as recorded, else that of the angle; None without either."""
    speed = columns.get(_SPEED)
    if speed is None and _ANGLE in columns:
        with np.errstate(divide="ignore", invalid="ignore"):
            speed = np.gradient(columns[_ANGLE], columns["t_s"])
    known = speed is not None and np.isfinite(speed).all()
    return _smoothed(speed) if speed is not None and known else None


def _kinds(
    time: Array, speed: Array, free: NDArray[np.bool_], *, transducer: bool
) -> NDArray[np.str_]:
    """What was done at each row [n]: coast, hold, rest or drive; `free` is without current."""
    top = float(np.max(np.abs(speed)))
    stands = np.abs(speed) <= ZERO_SHARE * top
    kind = np.full(time.size, "drive", dtype="U6")
    for first, stop in true_runs(~stands & (_drift(speed) <= HELD_SHARE * top) & transducer):
        if time[stop - 1] - time[first] >= LEAST_HELD_S:
            kind[first:stop] = "hold"
    for first, stop in true_runs(free & ~stands):
        fast, slow = abs(float(speed[first])), abs(float(speed[stop - 1]))
        falls = fast >= FAST_SHARE * top and slow <= (1.0 - FALL_SHARE) * fast
        if stop - first > LEAST_ROWS and falls:
            kind[first:stop] = "coast"
    for first, stop in true_runs(free & stands):
        if stop - first > LEAST_ROWS:
            kind[first:stop] = "rest"
    return kind


def _why(kind: str, time: Array, speed: Array, none: float) -> str:
    """What the rows of a part [m] show, in words."""
    seconds = f"{time[-1] - time[0]:.3g} s"
    if kind == "coast":
        return (
            f"a coast: no current beyond {none:.2g} A while the speed goes from {speed[0]:.4g} to "
            f"{speed[-1]:.4g} rad/s in {seconds}"
        )
    if kind == "hold":
        return f"the speed is held at {np.median(speed):.4g} rad/s for {seconds}"
    state = "neither current nor motion" if kind == "rest" else "driven"
    return f"{state} for {seconds}"


def _zero_of(current: Array) -> float:
    """What a current of none may read as [A]: its share of the largest, or noise."""
    noise = float(np.nanmedian(np.abs(np.diff(current)))) / (0.6745 * math.sqrt(2.0))
    return max(ZERO_SHARE * float(np.nanmax(np.abs(current))), NOISE_MULTIPLE * noise)


def _smoothed(values: Array) -> Array:
    """Means over five rows, which single readings of a coarse speed need."""
    padded = np.pad(values, 2, mode="edge")
    return np.convolve(padded, np.full(5, 0.2), mode="valid")


def _drift(speed: Array) -> Array:
    """Largest change of the speed over the rows around each [n]."""
    width = LEAST_ROWS
    padded = np.pad(speed, (width // 2, width - width // 2 - 1), mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, width)
    return windows.max(axis=1) - windows.min(axis=1)
