"""Parameters of the step model: those of the axes, and each capture's own."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.estimation.electrical.step_record import StepRecord
from pipeline.estimation.policy import policy

Array = NDArray[np.float64]
SHARED = ("ld_h", "d_1", "d_2", "d_3", "d_4", "lq_h", "q_1", "q_2", "q_3", "q_4")
TERMS = 4
LD, LQ = 0, 1 + TERMS
SPACE = 2.0 / math.sqrt(3.0)
"""Length of the space vector of a current of 1 through a pair."""


@dataclass(frozen=True, slots=True)
class Slots:
    """Where one capture's own parameters sit, counted from its first; None where it has none.

    The pair's and the supply's resistance, the current's offset where the voltage has two levels
    or more, the moves of its edges [samples], the first current where the capture starts unsettled,
    the inverter's drop where commanded, and the supply's open voltages.
    """

    r_ohm: int
    source_ohm: int | None
    offset_a: int | None
    moves: slice
    first_a: int | None
    drop_v: int | None
    levels_v: slice
    size: int


def slots_of(record: StepRecord) -> Slots:
    """The places of a capture's own parameters.

    Parameters
    ----------
    record
        The capture, as the model reads it.

    Returns
    -------
    Slots
        Counted from the capture's first parameter; None for a parameter that the capture has no
        need of.

    """
    wave, at = record.wave, 1
    places: list[int | None] = []
    for has_parameter in (
        wave.has_supply and not record.commanded,
        wave.levels_v.size > 1,
        not record.starts_settled,
        record.commanded,
    ):
        places.append(at if has_parameter else None)
        at += has_parameter
    source, offset, first, drop = places
    moves = slice(at, at + wave.moves.shape[1])
    levels = slice(moves.stop, moves.stop + (wave.levels_v.size if wave.has_supply else 0))
    return Slots(0, source, offset, moves, first, drop, levels, levels.stop)


@dataclass(frozen=True, slots=True)
class Layout:
    """Where the parameters sit: those of the axes, then from `starts` each capture's own."""

    starts: tuple[int, ...]
    slots: tuple[Slots, ...]

    @property
    def size(self) -> int:
        """How many parameters in all."""
        return self.starts[-1] + self.slots[-1].size

    def bounds(self, start: Array) -> tuple[Array, Array]:
        """Where the search may go; beyond, a current would run away without end.

        Parameters
        ----------
        start
            Starting values [k].

        Returns
        -------
        low, high
            [k]. Inductances and resistances stay positive, the loop's too, and an edge near the
            samples that leave it open.

        """
        low, high = np.full(start.size, -np.inf), np.full(start.size, np.inf)
        positive = [LD, LQ, *self.starts]
        low[positive] = 1e-3 * start[positive]
        for at, slots in zip(self.starts, self.slots, strict=True):
            if slots.source_ohm is not None:
                low[at], low[at + slots.source_ohm] = 0.6 * start[at], -0.5 * start[at]
            moves = slice(at + slots.moves.start, at + slots.moves.stop)
            low[moves], high[moves] = -policy().steps.edge_reach, policy().steps.edge_reach
        return low, high

    def columns_of(self, capture: int, free: NDArray[np.intp]) -> NDArray[np.intp]:
        """The free parameters that the prediction for a capture depends on.

        Parameters
        ----------
        capture
            Its index in the order of the fit.
        free
            Indices of the free parameters.

        Returns
        -------
        array of int
            Those that are shared, and the capture's own.

        """
        start, size = self.starts[capture], self.slots[capture].size
        of_capture = (free >= start) & (free < start + size)
        return free[of_capture | (free < len(SHARED))]


def layout_of(records: Sequence[StepRecord]) -> Layout:
    """The layout of the parameters for some captures.

    Parameters
    ----------
    records
        In the order of the fit.

    Returns
    -------
    Layout
        The shared parameters first, then those of each capture in turn.

    """
    slots = tuple(slots_of(record) for record in records)
    starts = np.cumsum([len(SHARED), *(o.size for o in slots[:-1])])
    return Layout(tuple(int(s) for s in starts), slots)


