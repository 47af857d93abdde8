"""What voltage a speed and an acceleration take, from a drive log without current: kS, kV, kA."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from pipeline.estimation.mechanical.shaft_rows import quiet_windows
from pipeline.estimation.method import Method
from pipeline.estimation.policy import policy
from pipeline.estimation.protocol import Estimator, Fit
from pipeline.estimation.uncertainty.instruments import (
    instrument_uncertainties,
    unstated_note,
    voltage_source,
)
from pipeline.estimation.uncertainty.regimes import (
    Partition,
    Regression,
    disagreement,
    halves,
    scatter,
    signs,
)
from pipeline.numerics.least_squares import LinearFit, fit_by_groups, linear_fit
from pipeline.numerics.shaft_log import shaft_log
from pipeline.numerics.weak_rows import LEAST_SAMPLES, WeakRows, smooth_speed
from pipeline.physics.glossary import Term
from pipeline.records.capture import Array, Campaign, Capture, Indices
from pipeline.records.constants import Constants
from pipeline.records.estimate import Estimate
from pipeline.records.evidence import Evidence
from pipeline.records.uncertainty import Contribution

TERMS = (
    Term("ks_v", "V", "q voltage against dry friction: R T_c / Kt", "constant", -1e3, 1e3),
    Term("kv_v_s_rad", "V·s/rad", "q voltage per speed: Ke + R B / Kt", "constant", 0.0, 1e3),
    Term("ka_v_s2_rad", "V·s²/rad", "q voltage per acceleration: R J / Kt", "constant", 0.0, 1e3),
    Term("voltage_delay_s", "s", "by how much the motion follows the voltage late", "constant",
         -1.0, 1.0),
)  # fmt: skip
GIVES = tuple(term.name for term in TERMS)
METHOD = Method("feedforward", TERMS)
# Columns of `voltage`: of all four, and of those that a log too slow for kA determines.
WHOLE, WITHOUT_ACCELERATION = (0, 1, 2, 3), (0, 1, 3)
EXPERIMENT = (
    "record a drive with vq_v and theta_mech_rad at several speeds of both senses, and with steps "
    "of voltage, sampled ten times in the time that the speed takes to follow"
)


@dataclass(frozen=True, slots=True)
class Part:
    """One log [n] on its own clock, with its windows; `quiet` says that they resolve dω/dt."""

    capture: Capture
    t_s: Array
    voltage_v: Array
    theta_rad: Array
    speed_rad_s: Array
    weak: WeakRows
    quiet: bool

    @property
    def since_pause_s(self) -> Array:
        """Time since the log began or went on after a pause [n, s]."""
        gaps = np.diff(self.t_s, prepend=-np.inf)
        first = gaps > 0.25 * float(np.ptp(self.t_s[: int(self.weak.sizes[0])]))
        begins = np.maximum.accumulate(np.where(first, np.arange(self.t_s.size), 0))
        return self.t_s - self.t_s[begins]


@dataclass(frozen=True, slots=True)
class Rows:
    """Window means [w] of several logs: the columns of `voltage`, and what they belong to."""

    design: Array
    voltage_v: Array
    capture: Indices
    cluster: Indices
    time_s: Array


@dataclass(frozen=True, slots=True)
class Solved:
    """The fit of the rows, their noise [w, V] and the delay about which they were linearised."""

    rows: Rows
    fit: LinearFit
    sigma: Array
    delay_s: float


def voltage(part: Part, delay_s: float) -> tuple[Array, Array]:
    """The derivatives of a log's voltage by what is fitted: it is linear in all four.

    Parameters
    ----------
    part
        The log.
    delay_s
        Delay about which the equation is linearised.

    Returns
    -------
    design : array [w, 4]
        Columns of kS [1], kV [rad/s], kA [rad/s²] and of what the delay is longer [V/s].
    voltage_v : array [w], V
        Window means of the voltage, `delay_s` earlier.

    Notes
    -----
    v(t - τ) = kS sign(ω) + kV ω + kA dω/dt, and v(t - τ - δ) = v(t - τ) - δ dv/dt.

    It follows from v = R i + Ke ω and J dω/dt = Kt i - T_c sign(ω) - B ω, where the current
    settles much sooner than the speed: kS = R T_c / Kt, kV = Ke + R B / Kt, kA = R J / Kt. All
    derivatives are those of windows (weak form).

    References
    ----------
    WPILib, System Identification: the permanent-magnet DC motor feedforward equation.
    Messenger and Bortz, Multiscale Model. Simul. 19(3), 2021, 1474, doi:10.1137/20M1343166.

    """
    weak = part.weak
    early = np.interp(part.t_s - delay_s, part.t_s, part.voltage_v)
    columns = [
        weak.integral(np.sign(part.speed_rad_s)),
        weak.integral(part.theta_rad, 1),
        weak.integral(part.theta_rad, 2),
        weak.integral(early, 1),
    ]
    return np.column_stack(columns), weak.integral(early)


def fit(campaign: Campaign, known: Constants, options: Mapping[str, float]) -> Fit:
    """kS, kV, kA and the delay by `voltage` over the windows of all drives without current.

    The delay is that of least deviance, from none to the longest of the policy, then by a few
    rounds. Windows in which the shaft may stand are left out, for the sign of friction is not known
    there; so are those that follow a pause by less than the delay, whose voltage is not recorded.
    What regimes of the rows disagree by beyond chance is in
    the uncertainty. Nothing else is corrected: all hold at the winding's and the magnets'
    temperature of the log, and with whatever load it had. Logs count by what they leave.
    """
    parts = [p for p in map(_part, campaign.of("drive")) if p is not None]
    if not parts:
        note = "of drives of voltage and motion alone; current tells j_rotor_kgm2 and more"
        return METHOD.nothing(GIVES, note)
    solved = _solve(parts, WHOLE)
    if isinstance(solved, str):
        return METHOD.nothing(GIVES, f"{solved}; {EXPERIMENT}")
    return Fit(tuple(_estimates(parts, solved, options["level"])), _plots(parts, solved))


def _solve(parts: Sequence[Part], columns: Sequence[int]) -> Solved | str:
    """The fit of some of the columns of `voltage`, about its own delay; or why there is none.

    The voltage is no straight line over longer delays, so the one of least deviance is sought.
    """
    width = min(float(np.ptp(p.t_s[: int(p.weak.sizes[0])])) for p in parts)
    longest = policy().shaft_rows.longest_delay_s
    delays = np.linspace(0.0, longest, max(2, round(4.0 * longest / width) + 1))
    solved = [_about(parts, columns, float(delay)) for delay in delays]
    scored = [one for one in solved if isinstance(one, Solved)]
    if isinstance(solved[0], str) or not scored:
        return str(solved[0])
    best = min(scored, key=lambda one: float(np.mean(np.log(one.sigma))))
    for _ in range(6):
        delay = best.delay_s + float(best.fit.coefficients[-1])
        nearer = _about(parts, columns, delay) if abs(delay) <= longest else ""
        if not isinstance(nearer, Solved) or abs(delay - best.delay_s) < 1e-6 * width:
            break
        best = nearer
    return best


def _about(parts: Sequence[Part], columns: Sequence[int], delay_s: float) -> Solved | str:
    """The fit linearised about a delay [s], or why there is none."""
    rows = _rows(parts, delay_s, columns)
    if rows.voltage_v.size < policy().evidence.rows:
        return f"{rows.voltage_v.size} windows at speed"
    sigma = _noise_v(rows)
    solution = linear_fit(rows.design, rows.voltage_v, sigma)
    if not solution.full_rank:
        return "speed and voltage stay as they are"
    return Solved(rows, solution, sigma, delay_s)


def _part(capture: Capture) -> Part | None:
    """The log where it holds voltage and motion, and neither current nor a load's torque."""
    log = None if capture.has("iq_a") else shaft_log(capture, "vq_v")
    if log is None or log.t_s.size < 3 * LEAST_SAMPLES:
        return None
    try:
        weak, quiet = quiet_windows(log.t_s, log.theta_rad, 1.5 * LEAST_SAMPLES * log.period_s)
        speed = smooth_speed(log.t_s, log.theta_rad, max(0.005, 10.0 * log.period_s))
    except ValueError:
        return None
    return Part(capture, log.t_s, log.data["vq_v"], log.theta_rad, speed, weak, quiet)


