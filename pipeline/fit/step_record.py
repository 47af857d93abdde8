"""A voltage step on a locked rotor, brought to the form that the step model is fitted to.

The applied voltage becomes levels between edges. Where the samples of a level are noise about a
constant, their mean is the level, so that voltage noise does not enter; an edge that instant
samples leave open by one sample is left for the fit to place. Any other waveform is taken sample by
sample, by the trapezoid, the hold or the centred mean that `voltage_timing` asks for.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.fit.integrals import trapezoid
from pipeline.fit.terminals import pair_of, pair_signals
from pipeline.numerics.least_squares import linear_fit
from pipeline.numerics.plateaus import white_noise_sigma
from pipeline.physics.conventions import PAIR_AXES_RAD
from pipeline.records.capture import Capture, VoltageTiming

Array = NDArray[np.float64]
MOST_EDGES = 12
MOST_CELLS = 1500
MOST_BINS = 3000
MOST_APART = 100.0
"""Most that saliency and iron's bend together part the inductances of one rotor's steps."""


@dataclass(frozen=True, slots=True)
class Waveform:
    """Voltage levels [s] between edges [s + 1]; `free` are the edges that the fit must place.

    `u_levels_v` [s] are the standard errors of levels that are means, empty for single samples.
    """

    edges_s: Array
    levels_v: Array
    free: tuple[int, ...]
    period_s: float
    u_levels_v: Array


@dataclass(frozen=True, slots=True)
class StepRecord:
    """One current_step capture: waveform in, current means [n] of `count` samples out.

    `axis_rad` is the angle from the d axis to the pair's current; `l_start_h`, `r_start_ohm` come
    from the integrated form; `commanded` says that an inverter's drop is in the voltage.
    """

    capture: Capture
    pair: str
    axis_rad: float
    wave: Waveform
    t_s: Array
    i_a: Array
    count: Array
    l_start_h: float
    r_start_ohm: float
    commanded: bool
    starts_settled: bool
    sigma_a: float

    @property
    def largest_a(self) -> float:
        """The largest current in magnitude."""
        return float(np.max(np.abs(self.i_a)))


def rotor_angle_rad(capture: Capture) -> float | None:
    """Electrical angle at which the rotor was locked: as stated, else the mean of the column."""
    if capture.meta.theta_elec_deg is not None:
        return math.radians(capture.meta.theta_elec_deg)
    if capture.has("theta_elec_rad"):
        return float(np.nanmean(capture.arrays("theta_elec_rad")["theta_elec_rad"]))
    return None


def read_step(capture: Capture) -> StepRecord | None:
    """The record of a capture, or None where it holds no step to speak of.

    Raises KeyError where voltage, current, pair or rotor angle is missing.
    """
    pair, angle = pair_of(capture), rotor_angle_rad(capture)
    if pair is None or angle is None:
        raise KeyError(f"{capture.path}: pair or theta_elec_deg is not stated")
    data = pair_signals(capture, pair)
    t, v, i = data["t_s"] - data["t_s"][:1], data["v_v"], data["i_a"]
    sigma_i = white_noise_sigma(i)
    if t.size < 50 or float(np.ptp(i)) < 10.0 * max(sigma_i, 1e-12):
        return None
    wave = waveform_of(t, v, capture.meta.voltage_timing)
    start = integrated_form(t, v, i)
    if start is None:
        return None
    inductance, resistance = start
    times, means, count = _bins(t, i, wave)
    first = wave.edges_s[1] - wave.edges_s[0]
    return StepRecord(
        capture,
        pair,
        PAIR_AXES_RAD[pair] - angle,
        wave,
        times,
        means,
        count,
        inductance,
        resistance,
        capture.meta.voltage_kind == "commanded",
        bool(wave.levels_v.size <= MOST_EDGES + 1 and first >= 5.0 * wave.period_s),
        max(sigma_i, 1e-6 * float(np.ptp(i))),
    )


def integrated_form(t_s: Array, v_v: Array, i_a: Array) -> tuple[float, float] | None:
    """L [H] and R [ohm] between the terminals: i = (1/L) ∫v dt - (R/L) ∫i dt + c.

    The integrated form takes no derivative; solved for i, in which alone the noise is white. A
    start for the fit, not an estimate: the trapezoid across an edge reads L up to half a sample of
    the time constant high. None where the two integrals are not told apart.
    """
    volts, amps = trapezoid(t_s, v_v), trapezoid(t_s, i_a)
    fit = linear_fit(np.column_stack([volts, amps, np.ones(t_s.size)]), i_a)
    inverse, slope = float(fit.coefficients[0]), -float(fit.coefficients[1])
    if not fit.full_rank or inverse <= 0.0 or slope <= 0.0:
        return None
    return 1.0 / inverse, slope / inverse


def disagreement(records: Sequence[StepRecord]) -> str:
    """The captures that cannot be of one rotor with the others, in words; empty where all can.

    A clock or a current in another unit scales L by a thousand, and a common fit would follow it.
    """
    found = np.log([record.l_start_h for record in records])
    if found.size < 2 or np.ptp(found) < math.log(MOST_APART):
        return ""
    apart = found - np.median(found)
    odd = [
        f"{record.capture.path} ({math.exp(ratio):.3g} times the usual L)"
        for record, ratio in zip(records, apart, strict=True)
        if abs(ratio) > 0.5 * math.log(MOST_APART) - 1e-9
    ]
    return f"look at t_s and the units of {', '.join(odd)}: not one rotor with the other steps"


def waveform_of(t_s: Array, v_v: Array, timing: VoltageTiming) -> Waveform:
    """Levels and edges of a sampled voltage [n]."""
    period = float(np.median(np.diff(t_s)))
    sigma = white_noise_sigma(v_v)
    jumps = np.flatnonzero(np.abs(np.diff(v_v)) > max(8.0 * sigma, 0.1 * float(np.ptp(v_v))))
    groups = np.split(jumps, np.flatnonzero(np.diff(jumps) > 1) + 1) if jumps.size else []
    if 0 < len(groups) <= MOST_EDGES and all(g.size <= 2 for g in groups):
        bounds = [0, *(int(g[-1]) + 1 for g in groups), v_v.size]
        stops = [*(int(g[0]) + 1 for g in groups), v_v.size]
        parts = [v_v[a:b] for a, b in zip(bounds[:-1], stops, strict=True)]
        if all(_is_level(part, sigma) for part in parts):
            return _levels(t_s, v_v, groups, parts, timing, period, sigma)
    return _sampled(t_s, v_v, timing, period)


def _is_level(samples: Array, sigma: float) -> bool:
    """Whether the samples are noise about a constant, by the means of up to eight blocks."""
    if samples.size < 16:
        return samples.size > 0
    means = np.array([block.mean() for block in np.array_split(samples, 8)])
    limit = 5.0 * max(sigma, 1e-12) / math.sqrt(samples.size / 8)
    return bool(np.max(np.abs(means - samples.mean())) < limit + 1e-9 * np.abs(samples).max())


def _levels(
    t_s: Array,
    v_v: Array,
    groups: list[NDArray[np.intp]],
    parts: list[Array],
    timing: VoltageTiming,
    period_s: float,
    sigma_v: float,
) -> Waveform:
    levels = np.array([float(part.mean()) for part in parts])
    edges, free = [float(t_s[0])], []
    for number, group in enumerate(groups):
        before, after = int(group[0]), int(group[-1]) + 1
        between = v_v[before + 1 : after]
        rise = levels[number + 1] - levels[number]
        share = float(np.sum((levels[number + 1] - between) / rise)) if between.size else 0.0
        if timing == "centred":
            edges.append(float(t_s[before]) + period_s * (0.5 + share))
        elif timing == "held":
            edges.append(float(t_s[before + 1]) + period_s * share)
        else:
            free.append(number + 1)
            edges.append(float(t_s[after]) - 0.25 * period_s)
    least = max(sigma_v, 1e-9 * float(np.max(np.abs(levels))))
    errors = np.array([least / math.sqrt(part.size) for part in parts])
    ends = np.array([*edges, float(t_s[-1]) + period_s])
    return Waveform(ends, levels, tuple(free), period_s, errors)


def _sampled(t_s: Array, v_v: Array, timing: VoltageTiming, period_s: float) -> Waveform:
    """Cells of one or more samples each, `MOST_CELLS` at most, with the integral kept."""
    if timing == "held":
        edges, means = np.append(t_s, t_s[-1] + period_s), v_v
    elif timing == "centred":
        middle = 0.5 * (t_s[1:] + t_s[:-1])
        ends = (t_s[0] - 0.5 * period_s, t_s[-1] + 0.5 * period_s)
        edges, means = np.concatenate([ends[:1], middle, ends[1:]]), v_v
    else:
        edges, means = t_s, 0.5 * (v_v[1:] + v_v[:-1])
    group = -(-means.size // MOST_CELLS)
    cuts = np.append(np.arange(0, means.size, group), means.size)
    areas = np.add.reduceat(means * np.diff(edges), cuts[:-1])
    kept = edges[cuts]
    return Waveform(kept, areas / np.diff(kept), (), period_s, np.zeros(0))


def _bins(t_s: Array, i_a: Array, wave: Waveform) -> tuple[Array, Array, Array]:
    """Means of equal groups of samples, `MOST_BINS` at most, none across an edge."""
    size = max(1, t_s.size // MOST_BINS)
    if size == 1:
        return t_s, i_a, np.ones(t_s.size)
    cuts = np.arange(0, t_s.size, size)
    if wave.levels_v.size <= MOST_EDGES + 1:
        near = np.searchsorted(t_s, wave.edges_s[1:-1] + 1e-3 * wave.period_s)
        around = (near[:, None] + np.arange(-2, 3)).ravel()
        cuts = np.unique(np.concatenate([cuts, around[(around > 0) & (around < t_s.size)]]))
    counts = np.diff(np.append(cuts, t_s.size)).astype(np.float64)
    return (np.add.reduceat(t_s, cuts) / counts, np.add.reduceat(i_a, cuts) / counts, counts)
