"""Standard errors when rows come in clusters: correlated inside, independent between."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def cluster_covariance(
    design: Array, residuals: Array, sigma: Array, cluster: NDArray[np.int64]
) -> tuple[Array, int]:
    """Covariance of weighted least squares under any correlation of the rows within a cluster.

    Parameters
    ----------
    design
        Derivatives of y by the coefficients [n, k].
    residuals
        Of the fit [n, unit of y].
    sigma
        Noise by which the rows were weighted [n, unit of y], above zero.
    cluster
        Number of the cluster of each row [n]; clusters are independent of each other.

    Returns
    -------
    covariance [k, k]
        Of the coefficients.
    dof
        Degrees of freedom: clusters less one, at least 1.

    Notes
    -----
    V = c (X'X)⁻¹ (Σ_g X_g' e_g e_g' X_g) (X'X)⁻¹, X and e divided by sigma, with the small-sample
    factor c = G/(G − 1) · (n − 1)/(n − k). It is the product of a matrix with itself, so that no
    rounding makes a variance negative. A single cluster has no covariance: its scores sum to
    zero, and so does V.

    References
    ----------
    Cameron and Miller, J. Human Resources 50(2), 2015, 317, eqs. 11 and 12,
    doi:10.3368/jhr.50.2.317.

    """
    n, k = design.shape
    scaled = design / sigma[:, None]
    norm = np.linalg.norm(scaled, axis=0)
    norm[norm == 0.0] = 1.0
    scaled = scaled / norm
    bread = np.linalg.pinv(scaled.T @ scaled)
    score = scaled * (residuals / sigma)[:, None]
    _, index = np.unique(cluster, return_inverse=True)
    count = int(index.max()) + 1
    sums = np.zeros((count, k))
    np.add.at(sums, index, score)
    factor = count / max(count - 1, 1) * (n - 1) / max(n - k, 1)
    influence = sums @ bread / norm
    covariance: Array = influence.T @ influence * factor
    return covariance, max(count - 1, 1)
