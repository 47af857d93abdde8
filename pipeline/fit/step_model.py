"""Current of a locked machine under voltage levels, and its fit to many captures at once.

    dI/dt = (v - R I)/L(I)
    L(I)  = 2 [cos²g Ld(i_d) + sin²g Lq(i_q)],  i_d + j i_q = (2/√3) I e^{jg}

g is the angle from the d axis to the pair's current. Ld and Lq are incremental and saturate with
their own flux, L0/(1 + a y + b y² + c y³ + d y⁴), y the flux that the current made; on q with |y|,
for there both senses are alike. So i is a polynomial of y, which is how iron bends. Every step of
the integration is an exact exponential with L frozen at its midpoint: exact for a constant L, else
second order.

References: IEEE Std 1812-2014, 8 (step response at standstill); Hairer, Norsett and Wanner,
Solving Ordinary Differential Equations I, II.1 (midpoint rule).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.fit.step_record import StepRecord

Array = NDArray[np.float64]
SHARED = ("ld_h", "d_1", "d_2", "d_3", "d_4", "lq_h", "q_1", "q_2", "q_3", "q_4")
TERMS = 4
EDGE_REACH = 4.0  # [samples]
LD, LQ = 0, 1 + TERMS
SPACE = 2.0 / math.sqrt(3.0)


@dataclass(frozen=True, slots=True)
class Layout:
    """Where the parameters sit: those of the axes, then each capture's own.

    Own ones in order: R, current offset where the voltage has two levels or more, the edges to
    place, the first current where the capture starts unsettled, the inverter's drop where
    commanded, and each level's error in units of its standard error, known to be 0 ± 1.
    """

    starts: tuple[int, ...]
    sizes: tuple[int, ...]

    @property
    def size(self) -> int:
        """How many parameters in all."""
        return self.starts[-1] + self.sizes[-1]


def layout_of(records: Sequence[StepRecord]) -> Layout:
    """The layout for these captures."""
    sizes = [
        1
        + (r.wave.levels_v.size > 1)
        + len(r.wave.free)
        + (not r.starts_settled)
        + r.commanded
        + r.wave.u_levels_v.size
        for r in records
    ]
    starts = np.cumsum([len(SHARED), *sizes[:-1]])
    return Layout(tuple(int(s) for s in starts), tuple(sizes))


@dataclass(frozen=True, slots=True)
class Own:
    """One capture's own parameters for m variants [m each]; edges [m, s + 1], levels [m, s]."""

    r_ohm: Array
    offset_a: Array
    edges_s: Array
    first_a: Array
    drop_v: Array
    levels_v: Array


def unpack(record: StepRecord, own: Array) -> Own:
    """The own parameters of a capture from their columns [m, size]."""
    count = own.shape[0]
    at = 1
    offset = np.zeros(count)
    if record.wave.levels_v.size > 1:
        offset, at = own[:, at], at + 1
    edges = np.tile(record.wave.edges_s, (count, 1))
    for index in record.wave.free:
        edges[:, index] = record.wave.edges_s[index] + own[:, at] * record.wave.period_s
        at += 1
    levels = np.tile(record.wave.levels_v, (count, 1))
    if record.wave.u_levels_v.size:
        levels = levels + own[:, -record.wave.u_levels_v.size :] * record.wave.u_levels_v
    first = levels[:, 0] / own[:, 0]
    if not record.starts_settled:
        first, at = own[:, at], at + 1
    drop = own[:, at] if record.commanded else np.zeros(count)
    return Own(own[:, 0], offset, edges, first, drop, levels)


def start_of(records: Sequence[StepRecord], layout: Layout) -> Array:
    """Starting values: the integrated form's L split over the axes, its R; no saturation."""
    cos2 = np.array([math.cos(r.axis_rad) ** 2 for r in records])
    mixing = 2.0 * np.column_stack([cos2, 1.0 - cos2])
    l_total = np.array([r.l_start_h for r in records])
    ridge = 1e-3 * np.eye(2)
    both = np.linalg.solve(
        mixing.T @ mixing + ridge, mixing.T @ l_total + ridge.sum(0) * l_total.mean() / 2
    )
    start = np.zeros(layout.size)
    start[[LD, LQ]] = np.clip(both, 0.2 * l_total.min() / 2, 5.0 * l_total.max() / 2)
    for record, at in zip(records, layout.starts, strict=True):
        start[at] = record.r_start_ohm
    return start


def axis_inductances(shared: Array, flux_d: Array, flux_q: Array) -> tuple[Array, Array]:
    """Incremental Ld and Lq [m] at the fluxes [m] made by current; shared [m, 10]."""
    d_axis = shared[:, LD] / _bend(shared[:, LD + 1 : LD + 1 + TERMS], flux_d)
    q_axis = shared[:, LQ] / _bend(shared[:, LQ + 1 : LQ + 1 + TERMS], np.abs(flux_q))
    return d_axis, q_axis


