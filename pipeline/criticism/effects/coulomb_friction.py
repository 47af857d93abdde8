"""Dry friction."""

from __future__ import annotations

import numpy as np

from pipeline.criticism.effect import Array, Effect, Operating, Parameter, Values


def _torque(x: Operating, q: Values) -> Array:
    return q["torque_nm"] * np.sign(x.omega_rad_s)


EFFECT = Effect(
    name="coulomb_friction",
    words="drag T_c sign(ω)",
    signature="a step of drag against the sense of rotation",
    tests=("spin_down", "cogging", "holding_current", "drive"),
    experiment="a spin-down, or a slow turn in both senses",
    headline="dry friction of {torque_nm}",
    reference="Armstrong-Hélouvry, Dupont & Canudas de Wit, Automatica 30 (1994)",
    parameters=(Parameter("torque_nm", "N·m", 0.01, 0.0005, "torque_nm", low=0.0, high=1.0),),
    alternatives={
        "iron_hysteresis": "an open-circuit comparison against a rotor without magnet",
        "torque_offset": "both rotation senses",
    },
    torque=_torque,
)
