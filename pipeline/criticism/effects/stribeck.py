"""Friction that falls with speed before it rises."""

from __future__ import annotations

import numpy as np

from pipeline.criticism.effect import Array, Effect, Operating, Parameter, Values

_NO_TAIL = 1e-6
"""Tail below which there is none: log(1 + tail s)/tail is then s to 1e-6."""


def _torque(x: Operating, q: Values) -> Array:
    fast = np.abs(x.omega_rad_s / q["speed_rad_s"]) ** q["exponent"]
    slowed = np.log1p(q["tail"] * fast) / q["tail"] if q["tail"] > _NO_TAIL else fast
    bump = np.exp(-slowed)
    return q["excess_nm"] * bump * np.sign(x.omega_rad_s)


EFFECT = Effect(
    name="stribeck",
    words="drag (T_s − T_c) exp(−|ω/ω_s|^δ) sign(ω), or with a tail to (T_s − T_c)/(1 + |ω/ω_s|^δ)",
    signature="a bump of drag at low speed",
    tests=("spin_down", "cogging", "drive"),
    experiment="a spin-down to standstill, and slow reversals",
    headline="extra friction of {excess_nm} below {speed_rad_s}",
    reference="Armstrong-Hélouvry, Dupont & Canudas de Wit, Automatica 30 (1994); with a tail: "
    "Hess & Soom, J. Tribology 112 (1990)",
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
            scan=(0.004, 0.008, 0.016, 0.03, 0.06, 0.12, 0.25),
        ),
        Parameter("exponent", "1", 2.0, 0.0, low=0.3, high=4.0, scan=(2.0,)),
        Parameter("tail", "1", 0.5, 0.0, low=0.0, high=1.0, scan=(0.0,), optional=1),
    ),
    alternatives={"presliding": "a reversal slow enough to see the angle within a milliradian"},
    torque=_torque,
)
