"""An encoder mounted off centre or at a tilt: an angle error once a turn, and twice."""

from __future__ import annotations

import numpy as np

from pipeline.criticism.effect import Array, Effect, Operating, Parameter, Values


def _angle(x: Operating, q: Values) -> Array:
    theta = x.theta_rad
    sine, cosine = x.once(theta, "mounting", lambda: (np.sin(theta), np.cos(theta)))
    error: Array = q["sine_rad"] * sine + q["cosine_rad"] * cosine
    if q["sine2_rad"] or q["cosine2_rad"]:
        # of twice the angle: sin 2θ = 2 sin θ cos θ, cos 2θ = 1 - 2 sin² θ
        error += 2.0 * q["sine2_rad"] * sine * cosine + q["cosine2_rad"] * (1.0 - 2.0 * sine**2)
    return x.machine.pole_pairs * error


EFFECT = Effect(
    name="angle_eccentricity",
    words="recorded shaft angle = true one + sine sin θ + cosine cos θ, a tilted disc's sine2 sin "
    "2θ + cosine2 cos 2θ besides",
    signature="first order a turn in v_d proportional to speed, in torque proportional to i_d",
    tests=("torque_map", "drive"),
    experiment="a constant speed of several turns, in both senses",
    headline=(
        "encoder disc off-centre by {sine_rad & cosine_rad}",
        "encoder's angle off twice a turn, by {sine2_rad & cosine2_rad}",
    ),
    reference="Hanselman, IEEE Trans. Ind. Electron. 37 (1990), resolver signal requirements",
    parameters=(
        Parameter("sine_rad", "rad", 0.003, 0.0002, low=-0.2, high=0.2, order=1.0),
        Parameter("cosine_rad", "rad", 0.003, 0.0002, low=-0.2, high=0.2, order=1.0),
        Parameter("sine2_rad", "rad", 0.001, 0.0002, low=-0.1, high=0.1, optional=1),
        Parameter("cosine2_rad", "rad", 0.001, 0.0002, low=-0.1, high=0.1, optional=1),
    ),
    alternatives={"unbalance": "a slow turn: an unbalance shows at rest, an encoder error not"},
    angle=_angle,
)
