"""Draws seeds, runs one estimator on each and judges bias, coverage and scatter.

A `Case` is one estimator on one simulated bench. `simulate(seed)` returns a `Trial`: the campaign,
what was put in (`truth`), and what an estimator without noise would read through the gains drawn
for that seed (`seen`). Bias and coverage are judged against `truth`; scatter is that of
value - `seen`, so that it holds noise alone, and is judged against `bound()`: the Cramér-Rao
standard deviations of the noise model. Where the noise differs from seed to seed, the trial states
its own.

Every verdict carries its own sampling error: a limit counts as broken only where the 99 % interval
of the statistic lies wholly beyond it, so a small sample is lenient and a large one is sharp.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy import stats

from pipeline.estimation.protocol import Estimator
from pipeline.records.capture import Campaign
from pipeline.records.constants import Constants

BIAS_LIMIT_U = 0.1
COVERAGE_LIMITS = (0.92, 0.98)
SCATTER_LIMIT = 1.2
CONFIDENCE = 0.99


@dataclass(frozen=True)
class Trial:
    """One seed's captures with what was put in; `known` is handed to the estimator.

    `bound` are the seed's own Cramér-Rao deviations, None where the case's hold for all seeds.
    """

    campaign: Campaign
    truth: Mapping[str, float]
    seen: Mapping[str, float]
    known: Constants = field(default_factory=Constants)
    bound: Mapping[str, float] | None = None


@dataclass(frozen=True)
class Case:
    """One estimator on one bench; `bound()` gives the Cramér-Rao deviation of each constant.

    Constants without an entry in `bound()` are judged on bias and coverage alone. `few` is the
    number of seeds of the slow tests, smaller where a seed takes long; the default run takes half.
    """

    name: str
    estimator: Estimator
    simulate: Callable[[int], Trial]
    bound: Callable[[], Mapping[str, float]]
    options: Mapping[str, float] = field(default_factory=dict)
    few: int = 40


@dataclass(frozen=True)
class Verdict:
    """The statistics of one constant of one case over `n` seeds, each with a 99 % interval."""

    case: str
    constant: str
    n: int
    missing: int
    bias_u: float
    bias_half_width_u: float
    coverage: float
    coverage_interval: tuple[float, float]
    scatter: float | None
    scatter_interval: tuple[float, float] | None
    u_relative: float

    @property
    def faults(self) -> tuple[str, ...]:
        """What is broken beyond the verdict's own sampling error, in words."""
        found = []
        if self.missing:
            found.append(f"not identified in {self.missing} of {self.n + self.missing} seeds")
        if abs(self.bias_u) - self.bias_half_width_u > BIAS_LIMIT_U:
            found.append(f"bias {self.bias_u:+.3f} u")
        low, high = self.coverage_interval
        if high < COVERAGE_LIMITS[0] or low > COVERAGE_LIMITS[1]:
            found.append(f"coverage {self.coverage:.3f}")
        if self.scatter_interval is not None and self.scatter_interval[0] > SCATTER_LIMIT:
            found.append(f"scatter {self.scatter:.2f} times the bound")
        return tuple(found)


@dataclass(frozen=True)
class Draw:
    """What one seed gave for one constant; `estimate` is None where it was not identified."""

    constant: str
    truth: float
    seen: float
    estimate: float | None
    u: float
    covered: bool
    bound: float | None = None


def run(case: Case, seeds: range) -> tuple[Verdict, ...]:
    """Judges every constant that the case states a truth for, over the seeds."""
    return judge(case, draw(case, seeds))


def draw(case: Case, seeds: Iterable[int]) -> list[Draw]:
    """Simulates and estimates seed by seed."""
    options = {**case.estimator.options, **case.options}
    draws = []
    for seed in seeds:
        trial = case.simulate(seed)
        fit = case.estimator.fit(trial.campaign, trial.known, options)
        found = {e.name: e for e in reversed(fit.estimates)}
        for name, truth in trial.truth.items():
            estimate, seen = found[name], trial.seen[name]
            own = None if trial.bound is None else trial.bound.get(name)
            if not estimate.known:
                draws.append(Draw(name, truth, seen, None, 0.0, False, own))
                continue
            low, high = estimate.interval(0.95)
            covered = bool(low <= truth <= high)
            draws.append(Draw(name, truth, seen, estimate.number, estimate.u, covered, own))
    return draws


