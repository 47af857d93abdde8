"""One constant of two groups of lots held against each other: what was found, on what grounds.

Numbers are None where they could not be had. Values are at the reference temperature of the
constant and, where golden motors allow it, corrected for their station's bias.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Verdict = Literal[
    "pass",
    "marginal",
    "fail",
    "undecided",
    "not_evaluated",
    "INSUFFICIENT_HISTORY",
    "CONFOUNDED",
]
Side = Literal["baseline", "candidate"]
MOST_RELATIVE = 2.0
"""Change over the baseline above which it is given in the constant's own unit, not in percent."""
Decision = Literal["pass", "conditional_pass", "conditional_fail", "fail", "not_evaluated"]


@dataclass(frozen=True, slots=True)
class MotorValue:
    """The value of one motor, and how the limits judge it.

    Attributes
    ----------
    motor_id, lot, side, stations
        The motor, and where it was measured.
    value, u
        At the reference temperature, corrected for the station, with its standard uncertainty
        [unit].
    correction
        Bias of the station that was taken off [unit].
    decision
        By the decision rule of the limits.
    z
        Robust distance from its lot in standard deviations between motors [1].
    outlier
        Whether that distance is significant.
    capture
        The file that the value depends on most.

    """

    motor_id: str
    lot: str
    side: Side
    stations: tuple[str, ...]
    value: float
    u: float
    correction: float
    decision: Decision
    z: float | None
    outlier: bool
    capture: str | None


@dataclass(frozen=True, slots=True)
class LotMean:
    """One lot in the order of time, on the control chart of lot means.

    Attributes
    ----------
    lot, side, started_at
        The lot, and ISO 8601 time of its first capture.
    motors
        How many.
    mean, u, sd
        Mean of the motors, its standard uncertainty, and the standard deviation between motors
        [unit].
    ewma, ewma_low, ewma_high
        Exponentially weighted mean after this lot and its control limits [unit]; None without
        history to chart against.
    signal
        Whether the chart signals.

    """

    lot: str
    side: Side
    started_at: str | None
    motors: int
    mean: float
    u: float
    sd: float | None
    ewma: float | None
    ewma_low: float | None
    ewma_high: float | None
    signal: bool


@dataclass(frozen=True, slots=True)
class Bounds:
    """The limits of a constant in its unit; None on a side that is not limited.

    Attributes
    ----------
    nominal
        Nominal value [unit].
    lower, upper
        Specification limits [unit].
    accept_lower, accept_upper
        Acceptance limits [unit]: the guard band inside.
    guard_band, rule
        Width of the guard band [unit], and the decision rule.
    margin
        Largest difference of lot means that still counts as equivalent [unit].

    """

    nominal: float | None
    lower: float | None
    upper: float | None
    accept_lower: float | None
    accept_upper: float | None
    guard_band: float
    rule: str
    margin: float | None


@dataclass(frozen=True, slots=True)
class Count:
    """How many motors got a decision."""

    decision: Decision
    motors: int


@dataclass(frozen=True, slots=True)
class Conformity:
    """How many motors of the candidate conform, by decision.

    Attributes
    ----------
    counts
        Motors by decision.
    worst, worst_motor
        The worst decision, and the motor that has it.
    risk_false_accept, risk_false_reject
        Probability of a motor accepted though outside the tolerance, and rejected though inside,
        for motors distributed as the candidate's.

    References
    ----------
    JCGM 106:2012, Evaluation of measurement data: the role of measurement uncertainty in conformity
    assessment.

    """

    counts: tuple[Count, ...]
    worst: Decision
    worst_motor: str | None = None
    risk_false_accept: float | None = None
    risk_false_reject: float | None = None


@dataclass(frozen=True, slots=True)
class LotTest:
    """t test whose unit is the lot: is the candidate beyond the baseline lots' own scatter.

    `status` is INSUFFICIENT_HISTORY below `needed` baseline lots; then there is no p value.

    Attributes
    ----------
    status
        `INSUFFICIENT_HISTORY` below `needed` baseline lots; there is no p-value then.
    lots, needed
        Baseline lots that there are, and that the test needs.
    t, dof, p_value
        The statistic, its degrees of freedom, and the p-value.
    p_holm
        The p-value after Holm's correction over the constants.
    significant
        Whether that is below the level.

    """

    status: Literal["evaluated", "INSUFFICIENT_HISTORY", "CONFOUNDED", "not_evaluated"]
    lots: int
    needed: int
    t: float | None = None
    dof: float | None = None
    p_value: float | None = None
    p_holm: float | None = None
    significant: bool = False


