"""Noise, resolution and reversals that the columns of a capture show."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from pipeline.criticism.data.hysteresis import play_lag, with_travel
from pipeline.criticism.data.locked_waves import LockedWaves
from pipeline.criticism.data.rounding import coarse_step
from pipeline.criticism.data.segment import Sensors, SpeedSensor
from pipeline.criticism.data.sensor_noise import sensor_noise
from pipeline.criticism.data.traces import smoothed
from pipeline.criticism.operating import Array
from pipeline.criticism.policy.policy import Policy
from pipeline.criticism.policy.sensors import SensorNoise

TEMPERATURES = ("temp_winding_degc", "temp_magnet_degc")


def prepared(
    columns: dict[str, Array],
    period: float,
    policy: Policy,
    speed: SpeedSensor | None = None,
    orders: Sequence[float] = (),
) -> Sensors:
    """Noise, coarse steps and runs of columns, which get ready for `segment_of`.

    Parameters
    ----------
    columns
        Columns [n]; temperatures are smoothed in place; `travel_rad`, `run` and `behind_nm`, the
        `play_lag` of the torque, are added.
    period
        Sample period [s].
    policy
        Constants of judgement.
    speed
        Of a speed whose integral is the angle (`shaft_angle`).
    orders
        Waves a turn of the angle that are no noise.

    Returns
    -------
    Sensors
        For `segment_of`.

    """
    noise, steps = noise_and_steps(columns, policy.sensor_noise, orders)
    width = max(2 * round(policy.cutting.temperature_s / period) + 1, 51)
    for name in TEMPERATURES:
        if name in columns:
            columns[name] = smoothed(columns[name], width)
            noise[name] /= math.sqrt(width)
    runs = np.array([math.inf])
    if "theta_mech_rad" in columns:
        runs = with_travel(columns, noise, policy.cutting)
    if "torque_shaft_nm" in columns:
        columns["behind_nm"] = play_lag(columns["torque_shaft_nm"], policy.cutting.play_share)
    return Sensors(noise, steps, runs, speed=speed)


def noise_and_steps(
    columns: Mapping[str, Array], policy: SensorNoise, orders: Sequence[float] = ()
) -> tuple[dict[str, float], dict[str, float]]:
    """Noise of columns, and steps of those that are rounded too coarsely for it.

    Parameters
    ----------
    columns
        Columns [n].
    policy
        Constants of judgement.
    orders
        Waves a turn of `theta_mech_rad` that are no noise, but of currents.

    Returns
    -------
    tuple of dict
        Standard deviations and steps by name; an angle has no step here.

    """
    angles = {name: name.startswith("theta") for name in columns}
    theta = columns.get("theta_mech_rad")
    waves = LockedWaves.of(theta, orders, policy) if orders and theta is not None else None
    # a wave of the current is what straight lines between its rows miss
    beside = {name: None if name.endswith("_a") else waves for name in columns}
    noise = {n: sensor_noise(column, policy, angles[n], beside[n]) for n, column in columns.items()}
    steps = {n: coarse_step(c, noise[n], policy) for n, c in columns.items() if not angles[n]}
    return noise, {name: step for name, step in steps.items() if step > 0.0}