def judge(case: Case, draws: Sequence[Draw]) -> tuple[Verdict, ...]:
    """The verdict of each constant, by name."""
    bound = case.bound()
    verdicts = []
    for name in sorted({d.constant for d in draws}):
        own = [d for d in draws if d.constant == name]
        usual = bound.get(name)
        bounded = usual is not None or all(d.bound is not None for d in own)
        rows = [
            (e - d.truth, (e - d.seen) / (d.bound or usual or 1.0), d.covered, d.u, d.truth)
            for d in own
            if (e := d.estimate) is not None
        ]
        missing = len(own) - len(rows)
        verdicts.append(_judge(case.name, name, np.array(rows), missing, bounded))
    return tuple(verdicts)


def _judge(case: str, constant: str, rows: np.ndarray, missing: int, bounded: bool) -> Verdict:
    if rows.size == 0:
        return Verdict(case, constant, 0, missing, 0, math.inf, 0, (0, 1), None, None, math.inf)
    error, noise, covered, u, truth = rows.T
    n = len(error)
    z = stats.norm.ppf(0.5 + CONFIDENCE / 2)
    typical_u = float(np.sqrt(np.mean(u**2)))
    exact = typical_u == 0.0
    scale = 1.0 if exact else typical_u
    half = 0.0 if exact else float(z * error.std(ddof=1) / math.sqrt(n) / scale)
    hits = int(covered.sum())
    interval = stats.binomtest(hits, n).proportion_ci(CONFIDENCE, method="exact")
    coverage_interval = (COVERAGE_LIMITS[0],) * 2 if exact and hits == n else tuple(interval)
    scatter = scatter_interval = None
    if bounded:
        scatter = float(noise.std(ddof=1))
        low, high = stats.chi2.ppf([0.5 + CONFIDENCE / 2, 0.5 - CONFIDENCE / 2], n - 1)
        scatter_interval = (
            scatter * math.sqrt((n - 1) / low),
            scatter * math.sqrt((n - 1) / high),
        )
    return Verdict(
        case,
        constant,
        n,
        missing,
        float(error.mean() / scale),
        half,
        hits / n,
        (float(coverage_interval[0]), float(coverage_interval[1])),
        scatter,
        scatter_interval,
        float(typical_u / abs(truth.mean())),
    )


def cramer_rao(
    mean: Callable[[np.ndarray], np.ndarray],
    parameters: np.ndarray,
    sigma: np.ndarray | float,
    prior: np.ndarray | None = None,
    step: float = 1e-5,
) -> np.ndarray:
    """Cramér-Rao covariance [k, k] of a signal `mean(parameters)` [n] in Gaussian white noise.

    `sigma` is the noise deviation, one number or one a sample; `prior` the k standard deviations
    of what is known of the parameters beforehand (inf where nothing is). J = dm'dm/sigma²;
    derivatives are central differences. Kay, Fundamentals of Statistical Signal Processing I, 3.9.
    """
    columns = []
    for index, value in enumerate(parameters):
        width = step * (abs(value) if value != 0.0 else 1.0)
        up, down = parameters.copy(), parameters.copy()
        up[index] += width
        down[index] -= width
        columns.append((mean(up) - mean(down)) / (2 * width))
    jacobian = np.column_stack(columns) / np.reshape(sigma, (-1, 1))
    scale = np.maximum(np.linalg.norm(jacobian, axis=0), 1e-300)
    information = (jacobian / scale).T @ (jacobian / scale)
    if prior is not None:
        information = information + np.diag(1.0 / (prior * scale) ** 2)
    return np.linalg.inv(information) / np.outer(scale, scale)