@dataclass(frozen=True, slots=True)
class Equivalence:
    """Two one-sided tests of the difference of means against the margin of equivalence.

    Attributes
    ----------
    status
        `equivalent` where the interval lies within the margin, `different` where it lies outside,
        `undecided` where it crosses it.
    margin
        Margin of equivalence [unit].
    low, high
        Interval of the difference at level 1 − 2 α [unit].
    p_value, dof
        Of the larger of the two one-sided tests.

    """

    status: Literal["equivalent", "different", "undecided", "not_evaluated"]
    margin: float | None = None
    low: float | None = None
    high: float | None = None
    p_value: float | None = None
    dof: float | None = None


@dataclass(frozen=True, slots=True)
class EffectSize:
    """How far the candidate is from the baseline.

    Attributes
    ----------
    difference, u
        Difference of means and its standard uncertainty [unit].
    k, expanded_u
        Coverage factor, and U = k u [unit].
    relative
        Difference over the baseline's mean [1].
    in_sd
        Difference in standard deviations between motors [1].

    """

    difference: float | None = None
    u: float | None = None
    k: float | None = None
    expanded_u: float | None = None
    relative: float | None = None
    in_sd: float | None = None


@dataclass(frozen=True, slots=True)
class Power:
    """What this comparison could have seen: power for `shift` [unit], and the shift seen at 95 %.

    `by` names what sees it: the lot-level test, or the motors of the two groups alone.
    """

    by: Literal["lots", "motors", "none"]
    shift: float | None = None
    power: float | None = None
    detectable: float | None = None


@dataclass(frozen=True, slots=True)
class Capability:
    """Cp and Cpk of the candidate's motors against the tolerance, with the interval of Cpk."""

    cp: float | None
    cpk: float | None
    cpk_low: float | None
    cpk_high: float | None
    level: float


@dataclass(frozen=True, slots=True)
class Component:
    """One part of the variance: standard deviation [unit] and share; None if it is unknown."""

    name: Literal["lot", "station", "motor", "capture"]
    sd: float | None
    share: float | None
    dof: float | None
    note: str


@dataclass(frozen=True, slots=True)
class Gauge:
    """Gauge repeatability and reproducibility: analysis of variance of motors repeated on stations.

    Attributes
    ----------
    motors, stations, repeats
        Size of the study.
    repeatability, reproducibility, rr, part
        Standard deviations [unit] of one station's repeats, between stations, of both together, and
        between motors.
    percent, percent_low, percent_high
        Share of R&R in the total study variation and its interval at `level` [%].
    level
        Of the interval [1].
    verdict
        `good`, `acceptable` or `not_acceptable`.

    """

    motors: int
    stations: int
    repeats: int
    repeatability: float
    reproducibility: float
    rr: float
    part: float
    percent: float
    percent_low: float
    percent_high: float
    level: float
    verdict: Literal["good", "acceptable", "not_acceptable"]


@dataclass(frozen=True, slots=True)
class StationBias:
    """A station's bias [unit] against the mean of the linked stations, with its uncertainty.

    `by` golden motors, or lots that were measured on linked stations; `same_station` measured both
    sides, `unreferenced` is linked to nothing.
    """

    station: str
    bias: float | None
    u: float | None
    by: Literal["golden", "lots", "same_station", "unreferenced"]
    golden_motors: int


@dataclass(frozen=True, slots=True)
class ConstantResult:
    """The whole result for one constant, baseline against candidate."""

    name: str
    unit: str
    words: str
    verdict: Verdict
    why: str
    decides: bool
    temperature_degc: float | None
    motors: tuple[MotorValue, ...]
    lots: tuple[LotMean, ...]
    bounds: Bounds | None
    conformity: Conformity
    test: LotTest
    equivalence: Equivalence
    effect: EffectSize
    power: Power
    capability: Capability
    variance: tuple[Component, ...] = ()
    gauge: Gauge | None = None
    stations: tuple[StationBias, ...] = ()
    missing: tuple[str, ...] = ()

    def of(self, side: Side) -> tuple[MotorValue, ...]:
        """The motors of one side.

        Parameters
        ----------
        side
            `baseline` or `candidate`.

        """
        return tuple(motor for motor in self.motors if motor.side == side)
