"""Flux of one axis that falls with the current of the other."""

from __future__ import annotations

from typing import Any

from pipeline.criticism.effect import Effect, Operating, Parameter, Values


def _coenergy(x: Operating, q: Values) -> Any:
    size = x.machine.scales["current_a"]
    d, square = x.id_a / size, (x.iq_a / size) ** 2
    mean = (x.base["ld_h"] * x.base["lq_h"]) ** 0.5
    beside = (q["odd"] * d + q["even"] * d**2) / (1 + q["d_bend"] * d**2)
    return -mean * size**2 * beside * square / (1 + q["bend"] * square)


EFFECT = Effect(
    name="cross_saturation",
    words="co-energy −√(L_d L_q) i_max² (odd s_d + even s_d²)/(1 + b_d s_d²) s_q²/(1 + b s_q²), "
    "s = i/i_max",
    signature="flux of one axis bends with the other axis' current; both bends are one function",
    tests=("torque_map", "flux_map"),
    experiment="a torque map with d and q current together",
    headline="inductance of one axis that falls with the current of the other",
    reference="Armando et al., IEEE Trans. Ind. Appl. 49 (2013), flux maps at constant speed",
    parameters=(
        Parameter("odd", "1", 0.05, 0.004, low=-20.0, high=20.0, optional=1),
        Parameter("even", "1", 0.05, 0.008, low=-20.0, high=20.0, optional=2),
        Parameter("bend", "1", 0.5, 0.0, low=0.0, high=100.0, scan=(1.0,), optional=3),
        Parameter("d_bend", "1", 0.5, 0.0, low=0.0, high=100.0, scan=(1.0,), optional=4),
    ),
    signals=("id_a", "iq_a"),
    alternatives={"saturation": "a torque map with both currents changed one at a time"},
    coenergy=_coenergy,
)
