"""Drag of a torque map: what the torque at no current is at each of its speeds."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.special import fdtrc

from pipeline.estimation.policy import policy
from pipeline.numerics.least_squares import LinearFit, linear_fit
from pipeline.records.capture import Array


@dataclass(frozen=True, slots=True)
class MapDrag:
    """Coulomb and viscous drag of a map.

    Attributes
    ----------
    values
        Both [2; N·m, N·m·s/rad]; zero where there are none.
    covariance
        Of these [2, 2].
    dof
        Degrees of freedom of their scatter.
    why
        Why there are none.
    windage
        Whether a drag by the square of speed was allowed for beside them.

    """

    values: Array
    covariance: Array
    dof: int
    why: str = ""
    windage: bool = False


def map_drag(
    speeds_rad_s: Array, offsets_nm: Array, covariance: Array, dof: int, experiment: str
) -> MapDrag:
    """Coulomb and viscous drag from the torque at no current of several speeds.

    Parameters
    ----------
    speeds_rad_s : array [n], rad/s
        Speeds of a shaft that turns.
    offsets_nm : array [n], N·m
        Torque at no current.
    covariance : array [n, n]
        Of the offsets.
    dof
        Degrees of freedom of their scatter.
    experiment
        What shows the drag, in words.

    Returns
    -------
    MapDrag
        None for less than three speeds or one sense of rotation.

    Notes
    -----
    T = T_0 − T_c sign(ω) − b ω. Offsets that miss it by more than their scatter widen it, and
    beyond chance it has the speeds' freedom. Where they do, and a drag by the square of speed
    explains it, that is allowed for.

    """
    blank = partial(MapDrag, np.zeros(2), np.zeros((2, 2)), 0)
    few = f"drag and transducer zero need three speeds, both senses; {experiment}"
    sense = np.sign(speeds_rad_s)
    if np.unique(sense).size < 2 or speeds_rad_s.size < 3:
        return blank(few)
    design = np.column_stack([-sense, -speeds_rad_s, np.ones(sense.size)])
    part = linear_fit(design, offsets_nm)
    if not part.full_rank:
        return blank(few)
    wider = np.column_stack([design, -speeds_rad_s * np.abs(speeds_rad_s)])
    windage = _needs(part, other := linear_fit(wider, offsets_nm), covariance, dof)
    if windage:
        design, part = wider, other
    left, inverse = lack_of_fit(part, covariance), np.linalg.pinv(design)
    own = np.maximum(1.0, left) * (inverse @ covariance @ inverse.T)[:2, :2]
    if np.any(part.coefficients[:2] < -policy().evidence.sigmas * np.sqrt(np.diag(own))):
        return blank("drag is not Coulomb and viscous: a fitted coefficient is negative")
    beyond = part.dof > 0 and fdtrc(part.dof, dof, left) < policy().torque_map.level
    return MapDrag(part.coefficients[:2], own, part.dof if beyond else dof, windage=windage)


def lack_of_fit(part: LinearFit, covariance: Array) -> float:
    """Variance of what a fit leaves over the mean variance of its rows.

    Parameters
    ----------
    part
        The fit.
    covariance : array [n, n]
        Of its rows.

    Returns
    -------
    float
        [1]; 0 of a fit that leaves nothing over.

    """
    if part.dof < 1:
        return 0.0
    return float(np.sum(part.residuals**2) / np.mean(np.diag(covariance)) / part.dof)


def _needs(part: LinearFit, wider: LinearFit, covariance: Array, dof: int) -> bool:
    """Whether offsets miss a fit beyond chance, and a wider one with windage explains that."""
    level, left = policy().torque_map.level, lack_of_fit(part, covariance)
    if part.dof < 2 or fdtrc(part.dof, dof, left) >= level or not wider.full_rank:
        return False
    ratio = part.dof * left / (wider.dof * max(lack_of_fit(wider, covariance), 1e-300))
    chance = fdtrc(1.0, wider.dof, wider.dof * (ratio - 1.0))
    return bool(wider.coefficients[3] > 0.0 and chance < level)
