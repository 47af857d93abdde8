"""Standard errors when rows come in clusters: correlated inside, independent between."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def cluster_covariance(
    design: Array, residuals: Array, sigma: Array, cluster: NDArray[np.int64]
) -> tuple[Array, int]:
    """Covariance [k, k] of weighted least squares under any correlation inside clusters, and dof.

    design [n, k], residuals and sigma [n] in the unit of y, `cluster` [n] numbers. Sandwich with
    the small-sample factor G/(G-1) (n-1)/(n-k); dof = G - 1. Reference: Cameron and Miller,
    J. Human Resources 50(2), 2015, eqs. 11-12.
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
    covariance: Array = bread @ (sums.T @ sums) @ bread / np.outer(norm, norm) * factor
    return covariance, max(count - 1, 1)
