"""Inductance that falls with the current of its own axis."""

from __future__ import annotations

from typing import Any

from pipeline.criticism.effect import Effect, Operating, Parameter, Values, log1p

_STRAIGHT = 1e-4
"""Bend below which the series serves: its next term is 1e-9, where the closed form loses digits."""


def _saturated(square: Any, bend: float) -> Any:
    """∫ s³/(1 + bend s²) ds over s², a series where the bend is next to nothing."""
    if bend < _STRAIGHT:
        return square * square * (0.25 - bend / 6 * square)
    return (bend * square - log1p(bend * square)) / (2 * bend**2)


def _coenergy(x: Operating, q: Values) -> Any:
    size = x.machine.scales["current_a"]
    d, s = x.id_a / size, x.iq_a / size
    loss = 0.0
    if q["q_fall"]:
        loss = loss + x.base["lq_h"] * q["q_fall"] * _saturated(s * s, q["q_bend"])
    if q["d_odd"]:
        loss = loss + x.base["ld_h"] * q["d_odd"] / 3 * d * d * d
    if q["d_fall"]:
        loss = loss + x.base["ld_h"] * q["d_fall"] * _saturated(d * d, q["d_bend"])
    return -(size**2) * loss


EFFECT = Effect(
    name="saturation",
    words="ψ_q = L_q i_q (1 − a s²/(1 + b s²)), ψ_d likewise and less L_d i_d c s, s = i/i_max",
    signature="flux bends with the current of its own axis",
    tests=("torque_map", "flux_map", "current_step"),
    experiment="a torque map, or current steps, up to rated current",
    headline="iron that saturates: inductance falls with current",
    reference="Armando et al., IEEE Trans. Ind. Appl. 49 (2013), flux maps at constant speed; "
    "Fröhlich's rational magnetisation curve in Bozorth, Ferromagnetism (1951), ch. 11",
    parameters=(
        Parameter("q_fall", "1", 0.1, 0.004, low=0.0, high=50.0, optional=1),
        Parameter("q_bend", "1", 0.5, 0.0, low=0.0, high=100.0, scan=(1.0,), optional=2),
        Parameter("d_odd", "1", 0.05, 0.004, low=-2.0, high=2.0, optional=3),
        Parameter("d_fall", "1", 0.1, 0.004, low=0.0, high=50.0, optional=4),
        Parameter("d_bend", "1", 0.5, 0.0, low=0.0, high=100.0, scan=(1.0,), optional=5),
    ),
    signals=("id_a", "iq_a"),
    alternatives={
        "cross_saturation": "a torque map with both currents changed one at a time",
        "inductance_harmonics": "a slow turn under current",
    },
    coenergy=_coenergy,
)
