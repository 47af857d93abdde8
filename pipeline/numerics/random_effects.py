"""Whether several values of one quantity agree, and the scatter between them where they do not."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtrc

Array = NDArray[np.float64]


class Between(NamedTuple):
    """Generalised chi-square of k values about their mean, and what goes beyond their covariance.

    `sd` is the standard deviation between the values [their unit], 0 where their covariance
    explains them; `dof` = k - 1 its degrees of freedom; `p_value` the chance of a chi-square as
    large where all values are of one quantity.
    """

    chi2: float
    dof: int
    p_value: float
    sd: float

    @property
    def birge(self) -> float:
        """Birge ratio sqrt(chi2 / dof), 1 where the stated uncertainties are right."""
        return float(np.sqrt(self.chi2 / self.dof)) if self.dof else 1.0


def between(values: Array, covariance: Array, covariance_dof: float = np.inf) -> Between:
    """Random effects of k `values` [k] with their `covariance` [k, k] known to `covariance_dof`.

    What the values share stands off the covariance's diagonal, and cancels in their differences.
    With W its inverse and P = W - W 1 (1'W 1)^-1 1'W, chi2 = y'P y does not know the mean, and
    E[chi2] = (k - 1) + sd² trace(P) where the values scatter by sd beyond their covariance: solved
    for sd (method of moments). chi2/(k - 1) is judged as F(k - 1, covariance_dof). Fewer than two
    values agree.

    References: DerSimonian and Laird, Controlled Clinical Trials 7, 1986, 177-188,
    doi:10.1016/0197-2456(86)90046-2; Jackson, White and Riley, Statistics in Medicine 31, 2012,
    3805-3820, doi:10.1002/sim.5453 (matrix form); Birge, Phys. Rev. 40, 1932, 207,
    doi:10.1103/PhysRev.40.207.
    """
    count = values.size
    if count < 2:
        return Between(0.0, 0, 1.0, 0.0)
    scale = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    weight = np.linalg.pinv(covariance / np.outer(scale, scale), rcond=1e-12, hermitian=True)
    weight = weight / np.outer(scale, scale)
    total = weight.sum(axis=1)
    projector = weight - np.outer(total, total) / max(float(total.sum()), 1e-300)
    chi2 = max(float(values @ projector @ values), 0.0)
    dof = count - 1
    p_value = float(fdtrc(dof, min(covariance_dof, 1e9), chi2 / dof))
    excess = (chi2 - dof) / max(float(np.trace(projector)), 1e-300)
    return Between(chi2, dof, p_value, float(np.sqrt(max(excess, 0.0))))
