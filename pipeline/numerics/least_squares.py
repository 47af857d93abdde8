"""Linear and nonlinear least squares with honest standard errors.

Residuals of a bench are often correlated (filters, drift, quantisation), which a plain covariance
ignores: `autocorrelation_time` says how many samples count as one.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.numerics.identifiability import TIED, Identified, identify

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class LinearFit:
    """Coefficients [k], their covariance [k, k], residuals [n] and degrees of freedom.

    `rank` below k means that the data do not part the coefficients; the covariance is then that
    of the minimum-norm solution and says nothing of the missing directions: ask `u`. `chi2_dof`
    is the weighted residual variance: 1 where `sigma` was right. `rows` [n, k] are the whitened
    rows, `sizes` [k] the coefficients at which a column alone would be as large as y.
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
        """Standard uncertainty of one coefficient, infinite where the data do not determine it."""
        if not (self.full_rank or math.isfinite(self.known.u[index])):
            return math.inf
        return math.sqrt(max(float(self.covariance[index, index]), 0.0))


def linear_fit(design: Array, y: Array, sigma: Array | float | None = None) -> LinearFit:
    """Weighted least squares of y [n] on design [n, k].

    With `sigma` (the standard deviation of each y) the covariance is (X'WX)^-1; without it, the
    residual variance is estimated, s² = r'r/(n - k), infinite where n = k. Columns are scaled
    before the decomposition. Reference: Golub and Van Loan, Matrix Computations, 4th ed., 5.3.
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


def autocorrelation_time(residuals: Array, longest: int | None = None) -> float:
    """How many samples count as one: 1 + 2 sum rho_k, at least 1.

    The sum runs over pairs of lags while their sum is positive (initial positive sequence) and at
    most to `longest` (a third of the series). The standard error of a mean is s sqrt(tau/n).
    Reference: Geyer, Statistical Science 7(4), 1992, 3.3.
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
        """Standard uncertainty of a function of the parameters with this gradient [k], infinite
        where the data do not determine it.
        """
        if math.isinf(self.known.u_of(gradient)):
            return math.inf
        return math.sqrt(max(float(gradient @ self.covariance @ gradient), 0.0))

    def u(self, index: int) -> float:
        """Standard uncertainty of one parameter, infinite where the data do not determine it."""
        return self.u_of(np.eye(self.parameters.size)[index])


Model = Callable[[Array], tuple[Array, Array]]


def gauss_newton(
    residuals_and_jacobian: Model,
    start: Array,
    low: Array | None = None,
    high: Array | None = None,
    iterations: int = 40,
    tolerance: float = 1e-5,
) -> NonlinearFit:
    """Minimises sum r² from `start`, r already divided by its sigma; bounds are kept by clipping.

    Levenberg-Marquardt with the diagonal's scaling. The covariance is (J'J)^-1 at the solution.
    Converged where no step moves the prediction by more than `tolerance` of the residuals' rms.
    Reference: Nocedal and Wright, Numerical Optimization, 2nd ed., 10.3.
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
    """Jacobian [n, k] of function(x) [n] by central differences of half width `width` [k]."""
    columns = []
    for index in range(x.size):
        up, down = x.copy(), x.copy()
        up[index] += width[index]
        down[index] -= width[index]
        columns.append((function(up) - function(down)) / (2.0 * width[index]))
    return np.column_stack(columns)
