"""What is missing from a model, how sure that is, and what else it could be."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

from pipeline.records.comparison import KnownCombination
from pipeline.records.error_map import ErrorMap, Histogram
from pipeline.records.plain_form import PlainRecord, plain_fields

Verdict = Literal["adequate", "missing", "unknown", "insufficient"]


class ReportedParameter(NamedTuple):
    """Value and standard uncertainty of a parameter, and their unit; None where the captures and
    the station's priors do not determine it.
    """

    value: float | None
    u: float | None
    unit: str


@dataclass(frozen=True, slots=True)
class Separation(PlainRecord):
    """An experiment that parts two effects, with the power it is predicted to have at the 1 %
    level; None where that cannot be predicted.
    """

    against: str
    experiment: str
    power: float | None


@dataclass(frozen=True, slots=True)
class RankedEffect(PlainRecord):
    """One effect's evidence. `score`: fall of the deviance less the BIC penalty of its parameters.

    `held_out_drop`: share of the removable held-out error that goes with it. `parameters`: value
    and standard uncertainty by name, where it was fitted. Of an effect that is not called for,
    `size` is its largest amplitude over the least that matters, `shortfall` why it is not named.
    `headline` is what a person says of a found one, with its size.
    """

    effect: str
    score: float
    held_out_drop: float
    p_value: float
    confused_with: tuple[str, ...]
    explanation: str
    experiment: str
    parameters: Mapping[str, ReportedParameter]
    separation: tuple[Separation, ...] = ()
    size: float | None = None
    shortfall: str = ""
    headline: str = ""

    @property
    def slight(self) -> bool:
        """Whether the captures show it, too small to matter."""
        return self.score > 0.0 and self.size is not None and self.size < 1.0


@dataclass(frozen=True, slots=True)
class RungError(PlainRecord):
    """Held-out error of one signal's window means beside their noise floor [unit]."""

    rmse: float
    noise_floor: float
    unit: str


@dataclass(frozen=True, slots=True)
class Signature(PlainRecord):
    """What came with a rung, as people look at it: mean errors of a signal [unit] without it and
    with it, [n] each, `at` values of a variable, a glossary name [its unit]. `capture` is None
    where it is of all captures together. With an `order` above 1, `at` is the angle [rad] within
    one of so many waves a turn of the variable, laid over each other.
    """

    signal: str
    unit: str
    variable: str
    capture: str | None
    at: tuple[float, ...]
    before: tuple[float, ...]
    after: tuple[float, ...]
    order: int = 1

    @property
    def x_name(self) -> str:
        """What `at` is, as a name of the glossary's form."""
        return self.variable if self.order == 1 else f"theta_in_one_of_{self.order}_waves_rad"


@dataclass(frozen=True, slots=True)
class LadderRung(PlainRecord):
    """A model's held-out error, 1 at the noise floor, and rms error of each signal [its unit].

    For looking: `errors` are those of `signals` beside their noise floors, `parameters` those of
    the effects on this rung (value, standard uncertainty, unit), `maps` where the error lives,
    `histograms` how it is spread, `signature` what gives away that which came with the rung.
    """

    effects: tuple[str, ...]
    held_out: float
    signals: Mapping[str, float]
    errors: Mapping[str, RungError] = field(default_factory=dict)
    parameters: Mapping[str, ReportedParameter] = field(default_factory=dict)
    maps: tuple[ErrorMap, ...] = field(default=())
    histograms: tuple[Histogram, ...] = field(default=())
    signature: Signature | None = None

    def map_of(self, signal: str, *variables: str) -> ErrorMap | None:
        """The map of a signal over one variable, or over x and y."""
        for one in self.maps:
            axes = (one.x.variable,) if one.y is None else (one.x.variable, one.y.variable)
            if one.signal == signal and axes == variables:
                return one
        return None


@dataclass(frozen=True, slots=True)
class Remainder(PlainRecord):
    """One place where error over the noise floor is left: χ²/n, its size [unit of signal], and
    whether that is as much as anybody would act on.
    """

    capture: str
    signal: str
    order: float
    chi2_per_n: float
    size: float
    matters: bool = True


@dataclass(frozen=True, slots=True)
class CurvePoint(PlainRecord):
    """A curve at one place: value and 95 % band [unit of the curve]."""

    at: float
    value: float
    low: float
    high: float


class SketchTerm(NamedTuple):
    """A term of an unknown structure, and its coefficient [unit]."""

    term: str
    coefficient: float
    unit: str


class AlternativeVariables(NamedTuple):
    """Variables that explain nearly as much, with their share of the held-out evidence [1]."""

    variables: tuple[str, ...]
    share: float


@dataclass(frozen=True, slots=True)
class UnknownStructure(PlainRecord):
    """Error that no known effect explains: where it acts, on what it depends, its shape.

    `curve` runs over the first of `variables`, temperatures counted from 25 degC; `times` is what
    multiplies it. `alternatives`: variables that explain nearly as much, with their share of the
    held-out evidence. `effect` is the name of an effect whose file has the text `source`.
    """

    signal: str
    variables: tuple[str, ...]
    shape: str
    sketch: tuple[SketchTerm, ...]
    expression: str = ""
    curve: tuple[CurvePoint, ...] = ()
    times: str = ""
    alternatives: tuple[AlternativeVariables, ...] = ()
    effect: str = ""
    source: str = ""

    def document(self) -> dict[str, Any]:
        """The JSON form of `contract/outputs.md`; `source` has a file of its own."""
        written = plain_fields(self)
        del written["source"]
        return written


@dataclass(frozen=True, slots=True)
class Unexcited(PlainRecord):
    """An effect of which these captures can say nothing: the tests that would show it, by name,
    what to do in them, and the signals that the captures of these tests lack.
    """

    effect: str
    tests: tuple[str, ...]
    experiment: str
    signals: tuple[str, ...] = ()

    @property
    def words(self) -> str:
        """What to record, in one line."""
        tests = " or ".join(self.tests)
        tests += f" with {' and '.join(self.signals)}" if self.signals else ""
        return f"no test here excites {self.effect}: record {tests} ({self.experiment})"


@dataclass(frozen=True, slots=True)
class Diagnosis(PlainRecord):
    """The verdict on one motor's model, with the ladder that leads to it.

    `asked`: effects that were asked for beside the `model`'s own; the first rung holds them.
    `combinations` are known where their parameters, on the last rung, are not. `policy`: digest of
    the constants of judgement.
    """

    motor_id: str
    model: str
    verdict: Verdict
    missing: tuple[str, ...]
    ranking: tuple[RankedEffect, ...]
    ladder: tuple[LadderRung, ...]
    unknown: UnknownStructure | None
    remainder: tuple[Remainder, ...]
    notes: tuple[str, ...]
    unexcited: tuple[Unexcited, ...] = ()
    asked: tuple[str, ...] = ()
    combinations: tuple[KnownCombination, ...] = ()
    policy: str = ""

    @property
    def whole_model(self) -> str:
        """The model as asked for, in words."""
        signs = (f"- {name[1:]}" if name.startswith("-") else f"+ {name}" for name in self.asked)
        return " ".join((f"model {self.model}", *signs))

    def document(self) -> dict[str, Any]:
        """The JSON form of `contract/outputs.md`, schema model-diagnosis/1."""
        notes = [*self.notes, *(one.words for one in self.unexcited)]
        return {**plain_fields(self), "schema": "model-diagnosis/1", "notes": notes}
