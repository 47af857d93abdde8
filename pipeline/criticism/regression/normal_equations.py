"""Weighted fits along columns from their normal matrices group by group.

Weights are one number a group, so that a fit whose weights change needs the samples only once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pipeline.criticism.effect import Array
from pipeline.criticism.policy.regression import GaussNewton

_TIE = 1e-11
"""Share of the largest information below which a direction has none, far above the rounding of
doubles (1e-16). Larger, and constants that captures barely determine are held; smaller, and
rounding moves them."""


@dataclass(frozen=True, slots=True)
class Descent:
    """Where a fit along some columns ends.

    Attributes
    ----------
    step
        Change of the parameters [k].
    reduced_chi2
        χ²/n of every group after it [G].
    deviance
        −2 log likelihood there, the cost of the priors included.

    """

    step: Array
    reduced_chi2: Array
    deviance: float


@dataclass(frozen=True, slots=True)
class Prior:
    """What is known of k parameters beforehand.

    Attributes
    ----------
    precision
        Inverse prior variance [k].
    gradient
        Half the gradient of its cost [k].
    elsewhere
        Cost of the priors of other parameters.

    """

    precision: Array
    gradient: Array
    elsewhere: float = 0.0

    def cost(self, step: Array | float = 0.0) -> float:
        """Squared distance from the centres after a step.

        Parameters
        ----------
        step
            Change of the parameters [k].

        Returns
        -------
        float
            In squared standard uncertainties.

        """
        gradient = self.gradient + self.precision * step
        return float(prior_costs(gradient, self.precision).sum())

    def along(self, places: NDArray[np.int64]) -> Prior:
        """The prior of some of the parameters.

        Parameters
        ----------
        places
            Their indices; the cost of the others goes into `elsewhere`.

        """
        out = np.setdiff1d(np.arange(self.precision.size), places)
        rest = float(prior_costs(self.gradient[out], self.precision[out]).sum())
        return Prior(self.precision[places], self.gradient[places], self.elsewhere + rest)


@dataclass(frozen=True, slots=True)
class NormalEquations:
    """What a fit along k columns needs of the rows of G groups.

    Attributes
    ----------
    counts
        Weak samples [G].
    power
        Sums of squares of the residuals [G].
    slope
        Columns times the residual [G, k].
    normal
        Columns times each other [G, k, k].
    prior
        What is known of the parameters beforehand.
    policy
        When a fit has converged.

    """

    counts: Array
    power: Array
    slope: Array
    normal: Array
    prior: Prior
    policy: GaussNewton

    @classmethod
    def of(
        cls, rows: Array, group: NDArray[np.int64], count: int, prior: Prior, policy: GaussNewton
    ) -> NormalEquations:
        """The normal equations of some rows.

        Parameters
        ----------
        rows
            Residual and columns [R, 1 + k].
        group
            Group of each row [R].
        count
            Number of groups.
        prior
            What is known of the parameters beforehand.
        policy
            When a fit has converged.

        """
        both = rows[np.argsort(group, kind="stable")]
        counts = np.bincount(group, minlength=count)
        edges = np.concatenate([[0], np.cumsum(counts)])
        normal = np.empty((count, both.shape[1], both.shape[1]))
        for number in range(count):
            in_group = both[edges[number] : edges[number + 1]]
            np.matmul(in_group.T, in_group, out=normal[number])
        return cls(
            counts.astype(float),
            normal[:, 0, 0].copy(),
            normal[:, 0, 1:].copy(),
            normal[:, 1:, 1:],
            prior,
            policy,
        )

    def along(self, places: NDArray[np.int64]) -> NormalEquations:
        """The normal equations of some of the columns.

        Parameters
        ----------
        places
            Their indices.

        """
        return NormalEquations(
            self.counts,
            self.power,
            self.slope[:, places],
            self.normal[:, places[:, None], places],
            self.prior.along(places),
            self.policy,
        )

    def moved(self, places: NDArray[np.int64], step: Array) -> NormalEquations:
        """The normal equations at the end of a step; the priors stay where they were.

        Parameters
        ----------
        places
            Columns that move.
        step
            Change of each.

        """
        rows = self.normal[:, places]
        power = _after(self.power, self.slope[:, places], rows[:, :, places], step)
        return replace(self, power=power, slope=self.slope + step @ rows)

    def deviance(self) -> float:
        """−2 log likelihood where the fit stands, and what the priors cost."""
        cost = self.prior.cost() + self.prior.elsewhere
        return deviance_of(self.counts, self._reduced_chi2(self.power)) + cost

    def best(self, starts: Sequence[float] = (1.0, 0.5, 0.0), rounds: int | None = None) -> Descent:
        """The step of least deviance.

        Parameters
        ----------
        starts
            Powers to which the weights of the residual at hand are taken to begin with.
        rounds
            Most renewals of the weights; the policy's where not given.

        Returns
        -------
        Descent
            The lowest of the ends.

        Notes
        -----
        Weighted least squares, the weights 1/max(1, q) renewed until the deviance stays. There may
        be more than one end: one start gives up a group that another would have saved.

        """
        now = np.maximum(self._reduced_chi2(self.power), 1.0)
        ends = [self._descended(now**power, rounds or self.policy.most_rounds) for power in starts]
        return min(ends, key=lambda end: end.deviance)

    def _descended(self, reduced_chi2: Array, rounds: int) -> Descent:
        step, now, before = np.zeros(self.prior.precision.size), np.inf, np.inf
        for _ in range(rounds):
            weight = 1.0 / np.maximum(reduced_chi2, 1.0)
            normal = np.einsum("g,gkl->kl", weight, self.normal) + np.diag(self.prior.precision)
            step = -pseudo_inverse(normal) @ (weight @ self.slope + self.prior.gradient)
            reduced_chi2 = self._reduced_chi2(_after(self.power, self.slope, self.normal, step))
            now = deviance_of(self.counts, reduced_chi2) + self.prior.cost(step)
            now += self.prior.elsewhere
            if abs(before - now) < self.policy.settled:
                break
            before = now
        return Descent(step, reduced_chi2, now)

    def _reduced_chi2(self, power: Array) -> Array:
        return np.where(self.counts > 0, power / np.maximum(self.counts, 1.0), 1.0)


def deviance_of(counts: Array, reduced_chi2: Array) -> float:
    """−2 log likelihood of groups of rows whose scatter is at least their noise floor.

    Parameters
    ----------
    counts
        Rows n of each group [G].
    reduced_chi2
        q = χ²/n of each group [G].

    Returns
    -------
    float
        Less constants.

    Notes
    -----
    Σ n [log max(1, q) + min(1, q) − 1]: χ² where q < 1, and that of a normal distribution of
    unknown variance where q > 1, so that a group which misses its floor counts 1/q.

    Examples
    --------
    >>> deviance_of(np.array([10.0, 10.0]), np.array([1.0, np.e]))
    10.0

    """
    each = np.log(np.maximum(reduced_chi2, 1.0)) + np.minimum(reduced_chi2, 1.0) - 1.0
    return float((counts * each).sum())


def pseudo_inverse(normal: Array) -> Array:
    """Inverse of a normal matrix, directions without information left at zero.

    Parameters
    ----------
    normal
        [k, k], symmetric and not negative.

    Returns
    -------
    array [k, k]
        A parameter that no row observes has a row and a column of zeros.

    Notes
    -----
    The matrix is scaled to a unit diagonal; directions below `_TIE` of the largest have no
    information.

    """
    information = np.diag(normal)
    # a parameter that no capture observes stays where it is, exactly
    size = np.sqrt(np.where(information > 0.0, information, 1.0))
    power, axes = np.linalg.eigh(normal / np.outer(size, size))
    good = power > _TIE * max(float(power[-1]), 1.0)
    inverse: Array = (axes[:, good] / power[good]) @ axes[:, good].T
    return inverse / np.outer(size, size)


def _after(power: Array, slope: Array, normal: Array, step: Array) -> Array:
    """Sums of squares [G] of the residuals after a step [k]."""
    # what is left of a fit that is exact is rounding
    return np.maximum(power + (2.0 * slope + normal @ step) @ step, 0.0)


def prior_costs(gradient: Array, precision: Array) -> Array:
    """Squared distances from the centres of priors.

    Parameters
    ----------
    gradient
        Half the slope of the cost [k].
    precision
        Inverse prior variance [k].

    Returns
    -------
    array [k]
        In squared standard uncertainties; 0 without a prior.

    """
    return gradient**2 / np.where(precision > 0, precision, np.inf)


def unit_diagonal(normal: Array) -> Array:
    """A normal matrix [k, k] with each column in its own size, so that its diagonal is 1.

    Parameters
    ----------
    normal
        [k, k].

    Returns
    -------
    array [k, k]
        Symmetric.

    """
    scale = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    return normal / np.outer(scale, scale)
