"""What `regress` answers: whether a lot, or a version of the code, still gives the same."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from pipeline.records.lot_constant import ConstantResult, Side, Verdict
from pipeline.records.plain_form import PlainRecord, plain_fields

SCHEMA = "lot-regression/1"


@dataclass(frozen=True, slots=True)
class Group:
    """What a selector took from the registry: one version a motor, by lots in order of time."""

    side: Side
    selector: str
    motors: int
    lots: tuple[str, ...]
    stations: tuple[str, ...]
    motor_types: tuple[str, ...]
    code_versions: tuple[str, ...]
    versions: tuple[str, ...]
    left_out: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class LimitsUsed:
    """The limits file and the rules in force: levels, guard band, how many lots a test needs."""

    name: str
    sha256: str
    rule: str
    alpha: float
    min_lots: int


@dataclass(frozen=True, slots=True)
class EffectChange:
    """How many motors of each side show an effect or a cogging order.

    Attributes
    ----------
    name
        An effect of the library, such as `stribeck`, or `cogging_order_N`.
    source
        Whether diagnoses or datasheets show it.
    verdict, why
        Of this effect.
    baseline_shown, baseline_of, candidate_shown, candidate_of
        Motors that show it, and motors that could.
    p_value, p_holm
        Of Fisher's exact test over motors, and after Holm's correction.
    baseline_amplitude, candidate_amplitude, unit
        Means over the motors that show it.
    motors
        Candidate motors that show it.

    """

    name: str
    source: Literal["diagnosis", "datasheet"]
    verdict: Verdict
    why: str
    baseline_shown: int
    baseline_of: int
    candidate_shown: int
    candidate_of: int
    p_value: float | None = None
    p_holm: float | None = None
    baseline_amplitude: float | None = None
    candidate_amplitude: float | None = None
    unit: str = ""
    motors: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class OrderLevel:
    """Cogging amplitude of one order over a side's motors [N·m], and how many show it."""

    side: Side
    order: int
    mean: float
    sd: float | None
    shown: int
    motors: int


@dataclass(frozen=True, slots=True)
class CoggingBand:
    """Cogging torque over angle: mean over motors ± one standard deviation [N·m], [n] each.

    Each motor's wave, the sum of its orders, is turned so that the crests of the leading order
    meet.
    """

    side: Side
    motors: int
    theta_mech_rad: tuple[float, ...]
    mean_nm: tuple[float, ...]
    low_nm: tuple[float, ...]
    high_nm: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Outlier:
    """A motor apart from its lot in one constant, and the capture that shows it."""

    motor_id: str
    lot: str
    side: Side
    constant: str
    value: float
    unit: str
    z: float
    capture: str | None
    why: str


@dataclass(frozen=True, slots=True)
class LotRegression(PlainRecord):
    """One comparison of lots, or of two versions of the code on the same captures.

    Attributes
    ----------
    mode
        `lots`, or `code`, motor by motor.
    verdict, headline, reasons
        The result, one sentence on it, and what led to it.
    history
        `INSUFFICIENT_HISTORY` where the baseline has too few lots for the lot-level test, whatever
        limits and equivalence decide without it.
    baseline, candidate
        The two groups.
    limits
        The limits in force.
    constants, effects
        Results of each constant and each effect.
    orders, cogging
        Cogging amplitudes by order, and the wave over the angle.
    outliers
        Motors apart from their lot.
    golden, notes
        Golden motors that were used; remarks.

    """

    mode: Literal["lots", "code"]
    verdict: Verdict
    headline: str
    reasons: tuple[str, ...]
    history: Literal["sufficient", "INSUFFICIENT_HISTORY"]
    baseline: Group
    candidate: Group
    limits: LimitsUsed
    constants: tuple[ConstantResult, ...]
    effects: tuple[EffectChange, ...]
    orders: tuple[OrderLevel, ...] = ()
    cogging: tuple[CoggingBand, ...] = ()
    outliers: tuple[Outlier, ...] = ()
    golden: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    def document(self) -> dict[str, Any]:
        """The JSON form, schema lot-regression/1."""
        return {"schema": SCHEMA, **plain_fields(self)}
