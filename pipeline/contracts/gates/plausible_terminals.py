"""Voltage over current that no winding has: milliampere for ampere, millivolt for volt."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pipeline.contracts.protocol import Gate, Passed, warning
from pipeline.contracts.requirements import PAIRS
from pipeline.contracts.waveform import noise_of
from pipeline.records.capture import Capture
from pipeline.records.finding import Finding


def check(capture: Capture, options: Mapping[str, float]) -> Passed:
    """Warns of a resistance between terminals, or a voltage on its link, that cannot be.

    Notes
    -----
    Resistance: 95th percentile of |v| over that of |i| of the first pair whose current is clear of
    noise, beyond `least_ohm` to `most_ohm` [ohm]. Voltage: 99th percentile of |v| above `over_link`
    [1] times the stated DC link.

    """
    findings = [*_resistance(capture, options), *_link(capture, options)]
    return Passed(findings=tuple(findings))


def _resistance(capture: Capture, options: Mapping[str, float]) -> list[Finding]:
    pairs = [capture.meta.pair] if capture.meta.pair else list(PAIRS)
    for pair in pairs:
        for phase in pair:
            names = (f"v{pair}_v", f"i{phase}_a")
            if not capture.has(*names):
                continue
            columns = capture.arrays(*names)
            voltage, current = np.abs(columns[names[0]]), np.abs(columns[names[1]])
            reach = float(np.nanpercentile(current, 95.0))
            if reach <= 10.0 * noise_of(current):
                continue
            ohm = float(np.nanpercentile(voltage, 95.0)) / reach
            if options["least_ohm"] <= ohm <= options["most_ohm"]:
                return []
            words = f"{names[0]} over {names[1]} is about {ohm:.3g} ohm, which no winding has"
            remedy = "check the units: mA recorded as A, or mV as V; map them in conf/source"
            return [warning(capture, "implausible_resistance", words, remedy)]
    return []


def _link(capture: Capture, options: Mapping[str, float]) -> list[Finding]:
    link = capture.meta.vdc_v
    if not link:
        return []
    for pair in PAIRS:
        name = f"v{pair}_v"
        if capture.has(name):
            top = float(np.nanpercentile(np.abs(capture.arrays(name)[name]), 99.0))
            if top > options["over_link"] * link:
                words = f"{name} reaches {top:.3g} V on a DC link of {link:g} V"
                remedy = "check the unit of the voltage, and `vdc_v`"
                return [warning(capture, "voltage_above_link", words, remedy)]
    return []


GATE = Gate(
    "plausible_terminals",
    ("resistance", "current_step"),
    check,
    {
        # Line to line: megawatt machines have some milliohm, the smallest servos some 100 ohm.
        "least_ohm": 2e-3,
        "most_ohm": 1e3,
        # No inverter makes more than its link; a tenth for the link's own error and ringing.
        "over_link": 1.1,
    },
)
