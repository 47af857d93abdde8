"""Friction that grows with the torque it passes on."""

from __future__ import annotations

import numpy as np

from pipeline.criticism.effect import Array, Effect, Operating, Parameter, Values


def _torque(x: Operating, q: Values) -> Array:
    return q["share"] * np.abs(x.torque_nm) * np.sign(x.omega_rad_s)


EFFECT = Effect(
    name="load_dependent_friction",
    words="drag μ |T| sign(ω)",
    signature="drag that grows with torque, in motoring and in braking",
    tests=("torque_map",),
    experiment="a torque map in both senses of torque and of speed",
    headline="friction of {share %} of the torque",
    reference="Duclusaud et al. (2024), extended friction models M1-M6 for servo actuators",
    parameters=(Parameter("share", "1", 0.02, 0.001, low=0.0, high=0.5),),
    signals=("torque_shaft_nm",),
    alternatives={"torque_scale": "motoring and braking: a gain changes sign with torque"},
    torque=_torque,
)
