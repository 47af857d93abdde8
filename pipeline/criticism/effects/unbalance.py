"""A mass off centre on a shaft that is not vertical."""

from __future__ import annotations

import numpy as np

from pipeline.criticism.effect import Array, Effect, Operating, Parameter, Values


def _torque(x: Operating, q: Values) -> Array:
    return q["sin_nm"] * np.sin(x.theta_rad) + q["cos_nm"] * np.cos(x.theta_rad)


EFFECT = Effect(
    name="unbalance",
    words="m g r sin(θ + φ) as a sine and a cosine",
    signature="torque once a turn, whatever the current",
    tests=("cogging",),
    exact=True,
    experiment="a slow turn without current",
    headline="unbalance, a torque of {sin_nm & cos_nm} once a turn",
    reference="ISO 21940-11:2016, rotor balancing",
    parameters=(
        Parameter("sin_nm", "N·m", 0.01, 0.0002, "torque_nm", low=-1.0, high=1.0, order=1.0),
        Parameter("cos_nm", "N·m", 0.01, 0.0002, "torque_nm", low=-1.0, high=1.0, order=1.0),
    ),
    alternatives={
        "angle_eccentricity": "a slow turn: an encoder error makes no torque at zero current"
    },
    torque=_torque,
)
