"""Friction that is another in each sense of rotation."""

from __future__ import annotations

import numpy as np

from pipeline.criticism.effect import Array, Effect, Operating, Parameter, Values


def _torque(x: Operating, q: Values) -> Array:
    omega = x.omega_rad_s
    speed = np.abs(omega) / x.machine.scales["speed_rad_s"]
    return q["coulomb_nm"] * np.abs(np.sign(omega)) + q["viscous_nm"] * speed


EFFECT = Effect(
    name="direction_friction",
    words="drag (T_c + coulomb) sign(ω) forwards, (T_c - coulomb) sign(ω) backwards; the viscous "
    "part likewise, reported at the highest speed",
    signature="drag against speed that is no odd function",
    tests=("spin_down", "drive", "holding_current"),
    experiment="coasts, or free motion, in both senses at several speeds",
    reference="Armstrong-Hélouvry, Dupont & Canudas de Wit, Automatica 30 (1994)",
    parameters=(
        Parameter("coulomb_nm", "N·m", 0.01, 0.0005, "torque_nm", low=-0.5, high=0.5),
        Parameter("viscous_nm", "N·m", 0.01, 0.0005, "torque_nm", low=-0.5, high=0.5),
    ),
    alternatives={
        "constant_load": "several speeds in both senses, and a hold at rest: a load stays",
        "torque_offset": "coasts in both senses, which no transducer sees",
    },
    friction=True,
    torque=_torque,
    headline="friction that differs by direction, by {coulomb_nm} and at the highest speed "
    "{viscous_nm} more",
)
