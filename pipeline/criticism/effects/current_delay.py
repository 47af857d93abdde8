"""Phase currents logged late."""

from __future__ import annotations

import numpy as np

from pipeline.criticism.effect import Complex, Effect, Parameter, Recorded, Values, alone, choice

_LATE = tuple(2.0**k for k in range(1, 8))
_EARLY = tuple(-late for late in _LATE)
"""Delays [sample periods] that it is looked for at."""


def _current(r: Recorded, q: Values) -> Complex:
    if not r.by_drive(q):
        return r.i_a
    # of phase currents, the rotor has turned on since they were sampled
    later, _, turned = r.later(q["delay_s"])
    return np.exp(1j * turned * q["of_phases"]) * later


EFFECT = Effect(
    name="current_delay",
    words="recorded current i(t − τ), of the phases or in the rotor frame",
    signature="error proportional to di/dt and to ω_e i",
    tests=("torque_map", "drive"),
    experiment="current steps at standstill and at the highest speed",
    headline="recorded currents late by {delay_s}",
    reference="Chung & Sul, IEEE Trans. Ind. Appl. 34 (1998), current measurement errors",
    parameters=(
        Parameter(
            "delay_s",
            "s",
            0.5,
            0.02,
            "period_s",
            low=-200.0,
            high=200.0,
            starts=(*_EARLY, *_LATE),
            rare_below=0.0,
        ),
        choice(
            "of_phases",
            (1.0, 0.0),
            "1: the phase currents are late, 0: those of the rotor frame are",
        ),
        alone(),
    ),
    signals=("id_a", "iq_a"),
    alternatives={
        "skin_effect": "current steps at standstill",
        "sample_delay": "the back-EMF alone: a late current leaves it in place",
    },
    current=_current,
)
