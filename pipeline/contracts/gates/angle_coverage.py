"""Too little of the turn: angles that the test asks for and the capture does not hold."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from pipeline.contracts.protocol import Gate, Passed, warning
from pipeline.contracts.requirements import LINE_VOLTAGES, TERMINAL_VOLTAGES
from pipeline.contracts.rotation import line_voltage_vector, turned_rad, turning
from pipeline.physics.units import TURN_RAD
from pipeline.records.capture import Capture
from pipeline.records.errors import CaptureError

CODE = "angle_coverage"


def check(capture: Capture, options: Mapping[str, float]) -> Passed:
    """Whether the turn, or the angles of a table, were covered.

    Notes
    -----
    By the test, with the options in brackets:

    - cogging and hand turn: travel of the shaft [turns]; less refuses.
    - holding current: the same, between the outermost angles.
    - open circuit: electrical cycles of the back-EMF [`cycles`]; fewer refuse.
    - LCR table: different rotor angles modulo 180° electrical [`rotor_angles`], for
      L(θ) = mean + amplitude cos(2θ + phase) has three unknowns; fewer warn, one alone refuses,
      unless all three pairs were measured.

    """
    return LOOKS[capture.meta.test](capture, options)


def _whole_turn(capture: Capture, options: Mapping[str, float]) -> Passed:
    turned = turned_rad(capture)
    if capture.meta.test == "holding_current":
        turned = float(np.nanmax(_angles(capture)) - np.nanmin(_angles(capture)))
    if turned is None or turned >= options["turns"] * TURN_RAD:
        return Passed()
    raise CaptureError(
        CODE,
        f"the shaft passes {turned / TURN_RAD:.2f} of a turn",
        "record at least one mechanical turn",
    )


def _angles(capture: Capture) -> np.ndarray:
    return capture.arrays("theta_mech_rad", masked=False)["theta_mech_rad"]


def _electrical_turn(capture: Capture, options: Mapping[str, float]) -> Passed:
    turned = turning(capture)
    cycles = _cycles(capture) if turned is None else turned.cycles
    if cycles >= options["cycles"]:
        return Passed()
    seen_words = f"the back-EMF turns {cycles:.2f}" if cycles else "no back-EMF turns"
    raise CaptureError(
        CODE,
        f"{seen_words} where {options['cycles']:g} electrical cycles are needed",
        "drive the shaft with open terminals, at two speeds or more",
    )


def _cycles(capture: Capture) -> float:
    """Cycles of a back-EMF without a shaft angle: by its vector, of one voltage by its signs."""
    vector = line_voltage_vector(capture)
    if vector is not None:
        x = vector[1][np.isfinite(vector[1])]
        clear = x[np.abs(x) > 0.1 * np.percentile(np.abs(x), 95.0)]
        return float(np.abs(np.diff(np.unwrap(np.angle(clear)))).sum()) / TURN_RAD
    names = [n for group in TERMINAL_VOLTAGES.alternatives if len(group) == 1 for n in group]
    most = 0.0
    for name in (n for n in names if capture.has(n)):
        voltage = capture.finite(name)[name]
        clear = voltage[np.abs(voltage) > 0.3 * np.percentile(np.abs(voltage), 95.0)]
        changes = int(np.count_nonzero(np.diff(np.sign(clear))))
        most = max(most, 0.5 * (changes - 1))
    return most


def _hand_turn(capture: Capture, options: Mapping[str, float]) -> Passed:
    largest = max(
        float(np.nanmax(np.abs(capture.arrays(n)[n]))) for n in LINE_VOLTAGES if capture.has(n)
    )
    if largest == 0.0:
        raise CaptureError(CODE, "there is no back-EMF", "turn the shaft, terminals open")
    return _whole_turn(capture, options)


def _locked_angles(capture: Capture, options: Mapping[str, float]) -> Passed:
    angles = capture.finite("theta_elec_deg")["theta_elec_deg"]
    folded = np.unique(np.mod(np.round(angles, 3), 180.0))
    if folded.size >= options["rotor_angles"] or capture.has("lab_h", "lbc_h", "lca_h"):
        return Passed()
    remedy = "record at least three rotor angles spread over 180° electrical, or all three pairs"
    words = f"{folded.size} rotor angles (modulo 180° electrical) do not fix L_d, L_q and the axis"
    if folded.size < 2:
        raise CaptureError(CODE, words, remedy)
    return Passed(findings=(warning(capture, CODE, words, remedy),))


LOOKS: dict[str, Callable[[Capture, Mapping[str, float]], Passed]] = {
    "cogging": _whole_turn,
    "holding_current": _whole_turn,
    "hand_turn": _hand_turn,
    "open_circuit": _electrical_turn,
    "lcr": _locked_angles,
}

GATE = Gate(
    CODE,
    tuple(LOOKS),
    check,
    {
        # Orders of a turn are orthogonal over a whole one; a twentieth short costs 5 %.
        "turns": 0.95,
        # One cycle is the least that has an amplitude.
        "cycles": 1.0,
        # L(theta) = mean + amplitude cos(2 theta + phase): three unknowns.
        "rotor_angles": 3.0,
    },
    follows=("stuck_channel", "wrapped_angle"),
)
