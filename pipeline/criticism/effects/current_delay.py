"""Phase currents logged late."""

from __future__ import annotations

import numpy as np

from pipeline.criticism.effect import Complex, Effect, Parameter, Recorded, Values


def _current(r: Recorded, q: Values) -> Complex:
    if not r.inverter:
        return r.i_a
    # the rotor has turned on since; a turn to first order alone would lengthen the current
    turned = np.exp(1j * r.omega_e_rad_s * q["delay_s"])
    now: Complex = turned * (r.i_a + q["delay_s"] * np.gradient(r.i_a, r.ts_s))
    return now


EFFECT = Effect(
    name="current_delay",
    words="recorded phase current i(t − τ)",
    signature="error proportional to di/dt and to ω_e i",
    tests=("torque_map", "drive"),
    experiment="current steps at standstill and at the highest speed",
    reference="Chung & Sul, IEEE Trans. Ind. Appl. 34 (1998), current measurement errors",
    parameters=(Parameter("delay_s", "s", 0.5, 0.02, "period_s", low=-5.0, high=5.0),),
    signals=("id_a", "iq_a"),
    rivals={
        "skin_effect": "current steps at standstill",
        "sample_delay": "the back-EMF alone: a late current leaves it in place",
    },
    current=_current,
)
