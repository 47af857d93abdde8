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
    """One motor's value [unit] with its standard uncertainty, and what the limits say of it.

    `value` is corrected for the station by `correction`. `z` is its robust distance from its lot
    in standard deviations between motors; `capture` is the file that the value rests on most.
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
    """One lot in the order of time: mean over its motors, and the chart over lot means.

    `ewma` is the exponentially weighted mean after this lot, in control within `ewma_low` and
    `ewma_high`; None where there is no history to chart against.
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
    """Limits [unit]: tolerance, acceptance limits inside it (guard band off), margin of sameness.

    The specification limits are `lower` and `upper`; None on a side that is not limited.
    `margin` is the largest difference of lot means that still counts as the same.
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
    """How many candidate motors the limits pass, by decision; the worst one named.

    The risks are those of the decision rule for motors spread like the candidate's: accepted
    though outside the tolerance, and rejected though inside (JCGM 106).
    """

    counts: tuple[Count, ...]
    worst: Decision
    worst_motor: str | None
    risk_false_accept: float | None
    risk_false_reject: float | None


@dataclass(frozen=True, slots=True)
class LotTest:
    """t test whose unit is the lot: is the candidate beyond the baseline lots' own scatter.

    `status` is INSUFFICIENT_HISTORY below `needed` baseline lots; then there is no p value.
    """

    status: Literal["evaluated", "INSUFFICIENT_HISTORY", "CONFOUNDED", "not_evaluated"]
    lots: int
    needed: int
    t: float | None
    dof: float | None
    p_value: float | None
    p_holm: float | None
    significant: bool


@dataclass(frozen=True, slots=True)
class Equivalence:
    """Two one-sided tests of the difference of means against the margin.

    `low` and `high` bound the difference [unit] at 1 − 2 α. `equivalent`: wholly within the
    margin; `different`: wholly outside; `undecided`: it lies across.
    """

    status: Literal["equivalent", "different", "undecided", "not_evaluated"]
    margin: float | None
    low: float | None
    high: float | None
    p_value: float | None
    dof: float | None


@dataclass(frozen=True, slots=True)
class EffectSize:
    """Candidate minus baseline [unit] with u and U = k u; also relative, and in motor sd."""

    difference: float | None
    u: float | None
    k: float | None
    expanded_u: float | None
    relative: float | None
    in_sd: float | None


@dataclass(frozen=True, slots=True)
class Power:
    """What this comparison could have seen: power for `shift` [unit], and the shift seen at 95 %.

    `by` names what sees it: the lot-level test, or the motors of the two groups alone.
    """

    by: Literal["lots", "motors", "none"]
    shift: float | None
    power: float | None
    detectable: float | None


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
    """Gauge R&R by analysis of variance over motors repeated on stations [sd in unit].

    `percent` is the share of R&R in the total study variation, with its interval.
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
    variance: tuple[Component, ...]
    gauge: Gauge | None
    stations: tuple[StationBias, ...]
    missing: tuple[str, ...]

    def of(self, side: Side) -> tuple[MotorValue, ...]:
        """The motors of one side."""
        return tuple(motor for motor in self.motors if motor.side == side)