def _bend(terms: Array, flux: Array) -> Array:
    """L0/L [m] at an axis flux [m], kept above 1/20."""
    bend = terms[:, 3] * flux
    for column in (2, 1, 0):
        bend = (bend + terms[:, column]) * flux
    return np.maximum(1.0 + bend, 0.05)


def along_ramp(shared: Array, cos_g: float, current_a: Array) -> Array:
    """Incremental inductance [n] between the terminals as the current follows a ramp [n] from 0."""
    one, sin_g = shared[None, :], math.sqrt(max(1.0 - cos_g**2, 0.0))
    flux_d, flux_q = np.zeros(1), np.zeros(1)
    found = np.empty(current_a.size)
    for k in range(current_a.size):
        l_d, l_q = axis_inductances(one, flux_d, flux_q)
        found[k] = 2.0 * float(cos_g**2 * l_d[0] + sin_g**2 * l_q[0])
        if k + 1 < current_a.size:
            step = SPACE * float(current_a[k + 1] - current_a[k])
            middle = flux_d + 0.5 * l_d * cos_g * step, flux_q + 0.5 * l_q * sin_g * step
            l_d, l_q = axis_inductances(one, *middle)
            flux_d, flux_q = flux_d + l_d * cos_g * step, flux_q + l_q * sin_g * step
    return found


def _steps(record: StepRecord) -> tuple[NDArray[np.intp], Array, Array]:
    """Segment of each integration step and the shares of the segment where it begins and ends."""
    tau = record.l_start_h / record.r_start_ohm
    segments, begin, end = [], [], []
    sampled = record.wave.levels_v.size > 20
    for index, length in enumerate(np.diff(record.wave.edges_s)):
        if sampled:
            nodes = np.array([0.0, 1.0])
        else:
            reach = min(8.0 * tau, length)
            fine = np.linspace(0.0, reach, max(int(reach / tau * 16), 4) + 1)
            coarse = np.linspace(reach, length, 8)[1:] if length > reach else np.zeros(0)
            nodes = np.concatenate([fine, coarse]) / length
            nodes[-1] = 1.0
        segments += [index] * (nodes.size - 1)
        begin.append(nodes[:-1])
        end.append(nodes[1:])
    return np.array(segments, dtype=np.intp), np.concatenate(begin), np.concatenate(end)


