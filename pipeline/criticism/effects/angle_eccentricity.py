"""An encoder mounted off centre: an angle error once a turn."""

from __future__ import annotations

import numpy as np

from pipeline.criticism.effect import Array, Effect, Operating, Parameter, Values


def _angle(x: Operating, q: Values) -> Array:
    wave = q["sine_rad"] * np.sin(x.theta_rad) + q["cosine_rad"] * np.cos(x.theta_rad)
    error: Array = x.machine.pole_pairs * wave
    return error


EFFECT = Effect(
    name="angle_eccentricity",
    words="recorded shaft angle = true one + sine sin θ + cosine cos θ",
    signature="first order a turn in v_d proportional to speed, in torque proportional to i_d",
    tests=("torque_map", "drive"),
    experiment="a constant speed of several turns, in both senses",
    reference="Hanselman, IEEE Trans. Ind. Electron. 37 (1990), resolver signal requirements",
    parameters=(
        Parameter("sine_rad", "rad", 0.003, 0.0002, low=-0.2, high=0.2),
        Parameter("cosine_rad", "rad", 0.003, 0.0002, low=-0.2, high=0.2),
    ),
    rivals={"unbalance": "a slow turn: an unbalance shows at rest, an encoder error not"},
    angle=_angle,
)
