"""Tests that were not done, as the fitted model would record them: segments to plan with."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from pipeline.criticism.data.segment import (
    Instrument,
    Segment,
    Sensors,
    slow_orders,
)
from pipeline.criticism.operating import Array
from pipeline.criticism.policy.design import Design
from pipeline.criticism.regression.fit import Fit
from pipeline.criticism.residuals.residual import residual
from pipeline.numerics.projection import projection, window_starts

PLANNED = {
    "torque_map": "a torque map at {} of full speed, in both senses",
    "spin_down": "a spin_down from full speed to a tenth of it",
    "cogging": "a slow turn (cogging) in both directions",
}
_NOISE = {
    "id_a": ("noise_current", "current_a"),
    "iq_a": ("noise_current", "current_a"),
    "vd_v": ("noise_voltage", "voltage_v"),
    "vq_v": ("noise_voltage", "voltage_v"),
    "torque_shaft_nm": ("noise_torque", "torque_nm"),
}
"""Field of the policy with the noise of a sensor that the captures do not show, and its scale."""


def planned_words(test: str, policy: Design) -> str:
    """What one of the planned tests is, in words.

    Parameters
    ----------
    test
        A key of `PLANNED`.
    policy
        Its speeds.

    """
    speeds = (f"{100.0 * speed:g} %" for speed in policy.map_speeds if speed > 0.0)
    return PLANNED[test].format(" and ".join(speeds))


def planned(test: str, fit: Fit) -> tuple[Segment, ...]:
    """The segments that a planned test would give, without noise, at 25 °C.

    Parameters
    ----------
    test
        A key of `PLANNED`.
    fit
        The model that records it. Sensors are as noisy as in its captures, or as usual where they
        were not used there.

    """
    noise = _noise(fit)
    makers = {"torque_map": _torque_map, "spin_down": _spin_down, "cogging": _cogging}
    return tuple(_obeying(s, fit) for s in makers[test](fit, noise))


def _obeying(segment: Segment, fit: Fit) -> Segment:
    """The segment with its channels as the model predicts them."""
    residuals = residual(segment, fit.model, fit.values)
    recorded = dict(segment.recorded)
    for place, channel in enumerate(segment.channels):
        if channel in recorded:
            recorded[channel] = recorded[channel] - residuals[place]
    return replace(segment, recorded=recorded)


def _noise(fit: Fit) -> Mapping[str, float]:
    scales = fit.model.machine.scales
    policy = fit.policy.design
    noise = {n: getattr(policy, field) * scales[scale] for n, (field, scale) in _NOISE.items()}
    noise["theta_mech_rad"] = policy.noise_angle_rad
    for segment in fit.segments:
        for name in (*_NOISE, "theta_mech_rad"):
            if segment.sensors.noise.get(name, 0.0) > 0.0:
                noise[name] = segment.sensors.noise[name]
    return noise


def _torque_map(fit: Fit, noise: Mapping[str, float]) -> list[Segment]:
    machine, policy = fit.model.machine, fit.policy.design
    period = machine.scales["period_s"]
    levels = [(d, q) for d in policy.map_id for q in policy.map_iq]
    i_d, i_q = (np.repeat([pair[k] for pair in levels], policy.map_samples) for k in (0, 1))
    current = machine.scales["current_a"]
    keep = np.tile(np.arange(policy.map_samples) > policy.map_samples // 4, len(levels))
    maps = []
    for speed in policy.map_speeds:
        theta = speed * machine.scales["speed_rad_s"] * period * np.arange(i_d.size, dtype=float)
        recorded = {
            "id_a": current * i_d,
            "iq_a": current * i_q,
            "vd_v": np.zeros(i_d.size),
            "vq_v": np.zeros(i_d.size),
            "theta_mech_rad": theta,
            "torque_shaft_nm": np.zeros(i_d.size),
        }
        window = policy.map_samples // 2
        weak = projection(theta, window_starts(keep, window), window, machine.electrical_orders)
        maps.append(
            Segment(
                capture=f"planned torque_map {speed:g}",
                test="torque_map",
                kind="dq",
                ts_s=period,
                recorded=recorded,
                channels=("vd_v", "vq_v", "torque_shaft_nm"),
                weak=weak,
                instrument=Instrument("drive", "instant", "gain_commanded"),
                sensors=Sensors(noise),
                fixed={"ambient_k": 0.0},
            )
        )
    return maps


def _shaft(
    name: str,
    test: str,
    period: float,
    recorded: Mapping[str, Array],
    noise: Mapping[str, float],
    orders: tuple[float, ...] = (),
) -> Segment:
    theta = recorded["theta_mech_rad"]
    slow = test == "cogging"
    channel = "torque_shaft_nm" if slow else "omega_mech_rad_s"
    window = theta.size - 2 if slow else 40
    keep = np.ones(theta.size - 2, dtype=bool)
    starts = 1 + window_starts(keep, window)
    cycles, margin = (0.9, 12.0) if slow else (3.0, 16.0)
    weak = projection(theta, starts, window, orders, cycles=cycles, margin=margin)
    return Segment(
        capture=name,
        test=test,
        kind="shaft",
        ts_s=period,
        recorded=recorded,
        channels=(channel,),
        weak=weak,
        instrument=Instrument("bench", "instant"),
        sensors=Sensors(noise),
        fixed={"ambient_k": 0.0},
    )


def _spin_down(fit: Fit, noise: Mapping[str, float]) -> list[Segment]:
    """A coast from full speed under the model's own friction, b ω + T_c."""
    scales, values, policy = fit.model.machine.scales, fit.values, fit.policy.design
    top, b = scales["speed_rad_s"], max(values["b_nm_s_rad"], 1e-9)
    dry = max(values.get("coulomb_friction.torque_nm", 0.0), 0.0)
    tau = values["j_kgm2"] / b
    dry_rad_s = dry / b
    length = tau * math.log((top + dry_rad_s) / (0.1 * top + dry_rad_s))
    period = length / policy.coast_samples
    t = period * np.arange(policy.coast_samples)
    theta: Array = (top + dry_rad_s) * tau * (1.0 - np.exp(-t / tau)) - dry_rad_s * t
    return [
        _shaft(
            f"planned spin_down {sign}",
            "spin_down",
            period,
            {"theta_mech_rad": sign * theta},
            noise,
        )
        for sign in (1, -1)
    ]


def _cogging(fit: Fit, noise: Mapping[str, float]) -> list[Segment]:
    orders, policy = slow_orders(fit.model.machine), fit.policy.design
    n = policy.samples_an_order * max(orders)
    period = 2 * math.pi / policy.slow_rad_s / n
    theta = policy.slow_rad_s * period * np.arange(n + 3, dtype=float)
    return [
        _shaft(
            f"planned cogging {sign}",
            "cogging",
            period,
            {"theta_mech_rad": sign * theta, "torque_shaft_nm": np.zeros(theta.size)},
            noise,
            orders,
        )
        for sign in (1, -1)
    ]
