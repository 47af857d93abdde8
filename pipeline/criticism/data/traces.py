"""Columns of a capture as signals: on an even clock, smoothed, decimated, cut to windows."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from pipeline.criticism.data.kept_digits import at_largest_step
from pipeline.criticism.operating import Array, Flags, Indices
from pipeline.criticism.policy.captures import Cutting
from pipeline.numerics.clocks import clearest_ratio, counted
from pipeline.numerics.projection import window_starts
from pipeline.physics.glossary import TESTS_WITHOUT_CLOCK
from pipeline.records.capture import Capture
from pipeline.records.row_means import bridged

if TYPE_CHECKING:
    import polars as pl

LINES_V = ("vab_v", "vbc_v", "vca_v")
PAD = 24
"""Fewest samples kept on either side of a window that is cut out."""
READ_BETWEEN = "read_between"
"""Column of the rows that were lost, or lack their angle, and are read between others."""
_SHORTEST = 24
"""Fewest rows of a capture with a clock: three windows of eight, by judgement."""


def with_values(capture: Capture) -> Capture | None:
    """The capture without columns that hold no value at the samples of its richest table, in rows
    that no gate set aside; those of a log each at one step.

    Parameters
    ----------
    capture
        Any capture.

    Returns
    -------
    Capture or None
        None where nothing remains, and for a test with a clock whose time does not rise or is too
        short.

    """
    table = max(capture.tables, key=lambda t: (len(t.columns), t.height), default=None)
    if table is None or table.height == 0:
        return None
    if capture.meta.test not in TESTS_WITHOUT_CLOCK and not _rises(table):
        return None
    names_of = [
        [name for name in t.columns if _has_values(t, name, table, capture.kept(place))]
        for place, t in enumerate(capture.tables)
    ]
    if all(set(names) <= {"t_s"} for names in names_of):
        return None
    tables = tuple(
        at_largest_step(t if len(names) == len(t.columns) else t.select(names))
        for names, t in zip(names_of, capture.tables, strict=True)
    )
    same = all(one is other for one, other in zip(tables, capture.tables, strict=True))
    return _on_its_motion(capture if same else replace(capture, tables=tables))


def _on_its_motion(capture: Capture) -> Capture:
    """A drive's log on the rows of its angle, where that is slower than its currents: between them
    nothing shows how the shaft accelerates.
    """
    if capture.meta.test not in ("drive", "torque_map"):
        return capture
    angle = next((n for n in ("theta_mech_rad", "theta_elec_rad") if capture.has(n)), None)
    return capture if angle is None else capture.on_rows_of(capture.table_of("t_s", angle))


def _rises(table: pl.DataFrame) -> bool:
    if "t_s" not in table.columns or table.height < _SHORTEST:
        return False
    return bool((np.diff(table["t_s"].to_numpy()) > 0.0).all())


def _has_values(table: pl.DataFrame, name: str, home: pl.DataFrame, kept: Flags) -> bool:
    """Whether a column has a finite value in the rows that are kept, and one of another clock has
    it while this one ran.
    """
    finite = np.isfinite(table[name].to_numpy()) & kept
    if table is home or not finite.any() or "t_s" not in table.columns:
        return bool(finite.any())
    known, time = table["t_s"].to_numpy()[finite], home["t_s"].to_numpy()
    return bool(known[0] <= time[-1] and known[-1] >= time[0])


def even_clock(
    capture: Capture, names: tuple[str, ...], policy: Cutting
) -> tuple[float, dict[str, Array], Flags]:
    """Columns of a capture on an even clock.

    Parameters
    ----------
    capture
        With `t_s`.
    names
        Columns that are wanted, on one clock.
    policy
        Constants of judgement.

    Returns
    -------
    period
        Sample period [s].
    columns
        [n each]; missing values are bridged. Where rows were lost, or lack the angle,
        `READ_BETWEEN` is 1 in those that are read between their neighbours, and 0 in others.
    keep
        Samples that count [n]: not those bridged, inside a gap, or at either end; a single row that
        is missing is read between its neighbours.

    Notes
    -----
    A clock that is even within a thousandth is taken as it is. Of another one it is found out
    whether the samples came unevenly, and are interpolated, or only their stamps, and are counted:
    then rows are read between others by their number, as their stamps are off.

    """
    home = capture.table_of("t_s", *names)
    columns = capture.arrays("t_s", *names, masked=False)
    keep = capture.kept(home).copy()
    time = columns.pop("t_s")
    period = float(np.median(np.diff(time)))
    lacks = _lacks_angle(capture.tables[home], names)
    recorded = {name: _recorded(capture.tables[home], name, c) for name, c in columns.items()}
    for name, column in columns.items():
        finite = np.isfinite(column)
        if not finite.all() and finite.any():
            columns[name] = np.interp(time, time[finite], column[finite])
            keep &= finite
    uneven = not _is_even(time, policy)
    clock = _counts(time, columns, policy) if uneven else None
    if clock:
        period, number = clock
        even = np.arange(number[-1] + 1)
        there, kept = np.zeros((2, even.size), dtype=bool)
        there[number], kept[number] = True, keep
        columns = {name: _filled(_placed(column, number)) for name, column in recorded.items()}
        single, lost = np.zeros((2, even.size), dtype=bool)
        lost[1:-1] = ~there[1:-1] & kept[:-2] & kept[2:]
        single[number], keep = lacks, kept | lost
        lacks = single | lost
    elif uneven:
        even = time[0] + period * np.arange(round((time[-1] - time[0]) / period) + 1)
        after = np.clip(np.searchsorted(time, even), 1, time.size - 1)
        keep = (
            (time[after] - time[after - 1] < policy.clock_gap * period)
            & keep[after]
            & keep[after - 1]
        )
        columns = {name: np.interp(even, time, column) for name, column in columns.items()}
        lacks = np.zeros(even.size, dtype=bool)
    keep[:1] = keep[-1:] = False
    if np.any(lacks & keep):
        columns[READ_BETWEEN] = (lacks & keep).astype(np.float64)
    return period, columns, keep


def _recorded(table: pl.DataFrame, name: str, column: Array) -> Array:
    """A column [n] without what was read between its rows by their stamps, NaN there."""
    if name not in table.columns:
        return column
    return np.where(np.isfinite(table[name].to_numpy()), column, np.nan)


def _lacks_angle(table: pl.DataFrame, names: Iterable[str]) -> Flags:
    """Rows of a table [n] in which an angle among the columns was not recorded."""
    angles = [name for name in names if name.startswith("theta") and name in table.columns]
    lacks: Flags = np.zeros(table.height, dtype=bool)
    for name in angles:
        lacks |= ~np.isfinite(table[name].to_numpy())
    return lacks


def on_counts(capture: Capture, name: str, policy: Cutting) -> Array:
    """A column at every count of its clock.

    Parameters
    ----------
    capture
        With `t_s`.
    name
        The column.
    policy
        Constants of judgement.

    Returns
    -------
    array [n]
        NaN in rows that were lost, or lack it; as recorded where its rows have no even clock.

    """
    table = capture.tables[capture.table_of("t_s", name)]
    time, column = table["t_s"].to_numpy(), table[name].to_numpy()
    known = np.isfinite(column)
    if not _rises(table) or known.sum() < _SHORTEST or _is_even(time, policy):
        return column
    clock = _counts(time[known], {name: column[known]}, policy)
    return column if clock is None else _placed(column[known], clock[1])


def _is_even(time: Array, policy: Cutting) -> bool:
    """Whether a clock [n, s] is even within a thousandth of its period."""
    steps = np.diff(time)
    period = float(np.median(steps))
    return bool(np.abs(steps - period).max() <= policy.clock_even * period)


def _counts(
    time: Array, columns: Mapping[str, Array], policy: Cutting
) -> tuple[float, Indices] | None:
    """Period [s] and number of each row [n] of an even clock that its stamps [n, s] are about; None
    where its columns [n each] are not of one.
    """
    signals = list(columns.values())
    clock = counted(time, policy.clock_missing, policy.clock_scatter, signals)
    even = clock and clearest_ratio(time, clock[1], signals) <= policy.clock_ratio
    return clock if even else None


def _placed(column: Array, number: Indices) -> Array:
    """A column at every count of a clock, of rows that have a `number` each; NaN in the others."""
    placed = np.full(number[-1] + 1, np.nan)
    placed[number] = column
    return placed


def _filled(column: Array) -> Array:
    """A column [n] with its missing values, NaN, read between others."""
    even = np.arange(column.size)
    filled = bridged(even.astype(float), column)
    known = np.isfinite(filled)
    return np.interp(even, even[known], filled[known]) if known.any() else filled


def smoothed(signal: Array, width: int) -> Array:
    """Centred moving mean, the ends continued by the mean of their half window.

    Parameters
    ----------
    signal
        Samples [n, any unit].
    width
        Samples of the mean, odd.

    Returns
    -------
    array [n]
        Same unit.

    """
    half = min(width, signal.size) // 2
    if half == 0:
        return signal
    padded = np.concatenate(
        [np.full(half, signal[:half].mean()), signal, np.full(half, signal[-half:].mean())]
    )
    total = np.concatenate([[0.0], np.cumsum(padded)])
    return (total[2 * half + 1 :] - total[: -2 * half - 1]) / (2 * half + 1)


def decimated(signal: Array, factor: int) -> Array:
    """Means of consecutive samples.

    Parameters
    ----------
    signal
        [n].
    factor
        Samples a mean.

    Returns
    -------
    array [n // factor]
        Samples beyond the last whole group are dropped.

    """
    n = signal.size // factor * factor
    return signal[:n].reshape(-1, factor).mean(axis=1)


def pad_of(period: float, policy: Cutting, least: int = PAD) -> int:
    """Samples kept on either side of a window that is cut out.

    Parameters
    ----------
    period
        Sample period [s].
    policy
        Length of the mean that makes a speed.
    least
        Fewest of them.

    Returns
    -------
    int
        What differences, and the smoothing of a speed, reach over.

    """
    return max(least, round(0.5 * policy.speed_s / period) + 3)


def thinned(
    columns: Mapping[str, Array], keep: Flags, length: int, most: int, pad: int
) -> tuple[dict[str, Array], Indices]:
    """Signals cut to an even selection of windows.

    Parameters
    ----------
    columns
        Signals [n each].
    keep
        Samples that count [n].
    length
        Samples a window.
    most
        Windows that stay.
    pad
        Samples kept on each side of a window, for what is smoothed or differenced.

    Returns
    -------
    signals
        Cut to the windows and their pads, one after the other; whole where little would go.
    starts
        First samples of the windows in them.

    Notes
    -----
    A bench log holds far more windows than the effects need, and cost goes with samples.

    """
    starts = window_starts(keep, length, length, most)
    if starts.size * (length + 2 * pad) >= keep.size:
        return dict(columns), window_starts(keep, length)
    starts = starts[(starts >= pad) & (starts + length + pad <= keep.size)]
    rows = (starts[:, None] - pad + np.arange(length + 2 * pad)[None, :]).ravel()
    cut = {name: column[rows] for name, column in columns.items()}
    return cut, pad + (length + 2 * pad) * np.arange(starts.size)


def window_of(period: float, size: int, policy: Cutting) -> int:
    """Samples a window.

    Parameters
    ----------
    period
        Sample period [s].
    size
        Samples of the capture.
    policy
        Length of a window.

    Returns
    -------
    int
        The policy's time, but no fewer than its samples, and four windows in the capture where that
        leaves enough.

    """
    samples = max(round(policy.window_s / period), policy.window_samples)
    return max(min(samples, size // 4), policy.least_window)


def window_between_gaps(period: float, keep: Flags, policy: Cutting, each: int = 1) -> int:
    """Samples a window of which some fit into the stretches that most of a capture is in.

    Parameters
    ----------
    period
        Sample period [s].
    keep
        Samples of the capture that count [n].
    policy
        Length of a window.
    each
        Windows that fit into such a stretch.

    Returns
    -------
    int
        As `window_of`.

    """
    ends = np.flatnonzero(~np.concatenate([[False], keep, [False]]))
    stretches = np.sort(np.diff(ends) - 1)
    usual = int(stretches[np.searchsorted(np.cumsum(stretches), 0.5 * float(stretches.sum()))])
    return max(min(window_of(period, keep.size, policy), usual // each), policy.least_window)


def lagged(signal: Array, step: float) -> Array:
    """A signal behind a lag of first order, at rest before its first sample.

    Parameters
    ----------
    signal
        Samples [n, any unit], on straight lines between.
    step
        Sample period over the time constant [1], above zero.

    Returns
    -------
    array [n]
        Same unit.

    """
    from scipy.signal import lfilter  # slow to import and rarely used

    kept = math.exp(-step)
    mean = -math.expm1(-step) / step
    behind: Array = lfilter([1.0 - mean, mean - kept], [1.0, -kept], signal - signal[0])
    return behind + signal[0]


def parabolas(signal: Array, width: int) -> Array:
    """Local parabolas by least squares, those of the ends to the ends.

    Parameters
    ----------
    signal
        Samples [n, any unit].
    width
        Samples of a parabola, odd; 1 leaves the signal.

    Returns
    -------
    array [n]
        Same unit.

    References
    ----------
    Savitzky and Golay, Anal. Chem. 36(8), 1964, 1627, doi:10.1021/ac60214a047.

    """
    if width == 1:
        return signal
    half = width // 2
    at = np.arange(-half, half + 1) / half
    basis = np.vander(at, 3, increasing=True)
    weights = np.linalg.pinv(basis)
    start, end = signal[:width], signal[-width:]
    middle = np.convolve(signal, weights[0][::-1], mode="valid")
    first, last = basis @ (weights @ start), basis @ (weights @ end)
    return np.concatenate([first[:half], middle, last[half + 1 :]])
