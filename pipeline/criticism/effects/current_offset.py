"""Offsets of the phase current sensors."""

from __future__ import annotations

import numpy as np

from pipeline.criticism.effect import Complex, Effect, Parameter, Recorded, Values, alone


def _current(r: Recorded, q: Values) -> Complex:
    if not r.by_drive(q):
        return r.i_a
    offset = (q["alpha_a"] + 1j * q["beta_a"]) * np.exp(-1j * r.eps_rad)
    return r.i_a - offset


EFFECT = Effect(
    name="current_offset",
    words="recorded stationary current = true one + constant α + jβ",
    signature="first electrical order in dq currents, voltages and torque, at any current",
    tests=("torque_map", "drive"),
    of_phases=True,
    experiment="a log with the current loop off: the sensors should read zero",
    headline="phase current sensors off zero by {alpha_a & beta_a}",
    reference="Chung & Sul, IEEE Trans. Ind. Appl. 34 (1998), current measurement errors",
    parameters=(
        Parameter("alpha_a", "A", 0.01, 0.0005, "current_a", low=-0.3, high=0.3),
        Parameter("beta_a", "A", 0.01, 0.0005, "current_a", low=-0.3, high=0.3),
        alone(),
    ),
    signals=("id_a", "iq_a"),
    alternatives={},
    current=_current,
)
