"""Columns of one table that were recorded on clocks of their own, each in a table of its own."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np
import polars as pl

from pipeline.contracts.protocol import warning
from pipeline.numerics.clocks import SMOOTHER, clearest_ratio, counted
from pipeline.records.capture import Array, Capture, Indices
from pipeline.records.finding import Finding

_SAMPLED = ("_v", "_a", "_nm", "omega_mech_rad_s")
"""Ends of columns that are new in every sample; a temperature may stay, and an angle by steps."""
_LEAST_HELD = 50
"""Values from which on a clock is known."""
_MOST_HELD_S = 0.05
"""Longest that a bus holds a value [s]; a plateau of a test without noise is longer."""
_VARIED = 2.5
"""Size of large changes over that of small ones from which on they are no steps of an encoder."""
_ON_CLOCK = 0.95
"""Least share of a column's changes that keep to its own clock, where it is held between them."""
_LEAST_STAMPS, _EVEN = 50, 1e-2
"""Stamps from which on a clock is known, and by how much of a period they may be off it."""
_MISSING, _MOST_SCATTER = 1.6, 0.5
"""Distance of two stamps beyond which a sample may be missing, and scatter beyond which a stamp may
be its neighbour's [periods]."""
_JITTER = 0.2
"""What a change may be off its clock by, over the time for which values are held."""


def stamps_counted(capture: Capture) -> tuple[Capture, list[Finding]]:
    """The capture with its samples counted, where only their stamps are uneven.

    A computer that stamps samples as they arrive is late by ever other times; a shaft that turns
    shows that they were taken evenly. Its angle over such stamps has a noise of the speed times
    what they are off by.

    Parameters
    ----------
    capture
        The capture.

    Returns
    -------
    Capture
        The same one where no signal is clearly smoother over the count.
    list of Finding
        A warning for each table that is counted.

    """
    tables, findings = [], []
    for table in capture.tables:
        even = _even_stamps(table)
        tables.append(table if even is None else table.with_columns(pl.Series("t_s", even)))
        if even is not None:
            period = (even[-1] - even[0]) / max(even.size - 1, 1)
            off = float(np.std(table["t_s"].to_numpy() - even)) / period
            words = (
                f"t_s is off an even clock by {100.0 * off:.2g} % of its period, and the signals "
                "are not: the samples are counted"
            )
            remedy = "stamp samples where they are taken, not where they arrive"
            rows = (0, table.height - 1)
            findings.append(warning(capture, "scattered_stamps", words, remedy, rows))
    return (replace(capture, tables=tuple(tables)) if findings else capture), findings


def _even_stamps(table: pl.DataFrame) -> Array | None:
    """Times [n, s] of a clock that is even, where only the stamps are not."""
    if "t_s" not in table.columns or table.height < _LEAST_STAMPS:
        return None
    time = table["t_s"].to_numpy()
    steps = np.diff(time)
    if np.abs(steps - np.median(steps)).max() <= _EVEN * np.median(steps):
        return None
    signals = [n for n in table.columns if n.endswith((*_SAMPLED, "_rad"))]
    columns = [table[n].to_numpy() for n in signals if table[n].dtype.is_float()]
    whole = [column for column in columns if np.isfinite(column).all()]
    clock = counted(time, _MISSING, _MOST_SCATTER, whole)
    if clock is None or clearest_ratio(time, clock[1], whole) >= SMOOTHER:
        return None
    period, first = np.polyfit(clock[1], time, 1)
    even: Array = first + period * clock[1]
    return even


def held_apart(capture: Capture) -> tuple[Capture, list[Finding]]:
    """The capture with what a slower clock brings in tables of its own, each value once.

    A logger that writes rows faster than a bus brings values fills them with the last ones, which
    are no samples. A coarse value repeats as well, but its changes keep to no clock.

    Parameters
    ----------
    capture
        The capture.

    Returns
    -------
    Capture
        The same one where nothing is held.
    list of Finding
        A warning for each time that values are held for.

    """
    tables: list[pl.DataFrame] = []
    streams: list[pl.DataFrame] = []
    findings = []
    for table in capture.tables:
        held = _held_rows(table, capture.meta.pwm_hz) if "t_s" in table.columns else {}
        new = {name: rows for name, (rows, _) in held.items()}
        streams += _in_common_rows(table.with_columns(map(_filled, new)), new)
        for count in sorted({count for _, count in held.values()}):
            names = [name for name, (_, every) in held.items() if every == count]
            words = f"{', '.join(names)}: new in every {count}th row, the last value in between"
            remedy = "write a value where it is new; the repeats are left out"
            findings.append(warning(capture, "held_values", words, remedy, (0, table.height - 1)))
        rest = table.drop(list(held))
        tables += [rest] if rest.columns != ["t_s"] else []
    return (replace(capture, tables=(*tables, *streams)) if findings else capture), findings


