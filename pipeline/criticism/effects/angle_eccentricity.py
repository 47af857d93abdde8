"""An encoder off centre or at a tilt: an angle error once and twice a turn; or a resolver with as
many poles as the motor, or Hall sensors: once and twice an electrical turn.
"""

from __future__ import annotations

import numpy as np

from pipeline.criticism.effect import Array, Effect, Machine, Operating, Parameter, Values


def _angle(x: Operating, q: Values) -> Array:
    theta = x.theta_rad
    sine, cosine = x.once(theta, "mounting", lambda: (np.sin(theta), np.cos(theta)))
    error: Array = q["sine_rad"] * sine + q["cosine_rad"] * cosine
    if q["sine2_rad"] or q["cosine2_rad"]:
        # of twice the angle: sin 2θ = 2 sin θ cos θ, cos 2θ = 1 - 2 sin² θ
        error += 2.0 * q["sine2_rad"] * sine * cosine + q["cosine2_rad"] * (1.0 - 2.0 * sine**2)
    for order in _electrical(x.machine):
        of_sine, of_cosine = (q[_of_electrical(wave, order)] for wave in ("sine", "cosine"))
        if of_sine or of_cosine:
            cosine, sine = x.waves(order)
            error += of_sine * sine + of_cosine * cosine
    return x.machine.pole_pairs * error


def _electrical(machine: Machine) -> tuple[int, ...]:
    """Waves an electrical turn that are none of the shaft's first two."""
    return tuple(order for order in (1, 2) if order * machine.pole_pairs > 2)


def _of_electrical(wave: str, order: int) -> str:
    return f"{wave}{order if order > 1 else ''}_elec_turn_rad"


def _parameters(machine: Machine) -> tuple[Parameter, ...]:
    return (
        Parameter("sine_rad", "rad", 0.003, 0.0002, low=-0.2, high=0.2, order=1.0),
        Parameter("cosine_rad", "rad", 0.003, 0.0002, low=-0.2, high=0.2, order=1.0),
        *(
            Parameter(name, "rad", 0.001, 0.0002, low=-0.1, high=0.1, optional=term)
            for term, names in enumerate(_terms(machine), 1)
            for name in names
        ),
    )


def _terms(machine: Machine) -> list[tuple[str, ...]]:
    """Names of sine and cosine of each wave beside that of one turn."""
    electrical = [
        tuple(_of_electrical(wave, order) for wave in ("sine", "cosine"))
        for order in _electrical(machine)
    ]
    return [("sine2_rad", "cosine2_rad"), *electrical]


EFFECT = Effect(
    name="angle_eccentricity",
    words="recorded shaft angle = true one + sine sin θ + cosine cos θ, a tilted disc's sine2 sin "
    "2θ + cosine2 cos 2θ besides, and waves of ε and 2ε of a resolver or of Hall sensors",
    signature="first order a turn in v_d proportional to speed, in torque proportional to i_d",
    tests=("torque_map", "drive"),
    experiment="a constant speed of several turns, in both senses",
    headline=(
        "encoder disc off-centre by {sine_rad & cosine_rad}",
        "encoder's angle off twice a turn, by {sine2_rad & cosine2_rad}",
        "angle off once an electrical turn, by {sine_elec_turn_rad & cosine_elec_turn_rad}",
        "angle off twice an electrical turn, by {sine2_elec_turn_rad & cosine2_elec_turn_rad}",
    ),
    reference="Hanselman, IEEE Trans. Ind. Electron. 37 (1990), resolver signal requirements",
    expand=_parameters,
    alternatives={"unbalance": "a slow turn: an unbalance shows at rest, an encoder error not"},
    angle=_angle,
)
