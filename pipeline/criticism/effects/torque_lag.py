"""A torque sensor that lags."""

from __future__ import annotations

import numpy as np

from pipeline.criticism.effect import Array, Effect, Parameter, Recorded, Values, choice

_STARTS = tuple(2.0**k for k in range(1, 8))
"""Delays [sample periods] that a late stamp is looked for at."""


def _load(r: Recorded, q: Values) -> Array:
    """The true torque behind a lag τ stamped l late, or behind two lags τ and l: to second order y
    + (τ + l) y' + τ l y''. What is reported is the whole delay τ + l, which captures know well.
    Where all of it is a late stamp the torque is read so much later in the log, however many
    samples.
    """
    stamped = q["stamped"] > 0.0
    torque = r.later(q["lag_s"])[1] if stamped else r.torque_nm
    slope = 0.0 if stamped else np.gradient(torque, r.ts_s)
    bend = np.zeros_like(torque)
    bend[1:-1] = np.diff(torque, 2) / r.ts_s**2
    return torque + q["lag_s"] * (slope + q["late"] * r.ts_s * bend)


EFFECT = Effect(
    name="torque_lag",
    words="recorded torque is lag_s behind the true one: as a first-order lag, with a part of it "
    "a late stamp or a second lag, or all of it",
    signature="torque behind current after steps",
    tests=("torque_map",),
    experiment="steps of torque at constant speed",
    headline="recorded torque late by {lag_s}",
    reference="Wegener & Andrae, Measurement 40 (2007), dynamic torque measurement",
    parameters=(
        Parameter("lag_s", "s", 10.0, 0.5, "period_s", low=0.0, high=400.0, starts=_STARTS),
        Parameter(
            "late",
            "1",
            0.5,
            0.0,
            low=-2.0,
            high=2.0,
            scan=(0.0,),
            words="τ l/(τ + l) of the two delays, in sample periods",
        ),
        choice("stamped", (0.0, 1.0), "1: all of the delay is a late stamp, 0: a first-order lag"),
    ),
    signals=("torque_shaft_nm", "iq_a"),
    in_place_of=("late_torque_s", "lag_s"),
    load=_load,
)
