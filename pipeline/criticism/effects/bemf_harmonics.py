"""Magnet flux that is not a pure sine along the air gap."""

from __future__ import annotations

from typing import Any

import numpy as np

from pipeline.criticism.effect import Effect, Operating, Parameter, Values


def _coenergy(x: Operating, q: Values) -> Any:
    total = 0.0
    for order in (6, 12):
        angle = order * x.eps_rad
        total = total + q[f"d{order}"] * x.id_a * np.cos(angle)
        total = total + q[f"q{order}"] * x.iq_a * np.sin(angle)
    return x.base["psi_wb"] * total


EFFECT = Effect(
    name="bemf_harmonics",
    words="ψ_d gains ψ d_n cos nε and ψ_q gains ψ q_n sin nε, n = 6, 12",
    signature="orders 6ε and 12ε: proportional to speed in voltage, to current in torque",
    tests=("open_circuit", "torque_map"),
    experiment="an open-circuit spin",
    reference="Hanselman, Brushless Permanent Magnet Motor Design, 2nd ed. (2006), ch. 4",
    parameters=(
        Parameter("d6", "1", 0.01, 0.0003, low=-0.3, high=0.3),
        Parameter("q6", "1", 0.01, 0.0003, low=-0.3, high=0.3),
        Parameter("d12", "1", 0.005, 0.0003, low=-0.3, high=0.3),
        Parameter("q12", "1", 0.005, 0.0003, low=-0.3, high=0.3),
    ),
    rivals={"cogging": "a slow turn without current"},
    coenergy=_coenergy,
)
