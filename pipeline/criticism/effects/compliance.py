"""A shaft that twists between the motor and the load."""

from __future__ import annotations

from pipeline.criticism.effect import Array, Effect, Operating, Parameter, Values, choice
from pipeline.criticism.machine.two_masses import (
    LINEAR_COUPLING,
    discriminator,
    far_drag,
    passed_on,
    shown,
    spring_twist,
)


def _torque(x: Operating, q: Values) -> Array:
    def twist() -> Array:
        return spring_twist(x, q, passed_on(x, q["share"], q["far_friction"]))

    return far_drag(x, q["share"], q["between"], twist)


EFFECT = Effect(
    name="compliance",
    words="two masses and a spring: a share of J at the far end, behind a twist (reported at the "
    "machine's torque) by the torque passed on, damping_s late (c/k); far_friction: the part of "
    "friction at the far end; between: the transducer is in the coupling (1), or beyond it on a "
    "dynamometer that gives way (-1)",
    signature="a resonance after torque steps",
    tests=("drive", "torque_map"),
    experiment="torque steps with the angle recorded on the load side as well",
    headline="a shaft or coupling that twists, {share %} of the inertia beyond it",
    touches={"j_rotor_kgm2": "is of all that turns, not of the rotor alone"},
    far_inertia="share",
    reference="Ellis & Lorenz, IEEE Ind. Appl. Conf. (2000), resonant load control",
    parameters=(
        Parameter("share", "1", 0.3, 0.03, low=0.0, high=0.95),
        Parameter("twist_rad", "rad", 0.01, 0.0005, low=1e-5, high=3.0, scan=(0.002, 0.01, 0.1)),
        Parameter("damping_s", "s", 1.0, 0.0, "period_s", 0.0, 5.0, scan=(0.0,), optional=1),
        Parameter("far_friction", "1", 0.5, 0.0, low=0.0, high=1.0, scan=(0.0,), optional=2),
        choice("between", (0.0, 1.0, -1.0)),
    ),
    signals=("torque_shaft_nm",),
    alternatives={
        "torque_lag": "an angle recorded on the load side: a lag of the sensor does not move it",
        "backlash": "a drive log whose torque changes its sign: only a gap opens then",
    },
    torque=_torque,
    coupling=True,
    linear=LINEAR_COUPLING,
    discriminator=discriminator,
    shown=shown,
)
