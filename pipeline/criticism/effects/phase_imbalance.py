"""Phase resistances that differ."""

from __future__ import annotations

import numpy as np

from pipeline.criticism.effect import Complex, Effect, Operating, Parameter, Values


def _drop(x: Operating, q: Values) -> Complex:
    gamma = q["cosine"] + 1j * q["sine"]
    return x.base["r_ohm"] * gamma * np.conj(x.i_a) * np.exp(-2j * x.eps_rad)


EFFECT = Effect(
    name="phase_imbalance",
    words="phase k has resistance R (1 + 2 Re(γ e^{−j4πk/3})), γ = cosine + j sine",
    signature="second electrical order in the dq voltages, proportional to current, at any speed",
    tests=("resistance", "torque_map"),
    of_phases=True,
    experiment="resistance through all three terminal pairs, or current at low speed",
    headline="phase resistances that differ, by up to {phases cosine & sine %} of their mean",
    reference="Fortescue, Trans. AIEE 37 (1918), symmetrical co-ordinates",
    parameters=(
        Parameter("cosine", "1", 0.01, 0.001, low=-0.3, high=0.3),
        Parameter("sine", "1", 0.01, 0.001, low=-0.3, high=0.3),
    ),
    alternatives={
        "current_gain": "the back-EMF terms: a gain error grows with speed, a resistance not"
    },
    drop=_drop,
)
