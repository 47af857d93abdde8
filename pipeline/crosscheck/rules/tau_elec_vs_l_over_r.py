"""The current's own time constant against L over R of the datasheet."""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import pairwise

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
    """The smallest current step on each rotor position, its time constant over L/R.

    Only the shape of the current enters, no voltage and no gain, so this sees what L and R cannot
    say of themselves: an open delta, a lossy core, resistance in the leads.
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
    """Time constants [s] of each step of a trace [n], by the integral form of an exponential.

    i(t) = c + i_end t/tau - (1/tau) integral of i dt is linear in c, i_end/tau and 1/tau; nothing
    is differentiated, and the current need not settle. An edge is where the voltage moves by more
    than half of its largest move between samples. A segment counts if it spans three time
    constants and its current moves by 20 times what the line leaves over.
    """
    moves = np.abs(np.diff(v_v))
    edges = np.flatnonzero(moves > 0.5 * moves.max(initial=0.0)) + 1
    found = []
    for start, stop in pairwise([*edges, v_v.size]):
        t, i = t_s[start : stop - 1] - t_s[start], i_a[start : stop - 1]
        if t.size < 50:
            continue
        area = np.concatenate([[0.0], np.cumsum(0.5 * (i[1:] + i[:-1]) * np.diff(t))])
        columns = np.column_stack([np.ones(t.size), t, area])
        beta = np.linalg.lstsq(columns, i, rcond=None)[0]
        left = float(np.std(i - columns @ beta))
        moved = float(np.ptp(columns @ beta))
        if beta[2] < 0.0 and -1.0 / beta[2] < t[-1] / 3.0 and moved > 20.0 * left:
            found.append(-1.0 / float(beta[2]))
    return found


def _smallest_steps(campaign: Campaign) -> list[Capture]:
    """The capture of least current at each pair and rotor position: the least saturated."""
    smallest: dict[tuple[str, float], tuple[float, Capture]] = {}
    for capture in campaign.of("current_step"):
        meta = capture.meta
        if meta.pair is None or meta.theta_elec_deg is None:
            continue
        height = float(np.max(np.abs(_trace(capture)[2]), initial=0.0))
        place = (meta.pair, meta.theta_elec_deg)
        if place not in smallest or height < smallest[place][0]:
            smallest[place] = (height, capture)
    return [capture for _, (_, capture) in sorted(smallest.items())]


def _trace(capture: Capture) -> tuple[Array, Array, Array]:
    """Time, voltage and current of the pair, by whichever of its two lines; blanks left out.

    KeyError where the capture holds neither line's current.
    """
    pair = capture.meta.pair or "ab"
    line = next((p for p in pair if capture.has(f"i{p}_a")), pair[0])
    names = ("t_s", f"v{pair}_v", f"i{line}_a")
    data = capture.arrays(*names)
    t_s, v_v, i_a = (data[name] for name in names)
    there = np.isfinite(v_v) & np.isfinite(i_a)
    sign = 1.0 if line == pair[0] else -1.0
    return t_s[there], v_v[there], sign * i_a[there]


def _expected_s(capture: Capture, ld_h: float, lq_h: float, r_phase_ohm: float) -> float:
    meta = capture.meta
    theta_rad = math.radians(meta.theta_elec_deg or 0.0)
    l_h = float(terminal_inductance_h(ld_h, lq_h, theta_rad, meta.pair or "ab"))
    temp_degc = meta.ambient_degc if meta.ambient_degc is not None else 25.0
    if capture.has("temp_winding_degc"):
        temp_degc = float(np.nanmean(capture.arrays("temp_winding_degc")["temp_winding_degc"]))
    return l_h / (2.0 * float(copper_resistance_ohm(r_phase_ohm, temp_degc, 25.0)))


RULE = Rule(NAME, check, {"allowance": 0.04}, tests=("current_step", "resistance"))
