"""Flux of one axis that falls with the current of the other."""

from __future__ import annotations

from typing import Any

from pipeline.criticism.effect import Effect, Operating, Parameter, Values


def _coenergy(x: Operating, q: Values) -> Any:
    size = x.machine.scales["current_a"]
    d, q2 = x.id_a / size, (x.iq_a / size) ** 2
    mean = (x.base["ld_h"] * x.base["lq_h"]) ** 0.5
    return -mean * size**2 * (q["odd"] * d * q2 + q["even"] * d**2 * q2)


EFFECT = Effect(
    name="cross_saturation",
    words="co-energy −√(L_d L_q) i_max² (odd s_d s_q² + even s_d² s_q²), s = i/i_max",
    signature="flux of one axis bends with the other axis' current; both bends are one function",
    tests=("torque_map",),
    experiment="a torque map with d and q current together",
    reference="Armando et al., IEEE Trans. Ind. Appl. 49 (2013), flux maps at constant speed",
    parameters=(
        Parameter("odd", "1", 0.05, 0.004, low=-2.0, high=2.0),
        Parameter("even", "1", 0.05, 0.008, low=-2.0, high=2.0),
    ),
    signals=("id_a", "iq_a"),
    rivals={"saturation": "a torque map with both currents changed one at a time"},
    coenergy=_coenergy,
)
