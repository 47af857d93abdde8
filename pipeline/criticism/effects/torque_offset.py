"""A torque transducer that does not read zero at rest."""

from __future__ import annotations

from pipeline.criticism.effect import Array, Effect, Parameter, Values


def _shaft(torque_nm: Array, q: Values) -> Array:
    return torque_nm + q["offset_nm"]


EFFECT = Effect(
    name="torque_offset",
    words="recorded torque = true torque + offset",
    signature="constant torque whatever current, speed and sense",
    tests=("torque_map", "cogging"),
    experiment="a slow turn in both senses, or the transducer read unloaded",
    headline="torque transducer off zero by {offset_nm}",
    reference="IEEE 1812-2014, 5: dynamometer tests of permanent magnet machines",
    parameters=(Parameter("offset_nm", "N·m", 0.01, 0.0005, "torque_nm", low=-0.5, high=0.5),),
    signals=("torque_shaft_nm",),
    alternatives={"coulomb_friction": "both rotation senses"},
    shaft=_shaft,
)
