"""A converter at its stop: the signal is cut flat at one extreme value."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pipeline.contracts.protocol import Gate, Passed, span_of, warning
from pipeline.contracts.requirements import LINE_CURRENTS, LINE_VOLTAGES
from pipeline.contracts.waveform import (
    Array,
    Rows,
    longest_likely_run,
    rows_of_runs,
    runs_of_equal,
)
from pipeline.physics.glossary import TESTS
from pipeline.records.capture import Capture, Mask
from pipeline.records.errors import CaptureError
from pipeline.records.finding import Finding

NAME = "saturation"
CURRENTS = (*LINE_CURRENTS, "id_a", "iq_a", "idc_a")
MEASURED_VOLTAGES = (*LINE_VOLTAGES, "va_v", "vb_v", "vc_v")
OTHERS = ("torque_shaft_nm",)
REMEDY = "record again with a larger range of that channel"


def check(capture: Capture, options: Mapping[str, float]) -> Passed:
    """Sets clipped rows aside; refuses where they are many or where the step's fit needs them.

    A commanded voltage may well stand at the inverter's limit and is not looked at.
    """
    masks: list[Mask] = []
    findings: list[Finding] = []
    measured = capture.meta.voltage_kind == "measured"
    names = CURRENTS + OTHERS + (MEASURED_VOLTAGES if measured else ())
    for index, table in enumerate(capture.tables):
        for name in (n for n in names if n in table.columns):
            values = table[name].to_numpy()
            clipped = clipped_rows(values, options)
            count = int(np.count_nonzero(clipped))
            if count == 0:
                continue
            stop = float(values[clipped][np.argmax(np.abs(values[clipped]))])
            words = f"{name} is cut flat at {stop:.6g} in {count} of {values.size} rows"
            share = options["refuse_share"] if capture.meta.test != "current_step" else 0.0
            if count > share * values.size:
                raise CaptureError(NAME, words, REMEDY, span_of(clipped))
            masks.append(Mask(NAME, index, ~clipped))
            findings.append(warning(capture, NAME, f"{words}; set aside", REMEDY, span_of(clipped)))
    return Passed(tuple(masks), tuple(findings))


def clipped_rows(values: Array, options: Mapping[str, float]) -> Rows:
    """True on rows [n] of flat tops: runs of the extreme value that noise would have broken.

    A run counts if it is longer than chance allows for the repeats seen away from the extremes,
    and if the signal came to it by more than a few steps of its resolution: a decay that
    settles on one code arrives there slowly, a clipped one at full speed.
    """
    clipped = np.zeros(values.size, dtype=bool)
    finite = values[np.isfinite(values)]
    if finite.size < 50:
        return clipped
    low, high = float(finite.min()), float(finite.max())
    inside = finite[(finite != low) & (finite != high)]
    if inside.size < options["inside_share"] * finite.size:
        return clipped
    steps = np.abs(np.diff(inside))
    resolution = float(np.min(steps[steps > 0.0], initial=np.inf))
    likely = max(longest_likely_run(inside, options["chance"]), options["shortest_run"])
    starts, lengths = runs_of_equal(values)
    for stop in (low, high):
        runs = np.flatnonzero((values[starts] == stop) & (lengths > likely))
        if runs.size == 0:
            continue
        arrivals = [abs(stop - values[starts[r] - 1]) for r in runs if starts[r] > 0]
        after = [r for r in runs if starts[r] + lengths[r] < values.size]
        arrivals += [abs(stop - values[starts[r] + lengths[r]]) for r in after]
        fast = [step for step in arrivals if np.isfinite(step)]
        if fast and np.median(fast) > options["arrival_steps"] * resolution:
            clipped |= rows_of_runs(values.size, starts[runs], lengths[runs])
    return clipped


GATE = Gate(
    NAME,
    tuple(TESTS),
    check,
    {
        # Expected number of such runs in a healthy capture of any length.
        "chance": 1e-6,
        # Two or three equal extremes are what a coarse converter gives at a peak.
        "shortest_run": 4.0,
        # With fewer samples between the extremes the signal has two levels, not a cut top.
        "inside_share": 0.05,
        # A settled exponential reaches its last code by single steps.
        "arrival_steps": 3.0,
        # A twentieth of the rows can be left out of a fit; more is another experiment.
        "refuse_share": 0.05,
    },
)
