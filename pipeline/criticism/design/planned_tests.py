"""Tests that were not done, as the fitted model would record them: segments to plan with."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from pipeline.criticism.data.segment import Segment, electrical_orders, slow_orders
from pipeline.criticism.effect import Array
from pipeline.criticism.equations.residuals import residual
from pipeline.criticism.regression.linear_system import Fitted
from pipeline.numerics.projection import projection, window_starts

PLANNED = {
    "torque_map": "a torque map at 30 % and 80 % of full speed, in both senses",
    "spin_down": "a spin_down from full speed to a tenth of it",
    "cogging": "a slow turn (cogging) in both directions",
}
_SPEEDS = (0.3, 0.8, -0.3, -0.8)
_ID_LEVELS = (-0.4, 0.0)
_IQ_LEVELS = (-0.9, -0.45, 0.0, 0.45, 0.9)
_DWELL = 800
"""A torque map as benches run it: shares of the largest speed and current, samples a level."""
_SLOW_RAD_S = 2.0
_SAMPLES_AN_ORDER = 24
"""A slow turn: speed [rad/s], and samples a wave of the highest order."""
_COAST = 1200
"""Samples of a spin-down. Lengths of all three are by judgement: the power that is told of an
experiment grows with them."""
_NOISE = {
    "id_a": (5e-4, "current_a"),
    "iq_a": (5e-4, "current_a"),
    "vd_v": (5e-4, "voltage_v"),
    "vq_v": (5e-4, "voltage_v"),
    "torque_shaft_nm": (1e-3, "torque_nm"),
}
_ANGLE_NOISE_RAD = 2e-5
"""Noise of sensors that the captures at hand do not tell, as a share of a machine's scale, and of
the angle [rad]: rounding of an encoder of 17 bits is 1.4e-5."""


def planned(test: str, fitted: Fitted, segments: Sequence[Segment]) -> tuple[Segment, ...]:
    """The segments [n each] of one of `PLANNED`, without noise, at 25 °C.

    Sensors are as noisy as in the captures at hand, or as usual where they were not used there.
    """
    noise = _noise(fitted, segments)
    makers = {"torque_map": _torque_map, "spin_down": _spin_down, "cogging": _cogging}
    return tuple(_obeying(s, fitted) for s in makers[test](fitted, noise))


def _obeying(segment: Segment, fitted: Fitted) -> Segment:
    """The segment with its channels as the model predicts them."""
    left = residual(segment, fitted.model, fitted.values)
    recorded = dict(segment.recorded)
    for place, channel in enumerate(segment.channels):
        if channel in recorded:
            recorded[channel] = recorded[channel] - left[place]
    return replace(segment, recorded=recorded)


def _noise(fitted: Fitted, segments: Sequence[Segment]) -> Mapping[str, float]:
    scales = fitted.model.machine.scales
    found = {name: share * scales[scale] for name, (share, scale) in _NOISE.items()}
    found["theta_mech_rad"] = _ANGLE_NOISE_RAD
    for segment in segments:
        for name in (*_NOISE, "theta_mech_rad"):
            if segment.noise.get(name, 0.0) > 0.0:
                found[name] = segment.noise[name]
    return found


def _torque_map(fitted: Fitted, noise: Mapping[str, float]) -> list[Segment]:
    machine = fitted.model.machine
    period = machine.scales["period_s"]
    levels = [(d, q) for d in _ID_LEVELS for q in _IQ_LEVELS]
    i_d, i_q = (np.repeat([pair[k] for pair in levels], _DWELL) for k in (0, 1))
    current = machine.scales["current_a"]
    keep = np.tile(np.arange(_DWELL) > _DWELL // 4, len(levels))
    made = []
    for speed in _SPEEDS:
        theta = speed * machine.scales["speed_rad_s"] * period * np.arange(i_d.size, dtype=float)
        recorded = {
            "id_a": current * i_d,
            "iq_a": current * i_q,
            "vd_v": np.zeros(i_d.size),
            "vq_v": np.zeros(i_d.size),
            "theta_mech_rad": theta,
            "torque_shaft_nm": np.zeros(i_d.size),
        }
        window = _DWELL // 2
        weak = projection(theta, window_starts(keep, window), window, electrical_orders(machine))
        channels = ("vd_v", "vq_v", "torque_shaft_nm")
        made.append(
            Segment(
                f"planned torque_map {speed:g}",
                "torque_map",
                "dq",
                "drive",
                "instant",
                period,
                recorded,
                noise,
                channels,
                weak,
                {"ambient_k": 0.0},
                "gain_commanded",
            )
        )
    return made


def _shaft(
    name: str,
    test: str,
    period: float,
    recorded: Mapping[str, Array],
    noise: Mapping[str, float],
    channel: str,
    orders: tuple[float, ...],
) -> Segment:
    theta = recorded["theta_mech_rad"]
    slow = test == "cogging"
    window = theta.size - 2 if slow else 40
    keep = np.ones(theta.size - 2, dtype=bool)
    starts = 1 + window_starts(keep, window)
    cycles, margin = (0.9, 12.0) if slow else (3.0, 16.0)
    weak = projection(theta, starts, window, orders, cycles=cycles, margin=margin)
    fixed = {"ambient_k": 0.0}
    return Segment(
        name, test, "shaft", "bench", "instant", period, recorded, noise, (channel,), weak, fixed
    )


def _spin_down(fitted: Fitted, noise: Mapping[str, float]) -> list[Segment]:
    """A coast from full speed under the model's own friction, b ω + T_c."""
    scales, values = fitted.model.machine.scales, fitted.values
    top, b = scales["speed_rad_s"], max(values["b_nm_s_rad"], 1e-9)
    dry = max(values.get("coulomb_friction.torque_nm", 0.0), 0.0)
    tau = values["j_kgm2"] / b
    rest = dry / b
    length = tau * math.log((top + rest) / (0.1 * top + rest))
    period = length / _COAST
    t = period * np.arange(_COAST)
    theta: Array = (top + rest) * tau * (1.0 - np.exp(-t / tau)) - rest * t
    return [
        _shaft(
            f"planned spin_down {sign}",
            "spin_down",
            period,
            {"theta_mech_rad": sign * theta},
            noise,
            "omega_mech_rad_s",
            (),
        )
        for sign in (1, -1)
    ]


def _cogging(fitted: Fitted, noise: Mapping[str, float]) -> list[Segment]:
    orders = slow_orders(fitted.model.machine)
    n = _SAMPLES_AN_ORDER * max(orders)
    period = 2 * math.pi / _SLOW_RAD_S / n
    theta = _SLOW_RAD_S * period * np.arange(n + 3, dtype=float)
    return [
        _shaft(
            f"planned cogging {sign}",
            "cogging",
            period,
            {"theta_mech_rad": sign * theta, "torque_shaft_nm": np.zeros(theta.size)},
            noise,
            "torque_shaft_nm",
            orders,
        )
        for sign in (1, -1)
    ]