def _rows(parts: Sequence[Part], delay_s: float, columns: Sequence[int]) -> Rows:
    fastest = max(float(np.max(np.abs(p.speed_rad_s))) for p in parts)
    pieces = []
    for index, part in enumerate(parts):
        design, volts = voltage(part, delay_s)
        weak = part.weak
        ends = zip(weak.starts, weak.starts + weak.sizes, strict=True)
        slowest = np.array([np.min(np.abs(part.speed_rad_s[a:b])) for a, b in ends])
        turning = slowest > policy().shaft_rows.slowest_share * fastest
        turning &= part.since_pause_s[weak.starts] >= delay_s
        cluster = weak.clusters(policy().evidence.cluster_s, index)
        number = np.full(weak.count, index)
        piece = [design[:, columns], volts, number, cluster, weak.centres_s]
        pieces.append([column[turning] for column in piece])
    return Rows(*(np.concatenate(one) for one in zip(*pieces, strict=True)))


def _noise_v(rows: Rows) -> Array:
    """Standard deviation [w] of each row: one a log, by what a fit of all leaves of it."""
    captures = [rows.capture == index for index in np.unique(rows.capture)]
    return fit_by_groups(rows.design, rows.voltage_v, captures, 3, alone=False)[1]


def _partitions(rows: Rows, paths: Sequence[str], weights: Array) -> list[Partition]:
    """Regimes of the rows by speed, sense, acceleration and capture."""
    speed, every = rows.design[:, 1], np.ones(rows.voltage_v.size, dtype=bool)
    gaining = rows.design[:, 2] * np.sign(speed)
    return [
        halves("speed", np.abs(speed), "slow", "fast", weights, every),
        signs("sense of rotation", speed, "backward", "forward", every),
        signs("acceleration", gaining, "braking", "accelerating", every),
        Partition("capture", rows.capture, tuple(f"in {path}" for path in paths)),
    ]


