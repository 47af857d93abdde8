"""Friction that builds up over a small angle after each reversal."""

from __future__ import annotations

import numpy as np

from pipeline.criticism.effect import Array, Effect, Operating, Parameter, Values


def _torque(x: Operating, q: Values) -> Array:
    missing = np.exp(-x.travel_rad / q["travel_rad"])
    drag: Array = -2.0 * q["torque_nm"] * missing * np.sign(x.omega_rad_s)
    return drag


EFFECT = Effect(
    name="presliding",
    words="after a reversal drag swings over as T (1 − 2 exp(−|Δθ|/θ_s)), Dahl's solution",
    signature="hysteresis of torque against angle within a small angle of a reversal",
    tests=("drive",),
    experiment="slow reversals under load",
    reference="Canudas de Wit et al., IEEE Trans. Autom. Control 40 (1995), friction model",
    parameters=(
        Parameter("torque_nm", "N·m", 0.01, 0.001, "torque_nm", low=0.0, high=1.0),
        Parameter("travel_rad", "rad", 0.001, 0.0, low=1e-5, high=0.1, scan=(0.0003, 0.003, 0.03)),
    ),
    rivals={"stribeck": "a spin-down: it has no reversal"},
    torque=_torque,
)
