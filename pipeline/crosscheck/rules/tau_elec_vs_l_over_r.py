"""The current's own time constant against L over R of the datasheet."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from pipeline.crosscheck.judge import judge_ratio, not_evaluated
from pipeline.crosscheck.protocol import Rule
from pipeline.physics.conventions import copper_resistance_ohm, terminal_inductance_h
from pipeline.records.capture import Campaign, Capture
from pipeline.records.constants import Constants
from pipeline.records.datasheet import Check
from pipeline.records.uncertainty import propagate, standard_uncertainty

NAME = "tau_elec_vs_l_over_r"
Array = NDArray[np.float64]


def check(constants: Constants, campaign: Campaign, options: Mapping[str, float]) -> Check:
    """The smallest step on each rotor position, its area over its height, over L/R.

    (i_end - i) integrated from any instant of an exponential is tau (i_end - i there): no
    voltage, no gain and no edge enters, so this sees what L and R cannot say of themselves (an
    open delta, a lossy core, a drooping supply).
    """
    ld, lq = constants.best("ld_h"), constants.best("lq_h")
    r_phase = constants.best("r_phase_ohm")
    if ld is None or lq is None or r_phase is None:
        return not_evaluated(NAME, "needs ld_h, lq_h and r_phase_ohm")
    ratios: list[float] = []
    for capture in _smallest_steps(campaign):
        expected = _expected_s(capture, ld.number, lq.number, r_phase.number)
        ratios += [tau / expected for tau in step_time_constants_s(*_trace(capture))]
    if len(ratios) < 2:
        return not_evaluated(NAME, "needs current_step captures that settle within the recording")
    budget = propagate(
        [
            (0.5 / ld.number, ld.budget),
            (0.5 / lq.number, lq.budget),
            (-1.0 / r_phase.number, r_phase.budget),
        ]
    )
    scatter = float(np.std(ratios, ddof=1)) / math.sqrt(len(ratios))
    u = math.hypot(standard_uncertainty(budget), scatter)
    return judge_ratio(
        NAME,
        float(np.mean(ratios)),
        u,
        options["allowance"],
        "time constant of the current step over L/R",
        otherwise="resistance in the leads of the step test, or eddy currents",
    )


def step_time_constants_s(t_s: Array, v_v: Array, i_a: Array) -> list[float]:
    """Time constants [s] of each step of a trace [n] that settles before the next step.

    An edge is where the voltage moves by more than half of its largest move between samples. A
    segment counts if its last fifth is level within 2 % of the step, and if the time constant
    fits into it five times.
    """
    moves = np.abs(np.diff(v_v))
    edges = np.flatnonzero(moves > 0.5 * moves.max()) + 1
    found = []
    for start, stop in zip(edges, [*edges[1:], v_v.size], strict=True):
        t, i = t_s[start : stop - 1], i_a[start : stop - 1]
        if t.size < 50:
            continue
        tail = i[-t.size // 5 :]
        end = float(tail.mean())
        height = end - float(i[0])
        halves = abs(float(tail[: tail.size // 2].mean() - tail[tail.size // 2 :].mean()))
        if abs(height) < 20.0 * float(tail.std()) or halves > 0.02 * abs(height):
            continue
        tau = float(np.trapezoid(end - i, t)) / height
        if 0.0 < tau < (t[-1] - t[0]) / 5.0:
            found.append(tau)
    return found


def _smallest_steps(campaign: Campaign) -> list[Capture]:
    """The capture of least current at each pair and rotor position: the least saturated."""
    smallest: dict[tuple[str, float], tuple[float, Capture]] = {}
    for capture in campaign.of("current_step"):
        meta = capture.meta
        if meta.pair is None or meta.theta_elec_deg is None:
            continue
        height = float(np.nanmax(np.abs(_trace(capture)[2])))
        place = (meta.pair, meta.theta_elec_deg)
        if place not in smallest or height < smallest[place][0]:
            smallest[place] = (height, capture)
    return [capture for _, (_, capture) in sorted(smallest.items())]


def _trace(capture: Capture) -> tuple[Array, Array, Array]:
    pair = capture.meta.pair or "ab"
    data = capture.arrays("t_s", f"v{pair}_v", f"i{pair[0]}_a")
    return data["t_s"], data[f"v{pair}_v"], data[f"i{pair[0]}_a"]


def _expected_s(capture: Capture, ld_h: float, lq_h: float, r_phase_ohm: float) -> float:
    meta = capture.meta
    theta_rad = math.radians(meta.theta_elec_deg or 0.0)
    l_h = float(terminal_inductance_h(ld_h, lq_h, theta_rad, meta.pair or "ab"))
    temp_degc = meta.ambient_degc if meta.ambient_degc is not None else 25.0
    if capture.has("temp_winding_degc"):
        temp_degc = float(np.nanmean(capture.arrays("temp_winding_degc")["temp_winding_degc"]))
    return l_h / (2.0 * float(copper_resistance_ohm(r_phase_ohm, temp_degc, 25.0)))


RULE = Rule(NAME, check, {"allowance": 0.04}, tests=("current_step", "resistance"))