def _estimates(parts: Sequence[Part], solved: Solved, level: float) -> list[Estimate]:
    rows, solution = solved.rows, solved.fit
    used = [part.capture for part in parts]
    regression = Regression(rows.design, rows.voltage_v, solved.sigma, rows.cluster)
    deviation, dof = scatter(regression, solution, policy().shaft_rows.overlap)
    values = [*(float(c) for c in solution.coefficients[:3]), solved.delay_s]
    split = partial(_partitions, rows, [c.path for c in used])
    gains = _gains(used)
    notes = [
        f"{rows.voltage_v.size} windows, {np.std(solution.residuals):.2g} V left; "
        "at the temperatures and the load of the log",
        unstated_note(used, ("voltage",)),
    ]
    at = {"omega_mech_rad_s": float(np.max(np.abs(rows.design[:, 1])))}
    significant = solution.coefficients[:3] > policy().evidence.sigmas * deviation[:3]
    if not significant[1]:
        why = f"voltage and speed do not go together; {EXPERIMENT}"
        return [METHOD.missing(name, why) for name in GIVES]
    clear = significant[2] and _resolved(parts, values) and all(p.quiet for p in parts)
    missing = {} if clear else _hidden(parts)
    estimates = []
    for k, (name, value) in enumerate(zip(GIVES, values, strict=True)):
        u = float(deviation[k])
        if name in missing:
            fitted = f"{value:.3g} ± {u:.2g} {METHOD.unit(name)} by the fit"
            estimates.append(METHOD.missing(name, f"{fitted}; {missing[name]}"))
            continue
        contributions = [METHOD.scatter(name, u, float(dof[k]))]
        doubt = disagreement(regression, k, split, level) if k < 3 else None
        words = []
        if doubt is not None:
            contributions.append(doubt.part(f"{METHOD.name}:{name}", value))
            words.append(doubt.words("the value"))
        if k == 3:
            between = float(np.mean([_between_rows_s(part) for part in parts]))
            contributions.append(Contribution("instant of the voltage's steps", between, "B"))
        else:
            contributions += [Contribution(s, value * u_rel, "B") for s, u_rel in gains.items()]
        estimates.append(METHOD.measured(name, value, contributions, used, at, [*words, *notes]))
    return estimates


