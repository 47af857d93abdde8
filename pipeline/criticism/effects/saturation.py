"""Inductance that falls with the current of its own axis."""

from __future__ import annotations

from typing import Any

from pipeline.criticism.effect import Effect, Operating, Parameter, Values


def _coenergy(x: Operating, q: Values) -> Any:
    size = x.machine.scales["current_a"]
    d, d2 = x.id_a / size, (x.id_a / size) ** 2
    q2 = (x.iq_a / size) ** 2
    lost_q = x.base["lq_h"] * (q["q_cubic"] * q2**2 / 4 - q["q_quintic"] * q2**3 / 6)
    lost_d = x.base["ld_h"] * (q["d_square"] * d * d2 / 3 + q["d_cubic"] * d2**2 / 4)
    return -(size**2) * (lost_q + lost_d)


EFFECT = Effect(
    name="saturation",
    words="ψ_q = L_q i_q (1 − a s² + b s⁴), ψ_d likewise with an odd term, s = i/i_max",
    signature="flux bends with the current of its own axis",
    tests=("torque_map", "current_step"),
    experiment="a torque map, or current steps, up to rated current",
    reference="Armando et al., IEEE Trans. Ind. Appl. 49 (2013), flux maps at constant speed",
    parameters=(
        Parameter("q_cubic", "1", 0.1, 0.004, low=0.0, high=2.0),
        Parameter("q_quintic", "1", 0.02, 0.004, low=-0.3, high=2.0),
        Parameter("d_square", "1", 0.05, 0.004, low=-2.0, high=2.0),
        Parameter("d_cubic", "1", 0.1, 0.004, low=0.0, high=2.0),
    ),
    signals=("id_a", "iq_a"),
    rivals={
        "cross_saturation": "a torque map with both currents changed one at a time",
        "inductance_harmonics": "a slow turn under current",
    },
    coenergy=_coenergy,
)
