"""The voltage of a step test as the step model is driven by it.

Between two edges a supply is an open voltage behind a resistance, v = e - R_source i: a supply that
holds its voltage has none. The open voltages and the resistance are fitted with the samples of v
as observations beside those of i, so that noise of v does not enter as if it drove the motor. Where
no such supply describes the samples, they are taken one by one, along the straight lines between
them or as `voltage_timing` says.

No instrument says when an edge was. It lies between two samples, and the two channels of a scope
have delays of their own; so every edge moves in the fit, or all the voltage where it has no edge.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.estimation.policy import policy
from pipeline.numerics.least_squares import linear_fit
from pipeline.numerics.quantisation import (
    noise_after_rounding,
    noise_before_rounding,
    resolution,
    rounding_rms,
)
from pipeline.records.capture import Array, VoltageTiming

Index = NDArray[np.intp]
BETWEEN = -1
"""Level of a sample that was taken while the voltage rose."""


@dataclass(frozen=True, slots=True)
class Noise:
    """The noise of one channel, in its unit.

    Attributes
    ----------
    sigma
        Standard deviation from sample to sample.
    rounding
        Rms error that rounding leaves in the mean over a level.
    step
        Resolution of the converter.

    """

    sigma: float
    rounding: float
    step: float


@dataclass(frozen=True, slots=True)
class Waveform:
    """The voltage of a step test between its edges.

    Attributes
    ----------
    edges_s
        Instants of the edges [s + 1].
    levels_v
        Voltage between two edges [s]; with a supply, where its open voltages start in the fit.
    moves
        Which edges move together [s + 1, f], one column a free shift.
    period_s
        Sampling period [s].
    source_ohm
        Where the resistance of the supply starts in the fit; 0 without a supply.
    level_of
        Level of each sample [n]; empty where no supply describes the samples.

    """

    edges_s: Array
    levels_v: Array
    moves: Array
    period_s: float
    source_ohm: float
    level_of: Index

    @property
    def has_supply(self) -> bool:
        """Whether the voltage is that of a supply between edges."""
        return self.level_of.size > 0


def noise_of(signal: Array) -> Noise:
    """The noise of a channel [n], at least 1e-6 of its span.

    Parameters
    ----------
    signal : array [n]
        In the channel's unit.

    Returns
    -------
    Noise
        Scatter, what rounding leaves in a level's mean, and the converter's step.

    """
    step = resolution(signal)
    sigma = noise_after_rounding(signal, step)
    rounding = rounding_rms(step, noise_before_rounding(sigma, step))
    return Noise(max(sigma, 1e-6 * float(np.ptp(signal)), 1e-12), rounding, step)


def waveform_of(
    t_s: Array, v_v: Array, i_a: Array, timing: VoltageTiming, ideal: bool = False
) -> Waveform:
    """Levels and edges of a sampled voltage [n]; an `ideal` supply has no resistance.

    Parameters
    ----------
    t_s, v_v, i_a : array [n]
        Times [s], voltage [V] and current [A] of one pair.
    timing
        When a voltage that no supply describes is valid.
    ideal
        Whether the supply has no resistance, as an inverter's command.

    Returns
    -------
    Waveform
        Levels [V] between edges [s], and which edges move together.

    """
    period = float(np.median(np.diff(t_s)))
    noise = noise_of(v_v)
    jumps = np.flatnonzero(np.abs(np.diff(v_v)) > max(8.0 * noise.sigma, 0.1 * float(np.ptp(v_v))))
    groups = np.split(jumps, np.flatnonzero(np.diff(jumps) > 1) + 1) if jumps.size else []
    few = len(groups) <= policy().steps.most_edges
    if few and all(group.size <= 2 for group in groups):
        wave = _supplied(t_s, v_v, i_a, groups, noise, ideal)
        if wave is not None:
            return wave
    return _sampled(t_s, v_v, timing, groups if few else [], period)


def _supplied(
    t_s: Array,
    v_v: Array,
    i_a: Array,
    groups: list[Index],
    noise: Noise,
    ideal: bool,
) -> Waveform | None:
    """The waveform of a supply, None where none describes the samples."""
    period_s = float(np.median(np.diff(t_s)))
    level_of = np.zeros(v_v.size, dtype=np.intp)
    for group in groups:
        level_of[group[-1] + 1 :] += 1
    for group in groups:
        level_of[group[0] + 1 : group[-1] + 1] = BETWEEN
    at_level = level_of >= 0
    columns = np.eye(len(groups) + 1)[level_of[at_level]]
    if not ideal:
        columns = np.column_stack([columns, -i_a[at_level]])
    fit = linear_fit(columns, v_v[at_level])
    source_ohm = 0.0 if ideal or not fit.full_rank else float(fit.coefficients[-1])
    sigma = math.hypot(noise.sigma, source_ohm * noise_of(i_a).sigma)
    for level in range(len(groups) + 1):
        rows = level_of[at_level] == level
        skew = 0.5 * source_ohm * i_a[at_level][rows]
        if not _is_noise(fit.residuals[rows], skew, sigma, noise.rounding):
            return None
    places = [t_s[g[0]] + 0.5 * (t_s[g[-1] + 1] - t_s[g[0]]) for g in groups]
    edges = np.array([t_s[0], *places, t_s[-1] + period_s])
    moves = np.eye(edges.size)[:, 1:-1]
    levels = fit.coefficients[: len(groups) + 1].copy()
    return Waveform(edges, levels, moves, period_s, source_ohm, level_of)


def _is_noise(residuals: Array, skew: Array, sigma: float, rounding: float) -> bool:
    """Whether the means of up to eight blocks of residuals [n] are those of noise.

    `skew` [n] is what half a sample between the channels makes of the current: R_source i / 2.
    """
    if residuals.size < 16:
        return True
    blocks = np.array_split(np.arange(residuals.size), 8)
    means = np.array([residuals[b].mean() for b in blocks])
    late = np.array([abs(float(skew[b[-1]] - skew[b[0]])) / b.size for b in blocks])
    limit = 5.0 * math.hypot(sigma / math.sqrt(residuals.size / 8), rounding)
    return bool(np.all(np.abs(means) < limit + late + 1e-9 * np.abs(skew).max(initial=0.0)))


def _sampled(
    t_s: Array, v_v: Array, timing: VoltageTiming, groups: list[Index], period_s: float
) -> Waveform:
    """Cells of one or more samples each, about `steps.most_cells` at most, with the integral kept.

    With edges, each parts the two samples around it and moves between them; the rest is straight
    lines. Without, the voltage moves as a whole.
    """
    free: list[list[int]] = []
    if groups:
        edges, means, free = _lines_and_edges(t_s, v_v, groups)
    elif timing == "held":
        edges, means = np.append(t_s, t_s[-1] + period_s), v_v
    elif timing == "centred":
        middle = 0.5 * (t_s[1:] + t_s[:-1])
        first, last = t_s[:1] - 0.5 * period_s, t_s[-1:] + 0.5 * period_s
        edges, means = np.concatenate([first, middle, last]), v_v
    else:
        edges, means = t_s, 0.5 * (v_v[1:] + v_v[:-1])
    group = -(-means.size // policy().steps.most_cells)
    beside = {k + d for together in free for k in together for d in (-1, 0, 1)}
    cuts = np.array(sorted({*range(0, means.size, group), *beside, means.size}), dtype=np.intp)
    areas = np.add.reduceat(means * np.diff(edges), cuts[:-1])
    moves = np.ones((cuts.size, 1))
    if free:
        moves = np.column_stack([np.isin(cuts, edge) for edge in free]).astype(np.float64)
    kept_s = edges[cuts]
    none = np.zeros(0, dtype=np.intp)
    return Waveform(kept_s, areas / np.diff(kept_s), moves, period_s, 0.0, none)


def _lines_and_edges(
    t_s: Array, v_v: Array, groups: list[Index]
) -> tuple[Array, Array, list[list[int]]]:
    """Edges and means of straight lines between samples, and which of the edges move together.

    A jump of up to two sampling intervals is an edge between the two samples around it; a rise
    that takes longer moves as it was sampled.
    """
    edges, means, free = [float(t_s[0])], [], []
    ends = {int(g[0]): int(g[-1]) + 1 for g in groups if g.size <= 2}
    slow = {int(g[0]): g.size for g in groups if g.size > 2}
    k = 0
    while k < t_s.size - 1:
        after = ends.get(k)
        if k in slow:
            free.append([len(edges) - 1 + d for d in range(slow[k] + 1) if len(edges) - 1 + d > 0])
        if after is None:
            after = k + 1
            means.append(0.5 * float(v_v[k] + v_v[after]))
        else:
            free.append([len(edges)])
            edges.append(0.5 * float(t_s[k] + t_s[after]))
            means += [float(v_v[k]), float(v_v[after])]
        edges.append(float(t_s[after]))
        k = after
    last = len(edges) - 1
    return np.array(edges), np.array(means), [[k for k in group if k < last] for group in free]
