"""Simulates the current of locked machines under voltage levels, many captures at once.

The equation is the estimator's (`estimators.current_step`). Every step of the integration is an
exact exponential with L frozen at its midpoint: exact for a constant L, else second order.

References: IEEE Std 1812-2014, 8 (step response at standstill); Hairer, Norsett and Wanner,
Solving Ordinary Differential Equations I, II.1 (midpoint rule).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from pipeline.estimation.electrical.step_parameters import (
    LD,
    LQ,
    SHARED,
    SPACE,
    Array,
    Drive,
    Layout,
    difference_widths,
    drive_of,
    layout_of,
)
from pipeline.estimation.electrical.step_record import StepRecord
from pipeline.estimation.electrical.step_wave import BETWEEN
from pipeline.estimation.policy import policy

Inductances = Callable[[Array, Array, Array], tuple[Array, Array]]
"""Incremental Ld and Lq [m, H] of shared parameters [m, 10] and the currents' fluxes [m, Wb]."""


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
            slower = policy().steps.slower_in * tau
            # the last step begins after 30 of these at the latest: nothing is left to settle there
            share = -math.expm1(-min(length / slower, 30.0))
            count = max(math.ceil(policy().steps.slower_in * policy().steps.fine * share), 4)
            nodes = -slower / length * np.log1p(-share * np.linspace(0.0, 1.0, count + 1))
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
    layout
        Where the parameters of each capture sit; one after the other where not given.

    """

    def __init__(
        self,
        records: Sequence[StepRecord],
        inductances: Inductances,
        layout: Layout | None = None,
    ) -> None:
        self.records = tuple(records)
        self.inductances = inductances
        self.layout = layout_of(records) if layout is None else layout
        self._grids = [_steps(record) for record in records]
        self._count = max(grid[0].size for grid in self._grids)

    def of(self, records: Sequence[StepRecord], places: Sequence[int]) -> StepModel:
        """The same equation for other records.

        Parameters
        ----------
        records
            With as many parameters of its own as the one in whose place each stands.
        places
            Of the records of this model; each gives its own parameters.

        """
        starts = tuple(self.layout.starts[n] for n in places)
        slots = tuple(self.layout.slots[n] for n in places)
        return StepModel(records, self.inductances, Layout(starts, slots))

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
        widths = difference_widths(self.records, self.layout, parameters)
        free = np.flatnonzero(jacobian)
        columns = [self.layout.columns_of(c, free) for c in range(len(self.records))]
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
