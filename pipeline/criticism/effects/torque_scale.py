"""Gain error of the torque transducer."""

from __future__ import annotations

from pipeline.criticism.effect import Array, Effect, Parameter, Values


def _shaft(torque_nm: Array, q: Values) -> Array:
    return torque_nm * (1.0 + q["gain"])


EFFECT = Effect(
    name="torque_scale",
    words="recorded torque = (1 + gain) true torque",
    signature="Kt from the dynamometer against 1.5 p ψ from the back-EMF",
    tests=("torque_map",),
    experiment="a calibrated weight on a lever arm",
    headline="recorded torque off by {gain %}",
    reference="IEEE 1812-2014, 5: dynamometer tests of permanent magnet machines",
    parameters=(Parameter("gain", "1", 0.02, 0.006, low=-0.5, high=0.5),),
    signals=("torque_shaft_nm",),
    alternatives={
        "current_scale": "resistance known to 0.2 % from a four-wire meter",
        "voltage_scale": "magnet flux known to 0.2 % from a calibrated voltmeter",
    },
    shaft=_shaft,
)
