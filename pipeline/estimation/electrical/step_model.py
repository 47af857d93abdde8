"""Simulates the current of locked machines under voltage levels, many captures at once.

The equation is the estimator's (`estimators.current_step`). Every step of the integration is an
exact exponential with L frozen at its midpoint: exact for a constant L, else second order.

References: IEEE Std 1812-2014, 8 (step response at standstill); Hairer, Norsett and Wanner,
Solving Ordinary Differential Equations I, II.1 (midpoint rule).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.estimation.electrical.step_record import StepRecord
from pipeline.estimation.electrical.step_wave import BETWEEN
from pipeline.estimation.policy import policy

Array = NDArray[np.float64]
SHARED = ("ld_h", "d_1", "d_2", "d_3", "d_4", "lq_h", "q_1", "q_2", "q_3", "q_4")
TERMS = 4
LD, LQ = 0, 1 + TERMS
SPACE = 2.0 / math.sqrt(3.0)
Inductances = Callable[[Array, Array, Array], tuple[Array, Array]]
"""Incremental Ld and Lq [m, H] of shared parameters [m, 10] and the currents' fluxes [m, Wb]."""


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


def _covered(time: Array) -> Array:
    """Share of the way to its goal [m] after a time [m, in time constants].

    Negative where two edges of a trial cross; so far back as to overflow no trial is worth it.
    """
    return -np.expm1(-np.maximum(time, -30.0))


def _steps(record: StepRecord) -> tuple[NDArray[np.intp], Array, Array]:
    """Segment of each integration step and the shares of the segment where it begins and ends."""
    tau = record.l_start_h / (record.r_start_ohm + max(record.wave.source_ohm, 0.0))
    segments, begin, end = [], [], []
    sampled = not record.wave.has_supply
    for index, length in enumerate(np.diff(record.wave.edges_s)):
        if sampled:
            nodes = np.array([0.0, 1.0])
        else:
            reach = min(8.0 * tau, length)
            dense = np.linspace(0.0, reach, max(int(reach / tau * 16), 4) + 1)
            coarse = np.linspace(reach, length, 8)[1:] if length > reach else np.zeros(0)
            nodes = np.concatenate([dense, coarse]) / length
            nodes[-1] = 1.0
        segments += [index] * (nodes.size - 1)
        begin.append(nodes[:-1])
        end.append(nodes[1:])
    return np.array(segments, dtype=np.intp), np.concatenate(begin), np.concatenate(end)


