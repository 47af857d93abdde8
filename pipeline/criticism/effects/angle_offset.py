"""Rotor angle of the drive off by a constant."""

from __future__ import annotations

import numpy as np

from pipeline.criticism.effect import Array, Effect, Operating, Parameter, Values


def _angle(x: Operating, q: Values) -> Array:
    return np.full(x.omega_rad_s.shape, q["offset_rad"])


EFFECT = Effect(
    name="angle_offset",
    words="recorded electrical angle = true one + offset",
    signature="v_d error proportional to speed and odd in it, torque from i_d",
    tests=("torque_map", "drive"),
    experiment="constant speeds in both senses",
    headline="electrical angle off by {offset_rad}",
    reference="Pillay & Krishnan, IEEE Trans. Ind. Appl. 25 (1989), modelling of PM motor drives",
    parameters=(Parameter("offset_rad", "rad", 0.03, 0.001, low=-1.0, high=1.0),),
    alternatives={"sample_delay": "both rotation senses: a delay is even in speed, an angle odd"},
    angle=_angle,
)
