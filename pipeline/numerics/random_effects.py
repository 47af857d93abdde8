"""Whether several values of one quantity agree, and the scatter between them where they do not."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.special import fdtrc

from pipeline.records.capture import Array


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


def between(values: Array, covariance: Array, covariance_dof: float = np.inf) -> Between:
    """Whether values of one quantity agree, and what they scatter beyond their covariance.

    Parameters
    ----------
    values
        Estimates of one quantity [k, any unit].
    covariance
        Of the values [k, k, unit²]. What they share stands off its diagonal, and cancels in their
        differences.
    covariance_dof
        Degrees of freedom to which the covariance is known.

    Returns
    -------
    Between
        Fewer than two values agree.

    Notes
    -----
    With W the inverse covariance and P = W − W 1 (1'W 1)⁻¹ 1'W, chi2 = y'P y does not depend on the
    mean, and E[chi2] = (k − 1) + sd² trace(P) where the values scatter by sd beyond their
    covariance: solved for sd (method of moments). chi2/(k − 1) is judged as F(k − 1,
    covariance_dof).

    References
    ----------
    DerSimonian and Laird, Controlled Clinical Trials 7, 1986, 177,
    doi:10.1016/0197-2456(86)90046-2.
    Jackson, White and Riley, Statistics in Medicine 31, 2012, 3805, doi:10.1002/sim.5453
    (matrices).
    Birge, Phys. Rev. 40, 1932, 207, doi:10.1103/PhysRev.40.207.

    Examples
    --------
    Two values 2 apart, each with a standard uncertainty of 1: chi2 = 2²/(1 + 1) = 2.

    >>> found = between(np.array([1.0, 3.0]), np.eye(2))
    >>> round(found.chi2, 9), found.dof, round(found.sd, 9)
    (2.0, 1, 1.0)

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
