"""The acceleration of an angle at single samples, and whether it is known there."""

from __future__ import annotations

import numpy as np

from pipeline.criticism.operating import Array
from pipeline.criticism.policy.captures import Cutting


def acceleration_at_samples(theta_rad: Array, period: float, every: int) -> Array:
    """Acceleration of an angle by differences of the fourth order.

    Parameters
    ----------
    theta_rad
        Angle [n].
    period
        Of its samples [s].
    every
        Samples from one to the next at which it is wanted; it is differenced over a quarter.

    Returns
    -------
    array [n, rad/s²]
        0 at both ends.

    """
    return _differenced(theta_rad, period, _span(every))


def shows_acceleration(theta_rad: Array, every: int, policy: Cutting) -> bool:
    """Whether an angle is fine enough for the acceleration at single samples.

    Parameters
    ----------
    theta_rad
        Angle [n].
    every
        Samples from one of these to the next.
    policy
        Constants of judgement.

    Returns
    -------
    bool
        Whether the power of what it is off by is less than a share of that of its means from one to
        the next: by as much an inertia comes out too low. It is off by its difference to one over
        twice as many samples: by noise, by little of a smooth motion, by much of a jump.

    References
    ----------
    Fuller, Measurement Error Models, Wiley, 1987, ch. 1 (attenuation), doi:10.1002/9780470316665.

    """
    if theta_rad.size <= 2 * every:
        return False
    near, far = (_differenced(theta_rad, 1.0, n * _span(every)) for n in (1, 2))
    means = theta_rad[2 * every :] - 2.0 * theta_rad[every:-every] + theta_rad[: -2 * every]
    power = float(np.mean((means / every**2) ** 2))
    return float(np.mean((near - far) ** 2)) < policy.attenuated * power


def _span(every: int) -> int:
    return max(round(0.25 * every), 1)


def _differenced(theta_rad: Array, period: float, span: int) -> Array:
    if theta_rad.size <= 4 * span:
        return np.zeros(theta_rad.size)
    near = theta_rad[span : -3 * span] + theta_rad[3 * span : -span]
    far = theta_rad[: -4 * span] + theta_rad[4 * span :]
    second = (16.0 * near - far - 30.0 * theta_rad[2 * span : -2 * span]) / 12.0
    return np.pad(second, 2 * span) / (span * period) ** 2
