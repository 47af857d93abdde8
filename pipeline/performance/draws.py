"""Draws of a motor's constants with the covariance that their budgets share.

References: JCGM 101:2008 (GUM Supplement 1), 6.4.9 (t distribution of a type A evaluation), 7
(propagation by Monte Carlo).
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from pipeline.records.capture import Array
from pipeline.records.estimate import Estimate

HALF = 200
"""Pairs of draws; the percentiles of 400 are known to some 8 % of the interval's half width."""
SEED = 60034


def joint_draws(estimates: Mapping[str, Estimate], half: int = HALF) -> dict[str, Array]:
    """Values of constants, the published ones first, then draws of all of them together.

    Parameters
    ----------
    estimates : mapping of str to Estimate
        Known constants with their budgets.
    half : int
        Half the number of draws; each draw comes with its opposite.

    Returns
    -------
    dict of str to array [1 + 2 half, the constant's unit]

    Notes
    -----
    x_j = value_j + Σ_s u_js z_s, one z a source, whatever constants it is in: contributions of one
    source are fully correlated and of different ones independent, so cov(x_j, x_k) = Σ_s u_js u_ks.
    z is normal, for a source of ν degrees of freedom t_ν. A budget without degrees of freedom (ν
    at most 2) counts as ν = 3, the least whose variance exists.

    """
    sources: dict[str, float] = {}
    for one in estimates.values():
        for part in one.budget:
            sources[part.source] = min(sources.get(part.source, math.inf), part.dof)
    rng = np.random.default_rng(SEED)
    z = {}
    for source in sorted(sources):
        normal = rng.standard_normal(half)
        chi2 = rng.chisquare(min(max(sources[source], 3.0), 1e6), half)
        if math.isfinite(sources[source]):
            normal = normal / np.sqrt(chi2 / min(max(sources[source], 3.0), 1e6))
        z[source] = np.concatenate([[0.0], normal, -normal])
    drawn = {}
    for name, one in estimates.items():
        values = np.full(1 + 2 * half, one.number)
        for part in one.budget:
            values = values + part.u * z[part.source]
        drawn[name] = values
    return drawn


def uniform_draws(name: str, low: float, high: float, half: int = HALF) -> Array:
    """Draws of what is known to lie between two values alone.

    Parameters
    ----------
    name
        Makes the stream: equal names give equal draws.
    low
        Smallest value.
    high
        Largest value.
    half
        Pairs of draws.

    Returns
    -------
    array [1 + 2 half]
        The middle first, then draws and their mirror images.

    References
    ----------
    JCGM 101:2008, 6.4.2 (rectangular distribution).

    """
    rng = np.random.default_rng([SEED, *name.encode()])
    shares = rng.uniform(-0.5, 0.5, half)
    middle, width = 0.5 * (low + high), high - low
    return middle + width * np.concatenate([[0.0], shares, -shares])


def interval(values: Array) -> tuple[float, float, float]:
    """The first value and the 95 % interval of the draws after it, equal chances either side.

    Reference: JCGM 101:2008, 7.7.2 b.

    Parameters
    ----------
    values
        The published value, then draws [1 + n].

    Returns
    -------
    tuple of float
        Value, low and high; equal probability on either side.

    References
    ----------
    JCGM 101:2008, 7.7.2 b (probabilistically symmetric coverage interval).

    """
    low, high = np.percentile(values[1:], [2.5, 97.5])
    return float(values[0]), float(low), float(high)
