"""Inductances that vary along the air gap beyond the two axes."""

from __future__ import annotations

from typing import Any

import numpy as np

from pipeline.criticism.effect import Effect, Operating, Parameter, Values


def _coenergy(x: Operating, q: Values) -> Any:
    cosine, sine = np.cos(6 * x.eps_rad), np.sin(6 * x.eps_rad)
    own = x.base["lq_h"] * q["q6"] * x.iq_a**2 + x.base["ld_h"] * q["d6"] * x.id_a**2
    mean = (x.base["ld_h"] * x.base["lq_h"]) ** 0.5
    return 0.5 * own * cosine + mean * q["cross6"] * x.id_a * x.iq_a * sine


EFFECT = Effect(
    name="inductance_harmonics",
    words="L_q (1 + q6 cos 6ε), L_d (1 + d6 cos 6ε), mutual √(L_d L_q) cross6 sin 6ε",
    signature="orders 6ε proportional to current in voltage and to its square in torque",
    tests=("torque_map",),
    experiment="a torque map, or a slow turn under current",
    reference="Hanselman, Brushless Permanent Magnet Motor Design, 2nd ed. (2006), ch. 5",
    parameters=(
        Parameter("q6", "1", 0.03, 0.002, low=-0.5, high=0.5),
        Parameter("d6", "1", 0.03, 0.004, low=-0.5, high=0.5),
        Parameter("cross6", "1", 0.03, 0.004, low=-0.5, high=0.5),
    ),
    signals=("id_a", "iq_a"),
    rivals={"bemf_harmonics": "an open-circuit spin", "dead_time": "two speeds"},
    coenergy=_coenergy,
)
