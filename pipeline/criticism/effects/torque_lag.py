"""A torque sensor that lags."""

from __future__ import annotations

import numpy as np

from pipeline.criticism.effect import Array, Effect, Parameter, Recorded, Values


def _load(r: Recorded, q: Values) -> Array:
    return r.torque_nm + q["lag_s"] * np.gradient(r.torque_nm, r.ts_s)


EFFECT = Effect(
    name="torque_lag",
    words="recorded torque follows the true one as a first-order lag τ",
    signature="torque behind current after steps",
    tests=("torque_map",),
    experiment="steps of torque at constant speed",
    reference="Wegener & Andrae, Measurement 40 (2007), dynamic torque measurement",
    parameters=(Parameter("lag_s", "s", 10.0, 0.5, "period_s", low=0.0, high=400.0),),
    signals=("torque_shaft_nm", "iq_a"),
    load=_load,
)
