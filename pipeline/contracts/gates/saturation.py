"""A converter at its stop: the signal is cut flat at one extreme value."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pipeline.contracts.protocol import Gate, Passed, span_of, warning
from pipeline.contracts.requirements import LINE_CURRENTS, LINE_VOLTAGES
from pipeline.contracts.waveform import Array, Rows, longest_likely_run, rows_of_runs, runs_of_equal
from pipeline.physics.glossary import TESTS
from pipeline.records.capture import Capture, Mask
from pipeline.records.errors import CaptureError
from pipeline.records.finding import Finding

NAME = "saturation"
CURRENTS = (*LINE_CURRENTS, "id_a", "iq_a", "idc_a")
MEASURED_VOLTAGES = (*LINE_VOLTAGES, "va_v", "vb_v", "vc_v")
OTHERS = ("torque_shaft_nm",)
BESIDE = 8
REMEDY = "record again with a larger range of that channel"


def check(capture: Capture, options: Mapping[str, float]) -> Passed:
    """Sets clipped rows aside; refuses where they are many or where the step's fit needs them.

    Notes
    -----
    See `clipped_rows`. More than `refuse_share` [1] of the rows refuse, in a current step any. A
    commanded voltage may well stand at the inverter's limit and is not looked at.

    """
    masks: list[Mask] = []
    findings: list[Finding] = []
    measured = capture.meta.voltage_kind != "commanded"
    names = CURRENTS + OTHERS + (MEASURED_VOLTAGES if measured else ())
    for index, table in enumerate(capture.tables):
        for name in (n for n in names if n in table.columns):
            signal = table[name].to_numpy()
            clipped = clipped_rows(signal, options)
            count = int(np.count_nonzero(clipped))
            if count == 0:
                continue
            stop = float(signal[clipped][np.argmax(np.abs(signal[clipped]))])
            words = f"{name} is cut flat at {stop:.6g} in {count} of {signal.size} rows"
            share = options["refuse_share"] if capture.meta.test != "current_step" else 0.0
            if count > share * signal.size:
                raise CaptureError(NAME, words, REMEDY, span_of(clipped))
            masks.append(Mask(NAME, index, ~clipped))
            findings.append(warning(capture, NAME, f"{words}; set aside", REMEDY, span_of(clipped)))
    return Passed(tuple(masks), tuple(findings))


def clipped_rows(values: Array, options: Mapping[str, float]) -> Rows:
    """Rows at an extreme value of which some runs are longer than noise allows.

    Parameters
    ----------
    values
        Signal [n, any unit].
    options
        `chance` [1], `shortest_run` [samples], `inside_share` [1], `pace_steps` [1].

    Returns
    -------
    array [n] of bool
        None for fewer than 50 samples, or fewer than `inside_share` of them between the extremes.

    Notes
    -----
    A run counts if it is longer than chance allows for the repeats seen away from the extremes, and
    if the samples next to it move by `pace_steps` of the converter's resolution or more: a decay
    that settles on one code, or a rounded peak, comes to it by single codes, a clipped signal at
    its full pace or with its full noise. Exact zero is rest, not a stop.

    """
    clipped = np.zeros(values.size, dtype=bool)
    finite = values[np.isfinite(values)]
    if finite.size < 50:
        return clipped
    low, high = float(finite.min()), float(finite.max())
    inside = finite[(finite != low) & (finite != high)]
    if inside.size < options["inside_share"] * finite.size:
        return clipped
    steps = np.abs(np.diff(values))
    resolution = float(np.min(steps[steps > 0.0], initial=np.inf))
    likely = max(longest_likely_run(inside, options["chance"]), options["shortest_run"])
    starts, lengths = runs_of_equal(values)
    for stop in (low, high):
        runs = (values[starts] == stop) & (lengths > likely)
        if stop == 0.0 or not runs.any():
            continue
        flat = rows_of_runs(values.size, starts[runs], lengths[runs])
        if _pace_beside(steps, flat) >= options["pace_steps"] * resolution:
            clipped |= values == stop
    return clipped


def _pace_beside(steps: Array, flat: Rows) -> float:
    """Median step [n-1] of the samples next to flat stretches, the steps onto them included."""
    beside = np.zeros(steps.size, dtype=bool)
    for edge in np.flatnonzero(flat[1:] != flat[:-1]):
        outward = slice(edge, edge + BESIDE) if flat[edge] else slice(edge + 1 - BESIDE, edge + 1)
        beside[max(0, outward.start) : outward.stop] = True
    beside &= ~(flat[1:] & flat[:-1]) & np.isfinite(steps)
    return float(np.median(steps[beside])) if beside.any() else 0.0


GATE = Gate(
    NAME,
    tuple(TESTS),
    check,
    {
        # Expected number of such runs in a healthy capture of any length.
        "chance": 1e-6,
        # Two equal extremes are what any converter gives at a peak now and then.
        "shortest_run": 2.0,
        # With fewer samples between the extremes the signal has two levels, not a cut top.
        "inside_share": 0.05,
        # What settles or turns by itself comes by single codes.
        "pace_steps": 2.0,
        # A twentieth of the rows can be left out of a fit; more is another experiment.
        "refuse_share": 0.05,
    },
)