@dataclass(frozen=True, slots=True)
class Drive:
    """What drives one capture in m variants [m each]; edges [m, s + 1], open voltages [m, s]."""

    r_ohm: Array
    source_ohm: Array
    offset_a: Array
    edges_s: Array
    first_a: Array
    drop_v: Array
    levels_v: Array

    @property
    def loop_ohm(self) -> Array:
        """Resistance of pair and supply [m]."""
        return self.r_ohm + self.source_ohm


def drive_of(record: StepRecord, slots: Slots, values: Array) -> Drive:
    """The drive of a capture from the columns of its own parameters [m, size].

    Parameters
    ----------
    record
        The capture.
    slots
        Where its own parameters sit.
    values : array [m, size]
        Variants of them.

    """
    wave, none = record.wave, np.zeros(values.shape[0])

    def column(place: int | None) -> Array:
        return none if place is None else values[:, place]

    r_ohm, source_ohm = values[:, slots.r_ohm], column(slots.source_ohm)
    edges = wave.edges_s + wave.period_s * values[:, slots.moves] @ wave.moves.T
    levels = (
        values[:, slots.levels_v] if wave.has_supply else np.tile(wave.levels_v, (none.size, 1))
    )
    settled = levels[:, 0] / (r_ohm + source_ohm)
    first = settled if slots.first_a is None else values[:, slots.first_a]
    return Drive(
        r_ohm, source_ohm, column(slots.offset_a), edges, first, column(slots.drop_v), levels
    )


def start_of(records: Sequence[StepRecord], layout: Layout) -> Array:
    """Parameters to begin the fit with, all from linear equations.

    Parameters
    ----------
    records
        The captures.
    layout
        Where their parameters sit.

    Returns
    -------
    array [k]
        L_d and L_q by which the captures' integrated forms, L = 2 (L_d cos² + L_q sin²) of the
        angle between d axis and pair, are met best; R and the supply's open voltages and resistance
        of each capture; all else 0.

    """
    cos2 = np.array([math.cos(r.axis_rad) ** 2 for r in records])
    mixing = 2.0 * np.column_stack([cos2, 1.0 - cos2])
    l_total = np.array([r.l_start_h for r in records])
    ridge = 1e-3 * np.eye(2)
    both = np.linalg.solve(
        mixing.T @ mixing + ridge, mixing.T @ l_total + ridge.sum(0) * l_total.mean() / 2
    )
    start = np.zeros(layout.size)
    start[[LD, LQ]] = np.clip(both, 0.2 * l_total.min() / 2, 5.0 * l_total.max() / 2)
    for record, at, slots in zip(records, layout.starts, layout.slots, strict=True):
        start[at] = record.r_start_ohm
        if slots.source_ohm is not None:
            start[at + slots.source_ohm] = max(record.wave.source_ohm, -0.5 * record.r_start_ohm)
        if record.wave.has_supply:
            start[at + slots.levels_v.start : at + slots.levels_v.stop] = record.wave.levels_v
    return start


def difference_widths(records: Sequence[StepRecord], layout: Layout, parameters: Array) -> Array:
    """Widths of one-sided differences, a small part of each parameter's natural scale.

    Parameters
    ----------
    records
        The captures.
    layout
        Where their parameters sit.
    parameters
        All parameters [k].

    Returns
    -------
    array [k]
        In the units of the parameters.

    """
    largest = SPACE * max(record.largest_a for record in records)
    widths = np.empty(parameters.size)
    for place in (LD, LQ):
        flux = parameters[place] * largest
        widths[place] = 1e-6 * parameters[place]
        powers = np.arange(1.0, 1.0 + TERMS) + (place == LQ)
        widths[place + 1 : place + 1 + TERMS] = 1e-6 * flux**-powers
    for record, at, slots in zip(records, layout.starts, layout.slots, strict=True):
        ampere = max(record.largest_a, 1e-9)
        widths[at : at + slots.size] = 1e-5 * ampere
        widths[at] = 1e-6 * parameters[at]
        if slots.source_ohm is not None:
            widths[at + slots.source_ohm] = 1e-6 * parameters[at]
        widths[at + slots.moves.start : at + slots.moves.stop] = 1e-4
        widths[at + slots.moves.stop : at + slots.size] = 1e-5 * ampere * parameters[at]
        if slots.drop_v is not None:
            widths[at + slots.drop_v] = 1e-5 * ampere * parameters[at]
    return widths
