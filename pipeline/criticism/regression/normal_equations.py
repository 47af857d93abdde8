"""Weighted fits along columns from their normal matrices group by group.

Weights are one number a group, so that a fit whose weights change needs the samples only once.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from scipy.linalg import lapack

from pipeline.criticism.operating import Array, Indices
from pipeline.criticism.policy.regression import GaussNewton

_UNSEEN = math.sqrt(sys.float_info.min)
"""Information [1] below which no capture observes a parameter, as its square is no number: a bump
of friction at a speed that no coast comes near has 1e-320, and steps along it overflow."""
_TIE = 1e-11
"""Share of the largest information below which a direction has none, far above the rounding of
doubles (1e-16). Larger, and constants that captures barely determine are held; smaller, and
rounding moves them."""
_SAFE = 10.0 * _TIE
"""Estimated reciprocal condition above which no direction is without information: an estimate of
LAPACK is seldom off by more than three [Higham (2002), ch. 15]."""


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

    def only(self, places: Indices) -> Prior:
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
        Columns times each other [k (k + 1) / 2, G], of each group the upper triangle by rows: so a
        sum over groups is half as long, and one product of a matrix and a vector; and what some of
        the columns need lies together.
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
        cls, rows: Array, group: Indices, count: int, prior: Prior, policy: GaussNewton
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
        sorted_rows = rows[np.argsort(group, kind="stable")]
        counts = np.bincount(group, minlength=count)
        edges = np.concatenate([[0], np.cumsum(counts)])
        size = sorted_rows.shape[1]
        # of the machine's constants a campaign observes half
        nonzero = np.flatnonzero(sorted_rows.any(axis=0))
        sorted_rows, upper = sorted_rows[:, nonzero], _upper(nonzero.size)
        places = _place(nonzero[upper[0]], nonzero[upper[1]], size)
        normal = np.zeros((_upper(size)[0].size, count))
        for number in range(count):
            in_group = sorted_rows[edges[number] : edges[number + 1]]
            normal[places, number] = (in_group.T @ in_group)[upper]
        return cls(counts.astype(float), normal[0], normal[1:size].T, normal[size:], prior, policy)

    def only(self, places: Indices) -> NormalEquations:
        """The normal equations of some of the columns.

        Parameters
        ----------
        places
            Their indices.

        """
        return self._only(places, self.prior.only(places))

    def _only(self, places: Indices, prior: Prior) -> NormalEquations:
        rows, columns = _upper(places.size)
        normal = self.normal[self._products(places[rows], places[columns])]
        return replace(self, slope=self.slope[:, places], normal=normal, prior=prior)

    def _products(self, rows: Indices, columns: Indices) -> Indices:
        """Where the products of columns are in `normal`."""
        first, second = np.minimum(rows, columns), np.maximum(rows, columns)
        return _place(first, second, self.slope.shape[1])

    def moved(self, places: Indices, step: Array) -> NormalEquations:
        """The normal equations at the end of a step; the priors stay where they were.

        Parameters
        ----------
        places
            Columns that move.
        step
            Change of each.

        """
        all_columns = np.arange(self.slope.shape[1])
        rows = self.normal[self._products(places[:, None], all_columns)]
        slope = self.slope + np.tensordot(step, rows, 1).T
        power = _rounded(self.power + (self.slope + slope)[:, places] @ step)
        return replace(self, power=power, slope=slope)

    def sheared(self, place: int, along: Indices, by: Array) -> NormalEquations:
        """The normal equations with multiples of some columns added to another one.

        Parameters
        ----------
        place
            The column that changes.
        along
            Columns [k] that are added to it.
        by
            Multiple of each in every group [G, k].

        """
        every = np.arange(self.slope.shape[1])
        rows = self.normal[self._products(along[:, None], every)]
        row = self.normal[self._products(np.array(place), every)]
        row += np.einsum("gk,kng->ng", by, rows)
        row[place] += np.einsum("gk,kg->g", by, row[along])
        slope, normal = self.slope.copy(), self.normal.copy()
        slope[:, place] += (by * self.slope[:, along]).sum(axis=1)
        normal[self._products(np.array(place), every)] = row
        return replace(self, slope=slope, normal=normal)

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
        all_columns, prior = np.arange(self.slope.shape[1]), self.prior
        nonzero = np.flatnonzero(self.normal[self._products(all_columns, all_columns)].any(axis=1))
        observed = Prior(prior.precision[nonzero], prior.gradient[nonzero], prior.elsewhere)
        known = self._only(nonzero, observed)
        now = np.maximum(self._reduced_chi2(self.power), 1.0)
        ends = [known._descended(now**power, rounds or self.policy.most_rounds) for power in starts]
        end = min(ends, key=lambda end: end.deviance)
        # what no row observes goes to the centre of its prior, and stays where it has none
        step = -prior.gradient / np.where(prior.precision > 0, prior.precision, np.inf)
        step[nonzero] = end.step
        return replace(end, step=step)

    def _descended(self, reduced_chi2: Array, rounds: int) -> Descent:
        upper = _upper(self.slope.shape[1])
        twice = np.where(upper[0] == upper[1], 1.0, 2.0)
        normal = np.diag(self.prior.precision)
        step, now, before = np.zeros(self.prior.precision.size), np.inf, np.inf
        for _ in range(rounds):
            weight = 1.0 / np.maximum(reduced_chi2, 1.0)
            normal[upper] = self.normal @ weight
            normal[np.diag_indices_from(normal)] += self.prior.precision
            step = -_solved(normal, weight @ self.slope + self.prior.gradient)
            bent = (twice * step[upper[0]] * step[upper[1]]) @ self.normal
            power = _rounded(self.power + 2.0 * (self.slope @ step) + bent)
            reduced_chi2 = self._reduced_chi2(power)
            now = deviance_of(self.counts, reduced_chi2) + self.prior.cost(step)
            now += self.prior.elsewhere
            if abs(before - now) < self.policy.settled:
                break
            before = now
        return Descent(step, reduced_chi2, now)

    def _reduced_chi2(self, power: Array) -> Array:
        return np.where(self.counts > 0, power / np.maximum(self.counts, 1.0), 1.0)


@cache
def _upper(size: int) -> tuple[Indices, Indices]:
    """Rows and columns of the upper triangle of a square, by rows; making them costs as much as a
    fit that uses them.
    """
    return np.triu_indices(size)


def _place(rows: Indices, columns: Indices, size: int) -> Indices:
    """Where entries of an upper triangle, `columns` not below `rows`, are in it by rows."""
    return rows * (2 * size - rows - 1) // 2 + columns


def deviances_of(counts: Array, reduced_chi2: Array) -> Array:
    """−2 log likelihood [G] of each group of rows whose scatter is at least their noise floor.

    Parameters
    ----------
    counts
        Rows n of each group [G].
    reduced_chi2
        q = χ²/n of each group [G].

    Returns
    -------
    array [G]
        Less constants.

    Notes
    -----
    n [log max(1, q) + min(1, q) − 1]: χ² where q < 1, and that of a normal distribution of
    unknown variance where q > 1, so that a group which misses its floor counts 1/q.

    """
    nats = np.log(np.maximum(reduced_chi2, 1.0)) + np.minimum(reduced_chi2, 1.0) - 1.0
    each: Array = counts * nats
    return each


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
        Less constants, the sum of `deviances_of`.

    Examples
    --------
    >>> deviance_of(np.array([10.0, 10.0]), np.array([1.0, np.e]))
    10.0

    """
    return float(deviances_of(counts, reduced_chi2).sum())


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
    size = np.sqrt(np.where(information > _UNSEEN, information, 1.0))
    power, axes = np.linalg.eigh(normal / np.outer(size, size))
    nonzero = power > _TIE * max(float(power[-1]), 1.0)
    inverse: Array = (axes[:, nonzero] / power[nonzero]) @ axes[:, nonzero].T
    return inverse / np.outer(size, size)


def _solved(normal: Array, slope: Array) -> Array:
    """Normal matrix [k, k], its upper triangle given, into a slope [k]: by Cholesky, or where some
    direction may have no information by the pseudo-inverse.
    """
    if not slope.size:
        return slope
    information = np.diag(normal)
    size = np.sqrt(np.where(information > _UNSEEN, information, 1.0))
    scaled = np.triu(normal / np.outer(size, size))
    entries = np.abs(scaled)
    norm = float((entries.sum(axis=0) + entries.sum(axis=1)).max(initial=1.0)) - 1.0
    factor, failed = lapack.dpotrf(scaled.T, lower=1)
    if not failed and lapack.dpocon(factor, norm, uplo="L")[0] > _SAFE:
        return lapack.dpotrs(factor, slope / size, lower=1)[0] / size
    whole = scaled + np.triu(scaled, 1).T
    return pseudo_inverse(whole) @ (slope / size) / size


def _rounded(power: Array) -> Array:
    """Sums of squares: what is left of a fit that is exact is rounding."""
    return np.maximum(power, 0.0)


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
