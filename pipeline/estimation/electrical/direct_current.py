"""Settled direct-current plateaus of all captures of one motor, fitted together."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pipeline.estimation.electrical.terminals import (
    PAIRS,
    bridged,
    first_temperature,
    pair_of,
    pair_signals,
)
from pipeline.estimation.uncertainty.instruments import (
    Shift,
    current_source,
    temperature_source,
    voltage_source,
)
from pipeline.numerics.least_squares import autocorrelation_time, linear_fit
from pipeline.numerics.plateaus import find_plateaus
from pipeline.physics.conventions import COPPER_COEFFICIENT_25_1_K
from pipeline.records.capture import Campaign, Capture, CaptureMeta

TEST = "resistance"
POINT_OPTIONS = {"zero_crossing": 0.03, "temp_assumed_degc": 25.0}
COPPER_SOURCE = "assumed:temp_coeff_copper_1_k"
Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Point:
    """Means over one settled plateau with their standard errors, and where it came from."""

    capture: int
    pair: str
    v_v: float
    i_a: float
    temp_degc: float
    u_v: float
    u_i: float
    meta: CaptureMeta


def direct_current_points(
    campaign: Campaign, options: Mapping[str, float]
) -> tuple[list[Point], list[str]]:
    """The plateaus of all resistance captures, and what had to be assumed about them.

    Plateaus below `zero_crossing` times the largest current of all are left out: the sign of their
    current, and what an inverter adds there, is in doubt. Temperature is the plateau's own, else
    the capture's ambient, else `temp_assumed_degc`.
    """
    points: list[Point] = []
    notes: list[str] = []
    temp_assumed_degc = options["temp_assumed_degc"]
    for index, capture in enumerate(campaign.of(TEST)):
        pair = pair_of(capture)
        if pair is None:
            notes.append(f"{capture.path}: which terminal pair is not stated")
            continue
        ambient = capture.meta.ambient_degc
        if first_temperature(capture, "winding") is None:
            notes.append(f"{capture.path}: no temp_winding_degc, taken at ambient")
        try:
            points += _points_of(
                capture, index, pair, temp_assumed_degc if ambient is None else ambient
            )
        except KeyError:
            notes.append(f"{capture.path}: no voltage and current of pair {pair}")
    largest = max((abs(p.i_a) for p in points), default=0.0)
    return [p for p in points if abs(p.i_a) > options["zero_crossing"] * largest], notes


def captures_of(campaign: Campaign, points: Sequence[Point]) -> tuple[Capture, ...]:
    """The captures that the points came from, in path order."""
    captures = campaign.of(TEST)
    return tuple(captures[k] for k in sorted({p.capture for p in points}))


def _points_of(capture: Capture, index: int, pair: str, temp_degc: float) -> list[Point]:
    column = first_temperature(capture, "winding")
    data = pair_signals(capture, pair, *((column,) if column else ()))
    temps = np.full(data["t_s"].size, temp_degc)
    if column is not None and np.isfinite(data[column]).any():
        temps = bridged(data["t_s"], data[column])
    points = []
    for plateau in find_plateaus(data["i_a"]):
        v, i = data["v_v"][plateau.rows], data["i_a"][plateau.rows]
        temp = float(temps[plateau.rows].mean())
        errors = (_standard_error(v), _standard_error(i))
        means = (float(v.mean()), float(i.mean()))
        points.append(Point(index, pair, *means, temp, *errors, capture.meta))
    return points


def _standard_error(samples: Array) -> float:
    scatter = float(samples.std(ddof=1))
    return scatter * math.sqrt(autocorrelation_time(samples) / samples.size)


def shifted(points: Sequence[Point], shift: Shift) -> list[Point]:
    """The points as read by instruments that are off by `shift`."""
    return [
        replace(
            p,
            v_v=p.v_v * (1.0 + shift.get(voltage_source(p.meta), 0.0)),
            i_a=p.i_a * (1.0 + shift.get(current_source(p.meta), 0.0)),
            temp_degc=p.temp_degc + shift.get(temperature_source(p.meta), 0.0),
        )
        for p in points
    ]


@dataclass(frozen=True, slots=True)
class Columns:
    """What the coefficients of a fit mean, in their order: R of each pair, the offset of each
    capture that saw both signs, V0 of each voltage source that saw two levels as well.
    """

    pairs: tuple[str, ...]
    offsets: tuple[int, ...]
    drops: tuple[str, ...]

    @property
    def drop_start(self) -> int:
        """Index of the first V0."""
        return len(self.pairs) + len(self.offsets)

    @property
    def size(self) -> int:
        """How many, without the copper coefficient's correction that comes last."""
        return self.drop_start + len(self.drops)


