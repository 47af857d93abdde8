"""A shaft that twists between the motor and the load."""

from __future__ import annotations

from pipeline.criticism.coupling import far_drag, passed_on, present
from pipeline.criticism.effect import Array, Effect, Operating, Parameter, Values


_NEGLIGIBLE_PERIODS2 = 8.0


def _torque(x: Operating, q: Values) -> Array:
    share, square = q["share"], q["square_s2"]
    if x.held:
        negligible = _NEGLIGIBLE_PERIODS2 * x.machine.scales["period_s2"]
        return far_drag(x, share * present(square, negligible), lambda: x.theta_rad)
    softness = square / (share * x.base["j_kgm2"] + 1e-30)
    return far_drag(x, share, lambda: softness * passed_on(x, share))


EFFECT = Effect(
    name="compliance",
    words="two masses and a spring: the far one adds (J_load/K) d²T/dt², J_load/K in s²",
    signature="a resonance after torque steps",
    tests=("drive", "torque_map"),
    experiment="torque steps with the angle recorded on the load side as well",
    reference="Ellis & Lorenz, IEEE Ind. Appl. Conf. (2000), resonant load control",
    parameters=(
        Parameter("square_s2", "s²", 800.0, _NEGLIGIBLE_PERIODS2, "period_s2", low=0.0, high=4e4),
        Parameter("share", "1", 0.5, 0.0, low=0.05, high=0.95, scan=(0.5,)),
    ),
    signals=("torque_shaft_nm",),
    rivals={
        "torque_lag": "an angle recorded on the load side: a lag of the sensor does not move it",
        "backlash": "steps of torque of one sign only: a gap then stays closed, a spring does not",
    },
    torque=_torque,
)