def _gains(used: Sequence[Capture]) -> dict[str, float]:
    """Relative standard uncertainty of each voltmeter's gain, times its share of the captures."""
    gains = instrument_uncertainties(used, ("voltage",))
    sources = [voltage_source(c.meta) for c in used]
    return {s: u_rel * sources.count(s) / len(sources) for s, u_rel in gains.items()}


def _between_rows_s(part: Part) -> float:
    """Standard uncertainty [s] of the instant at which a logged voltage changes.

    Notes
    -----
    A step that is in the log from one row to the next was anywhere between them, T/√12, and always
    at the same place where log and drive go by one clock. Of a voltage that changes steadily each
    row is known. How much of what changes are steps, the correlation of increments says that
    follow each other: 1 of a ramp, 0 of steps.

    """
    steps, gaps = np.diff(part.voltage_v), np.diff(part.t_s)
    period = float(np.median(gaps))
    steps[gaps > 1.5 * period] = 0.0
    steady = float(steps[1:] @ steps[:-1]) / (float(steps @ steps) or 1.0)
    return min(1.0, 1.0 - steady) * period / math.sqrt(12.0)


def _resolved(parts: Sequence[Part], values: Sequence[float]) -> bool:
    """Whether the third coefficient is more than a few sampling periods of the second."""
    period = max(float(np.median(np.diff(p.t_s))) for p in parts)
    return values[2] > policy().shaft_rows.resolved_periods * period * values[1]


def _hidden(parts: Sequence[Part]) -> dict[str, str]:
    """Why kA and the delay are not determined.

    Where the speed follows sooner than the log shows, dω/dt is dv/dt / kV: then only the sum of
    the time constant kA / kV and the delay is determined.
    """
    late = _solve(parts, WITHOUT_ACCELERATION)
    value = "" if isinstance(late, str) else f" = about {late.delay_s:.2g} s"
    note = f"only ka_v_s2_rad / kv_v_s_rad + voltage_delay_s{value} is seen; {EXPERIMENT}"
    return dict.fromkeys(("ka_v_s2_rad", "voltage_delay_s"), note)


def _plots(parts: Sequence[Part], solved: Solved) -> tuple[Evidence, ...]:
    rows = solved.rows
    captures = [part.capture for part in parts]
    title = "Voltage by speed and acceleration"
    columns = rows.capture, rows.time_s, rows.voltage_v, rows.voltage_v - solved.fit.residuals
    return tuple(METHOD.traces(captures, title, "vq_v", columns, "window means"))


ESTIMATOR = Estimator(
    name=METHOD.name,
    gives=GIVES,
    tests=("drive",),
    experiment=EXPERIMENT,
    fit=fit,
    rank=40,
    terms=TERMS,
    clock_powers={"kv_v_s_rad": 1, "ka_v_s2_rad": 2, "voltage_delay_s": 1},
    options={"level": 0.001},
)