class StepModel:
    """Predicts the current of every capture for every variant of the parameters in one sweep.

    Parameters
    ----------
    records
        The captures, as the model reads them.
    inductances
        Incremental L_d and L_q [m, H] from the shared parameters [m, 10] and the fluxes of the
        currents along d and q [m, Wb].

    """

    def __init__(self, records: Sequence[StepRecord], inductances: Inductances) -> None:
        self.records = tuple(records)
        self.inductances = inductances
        self.layout = layout_of(records)
        self._grids = [_steps(record) for record in records]
        self._count = max(grid[0].size for grid in self._grids)

    def of(self, records: Sequence[StepRecord]) -> StepModel:
        """The same equation for other records.

        Parameters
        ----------
        records
            In the same number and order, so that the parameters keep their places.

        """
        return StepModel(records, self.inductances)

    def predict(self, variants: Sequence[Array]) -> list[Array]:
        """Currents of every capture for every variant of the parameters, in one sweep.

        Parameters
        ----------
        variants
            Full parameter vectors of each capture [m, size].

        Returns
        -------
        list of array [n, m]
            Of each capture [A], offset included.

        Notes
        -----
        L(ψ) di/dt = v − R i, each step exact for the inductance in its middle: i → v/R with
        exp(−h R/L).

        """
        shared, cos_g, width, volts, drives = [], [], [], [], []
        for record, grid, rows, at, slots in zip(
            self.records, self._grids, variants, self.layout.starts, self.layout.slots, strict=True
        ):
            drive = drive_of(record, slots, rows[:, at : at + slots.size])
            segment, begin, end = grid
            lengths = np.diff(drive.edges_s, axis=1)[:, segment]
            pad = self._count - segment.size
            width.append(np.pad(lengths * (end - begin), ((0, 0), (0, pad))))
            volts.append(np.pad(drive.levels_v[:, segment], ((0, 0), (0, pad)), mode="edge"))
            shared.append(rows[:, : len(SHARED)])
            cos_g.append(np.full(rows.shape[0], math.cos(record.axis_rad)))
            drives.append(drive)
        nodes, l_mid, target = self._sweep(
            np.vstack(shared),
            np.concatenate(cos_g),
            np.vstack(width).T.copy(),
            np.vstack(volts).T.copy(),
            drives,
        )
        currents, first = [], 0
        for record, grid, drive in zip(self.records, self._grids, drives, strict=True):
            block = slice(first, first + drive.r_ohm.size)
            trace = (nodes[:, block], l_mid[:, block], target[:, block])
            currents.append(_at_samples(record, grid, drive, trace))
            first += drive.r_ohm.size
        return currents

    def _sweep(
        self, shared: Array, cos_g: Array, width: Array, volts: Array, drives: Sequence[Drive]
    ) -> tuple[Array, Array, Array]:
        """Currents at the nodes [k + 1, m]; inductance and final current of each step [k, m]."""
        r = np.concatenate([o.loop_ohm for o in drives])
        drop = np.concatenate([o.drop_v for o in drives])
        knee = np.concatenate(
            [
                np.full(o.r_ohm.size, policy().steps.drop_knee_share * c.largest_a)
                for o, c in zip(drives, self.records, strict=True)
            ]
        )
        current = np.concatenate([o.first_a for o in drives])
        nodes = np.empty((self._count + 1, r.size))
        l_mid, target = np.empty((self._count, r.size)), np.empty((self._count, r.size))
        nodes[0] = current
        dropping = bool(np.any(drop))
        sin_g = np.sqrt(np.maximum(1.0 - cos_g**2, 0.0))
        l_d, l_q = shared[:, LD], shared[:, LQ]
        flux_d, flux_q = l_d * SPACE * cos_g * current, l_q * SPACE * sin_g * current
        for k in range(self._count):
            goal = volts[k] / r
            if dropping:
                goal = goal - drop / r * np.clip(current / knee, -1.0, 1.0)
            l_d, l_q = self.inductances(shared, flux_d, flux_q)
            inductance = 2.0 * (cos_g**2 * l_d + sin_g**2 * l_q)
            rise = SPACE * (goal - current) * _covered(0.5 * width[k] * r / inductance)
            l_d, l_q = self.inductances(
                shared, flux_d + l_d * cos_g * rise, flux_q + l_q * sin_g * rise
            )
            inductance = 2.0 * (cos_g**2 * l_d + sin_g**2 * l_q)
            step = (goal - current) * _covered(width[k] * r / inductance)
            flux_d = flux_d + l_d * cos_g * SPACE * step
            flux_q = flux_q + l_q * sin_g * SPACE * step
            current = current + step
            nodes[k + 1], l_mid[k], target[k] = current, inductance, goal
        return nodes, l_mid, target

    def residuals(
        self, parameters: Array, weights: Sequence[Array], jacobian: NDArray[np.bool_]
    ) -> tuple[Array, Array]:
        """Weighted residuals [n] and their Jacobian [n, k] over the parameters that are free.

        Of each capture first the currents, then the voltages, each times its row of `weights`
        [2, rows]. One-sided differences of width 1e-6 of each parameter's natural scale.

        Parameters
        ----------
        parameters : array [k]
            All parameters.
        weights : arrays [2, n]
            Of each capture 1/standard deviation of its currents and voltages; 0 leaves a row out.
        jacobian : array [k] of bool
            Which parameters are free.

        Returns
        -------
        residuals : array [n]
        jacobian : array [n, free]

        """
        widths = self._widths(parameters)
        free = np.flatnonzero(jacobian)
        columns = [self.columns_of(c, free) for c in range(len(self.records))]
        variants = []
        for used in columns:
            rows = np.tile(parameters, (used.size + 1, 1))
            rows[np.arange(1, used.size + 1), used] += widths[used]
            variants.append(rows)
        blocks, slopes = [], []
        for c, (current, volts) in enumerate(self.predict_both(variants)):
            record, used = self.records[c], columns[c]
            place = np.searchsorted(free, used)
            for predicted, measured, weight in zip(
                (current, volts), (record.i_a, record.v_v), weights[c], strict=True
            ):
                blocks.append((predicted[:, 0] - measured) * weight)
                slope = np.zeros((measured.size, free.size))
                slope[:, place] = (
                    (predicted[:, 1:] - predicted[:, :1]) / widths[used] * weight[:, None]
                )
                slopes.append(slope)
        return np.concatenate(blocks), np.vstack(slopes)

    def predict_both(self, variants: Sequence[Array]) -> list[tuple[Array, Array]]:
        """Currents and voltages of every capture for every variant of the parameters.

        Parameters
        ----------
        variants
            For each capture, rows of all parameters [m, k].

        Returns
        -------
        list of tuple
            For each capture current and voltage [n, m] in A and V; the voltage of a sample that
            belongs to no level of the supply is 0.

        """
        predicted = []
        for current, record, rows, at, slots in zip(
            self.predict(variants),
            self.records,
            variants,
            self.layout.starts,
            self.layout.slots,
            strict=True,
        ):
            drive = drive_of(record, slots, rows[:, at : at + slots.size])
            volts = np.zeros_like(current)
            at_level = record.level != BETWEEN
            through = current[at_level] - drive.offset_a
            volts[at_level] = drive.levels_v.T[record.level[at_level]] - drive.source_ohm * through
            predicted.append((current, volts))
        return predicted

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
        positive = [LD, LQ, *self.layout.starts]
        low[positive] = 1e-3 * start[positive]
        for at, slots in zip(self.layout.starts, self.layout.slots, strict=True):
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
            Its index in `records`.
        free
            Indices of the free parameters.

        Returns
        -------
        array of int
            Those that are shared, and the capture's own.

        """
        start, size = self.layout.starts[capture], self.layout.slots[capture].size
        of_capture = (free >= start) & (free < start + size)
        return free[of_capture | (free < len(SHARED))]

    def _widths(self, parameters: Array) -> Array:
        largest = SPACE * max(record.largest_a for record in self.records)
        widths = np.empty(parameters.size)
        for place in (LD, LQ):
            flux = parameters[place] * largest
            widths[place] = 1e-6 * parameters[place]
            powers = np.arange(1.0, 1.0 + TERMS) + (place == LQ)
            widths[place + 1 : place + 1 + TERMS] = 1e-6 * flux**-powers
        for record, at, slots in zip(
            self.records, self.layout.starts, self.layout.slots, strict=True
        ):
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


def _at_samples(
    record: StepRecord,
    grid: tuple[NDArray[np.intp], Array, Array],
    drive: Drive,
    trace: tuple[Array, Array, Array],
) -> Array:
    """Current [n, m] at the record's times, by the exact step from the node before each."""
    segment, begin, _ = grid
    nodes, l_mid, target = trace
    currents = np.empty((record.t_s.size, drive.r_ohm.size))
    lengths = np.diff(drive.edges_s, axis=1)
    for column in range(drive.r_ohm.size):
        starts = drive.edges_s[column, segment] + begin * lengths[column, segment]
        index = np.clip(np.searchsorted(starts, record.t_s, side="right") - 1, 0, segment.size - 1)
        goal = target[index, column]
        decay = np.exp(
            -(record.t_s - starts[index]) * drive.loop_ohm[column] / l_mid[index, column]
        )
        currents[:, column] = goal + (nodes[index, column] - goal) * decay + drive.offset_a[column]
    return currents
