"""A coupling with a gap that opens whenever the torque changes sign.

The gap is crossed at once. A real one takes its time, which depends on what is beyond it: without a
torque in the coupling, rows know the product of share and gap, and nothing of the share.
"""

from __future__ import annotations

from pipeline.criticism.effect import Array, Effect, Operating, Parameter, Values, choice
from pipeline.criticism.machine.two_masses import (
    discriminator,
    far_drag,
    passed_on,
    shown,
    side_of,
    spring_twist,
)


def _torque(x: Operating, q: Values) -> Array:
    share, gap = q["share"], q["gap_rad"]

    def twist() -> Array:
        through = passed_on(x, share, q["far_friction"])
        return 0.5 * gap * side_of(through, q["torque_nm"]) + spring_twist(x, q, through)

    return far_drag(x, share, q["between"], twist)


EFFECT = Effect(
    name="backlash",
    words="two masses, a share of J at the far end, behind half a gap to the side that the torque "
    "presses to, and a spring; between: the transducer is in the coupling (1), or "
    "beyond it on a dynamometer that gives way (-1)",
    signature="no torque at the shaft while the gap is crossed, a jump of the angle at reversals",
    tests=("drive", "torque_map"),
    experiment="reversals of torque with the angle recorded on the load side as well",
    headline="play of {gap_rad} between rotor and load",
    touches={"j_rotor_kgm2": "is of all that turns, not of the rotor alone"},
    far_inertia="share",
    far_by_torque=True,
    reference="Nordin & Gutman, Automatica 38 (2002), controlling systems with backlash",
    parameters=(
        Parameter("share", "1", 0.3, 0.03, low=0.0, high=0.95),
        Parameter("gap_rad", "rad", 0.005, 0.0002, low=0.0, high=0.3, scan=(0.0005, 0.005)),
        Parameter("twist_rad", "rad", 0.005, 0.0, low=1e-5, high=3.0, scan=(0.003,)),
        Parameter("damping_s", "s", 1.0, 0.0, "period_s", 0.0, 5.0, scan=(0.0,), optional=1),
        Parameter("far_friction", "1", 0.5, 0.0, low=0.0, high=1.0, scan=(0.0,), optional=2),
        Parameter("torque_nm", "N·m", 0.03, 0.0, "torque_nm", scan=(0.01,), choice=True),
        choice("between", (0.0, 1.0, -1.0)),
    ),
    signals=("torque_shaft_nm",),
    alternatives={
        "compliance": "a drive log whose torque changes its sign: only a gap opens then",
        "presliding": "an angle on the load side: friction moves no far mass",
    },
    torque=_torque,
    coupling=True,
    discriminator=discriminator,
    shown=shown,
)
