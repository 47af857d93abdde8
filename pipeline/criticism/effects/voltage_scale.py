"""Gain error of the voltage measurement."""

from __future__ import annotations

from pipeline.criticism.effect import Complex, Effect, Operating, Parameter, Values, choice


def _voltage(v_v: Complex, _: Operating, q: Values, instrument: str) -> Complex:
    return v_v * (1.0 + q["gain"] * q[f"of_{instrument}"])


EFFECT = Effect(
    name="voltage_scale",
    words="recorded voltage = (1 + gain) true voltage, of the drive, of the bench, or of both",
    signature="every voltage of one instrument off by one factor",
    tests=("open_circuit", "torque_map"),
    experiment="the voltage reading against a second, calibrated meter",
    headline="recorded voltages off by {gain %}",
    reference="JCGM 100:2008, 4.3 (a gain is common to all samples)",
    parameters=(
        Parameter("gain", "1", 0.02, 0.006, low=-0.5, high=0.5),
        choice("of_drive", (1.0, 0.0)),
        choice("of_bench", (1.0, 0.0)),
    ),
    alternatives={
        "current_scale": "resistance known to 0.2 % from a four-wire meter",
        "torque_scale": "magnet flux known to 0.2 % from a calibrated voltmeter",
    },
    voltage=_voltage,
)
