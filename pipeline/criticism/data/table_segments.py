"""Tables without a clock: flux linkages of currents, or the steady voltages they make at speed."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from pipeline.criticism.data.segment import Segment, Sensors, segment_of
from pipeline.criticism.effect import Array, Machine
from pipeline.records.capture import Capture

_FLUX_NOISE = 1e-3
"""Noise of a table's column, as a share of its range: a table does not tell its own, and 0.1 % is
what such tables are good to, by judgement."""
_OTHER_AXIS = 0.1
"""Share of the other axis's range that an axis has at the least: one that stands still has none."""
_LEAST_NOISE = 1e-5
"""Share of the largest voltage that the noise is never below: straight lines may fit exactly."""
_FEW_LEVELS = 4
"""Levels of d current from which on they can be held out one by one: the others tell a curve."""
_ROWS_A_LEVEL = 3
"""Rows a level on the average: two make a straight line, a third its scatter."""
_CLEAR_OF_NOISE = 2.0
"""Widths of the widest level that levels must be apart. By judgement: at 1 noise parts a level."""


def flux_table(capture: Capture, _: Machine) -> Segment | None:
    """The segment of a `flux_map` capture: flux linkages where there are any, else voltages."""
    if capture.has("id_a", "iq_a", "psi_d_wb", "psi_q_wb"):
        return _linkages(capture)
    if capture.has("id_a", "omega_mech_rad_s", "vq_v"):
        return _steady(capture)
    return None


def _linkages(capture: Capture) -> Segment | None:
    """Flux linkages of both axes, or of a sweep along one, whose other axis stands still."""
    names = ("id_a", "iq_a", "psi_d_wb", "psi_q_wb")
    found = capture.arrays(*names)
    noise = _axes_noise(found, names[:2]) | _axes_noise(found, names[2:])
    if not all(noise.values()):
        return None
    levels = levels_of(found["id_a"])
    # rows of one d current are held out together: a map is often its own mirror image in i_q
    blocks = levels if levels.max(initial=0) + 1 >= _FEW_LEVELS else None
    channels = ("psi_d_wb", "psi_q_wb")
    return segment_of(
        capture,
        "flux_map",
        "drive",
        1.0,
        found=found,
        sensors=Sensors(noise),
        channels=channels,
        weak=None,
        blocks=blocks,
    )


def _axes_noise(found: Mapping[str, Array], names: tuple[str, ...]) -> dict[str, float]:
    """A share of an axis's range, or a tenth of the other's at least: one instrument reads both."""
    ranges = {name: float(np.ptp(found[name])) for name in names}
    least = _OTHER_AXIS * max(ranges.values())
    return {name: _FLUX_NOISE * max(own, least) for name, own in ranges.items()}


def _steady(capture: Capture) -> Segment | None:
    """Levels of d current, each run at several speeds: v_q, the drop of i_q taken off.

    Each level has a free offset of its own, since what the inverter drops along q depends on the
    current. The noise is the scatter of a level's voltages about a straight line over speed.
    """
    found = capture.arrays("id_a", "omega_mech_rad_s", "vq_v")
    levels = set_levels(found["id_a"])
    count = int(levels.max(initial=0)) + 1
    freedom = found["vq_v"].size - 2 * count
    if freedom < count:
        return None
    volts = found["vq_v"]
    power = sum(
        _scatter(found["omega_mech_rad_s"][levels == k], volts[levels == k]) for k in range(count)
    )
    least = _LEAST_NOISE * float(np.abs(volts).max())
    noise = {"vq_v": max(math.sqrt(power / freedom), least)}
    offsets = np.abs(volts).max() * (levels[None, :] == np.arange(count)[:, None])
    return segment_of(
        capture,
        "steady",
        "drive",
        1.0,
        found=found,
        sensors=Sensors(noise),
        channels=("vq_v",),
        weak=None,
        blocks=levels,
        offsets=offsets.astype(float),
    )


def _scatter(speed: Array, volts: Array) -> float:
    """Sum of squares of one level's voltages about a straight line over speed."""
    design = np.column_stack([np.ones(speed.size), speed])
    left = volts - design @ np.linalg.lstsq(design, volts, rcond=None)[0]
    return float(left @ left)


def set_levels(current: Array) -> NDArray[np.int64]:
    """Number of the level [n] that was set for each current, noise and all.

    The rows are parted as finely as leaves three rows a level on average, and levels further from
    each other than twice the width of the widest. If there is no such parting, all are one level.
    """
    gaps = np.diff(np.sort(current))
    gaps = gaps[gaps > _apart(current, 0.0)]
    for least in np.unique(np.append(gaps, 0.0)):
        levels = levels_of(current, float(least))
        count = int(levels.max(initial=0)) + 1
        if current.size < _ROWS_A_LEVEL * count:
            continue
        widest = max(float(np.ptp(current[levels == k])) for k in range(count))
        if gaps[gaps > least].min(initial=math.inf) > _CLEAR_OF_NOISE * widest:
            return levels
    return np.zeros(current.size, dtype=np.int64)


def levels_of(current: Array, least: float = 0.0) -> NDArray[np.int64]:
    """Number of the level [n] that each current is at; levels are parted by a gap between them.

    A gap is a step of the sorted currents over a hundredth of their range, and over `least`.
    """
    order = np.argsort(current, kind="stable")
    parted = np.diff(current[order]) > _apart(current, least)
    number = np.concatenate([[0], np.cumsum(parted)])
    levels = np.empty(current.size, dtype=np.int64)
    levels[order] = number
    return levels


def _apart(current: Array, least: float) -> float:
    return max(1e-2 * float(np.ptp(current)), least)
