"""The fit of the step model to all captures, with as many saturation terms as the data support."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.estimation.electrical.step_model import StepModel
from pipeline.estimation.electrical.step_parameters import LD, LQ, SHARED, TERMS, start_of
from pipeline.estimation.electrical.step_wave import BETWEEN, Noise
from pipeline.estimation.policy import policy
from pipeline.numerics.least_squares import Array, NonlinearFit, autocorrelation_time, gauss_newton

AXES: Mapping[str, tuple[int, tuple[int, ...]]] = {
    "ld_h": (LD, tuple(range(LD + 1, LD + 1 + TERMS))),
    "lq_h": (LQ, tuple(range(LQ + 1, LQ + 1 + TERMS))),
}
Flags = NDArray[np.bool_]
Offer = tuple[float, int, float]
Sigmas = Sequence[tuple[float, float]]


@dataclass(frozen=True, slots=True)
class Solution:
    """The step model fitted to all captures.

    Attributes
    ----------
    model
        The model.
    parameters
        All parameters [k], fixed ones too.
    free
        Which of them [k] were fitted.
    fit
        The fit over the free parameters.
    weights
        Weights [2, rows] of the residuals of current and voltage of each capture.
    sigmas
        Standard deviations of current and voltage found for each capture [A, V].
    scatter
        Standard deviation [n] that each weighted residual turned out to have, correlated ones
        counted.

    """

    model: StepModel
    parameters: Array
    free: Flags
    fit: NonlinearFit
    weights: tuple[Array, ...]
    sigmas: tuple[tuple[float, float], ...]
    scatter: Array

    def covariance(self) -> Array:
        """Covariance over all parameters.

        Returns
        -------
        array [k, k]
            Zero for a parameter that was fixed; an infinite variance for one that the steps do not
            determine.

        """
        full = np.zeros((self.free.size, self.free.size))
        where = np.flatnonzero(self.free)
        full[np.ix_(where, where)] = self.fit.covariance
        unknown = where[~np.isfinite(self.fit.known.u)]
        full[unknown, unknown] = np.inf
        return full


def solve(model: StepModel, axes: Sequence[str]) -> Solution:
    """Adds saturation terms that lower the BIC, then drops those that no longer do.

    A term lowers the BIC where it lowers the weighted sum of squares by more than log n (BIC).
    Terms are proposed by the score of the present fit under white noise, one an axis and round, and
    judged after a fit with them by their own standard error, which counts correlated residuals.

    Parameters
    ----------
    model
        The records and their equation.
    axes
        `ld_h`, `lq_h` or both: which inductances the rotor angles separate.

    Returns
    -------
    Solution
        Parameters with covariance, and which of them are free.

    References
    ----------
    Schwarz, Ann. Statist. 6(2), 1978, 461, doi:10.1214/aos/1176344136 (BIC).

    """
    free = np.ones(model.layout.size, dtype=bool)
    free[: len(SHARED)] = False
    free[[AXES[name][0] for name in axes]] = True
    start = start_of(model.records, model.layout)
    if len(axes) == 1:
        start[[LD, LQ]] = start[AXES[axes[0]][0]]
    sigmas = [(r.current_noise.sigma, r.voltage_noise.sigma) for r in model.records]
    solution = _fit(model, start, free, sigmas)
    penalty = bic_penalty(model)
    for _ in range(TERMS):
        proposals = offers_of(solution, axes, sigmas)
        accepted = [max(o)[1] for o in proposals.values() if o and max(o)[0] > penalty]
        if not accepted:
            break
        free = solution.free.copy()
        free[accepted] = True
        solution = _fit(model, solution.parameters, free, solution.sigmas)
    while True:
        worth = {k: _worth(solution, k) for name in axes for k in AXES[name][1] if solution.free[k]}
        idle = [k for k, value in worth.items() if value < penalty]
        if not idle:
            return solution
        least = min(idle, key=lambda k: worth[k])
        free, start = solution.free.copy(), solution.parameters.copy()
        free[least], start[least] = False, 0.0
        solution = _fit(model, start, free, solution.sigmas)


def bic_penalty(model: StepModel) -> float:
    """What one more term must lower the weighted sum of squares by.

    Parameters
    ----------
    model
        Whose samples count.

    Returns
    -------
    float
        log n [1], n the samples of all captures (Bayesian information criterion).

    References
    ----------
    G. Schwarz, Ann. Statist. 6(2), 1978, 461, doi:10.1214/aos/1176344136.

    """
    return math.log(sum(float(r.count.sum()) for r in model.records))


def _worth(solution: Solution, term: int) -> float:
    """What dropping one term would cost in weighted squares: (value/u)², Wald."""
    variance = float(solution.covariance()[term, term])
    return float(solution.parameters[term]) ** 2 / max(variance, 1e-300)


def offers_of(solution: Solution, axes: Sequence[str], sigmas: Sigmas) -> dict[str, list[Offer]]:
    """What each term that is not in use would gain, and how it would move the inductance.

    Parameters
    ----------
    solution
        The present fit.
    axes
        `ld_h`, `lq_h`, or both.
    sigmas
        Standard deviations that weigh the rows.

    Returns
    -------
    dict
        By axis: fall of the weighted sum of squares [1], place of the term, change of the
        inductance [H], one each.

    Notes
    -----
    One Gauss-Newton step of the present fit with that term added (Rao's score test).

    """
    everything = solution.free.copy()
    for name in axes:
        everything[list(AXES[name][1])] = True
    weights = _weights(solution.model, solution.parameters, sigmas)[0]
    residuals, jacobian = solution.model.residuals(solution.parameters, weights, everything)
    scale = np.linalg.norm(jacobian, axis=0)
    scale[scale == 0.0] = 1.0
    scaled = jacobian / scale
    normal, gradient = scaled.T @ scaled, scaled.T @ residuals
    places = np.flatnonzero(everything)
    offers: dict[str, list[Offer]] = {}
    for name in axes:
        offers[name] = []
        for term in AXES[name][1]:
            if solution.free[term]:
                continue
            use = np.flatnonzero(solution.free[places] | (places == term))
            step = -np.linalg.pinv(normal[np.ix_(use, use)], 1e-13, hermitian=True) @ gradient[use]
            moved = step[np.flatnonzero(places[use] == AXES[name][0])[0]]
            change = float(moved / scale[np.flatnonzero(places == AXES[name][0])[0]])
            offers[name].append((-float(step @ gradient[use]), term, change))
    return offers


def between_models(solution: Solution, offers: Sequence[Offer]) -> float:
    """Standard deviation of L between the chosen model and those with one term more.

    Each is weighted by exp(-BIC/2), the chosen one by 1.

    Parameters
    ----------
    solution
        The chosen model.
    offers
        Gain in weighted squares, term and change of L of each model with one term more.

    Returns
    -------
    float, H

    References
    ----------
    Hoeting et al., Statist. Sci. 14(4), 1999, 382, doi:10.1214/ss/1009212519, eq. 5.

    """
    penalty = bic_penalty(solution.model)
    weights = [math.exp(-0.5 * max(penalty - gain, 0.0)) for gain, _, _ in offers]
    spread = sum(w * change**2 for w, (_, _, change) in zip(weights, offers, strict=True))
    return math.sqrt(spread / (1.0 + sum(weights)))


def _weights(
    model: StepModel, parameters: Array, sigmas: Sigmas
) -> tuple[tuple[Array, ...], tuple[Array, ...]]:
    """Of each capture 1/standard deviation of its rows [2, rows], and white noise's share of it.

    Samples that are rounded alike have one error in common, so that a level of m samples is known
    to σ²/m + rounding², not σ²/m; each of its samples counts with σ² + m rounding².
    """
    rows = [parameters[None, :]] * len(model.records)
    weights, shares = [], []
    for record, pair, read in zip(model.records, sigmas, model.predict_both(rows), strict=True):
        noises = (record.current_noise, record.voltage_noise)
        masks = (np.ones(record.count.size, dtype=bool), record.level != BETWEEN)
        powers = [
            row_variance(values[:, 0], record.count, noise, sigma, used)
            for values, noise, sigma, used in zip(read, noises, pair, masks, strict=True)
        ]
        weights.append(
            np.array([u / np.sqrt(total) for u, (total, _) in zip(masks, powers, strict=True)])
        )
        shares.append(np.array([white / total for total, white in powers]))
    return tuple(weights), tuple(shares)


def row_variance(
    read: Array, count: Array, noise: Noise, sigma: float, used: Flags
) -> tuple[Array, Array]:
    """Variance of the means [n] of `count` samples of a channel, and white noise's part of it.

    Parameters
    ----------
    read : array [n]
        What the model says that a channel reads [its unit].
    count : array [n]
        Samples in each mean.
    noise
        The channel's rounding.
    sigma
        Its scatter from sample to sample [its unit].
    used : array [n] of bool
        Rows that count.

    Returns
    -------
    total, white : array [n]
        [unit squared].

    """
    white = sigma**2 / count
    if noise.rounding**2 * float(count[used].sum()) < (policy().steps.unseen_share * sigma) ** 2:
        return white, white
    order = np.argsort(read[used])
    level = read[used][order]
    before = np.concatenate([[0.0], np.cumsum(count[used][order])])
    ends = [np.searchsorted(level, read + side * 0.5 * noise.step) for side in (-1.0, 1.0)]
    alike = np.maximum(before[ends[1]] - before[ends[0]], count)
    return white + noise.rounding**2 * alike / count, white


def _fit(model: StepModel, start: Array, free: Flags, sigmas: Sigmas) -> Solution:
    """Gauss-Newton over the free parameters; the noise of each capture from its residuals."""
    where = np.flatnonzero(free)
    weights, shares = _weights(model, start, sigmas)

    def residuals_and_jacobian(values: Array) -> tuple[Array, Array]:
        trial = start.copy()
        trial[where] = values
        return model.residuals(trial, weights, free)

    low, high = model.layout.bounds(start)
    fit = gauss_newton(
        residuals_and_jacobian, start[where], low[where], high[where], tolerance=1e-3
    )
    parameters = start.copy()
    parameters[where] = fit.parameters
    scale = np.linalg.norm(fit.jacobian, axis=0)
    scale[scale == 0.0] = 1.0
    scatter = np.ones(fit.residuals.size)
    scaled, first = [], 0
    for pair, weight, share in zip(sigmas, weights, shares, strict=True):
        rescaled = []
        for sigma, w, white in zip(pair, weight, share, strict=True):
            rows = slice(first, first + w.size)
            first = rows.stop
            power = _white_power(fit.residuals[rows], np.where(w > 0.0, white, 0.0))
            scatter[rows] = np.sqrt(power * white + 1.0 - white)
            rescaled.append(sigma * max(math.sqrt(power), 1e-9))
        scaled.append((rescaled[0], rescaled[1]))
    spread = fit.jacobian / scale * scatter[:, None]
    bread = fit.covariance * np.outer(scale, scale)
    covariance = bread @ (spread.T @ spread) @ bread / np.outer(scale, scale)
    honest = NonlinearFit(
        fit.parameters, covariance, fit.residuals, fit.jacobian, fit.cost, fit.converged
    )
    return Solution(model, parameters, free, honest, weights, tuple(scaled), scatter)


def _white_power(residuals: Array, white: Array) -> float:
    """Mean square of weighted residuals [n] by white noise's share, times how many count as one."""
    total = float(white.sum())
    if total == 0.0:
        return 1.0
    used = residuals[white > 0.0]
    return float(white @ residuals**2) / total * autocorrelation_time(used)