class StepModel:
    """Predicts the current of every capture for every variant of the parameters in one sweep."""

    def __init__(self, records: Sequence[StepRecord]) -> None:
        self.records = tuple(records)
        self.layout = layout_of(records)
        self._grids = [_steps(record) for record in records]
        self._count = max(grid[0].size for grid in self._grids)

    def predict(self, variants: Sequence[Array]) -> list[Array]:
        """Currents [n, m] of each capture; variants[c] [m, size] are full parameter vectors."""
        shared, cos_g, width, volts, own = [], [], [], [], []
        for record, grid, rows, at, size in zip(
            self.records,
            self._grids,
            variants,
            self.layout.starts,
            self.layout.sizes,
            strict=True,
        ):
            mine = unpack(record, rows[:, at : at + size])
            segment, begin, end = grid
            lengths = np.diff(mine.edges_s, axis=1)[:, segment]
            pad = self._count - segment.size
            width.append(np.pad(lengths * (end - begin), ((0, 0), (0, pad))))
            volts.append(np.pad(mine.levels_v[:, segment], ((0, 0), (0, pad)), mode="edge"))
            shared.append(rows[:, : len(SHARED)])
            cos_g.append(np.full(rows.shape[0], math.cos(record.axis_rad)))
            own.append(mine)
        nodes, l_mid, target = self._sweep(
            np.vstack(shared),
            np.concatenate(cos_g),
            np.vstack(width).T.copy(),
            np.vstack(volts).T.copy(),
            own,
        )
        currents, first = [], 0
        for record, grid, mine in zip(self.records, self._grids, own, strict=True):
            block = slice(first, first + mine.r_ohm.size)
            trace = (nodes[:, block], l_mid[:, block], target[:, block])
            currents.append(_at_samples(record, grid, mine, trace))
            first += mine.r_ohm.size
        return currents

    def _sweep(
        self, shared: Array, cos_g: Array, width: Array, volts: Array, own: Sequence[Own]
    ) -> tuple[Array, Array, Array]:
        """Currents at the nodes [k + 1, m]; inductance and final current of each step [k, m]."""
        r = np.concatenate([o.r_ohm for o in own])
        drop = np.concatenate([o.drop_v for o in own])
        knee = np.concatenate(
            [
                np.full(o.r_ohm.size, 0.02 * c.largest_a)
                for o, c in zip(own, self.records, strict=True)
            ]
        )
        current = np.concatenate([o.first_a for o in own])
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
            l_d, l_q = axis_inductances(shared, flux_d, flux_q)
            here = 2.0 * (cos_g**2 * l_d + sin_g**2 * l_q)
            rise = SPACE * (goal - current) * -np.expm1(-0.5 * width[k] * r / here)
            l_d, l_q = axis_inductances(
                shared, flux_d + l_d * cos_g * rise, flux_q + l_q * sin_g * rise
            )
            here = 2.0 * (cos_g**2 * l_d + sin_g**2 * l_q)
            step = (goal - current) * -np.expm1(-width[k] * r / here)
            flux_d = flux_d + l_d * cos_g * SPACE * step
            flux_q = flux_q + l_q * sin_g * SPACE * step
            current = current + step
            nodes[k + 1], l_mid[k], target[k] = current, here, goal
        return nodes, l_mid, target

    def residuals(
        self, parameters: Array, sigmas: Sequence[float], jacobian: NDArray[np.bool_]
    ) -> tuple[Array, Array]:
        """Weighted residuals [n] and their Jacobian [n, k] over the parameters that are free.

        After the samples of each capture come its levels' errors, as observations of 0 ± 1.
        One-sided differences of width 1e-6 of each parameter's natural scale.
        """
        widths = self._widths(parameters)
        free = np.flatnonzero(jacobian)
        columns = [self.columns_of(c, free) for c in range(len(self.records))]
        variants = []
        for mine in columns:
            rows = np.tile(parameters, (mine.size + 1, 1))
            rows[np.arange(1, mine.size + 1), mine] += widths[mine]
            variants.append(rows)
        blocks, slopes = [], []
        for c, current in enumerate(self.predict(variants)):
            record, mine = self.records[c], columns[c]
            weight = np.sqrt(record.count) / sigmas[c]
            blocks.append((current[:, 0] - record.i_a) * weight)
            slope = np.zeros((record.i_a.size, free.size))
            place = np.searchsorted(free, mine)
            slope[:, place] = (current[:, 1:] - current[:, :1]) / widths[mine] * weight[:, None]
            slopes.append(slope)
            levels = self.level_columns(c)
            blocks.append(parameters[levels])
            slopes.append((levels[:, None] == free[None, :]).astype(np.float64))
        return np.concatenate(blocks), np.vstack(slopes)

    def bounds(self, start: Array) -> tuple[Array, Array]:
        """Where the search may go from `start`: beyond, a current would run away without end.

        Inductances and resistances stay positive, and an edge near the samples that leave it open.
        """
        low, high = np.full(start.size, -np.inf), np.full(start.size, np.inf)
        positive = [LD, LQ, *self.layout.starts]
        low[positive] = 1e-3 * start[positive]
        for record, at in zip(self.records, self.layout.starts, strict=True):
            first = at + 1 + (record.wave.levels_v.size > 1)
            edges = slice(first, first + len(record.wave.free))
            low[edges], high[edges] = -EDGE_REACH, EDGE_REACH
        return low, high

    def level_columns(self, capture: int) -> NDArray[np.intp]:
        """Where the errors of a capture's voltage levels sit among the parameters."""
        end = self.layout.starts[capture] + self.layout.sizes[capture]
        return np.arange(end - self.records[capture].wave.u_levels_v.size, end)

    def columns_of(self, capture: int, free: NDArray[np.intp]) -> NDArray[np.intp]:
        """Those of the free parameters that a capture depends on."""
        start, size = self.layout.starts[capture], self.layout.sizes[capture]
        own = (free >= start) & (free < start + size)
        return free[own | (free < len(SHARED))]

    def _widths(self, parameters: Array) -> Array:
        largest = SPACE * max(record.largest_a for record in self.records)
        widths = np.empty(parameters.size)
        for place in (LD, LQ):
            flux = parameters[place] * largest
            widths[place] = 1e-6 * parameters[place]
            widths[place + 1 : place + 1 + TERMS] = 1e-6 * flux ** -np.arange(1.0, 1.0 + TERMS)
        for record, at, size in zip(
            self.records, self.layout.starts, self.layout.sizes, strict=True
        ):
            widths[at] = 1e-6 * parameters[at]
            widths[at + 1 : at + size] = 1e-5 * max(record.largest_a, 1e-9)
            shift = 2 if record.wave.levels_v.size > 1 else 1
            widths[at + shift : at + shift + len(record.wave.free)] = 1e-4
            last = at + size - record.wave.u_levels_v.size
            if record.commanded:
                widths[last - 1] = 1e-5 * record.largest_a * parameters[at]
            widths[last : at + size] = 1e-2
        return widths


def _at_samples(
    record: StepRecord,
    grid: tuple[NDArray[np.intp], Array, Array],
    own: Own,
    trace: tuple[Array, Array, Array],
) -> Array:
    """Current [n, m] at the record's times, by the exact step from the node before each."""
    segment, begin, _ = grid
    nodes, l_mid, target = trace
    currents = np.empty((record.t_s.size, own.r_ohm.size))
    lengths = np.diff(own.edges_s, axis=1)
    for column in range(own.r_ohm.size):
        starts = own.edges_s[column, segment] + begin * lengths[column, segment]
        index = np.clip(np.searchsorted(starts, record.t_s, side="right") - 1, 0, segment.size - 1)
        goal = target[index, column]
        decay = np.exp(-(record.t_s - starts[index]) * own.r_ohm[column] / l_mid[index, column])
        currents[:, column] = goal + (nodes[index, column] - goal) * decay + own.offset_a[column]
    return currents
