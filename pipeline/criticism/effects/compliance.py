"""A shaft that twists between the motor and the load."""

from __future__ import annotations

import numpy as np

from pipeline.criticism.effect import Array, Effect, Parameter, Recorded, Values


def _load(r: Recorded, q: Values) -> Array:
    bend = np.zeros_like(r.torque_nm)
    bend[1:-1] = np.diff(r.torque_nm, 2) / r.ts_s**2
    return r.torque_nm + q["square_s2"] * bend


EFFECT = Effect(
    name="compliance",
    words="two masses and a spring: the load side adds (J_load/K) d²T/dt², J_load/K in s²",
    signature="a resonance after torque steps",
    tests=("torque_map", "drive"),
    experiment="torque steps with the angle recorded on the load side as well",
    reference="Ellis & Lorenz, IEEE Ind. Appl. Conf. (2000), resonant load control",
    parameters=(Parameter("square_s2", "s²", 100.0, 4.0, "period_s2", low=0.0, high=4e4),),
    signals=("torque_shaft_nm",),
    rivals={"torque_lag": "a load-side angle", "backlash": "steps of one sign only"},
    load=_load,
)