def _held_rows(table: pl.DataFrame, pwm_hz: float | None) -> dict[str, tuple[Indices, int]]:
    """Rows in which columns that hold are new, and how many rows they hold, by name.

    An inverter holds its voltage as well, such as a square wave, and the current follows it in
    every row. So a voltage is held by a bus only where no current changes faster, or for longer
    than the drive's period.
    """
    held, faster = {}, set()
    row_s = float(np.median(np.diff(table["t_s"].to_numpy()))) if table.height > 1 else 0.0
    for name in table.columns:
        if not name.endswith((*_SAMPLED, "_rad")) or not table[name].dtype.is_float():
            continue
        # a row without a value brings none
        moved = np.diff(table.select(_filled(name))[name].to_numpy())
        changes = np.flatnonzero(moved != 0.0) + 1
        if name.endswith("_rad") and not _of_many_sizes(moved[changes - 1]):
            continue
        steps = np.diff(changes)
        count = int(np.median(steps)) if steps.size >= _LEAST_HELD else 0
        if count == 1:
            faster.add(name)
        if count <= 1 or count * row_s > _MOST_HELD_S:
            continue
        ticks = np.rint(steps / count)
        if np.mean(np.abs(steps - count * ticks) <= _JITTER * count) > _ON_CLOCK:
            # a value that is by chance the last one again is a sample as well
            passed = np.concatenate([[0], np.cumsum(np.maximum(ticks, 1))])
            rows = np.interp(np.arange(passed[-1] + 1), passed, changes)
            held[name] = np.rint(rows).astype(np.int64), count
    follows = any(name.endswith("_a") for name in faster)
    longest = 1.5 / (pwm_hz * row_s) if pwm_hz and row_s else math.inf
    return {
        name: (rows, count)
        for name, (rows, count) in held.items()
        if not (follows and name.endswith("_v") and count < longest)
    }


def _of_many_sizes(moved: Array) -> bool:
    """Whether changes of an angle are no steps of an encoder, which are all of one size or two."""
    size = np.abs(moved[np.isfinite(moved)])
    low, high = np.quantile(size, (0.1, 0.9)) if size.size else (0.0, 0.0)
    return bool(high > _VARIED * low)


def _filled(name: str) -> pl.Expr:
    """A column with the last value in rows that hold none."""
    return pl.col(name).fill_nan(None).forward_fill().fill_null(math.nan)


def streams_split(capture: Capture, dense_share: float) -> Capture:
    """The capture with every slow stream of a fast table in a further table, on its own clock.

    A stream is slow where fewer than `dense_share` of the rows hold a value, most of them with
    blank rows in between, and another column is there in more. Rows that need every column keep
    to the fast clock then, on which the slow one is interpolated.

    Parameters
    ----------
    capture
        The capture.
    dense_share
        Share of the rows [1].

    """
    tables: list[pl.DataFrame] = []
    streams: list[pl.DataFrame] = []
    for table in capture.tables:
        slow = _slow_columns(table, dense_share) if "t_s" in table.columns else {}
        streams += _in_common_rows(table, slow)
        tables.append(table.drop(list(slow)))
    return replace(capture, tables=(*tables, *streams)) if streams else capture


def _slow_columns(table: pl.DataFrame, dense_share: float) -> dict[str, Indices]:
    """Rows that hold a value of each slow column."""
    places = {n: np.flatnonzero(np.isfinite(table[n].to_numpy())) for n in table.columns}
    dense = [n for n, rows in places.items() if rows.size >= dense_share * table.height]
    if not set(dense) - {"t_s"}:
        return {}
    blanks = {n: rows for n, rows in places.items() if n not in dense and rows.size > 1}
    return {name: rows for name, rows in blanks.items() if np.median(np.diff(rows)) > 1.0}


def _in_common_rows(table: pl.DataFrame, rows: Mapping[str, Indices]) -> Iterable[pl.DataFrame]:
    """A table for all columns that hold values in the same rows: they are one stream."""
    together: dict[bytes, list[str]] = {}
    for name, places in rows.items():
        together.setdefault(places.tobytes(), []).append(name)
    for names in together.values():
        yield table.select("t_s", *names)[rows[names[0]]]
