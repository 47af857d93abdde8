"""Friction that falls with speed before it rises."""

from __future__ import annotations

import numpy as np

from pipeline.criticism.effect import Array, Effect, Operating, Parameter, Values


def _torque(x: Operating, q: Values) -> Array:
    bump = np.exp(-(np.abs(x.omega_rad_s / q["speed_rad_s"]) ** q["exponent"]))
    drag: Array = q["excess_nm"] * bump * np.sign(x.omega_rad_s)
    return drag


EFFECT = Effect(
    name="stribeck",
    words="drag (T_s − T_c) exp(−|ω/ω_s|^δ) sign(ω)",
    signature="a bump of drag at low speed",
    tests=("spin_down", "cogging", "drive"),
    experiment="a spin-down to standstill, and slow reversals",
    reference="Armstrong-Hélouvry, Dupont & Canudas de Wit, Automatica 30 (1994)",
    parameters=(
        Parameter("excess_nm", "N·m", 0.005, 0.0005, "torque_nm", low=0.0, high=1.0),
        Parameter(
            "speed_rad_s",
            "rad/s",
            0.03,
            0.0,
            "speed_rad_s",
            low=0.001,
            high=0.3,
            scan=(0.004, 0.012, 0.036, 0.1),
        ),
        Parameter("exponent", "1", 2.0, 0.0, low=0.3, high=4.0, scan=(2.0,)),
    ),
    rivals={"presliding": "a reversal slow enough to see the angle within a milliradian"},
    torque=_torque,
)
