"""Gain error common to all phase currents of one instrument."""

from __future__ import annotations

from pipeline.criticism.effect import Complex, Effect, Parameter, Recorded, Values, choice


def _current(r: Recorded, q: Values) -> Complex:
    return r.i_a / (1.0 + q["gain"] * q[f"of_{r.instrument}"])


EFFECT = Effect(
    name="current_scale",
    words="recorded current = (1 + gain) true current, of the drive, of the bench, or of both",
    signature="every current of one instrument off by one factor",
    tests=("torque_map", "resistance"),
    experiment="the current reading against a second, calibrated meter",
    headline="recorded currents off by {gain %}",
    reference="Chung & Sul, IEEE Trans. Ind. Appl. 34 (1998), current measurement errors",
    parameters=(
        Parameter("gain", "1", 0.02, 0.006, low=-0.5, high=0.5),
        choice("of_drive", (1.0, 0.0)),
        choice("of_bench", (1.0, 0.0)),
    ),
    alternatives={
        "voltage_scale": "resistance known to 0.2 % from a four-wire meter",
        "torque_scale": "resistance known to 0.2 % from a four-wire meter",
    },
    current=_current,
)
