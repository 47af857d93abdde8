"""Inductances that vary along the air gap beyond the two axes."""

from __future__ import annotations

from typing import Any

import numpy as np

from pipeline.criticism.effect import Array, Effect, Operating, Parameter, Values, choice


def _stored(x: Operating) -> dict[str, Any]:
    """Co-energies over 1.5 [n, Wb·A] of the two axes and of a mutual inductance of their size."""
    ld, lq = x.base["ld_h"], x.base["lq_h"]
    return {
        "d6": 0.5 * ld * x.id_a**2,
        "q6": 0.5 * lq * x.iq_a**2,
        "cross6": (ld * lq) ** 0.5 * x.id_a * x.iq_a,
    }


def _coenergy(x: Operating, q: Values) -> Any:
    cosine, sine = x.waves(6)
    return sum(
        product * (q[f"{name}_cos"] * cosine + q[f"{name}_sin"] * sine)
        for name, product in _stored(x).items()
    )


def _torque(x: Operating, q: Values) -> Array:
    if q["ripple_share"] == 1.0:
        return np.zeros(x.omega_rad_s.shape)
    cosine, sine = x.waves(6)
    slope = sum(
        6.0 * product * (q[f"{name}_sin"] * cosine - q[f"{name}_cos"] * sine)
        for name, product in _stored(x).items()
    )
    ripple: Array = 1.5 * x.machine.pole_pairs * slope
    return (1.0 - q["ripple_share"]) * ripple


EFFECT = Effect(
    name="inductance_harmonics",
    words="L_q, L_d and a mutual inductance of size √(L_d L_q) vary with waves of 6ε; ripple_share "
    "of the torque from their slope reaches the shaft's sensor",
    signature="orders 6ε proportional to current in voltage and to its square in torque",
    tests=("torque_map",),
    of_phases=True,
    rotor_angles=3,
    experiment="a torque map, or a slow turn under current",
    headline=tuple(
        f"inductance that changes with the rotor's angle, {{{name}_cos & {name}_sin %}} {where}"
        for name, where in (
            ("q6", "on the q axis"),
            ("d6", "on the d axis"),
            ("cross6", "between the axes"),
        )
    ),
    reference="Hanselman, Brushless Permanent Magnet Motor Design, 2nd ed. (2006), ch. 5",
    parameters=(
        *(
            Parameter(f"{name}_{wave}", "1", 0.03, 0.003, low=-0.5, high=0.5)
            for name in ("q6", "d6", "cross6")
            for wave in ("cos", "sin")
        ),
        choice("ripple_share", (1.0, 0.0)),
    ),
    signals=("id_a", "iq_a"),
    alternatives={"bemf_harmonics": "an open-circuit spin", "dead_time": "two speeds"},
    touches=dict.fromkeys(("ld_h", "lq_h"), "goes with the angle at which the rotor was locked"),
    coenergy=_coenergy,
    torque=_torque,
)
