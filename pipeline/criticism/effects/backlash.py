"""A coupling with a gap that opens whenever the torque changes sign."""

from __future__ import annotations

import numpy as np

from pipeline.criticism.coupling import far_drag, passed_on, present
from pipeline.criticism.effect import Array, Effect, Operating, Parameter, Values

_NEGLIGIBLE_RAD = 2e-4


def _torque(x: Operating, q: Values) -> Array:
    share, gap = q["share"], q["gap_rad"]
    if x.held:
        return far_drag(x, share * present(gap, _NEGLIGIBLE_RAD), lambda: x.theta_rad)

    def twist() -> Array:
        through = passed_on(x, share)
        softness = q["square_s2"] / (share * x.base["j_kgm2"] + 1e-30)
        found: Array = 0.5 * gap * np.tanh(through / q["torque_nm"]) + softness * through
        return found

    return far_drag(x, share, twist)


EFFECT = Effect(
    name="backlash",
    words="twist of half a gap to the side that the torque presses to, and of a spring",
    signature="no torque at the shaft while the gap is crossed, a jump of the angle at reversals",
    tests=("drive", "torque_map"),
    experiment="reversals of torque with the angle recorded on the load side as well",
    reference="Nordin & Gutman, Automatica 38 (2002), controlling systems with backlash",
    parameters=(
        Parameter("gap_rad", "rad", 0.005, _NEGLIGIBLE_RAD, low=0.0, high=0.3),
        Parameter("square_s2", "s²", 40.0, 8.0, "period_s2", low=0.0, high=4e4),
        Parameter("share", "1", 0.5, 0.0, low=0.05, high=0.95, scan=(0.5,)),
        Parameter(
            "torque_nm", "N·m", 0.03, 0.0, "torque_nm", low=0.003, high=0.5, scan=(0.01, 0.05)
        ),
    ),
    signals=("torque_shaft_nm",),
    rivals={
        "compliance": "an angle on the load side, or steps of one sign only: the gap stays closed",
        "presliding": "an angle on the load side: friction moves no far mass",
    },
    torque=_torque,
    allowed=lambda q: q["gap_rad"] > 0.0,
)
