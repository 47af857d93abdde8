"""A load that pulls one way, whatever the speed and its sense."""

from __future__ import annotations

import numpy as np

from pipeline.criticism.effect import Array, Effect, Operating, Parameter, Values, choice


def _torque(x: Operating, q: Values) -> Array:
    # what acts behind a transducer is no drag: it is in the recorded load
    size = q["torque_nm"] if x.shaft.alone or q["inside"] else 0.0
    return np.full(x.omega_rad_s.shape, size)


EFFECT = Effect(
    name="constant_load",
    words="torque T_0 against positive rotation, behind the transducer or, if inside, before it",
    signature="acceleration that differs by sense of torque, not of rotation: a weight on a screw, "
    "an offset of the demand",
    tests=("drive", "spin_down", "holding_current"),
    experiment="free motion, or coasts, in both senses",
    reference="Armstrong-Hélouvry, Control of Machines with Friction (1991), ch. 2",
    parameters=(
        Parameter("torque_nm", "N·m", 0.01, 0.0005, "torque_nm", low=-1.0, high=1.0),
        choice(
            "inside", (0.0, 1.0), "1: it acts on the motor's side of the transducer, 0: beyond it"
        ),
    ),
    alternatives={
        "direction_friction": "several speeds in both senses, and a hold at rest: a load stays",
        "torque_offset": "the transducer read with the load taken off",
    },
    torque=_torque,
    headline="a load of {torque_nm} in one direction",
)
