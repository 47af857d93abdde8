"""Too little current, or too few levels of it, for what the test is to show."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from pipeline.contracts.protocol import Gate, Passed, warning
from pipeline.contracts.requirements import LINE_CURRENTS
from pipeline.contracts.waveform import Array, noise_of
from pipeline.numerics.plateaus import block_means
from pipeline.physics.glossary import of_ohmmeter
from pipeline.records.capture import Capture
from pipeline.records.errors import CaptureError

CODE = "current_coverage"
NOISE_MULTIPLE = 10.0
_PARTS = 100
"""Of a torque map, each with a mean: a ripple averages out in it, and a level does not."""


def check(capture: Capture, options: Mapping[str, float]) -> Passed:
    """Whether the currents of the test were there; a refusal names the missing experiment.

    Notes
    -----
    By the test, σ being the white noise of the channel and m the option `noise_multiple` [1]:

    - resistance: an ohmmeter's readings pass; max |i| > m σ in a line, else refused; one level only
      warns.
    - current step: the range of the current > 2 m σ, else refused.
    - torque map: the range of the current's means over a hundredth of the rows > 2 m σ of a mean,
      else refused: a ripple from row to row hides no level.
    - heat run: max |i| > m σ, else refused; a rise of the winding below `rise_k` [K] warns.
    - flux map, torque table: two levels or more, else refused; a table of one sense only warns.

    """
    return LOOKS[capture.meta.test](capture, options)


def _finite(capture: Capture, *names: str) -> dict[str, Array]:
    columns = {n: capture.arrays(n)[n] for n in names if capture.has(n)}
    return {n: v[np.isfinite(v)] for n, v in columns.items() if np.isfinite(v).any()}


def _clear_of_noise(values: Array, reach: float, times: float) -> bool:
    return reach > times * noise_of(values)


def _resistance(capture: Capture, options: Mapping[str, float]) -> Passed:
    if of_ohmmeter(capture.meta.test, capture.columns):
        return Passed()
    currents = _finite(capture, *LINE_CURRENTS)
    times = options["noise_multiple"]
    flows = [v for v in currents.values() if _clear_of_noise(v, np.abs(v).max(), times)]
    if not flows:
        raise CaptureError(
            CODE,
            "no current flows in any line",
            "drive DC steps through the pair: at least two levels, of both signs",
        )
    spread = max(np.percentile(v, 95) - np.percentile(v, 5) for v in flows)
    if all(spread <= max(times * noise_of(v), 0.05 * np.abs(v).max()) for v in flows):
        words = "all current is at one level: the offset of the leads cannot be separated from R"
        remedy = "record at least two levels, best of both signs"
        return Passed(findings=(warning(capture, CODE, words, remedy),))
    return Passed()


def _step(capture: Capture, options: Mapping[str, float]) -> Passed:
    currents = _finite(capture, *LINE_CURRENTS)
    times = options["noise_multiple"]
    if any(_clear_of_noise(v, np.ptp(v), 2.0 * times) for v in currents.values()):
        return Passed()
    raise CaptureError(
        CODE,
        "no line current leaves its noise: there is no step",
        "record a voltage step on the pair, with the rotor locked",
    )


def holds_levels(current: Array, times: float = NOISE_MULTIPLE) -> bool:
    """Whether a current has levels that its scatter from row to row does not hide.

    Parameters
    ----------
    current
        [n, A], finite.
    times
        Over the white noise of a mean of a hundredth of the rows [1].

    """
    size = max(current.size // _PARTS, 1)
    reach = float(np.ptp(block_means(current, size)))
    return reach > 2.0 * times * noise_of(current) / np.sqrt(size)


def _torque_map(capture: Capture, options: Mapping[str, float]) -> Passed:
    if holds_levels(_finite(capture, "iq_a")["iq_a"], options["noise_multiple"]):
        return Passed()
    raise CaptureError(
        CODE,
        "iq_a holds no two levels that differ beyond its scatter from row to row: torque against "
        "current has no slope",
        "record steps of q current at held speed, of both signs; if every row is a settled point "
        "of its own, state test: torque_table",
    )


def _heat_run(capture: Capture, options: Mapping[str, float]) -> Passed:
    currents = _finite(capture, "id_a", "iq_a", *LINE_CURRENTS)
    times = options["noise_multiple"]
    if not any(_clear_of_noise(v, np.abs(v).max(), times) for v in currents.values()):
        raise CaptureError(
            CODE,
            "no current leaves its noise: nothing is recorded that could warm the winding",
            "drive current through the winding, and record it, until the winding warms",
        )
    temperature = _finite(capture, "temp_winding_degc")["temp_winding_degc"]
    rise = float(np.ptp(temperature)) - 2.0 * noise_of(temperature)
    if rise >= options["rise_k"]:
        return Passed()
    words = f"the winding warms by {max(rise, 0.0):.2g} K; {options['rise_k']:g} K are needed"
    return Passed(findings=(warning(capture, CODE, words, "record longer, or with more current"),))


def _flux_map(capture: Capture, options: Mapping[str, float]) -> Passed:
    # steady voltages of levels of d current carry no q current
    for name in ("id_a", "iq_a") if capture.has("iq_a") else ("id_a",):
        levels = np.unique(_finite(capture, name)[name].round(9))
        if levels.size < 2:
            raise CaptureError(
                CODE,
                f"{name} has one level only",
                "add rows at further levels of both currents",
            )
    return Passed()


def _torque_table(capture: Capture, options: Mapping[str, float]) -> Passed:
    """Refuses one current only; warns of one sense only, where an offset looks like a constant."""
    current = _finite(capture, "iq_a")["iq_a"]
    if np.ptp(current) <= 1e-3 * np.abs(current).max(initial=0.0):
        raise CaptureError(CODE, "iq_a has one level only", "add rows at further currents")
    if current.min() * current.max() >= 0.0:
        words = "q current of one sense only: an offset of the transducer bends with saturation"
        return Passed(findings=(warning(capture, CODE, words, "add rows of the other sense"),))
    return Passed()


LOOKS: dict[str, Callable[[Capture, Mapping[str, float]], Passed]] = {
    "resistance": _resistance,
    "current_step": _step,
    "torque_map": _torque_map,
    "heat_run": _heat_run,
    "flux_map": _flux_map,
    "torque_table": _torque_table,
}

GATE = Gate(
    CODE,
    tuple(LOOKS),
    check,
    {
        # Over white noise: the largest of a million samples is 5 sigma; twice that is a signal.
        "noise_multiple": NOISE_MULTIPLE,
        # At 0.39 %/K a rise of 5 K moves R by 2 %: ten times what a good meter leaves open.
        "rise_k": 5.0,
    },
)
