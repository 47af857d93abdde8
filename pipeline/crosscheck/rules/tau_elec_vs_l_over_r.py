"""The current's own time constant against L over R of the datasheet."""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import pairwise

import numpy as np

from pipeline.crosscheck.judge import Ratio, judge_ratio, not_evaluated
from pipeline.crosscheck.protocol import Rule
from pipeline.numerics.integrals import trapezoid
from pipeline.numerics.least_squares import autocorrelation_time, linear_fit
from pipeline.physics.copper import COPPER_COEFFICIENT_25_1_K, copper_resistance_ohm
from pipeline.physics.unlogged import UNLOGGED_U_K
from pipeline.physics.windings import terminal_inductance_h
from pipeline.records.capture import Array, Campaign, Capture
from pipeline.records.constants import Constants
from pipeline.records.datasheet import Check
from pipeline.records.uncertainty import propagate, type_a, type_b

NAME = "tau_elec_vs_l_over_r"
WINDING = "temp_winding_degc"


def check(constants: Constants, campaign: Campaign, options: Mapping[str, float]) -> Check:
    """The time constant of the smallest current step on each rotor position, over L/R.

    Notes
    -----
    The mean of the ratios is judged; the option `allowance` [1] is added to its uncertainty. A
    winding whose temperature the step did not log is at ambient ± `UNLOGGED_U_K`. No gain enters
    the time constant, so this sees what L and R cannot say of themselves: an open delta, a lossy
    core, resistance between the motor and where the voltage was measured.

    """
    ld, lq = constants.best("ld_h"), constants.best("lq_h")
    r_phase = constants.best("r_phase_ohm")
    if ld is None or lq is None or r_phase is None:
        return not_evaluated(NAME, "needs ld_h, lq_h and r_phase_ohm")
    ratios: list[float] = []
    errors: list[float] = []
    unlogged = 0
    for capture in _smallest_steps(campaign):
        expected = _expected_s(capture, ld.number, lq.number, r_phase.number)
        tau_s = step_time_constant_s(*_trace(capture))
        if tau_s is not None:
            ratios.append(tau_s[0] / expected)
            errors.append(tau_s[1] / expected)
            unlogged += not capture.has(WINDING)
    if not ratios:
        return not_evaluated(NAME, "needs current_step captures that settle within the recording")
    mean = float(np.mean(ratios))
    fit = float(np.linalg.norm(errors)) / math.sqrt(len(errors))
    spread, others = float(np.std(ratios)), max(len(ratios) - 1, 1)
    scatter = max(spread, fit) / math.sqrt(others)
    dof = others if spread > fit else math.inf
    kelvin = type_b(f"assumed:{WINDING}", UNLOGGED_U_K * unlogged / len(ratios))
    budget = propagate(
        [
            (0.5 * mean / ld.number, ld.budget),
            (0.5 * mean / lq.number, lq.budget),
            (-mean / r_phase.number, r_phase.budget),
            (-mean * COPPER_COEFFICIENT_25_1_K, kelvin),
            (1.0, type_a(f"scatter:{NAME}", scatter, dof)),
        ]
    )
    return judge_ratio(
        NAME,
        Ratio.of(mean, budget),
        options["allowance"],
        "time constant of the current step over L/R",
        "time_constant",
        otherwise="resistance in the leads of the step test, or eddy currents",
    )


def step_time_constant_s(t_s: Array, v_v: Array, i_a: Array) -> tuple[float, float] | None:
    """L/R of a trace of current steps, by the integral form of L di/dt = v − R i.

    Parameters
    ----------
    t_s
        Sampling instants [n, s].
    v_v
        Measured voltage of the pair [n, V]. A supply that sags makes the current settle sooner than
        L/R, by its own resistance; a constant in place of v would take that for the motor's.
    i_a
        Current of the pair [n, A].

    Returns
    -------
    (tau, u) or None
        [s] and its standard error [s]; None where no step spans three time constants, or the
        current moves by less than 20 times what the fit leaves over.

    Notes
    -----
    i = c + (1/L) ∫v dt − (R/L) ∫i dt between edges, with one c an edge, is linear in c, 1/L and
    R/L, and no gain is in R/L. After the last edge v is −R_source i, which alone does not separate
    the two: the steps are taken together. What both channels read before the first edge is taken
    off, offsets among it. An edge is where the voltage moves by more than half of its largest move
    between samples.

    """
    moves = np.abs(np.diff(v_v))
    edges = np.flatnonzero(moves > 0.5 * moves.max(initial=0.0)) + 1
    spans = [slice(a, b) for a, b in pairwise([*edges, v_v.size]) if b - a >= 50]
    if not spans:
        return None
    volts, amps = v_v - v_v[: edges[0]].mean(), i_a - i_a[: edges[0]].mean()
    areas = [[trapezoid(t_s[s], x[s]) for s in spans] for x in (volts, amps)]
    of_step = np.repeat(np.eye(len(spans)), [s.stop - s.start for s in spans], axis=0)
    columns = np.column_stack([np.concatenate(areas[0]), np.concatenate(areas[1]), of_step])
    current = np.concatenate([amps[s] for s in spans])
    fit = linear_fit(columns, current)
    rate, scatter = -float(fit.coefficients[1]), float(np.std(fit.residuals))
    longest = max(float(t_s[s.stop - 1] - t_s[s.start]) for s in spans)
    if not fit.full_rank or rate * longest < 3.0 or np.ptp(current) < 20.0 * scatter:
        return None
    return 1.0 / rate, fit.u(1) * math.sqrt(autocorrelation_time(fit.residuals)) / rate**2


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
    t_s, v_v, i_a = capture.finite(*names, needed=names[1:]).values()
    return t_s, v_v, i_a if line == pair[0] else -i_a


def _expected_s(capture: Capture, ld_h: float, lq_h: float, r_phase_ohm: float) -> float:
    meta = capture.meta
    theta_rad = math.radians(meta.theta_elec_deg or 0.0)
    l_h = float(terminal_inductance_h(ld_h, lq_h, theta_rad, meta.pair or "ab"))
    temp_degc = meta.ambient_degc if meta.ambient_degc is not None else 25.0
    if capture.has(WINDING):
        temp_degc = float(np.nanmean(capture.arrays(WINDING)[WINDING]))
    return l_h / (2.0 * float(copper_resistance_ohm(r_phase_ohm, temp_degc, 25.0)))


RULE = Rule(
    NAME,
    check,
    {"allowance": 0.04},
    tests=("current_step", "resistance"),
    quantities=("ld_h", "lq_h", "r_phase_ohm"),
)
