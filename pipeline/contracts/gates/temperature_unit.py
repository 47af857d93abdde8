"""A temperature that no bench can have: kelvin in a column of degrees Celsius."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pipeline.contracts.protocol import Gate, Passed, span_of
from pipeline.contracts.waveform import Array
from pipeline.physics.glossary import TESTS
from pipeline.records.capture import Capture
from pipeline.records.errors import CaptureError, merged

NAME = "temperature_unit"
ZERO_DEGC_K = 273.15
COLDEST_PERCENT = 5.0
REMEDY = "write degrees Celsius, or map the column with `unit: K` in conf/source"


def check(capture: Capture, options: Mapping[str, float]) -> Passed:
    """Refuses a capture with a temperature column that is in kelvin, naming each such column.

    Notes
    -----
    The 5th percentile of a column counts, so that no hot end of a test does. It is in kelvin where
    that lies 273.15 ± `near_k` [K] above the stated `ambient_degc`, or beyond any motor: above
    `most_degc` [degC], and more than `most_rise_k` [K] above an ambient that is stated. A hot
    start, a cold chamber and an oven are let through.

    """
    faults = [
        fault
        for table in capture.tables
        for name in table.columns
        if name.startswith("temp_") and name.endswith("_degc")
        for fault in _faults(name, table[name].to_numpy(), capture.meta.ambient_degc, options)
    ]
    if faults:
        raise merged(faults)
    return Passed()


def _faults(
    name: str, values: Array, ambient: float | None, options: Mapping[str, float]
) -> list[CaptureError]:
    finite = np.isfinite(values)
    if not finite.any():
        return []
    coldest = float(np.percentile(values[finite], COLDEST_PERCENT))
    most, in_kelvin = options["most_degc"], False
    against = "no motor is as hot as that"
    if ambient is not None:
        most = max(most, ambient + options["most_rise_k"])
        in_kelvin = abs(coldest - ambient - ZERO_DEGC_K) <= options["near_k"]
        against = f"ambient_degc is {ambient:g}"
    if coldest <= most and not in_kelvin:
        return []
    words = f"{name} lies at {coldest:.4g} and above, and {against}: it is in kelvin"
    return [CaptureError(NAME, words, REMEDY, span_of(finite))]


GATE = Gate(
    NAME,
    tuple(TESTS),
    check,
    {
        # IEC 60085 names no insulation beyond class 250; a bench of -23 degC reads that in kelvin.
        "most_degc": 250.0,
        # An oven's ambient of 200 degC, the contract's most, leaves its motor this rise.
        "most_rise_k": 150.0,
        # A bench that cooled or warmed since its ambient was written down.
        "near_k": 15.0,
    },
)
