"""A torque sensor that lags."""

from __future__ import annotations

import numpy as np

from pipeline.criticism.effect import Array, Effect, Parameter, Recorded, Values


def _load(r: Recorded, q: Values) -> Array:
    """The true torque behind a lag τ stamped l late, or behind two lags τ and l: to second order
    y + (τ + l) y' + τ l y''. What is told is the whole delay τ + l, which captures know well.
    """
    slope = np.gradient(r.torque_nm, r.ts_s)
    bend = np.zeros_like(r.torque_nm)
    bend[1:-1] = np.diff(r.torque_nm, 2) / r.ts_s**2
    return r.torque_nm + q["lag_s"] * (slope + q["late"] * r.ts_s * bend)


EFFECT = Effect(
    name="torque_lag",
    words="recorded torque is lag_s behind the true one: as a first-order lag, with a part of it "
    "a late stamp or a second lag",
    signature="torque behind current after steps",
    tests=("torque_map",),
    experiment="steps of torque at constant speed",
    reference="Wegener & Andrae, Measurement 40 (2007), dynamic torque measurement",
    parameters=(
        Parameter("lag_s", "s", 10.0, 0.5, "period_s", low=0.0, high=400.0),
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
    ),
    signals=("torque_shaft_nm", "iq_a"),
    load=_load,
)
