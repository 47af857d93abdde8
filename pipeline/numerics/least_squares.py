"""Linear and nonlinear least squares with standard errors that hold for correlated residuals.

Residuals of a bench are often correlated (filters, drift, quantisation), which a plain covariance
ignores: `autocorrelation_time` says how many samples count as one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.numerics.identifiability import TIED, Identified, identify

Array = NDArray[np.float64]
Model = Callable[[Array], tuple[Array, Array]]


@dataclass(frozen=True, slots=True)
class LinearFit:
    """Coefficients [k], their covariance [k, k], residuals [n] and degrees of freedom.

    `rank` below k means that the data do not part the coefficients; the covariance is then that
    of the minimum-norm solution and says nothing of the missing directions: ask `u`. `chi2_dof`
    is the weighted residual variance: 1 where `sigma` was right. `rows` [n, k] are the whitened
    rows, `sizes` [k] the coefficients at which a column alone would be as large as y.

    Attributes
    ----------
    coefficients
        [k].
    covariance
        [k, k]. Where `rank` is below k it is that of the minimum-norm solution and says nothing of
        the undetermined directions: use `u`.
    residuals
        y less the fit [n, unit of y].
    dof
        n less the rank.
    rank
        Number of directions that the data determine.
    chi2_dof
        Weighted residual variance [1]: 1 where `sigma` was right.
    rows
        Weighted rows [n, k].
    sizes
        Coefficients [k] at which a column alone would be as large as y.

    """

    coefficients: Array
    covariance: Array
    residuals: Array
    dof: int
    rank: int
    chi2_dof: float
    rows: Array
    sizes: Array

    @property
    def full_rank(self) -> bool:
        """Whether every coefficient is determined."""
        return self.rank == self.coefficients.size

    @property
    def known(self) -> Identified:
        """What the rows say of the coefficients."""
        return identify(self.rows, self.sizes)

    def u(self, index: int) -> float:
        """Standard uncertainty of one coefficient.

        Parameters
        ----------
        index
            Of the coefficient.

        Returns
        -------
        float
            k = 1; infinite where the data do not determine it.

        """
        if not (self.full_rank or math.isfinite(self.known.u[index])):
            return math.inf
        return math.sqrt(max(float(self.covariance[index, index]), 0.0))


def linear_fit(design: Array, y: Array, sigma: Array | float | None = None) -> LinearFit:
    """Weighted linear least squares of y on the columns of a design.

    Parameters
    ----------
    design
        Derivatives of y by the coefficients [n, k].
    y
        Observations [n].
    sigma
        Standard deviation of each observation [n, unit of y], or one for all; None where unknown.

    Returns
    -------
    LinearFit
        Of minimum norm where the columns are tied: its `u` is infinite for what they do not part.

    Notes
    -----
    With `sigma` the covariance is (X'WX)⁻¹, W = diag(σ⁻²). Without, the residual variance is
    estimated, s² = r'r/(n − rank), infinite where n = rank. The columns are scaled to unit length
    before the singular value decomposition, so their units do not matter.

    References
    ----------
    Golub and Van Loan, Matrix Computations, 4th ed., Johns Hopkins, 2013, 5.3 and 5.5.

    Examples
    --------
    >>> line = np.column_stack([np.ones(3), [0.0, 1.0, 2.0]])
    >>> np.round(linear_fit(line, np.array([1.0, 3.0, 5.0])).coefficients, 9).tolist()
    [1.0, 2.0]

    """
    weight = np.ones(y.size) if sigma is None else 1.0 / np.broadcast_to(sigma, y.shape)
    rows = design * weight[:, None]
    scale = np.linalg.norm(rows, axis=0)
    scale[scale == 0.0] = 1.0
    left, singular, right = np.linalg.svd(rows / scale, full_matrices=False)
    keep = singular > TIED * max(singular.max(initial=0.0), 1e-300)
    inverse = np.where(keep, 1.0 / np.where(keep, singular, 1.0), 0.0)
    coefficients = (right.T * inverse) @ (left.T @ (y * weight)) / scale
    residuals = y - design @ coefficients
    dof = y.size - int(keep.sum())
    chi2_dof = float(np.sum((residuals * weight) ** 2) / dof) if dof > 0 else math.nan
    covariance = (right.T * inverse**2) @ right / np.outer(scale, scale)
    if sigma is None:
        covariance = covariance * chi2_dof if dof > 0 else np.full_like(covariance, math.inf)
    sizes = max(float(np.linalg.norm(y * weight)), 1e-300) / scale
    rank = int(keep.sum())
    return LinearFit(coefficients, covariance, residuals, dof, rank, chi2_dof, rows, sizes)


def fit_by_groups(
    design: Array, y: Array, groups: Sequence[NDArray[np.bool_]], rounds: int, *, alone: bool = True
) -> tuple[LinearFit, Array]:
    """A weighted fit whose groups of rows have each the standard deviation that it leaves of them.

    Parameters
    ----------
    design : array [n, k]
        Columns of the model.
    y : array [n]
        What they explain.
    groups
        Rows [n] of each group.
    rounds
        How often the fit and the standard deviations are made of each other.
    alone
        Whether each group begins with what a fit of its own leaves, so that the better one leads.

    Returns
    -------
    fit, sigma [n]
        The last fit, and the standard deviation of each row by what it left [unit of y].

    """
    sigma, floor = np.ones(y.size), max(1e-6 * float(np.std(y)), 1e-300)
    for rows in groups if alone else ():
        residuals = linear_fit(design[rows], y[rows]).residuals
        sigma[rows] = max(float(np.sqrt(np.mean(residuals**2))), floor)
    for _ in range(rounds):
        fit = linear_fit(design, y, sigma)
        for rows in groups:
            sigma[rows] = max(float(np.sqrt(np.mean(fit.residuals[rows] ** 2))), floor)
    return fit, sigma


def autocorrelation_time(residuals: Array, longest: int | None = None) -> float:
    """How many samples of a series count as one independent sample.

    Parameters
    ----------
    residuals
        Series [n, any unit], evenly sampled.
    longest
        Longest lag looked at [samples]; a third of the series by default.

    Returns
    -------
    float
        τ = 1 + 2 Σ ρ_k [samples], at least 1. It is 1 for fewer than eight samples, for a constant
        series, and where ρ₁ is below its standard error twice, 2/√n, so that chance makes none.

    Notes
    -----
    The sum runs over pairs of lags while their sum is positive (initial positive sequence). The
    standard error of a mean is s √(τ/n).

    References
    ----------
    Geyer, Statistical Science 7(4), 1992, 473, section 3.3, doi:10.1214/ss/1177011137.

    """
    n = residuals.size
    longest = min(longest if longest is not None else n // 3, n - 2)
    centred = residuals - residuals.mean()
    power = float(centred @ centred)
    if n < 8 or power == 0.0 or longest < 1:
        return 1.0
    size = 1 << (2 * n - 1).bit_length()
    spectrum = np.fft.rfft(centred, size)
    rho = np.fft.irfft(np.abs(spectrum) ** 2, size)[: longest + 1] / power
    if rho[1] < 2.0 / math.sqrt(n):
        return 1.0
    pairs = rho[: rho.size // 2 * 2].reshape(-1, 2).sum(axis=1)
    ends = np.flatnonzero(pairs <= 0.0)
    stop = int(ends[0]) if ends.size else pairs.size
    return max(1.0, float(2.0 * pairs[:stop].sum() - 1.0))


@dataclass(frozen=True, slots=True)
class NonlinearFit:
    """Parameters [k] at the minimum, covariance [k, k], residuals and Jacobian there.

    The covariance is that of the minimum-norm step where the data do not part the parameters: ask
    `u`.

    Attributes
    ----------
    parameters
        At the minimum [k].
    covariance
        [k, k]; that of the minimum-norm step where the data do not determine all parameters: use
        `u`.
    residuals
        At the minimum [n].
    jacobian
        Derivatives of the residuals by the parameters [n, k].
    cost
        Sum of squared residuals.
    converged
        Whether the last step was below the tolerance.

    """

    parameters: Array
    covariance: Array
    residuals: Array
    jacobian: Array
    cost: float
    converged: bool

    @property
    def known(self) -> Identified:
        """What the residuals say of the parameters, near where they are."""
        length = np.linalg.norm(self.jacobian, axis=0)
        one = 1.0 / np.where(length > 0.0, length, 1.0)
        return identify(self.jacobian, np.maximum(np.abs(self.parameters), one))

    def u_of(self, gradient: Array) -> float:
        """Standard uncertainty of a function of the parameters.

        Parameters
        ----------
        gradient
            Its derivatives [k] by the parameters.

        Returns
        -------
        float
            k = 1; infinite where the data do not determine it.

        """
        if math.isinf(self.known.u_of(gradient)):
            return math.inf
        return math.sqrt(max(float(gradient @ self.covariance @ gradient), 0.0))

    def u(self, index: int) -> float:
        """Standard uncertainty of one parameter.

        Parameters
        ----------
        index
            Of the parameter.

        Returns
        -------
        float
            k = 1; infinite where the data do not determine it.

        """
        return self.u_of(np.eye(self.parameters.size)[index])


def gauss_newton(
    residuals_and_jacobian: Model,
    start: Array,
    low: Array | None = None,
    high: Array | None = None,
    iterations: int = 40,
    tolerance: float = 1e-5,
) -> NonlinearFit:
    """Nonlinear least squares within bounds, by Levenberg-Marquardt.

    Parameters
    ----------
    residuals_and_jacobian
        Of parameters [k]: residuals [n] divided by their standard deviation, and their derivatives
        by the parameters [n, k].
    start
        Parameters to begin with [k]; clipped to the bounds.
    low, high
        Bounds [k]; none by default. They are kept by clipping, and a parameter on its bound is left
        out of a step that would lead across it.
    iterations
        Most steps that are tried.
    tolerance
        Converged where a step changes the prediction, through any one parameter, by less than this
        part of the residuals' root mean square √(Σ r²/(n − k)) [1].

    Returns
    -------
    NonlinearFit
        At the last step that did not make the sum of squares larger; see its `converged`.

    Notes
    -----
    Minimises Σ r². A step solves (J'J + λ diag J'J) Δ = −J'r; λ begins at 0 (Gauss-Newton), rises
    tenfold after a step that fails and falls tenfold after one that succeeds. The covariance is
    (J'J)⁻¹ at the solution.

    References
    ----------
    Marquardt, J. SIAM 11(2), 1963, 431, doi:10.1137/0111030.
    Nocedal and Wright, Numerical Optimization, 2nd ed., Springer, 2006, 10.3.

    """
    low = np.full(start.size, -np.inf) if low is None else low
    high = np.full(start.size, np.inf) if high is None else high
    x = np.clip(start.astype(np.float64), low, high)
    residuals, jacobian = residuals_and_jacobian(x)
    cost = float(residuals @ residuals)
    damping, converged = 0.0, False
    for _ in range(iterations):
        scale, normal = _scaled_normal(jacobian)
        gradient = (jacobian / scale).T @ residuals
        free = ~(((x <= low) & (gradient > 0.0)) | ((x >= high) & (gradient < 0.0)))
        step = _step(normal, gradient, damping, free) / scale
        trial = np.clip(x + step, low, high)
        moved = float(np.max(np.abs(trial - x) * scale))
        enough = tolerance * math.sqrt(cost / max(residuals.size - x.size, 1))
        new_residuals, new_jacobian = residuals_and_jacobian(trial)
        new_cost = float(new_residuals @ new_residuals)
        if np.isfinite(new_cost) and new_cost <= cost * (1.0 + 1e-12):
            x, residuals, jacobian, cost = trial, new_residuals, new_jacobian, new_cost
            damping = 0.0 if damping < 1e-6 else damping * 0.1
            if moved <= enough:
                converged = True
                break
        elif moved <= enough:
            converged = True
            break
        else:
            damping = max(10.0 * damping, 1e-4)
    scale, normal = _scaled_normal(jacobian)
    covariance = np.linalg.pinv(normal, rcond=1e-13, hermitian=True) / np.outer(scale, scale)
    return NonlinearFit(x, covariance, residuals, jacobian, cost, converged)


def _scaled_normal(jacobian: Array) -> tuple[Array, Array]:
    scale = np.linalg.norm(jacobian, axis=0)
    scale[scale == 0.0] = 1.0
    scaled = jacobian / scale
    return scale, scaled.T @ scaled


def _step(normal: Array, gradient: Array, damping: float, free: NDArray[np.bool_]) -> Array:
    step = np.zeros(gradient.size)
    if free.any():
        block = normal[np.ix_(free, free)] + damping * np.eye(int(free.sum()))
        step[free] = -np.linalg.pinv(block, rcond=1e-14, hermitian=True) @ gradient[free]
    return step


def central_jacobian(function: Callable[[Array], Array], x: Array, width: Array) -> Array:
    """Derivatives of a function by central differences.

    Parameters
    ----------
    function
        Of parameters [k]; returns [n].
    x
        Where [k].
    width
        Half the width of each difference [k, unit of x], above zero.

    Returns
    -------
    array [n, k]
        (f(x + h) − f(x − h))/2h, exact for parabolas; the error is h²/6 f'''.

    """
    columns = []
    for index in range(x.size):
        up, down = x.copy(), x.copy()
        up[index] += width[index]
        down[index] -= width[index]
        columns.append((function(up) - function(down)) / (2.0 * width[index]))
    return np.column_stack(columns)