def columns_of(points: Sequence[Point]) -> Columns:
    """The coefficients that these plateaus can tell apart."""
    pairs = tuple(p for p in PAIRS if any(point.pair == p for point in points))
    offsets, drops = [], set()
    for index in sorted({p.capture for p in points}):
        own = [p for p in points if p.capture == index]
        signs = {math.copysign(1.0, p.i_a) for p in own}
        levels = sorted(abs(p.i_a) for p in own)
        if len(signs) == 2:
            offsets.append(index)
        if len(levels) > len(signs) and levels[-1] > 1.2 * levels[0]:
            drops.add(voltage_source(own[0].meta))
    return Columns(pairs, tuple(offsets), tuple(sorted(drops)))


@dataclass(frozen=True, slots=True)
class DirectCurrentFit:
    """R at 25 degC of each pair and the rest of `Columns` [k], with the covariance of the scatter.

    `alpha_1_k` is the copper coefficient found; `residuals` [n] are those of the points. `dof` is
    that of the scatter: infinite where it is what the plateaus' own noise makes, else the points'.
    """

    coefficients: Array
    covariance: Array
    alpha_1_k: float
    u_alpha_1_k: float
    residuals: Array
    full_rank: bool
    dof: float


def fit_direct_current(
    points: Sequence[Point],
    columns: Columns,
    u_alpha_rel: float,
    alpha_rel: float = 0.0,
) -> DirectCurrentFit:
    """V = offset + V0 sign(I) + R25 (1 + alpha (T - 25)) I over the plateaus of all pairs.

    alpha at 25 degC is fitted as well, with copper's 1/259.5 (1 + alpha_rel) ± `u_alpha_rel` as
    what is known of it beforehand (inf: nothing). Weights from both standard errors,
    u² = u_V² + (R u_I)² (York, Can. J. Phys. 44, 1966, for errors small against the span).
    The covariance holds the scatter alone, widened where the points scatter more than their own
    noise explains (Birge, Phys. Rev. 40, 1932); the prior's share is for the caller to add.
    """
    prior = COPPER_COEFFICIENT_25_1_K * (1.0 + alpha_rel)
    alpha = prior
    width = columns.size + 1
    for _ in range(4):
        design, v, sigma = _system(points, columns, alpha)
        rows = np.vstack([design, np.eye(1, width, width - 1)])
        known = np.append(v, 0.5 * (prior - alpha) / COPPER_COEFFICIENT_25_1_K)
        slack = np.append(sigma, 0.5 * max(u_alpha_rel, 1e-9))
        fit = linear_fit(rows, known, slack)
        alpha += 2.0 * float(fit.coefficients[-1]) * COPPER_COEFFICIENT_25_1_K
    last = fit.covariance[:, -1]
    scatter = fit.covariance - np.outer(last, last) / slack[-1] ** 2
    residuals = fit.residuals[:-1]
    dof = len(points) - fit.rank + (1 if math.isfinite(u_alpha_rel) else 0)
    factor = _birge(residuals / sigma, dof)
    scatter = scatter * factor
    u_alpha = 2.0 * COPPER_COEFFICIENT_25_1_K * math.sqrt(max(float(scatter[-1, -1]), 0.0))
    size = columns.size
    return DirectCurrentFit(
        fit.coefficients[:size],
        scatter[:size, :size],
        alpha,
        u_alpha,
        residuals,
        fit.full_rank,
        float(dof) if factor > 1.0 else math.inf,
    )


def _system(
    points: Sequence[Point], columns: Columns, alpha_1_k: float
) -> tuple[Array, Array, Array]:
    """Design [n, k + 1], V [n] and its sigma [n], linear in the corrections of R and alpha.

    The last column is the change of V with alpha, in units of 2 x copper's coefficient, R taken
    from the point itself, so that the alternation converges in a few rounds.
    """
    design = np.zeros((len(points), columns.size + 1))
    v, sigma = np.zeros(len(points)), np.zeros(len(points))
    for row, p in enumerate(points):
        excess = p.temp_degc - 25.0
        factor = 1.0 + alpha_1_k * excess
        design[row, columns.pairs.index(p.pair)] = factor * p.i_a
        design[row, -1] = 2.0 * COPPER_COEFFICIENT_25_1_K * excess * p.v_v / factor
        if p.capture in columns.offsets:
            design[row, len(columns.pairs) + columns.offsets.index(p.capture)] = 1.0
        if (source := voltage_source(p.meta)) in columns.drops:
            at = columns.drop_start + columns.drops.index(source)
            design[row, at] = math.copysign(1.0, p.i_a)
        v[row] = p.v_v
        sigma[row] = max(math.hypot(p.u_v, p.v_v / p.i_a * p.u_i), 1e-12 + 1e-9 * abs(p.v_v))
    return design, v, sigma


def _birge(normalised: Array, dof: int) -> float:
    """Variance factor of points that scatter more than they should, 1 where chance explains it."""
    if dof < 3:
        return 1.0
    chi2_dof = float(normalised @ normalised) / dof
    return chi2_dof if chi2_dof > 1.0 + 3.0 * math.sqrt(2.0 / dof) else 1.0
