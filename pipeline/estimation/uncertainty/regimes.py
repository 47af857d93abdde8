"""One coefficient of a regression in each regime of its rows: where it differs, the law lacks.

Rows that accelerate, that brake, that run fast or slow, in either sense, early or late, of one
capture or of another, are equations of the same constants. Where something is missing from the law
they give different ones, each by far more than its scatter; what the regimes scatter beyond that
belongs to the uncertainty (`between`), as no one knows which regime is free of what is missing.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pipeline.estimation.policy import policy
from pipeline.numerics.clusters import cluster_covariance
from pipeline.numerics.least_squares import Array, LinearFit, autocorrelation_time, linear_fit
from pipeline.numerics.random_effects import Between, between
from pipeline.records.uncertainty import BETWEEN, Contribution

Labels = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Partition:
    """Regimes of the rows of a regression.

    Attributes
    ----------
    name
        What the rows are grouped by.
    labels
        Number of each row's regime [n]; −1 for a row of none.
    names
        Names of the regimes.

    """

    name: str
    labels: Labels
    names: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Regression:
    """y = design times coefficients plus noise.

    Attributes
    ----------
    design
        Columns [n, k].
    y
        Observations [n].
    sigma
        Standard deviation of the noise [n, unit of y].
    cluster
        Rows of one number may be correlated [n].

    """

    design: Array
    y: Array
    sigma: Array
    cluster: Labels


@dataclass(frozen=True, slots=True)
class Disagreement:
    """A partition whose regimes differ beyond chance: relative values [k] and their scatter.

    Attributes
    ----------
    partition
        The regimes that were compared.
    relative
        Coefficient of each regime over the common one [k].
    between
        The test of their agreement.

    """

    partition: Partition
    relative: Array
    between: Between

    def part(self, source: str, value: float) -> Contribution:
        """The contribution of the regimes to the uncertainty of a constant.

        Parameters
        ----------
        source
            Name of the constant, for the name of the contribution.
        value
            The constant [its unit].

        Returns
        -------
        Contribution
            Type A, with the degrees of freedom of the scatter between regimes.

        """
        return Contribution(f"{BETWEEN}{source}", self.between.sd * value, "A", self.between.dof)

    def words(self, subject: str) -> str:
        """Which regimes differ, and by how much.

        Parameters
        ----------
        subject
            Name of the constant in the sentence.

        """
        each = ", ".join(
            f"{100.0 * (r - 1.0):+.3g} % {n}"
            for r, n in zip(self.relative, self.partition.names, strict=True)
        )
        return f"{subject} disagrees with itself by {self.partition.name} beyond chance ({each})"


def halves(
    name: str, values: Array, low: str, high: str, information: Array, among: NDArray[np.bool_]
) -> Partition:
    """Rows below and above the value that halves their information.

    Parameters
    ----------
    name
        Of the partition.
    values
        By which the rows are grouped [n].
    low, high
        Names of the two regimes.
    information
        Of each row [n].
    among
        Rows that count [n]; the others are in neither regime.

    Returns
    -------
    Partition

    """
    order = np.argsort(values, kind="stable")
    share = np.cumsum(np.where(among, information, 0.0)[order])
    labels = np.full(values.size, -1)
    labels[order] = (share > 0.5 * share[-1]).astype(np.int64)
    return Partition(name, np.where(among, labels, -1), (low, high))


def signs(name: str, values: Array, low: str, high: str, among: NDArray[np.bool_]) -> Partition:
    """Rows of negative and of positive values.

    Parameters
    ----------
    name
        Of the partition.
    values
        By which the rows are grouped [n]; 0 counts as negative.
    low, high
        Names of the two regimes.
    among
        Rows that count [n]; the others are in neither regime.

    Returns
    -------
    Partition

    """
    return Partition(name, np.where(among, (values > 0.0).astype(np.int64), -1), (low, high))


def information(regression: Regression, column: int) -> Array:
    """What each row determines of one coefficient beside the others.

    Parameters
    ----------
    regression
        The regression.
    column
        Index of the coefficient.

    Returns
    -------
    array [n]
        Share of each row in 1/variance of the coefficient; the sum is 1.

    Notes
    -----
    The column's residual on the other columns, over sigma, squared (Frisch and Waugh).

    """
    further = np.delete(regression.design, column, axis=1)
    residuals = linear_fit(further, regression.design[:, column], regression.sigma).residuals
    weights: Array = (residuals / regression.sigma) ** 2
    return weights / max(float(weights.sum()), 1e-300)


def disagreement(
    regression: Regression,
    column: int,
    partitions: Callable[[Array], Sequence[Partition]],
    level: float,
) -> Disagreement | None:
    """The partition whose regimes scatter most beyond chance in one coefficient.

    Parameters
    ----------
    regression
        Rows with their noise and clusters.
    column
        The coefficient, by its place in the design.
    partitions
        Of the rows, from their information [n].
    level
        Chance that any partition is named where the law is whole [1] (Bonferroni).

    Returns
    -------
    Disagreement or None
        The values of the regimes, relative to the common one [1], and what they scatter. The
        coefficient is fitted once a regime, with all else common.

    """
    weights = information(regression, column)
    tried = [_of_partition(regression, column, weights, p) for p in partitions(weights)]
    tested = [one for one in tried if one is not None]
    beyond = [d for d in tested if d.between.p_value * len(tested) < level and d.between.sd > 0.0]
    return max(beyond, key=lambda d: d.between.sd, default=None)


def _of_partition(
    regression: Regression, column: int, weights: Array, partition: Partition
) -> Disagreement | None:
    """The coefficient of a column in each regime, relative to the common one."""
    design, labels, y, sigma = (
        regression.design, partition.labels, regression.y, regression.sigma,
    )  # fmt: skip
    present = [
        k
        for k in range(len(partition.names))
        if np.sum(labels == k) >= policy().evidence.rows
        and weights[labels == k].sum() >= policy().regimes.least_share
        and np.any(design[labels == k, column])
    ]
    if len(present) < 2:
        return None
    split = [design[:, column] * (labels == k) for k in present]
    remaining = design[:, column] * ~np.isin(labels, present)
    wide = np.column_stack([np.delete(design, column, axis=1), remaining, *split])
    wide = wide[:, np.any(wide != 0.0, axis=0)]
    fit, common = linear_fit(wide, y, sigma), linear_fit(design, y, sigma).coefficients[column]
    if not fit.full_rank or common == 0.0 or fit.dof < policy().evidence.rows:
        return None
    tau = autocorrelation_time(fit.residuals / sigma, policy().evidence.memory_rows)
    covariance, dof = fit.covariance * fit.chi2_dof * tau, max(fit.dof / tau, 1.0)
    clusters = [np.unique(regression.cluster[labels == k]).size for k in present]
    if min(clusters) >= policy().evidence.clusters:
        robust, _ = cluster_covariance(wide, fit.residuals, sigma, regression.cluster)
        covariance, dof = robust, float(sum(clusters) - len(clusters))
    count = len(present)
    values = fit.coefficients[-count:] / common
    value_covariance = covariance[-count:, -count:] / common**2
    shown = replace(partition, names=tuple(partition.names[k] for k in present))
    return Disagreement(shown, values, between(values, value_covariance, dof))


def scatter(regression: Regression, fit: LinearFit, overlap: float) -> tuple[Array, Array]:
    """Standard deviations of the coefficients, and their degrees of freedom.

    Parameters
    ----------
    regression
        Rows with their noise and clusters.
    fit
        Their fit [k coefficients].
    overlap
        Share that neighbouring windows have in common [1].

    Returns
    -------
    tuple of array [k]
        In the units of the coefficients, and degrees of freedom.

    Notes
    -----
    By clusters, and by how many windows count as one; the larger counts. A coefficient may rest on
    few windows, so of clusters only as many count as hold its information.

    References
    ----------
    Carter, Schnepel and Steigerwald, Rev. Econ. Stat. 99(4), 2017, 698 (effective number of
    clusters).

    """
    tau = autocorrelation_time(fit.residuals / regression.sigma, policy().evidence.memory_rows)
    tau = max(tau, 1.0 / (1.0 - overlap))
    by_windows = np.sqrt(np.diag(fit.covariance) * fit.chi2_dof * tau)
    _, cluster = np.unique(regression.cluster, return_inverse=True)
    shares = [np.bincount(cluster, information(regression, k)) for k in range(by_windows.size)]
    groups = np.maximum([1.0 / float(share @ share) for share in shares], 2.0)
    covariance, _ = cluster_covariance(
        regression.design, fit.residuals, regression.sigma, regression.cluster
    )
    robust = np.sqrt(np.diag(covariance) * groups / (groups - 1.0))
    return np.maximum(by_windows, robust), np.minimum(max(fit.dof / tau, 1.0), groups - 1.0)
