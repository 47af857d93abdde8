"""What is missing from a model, how sure that is, and what else it could be."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

from pipeline.records.comparison import KnownCombination
from pipeline.records.error_map import ErrorMap, Histogram
from pipeline.records.field_kinds import Extension, Name, Share, Spread
from pipeline.records.plain_form import PlainRecord, plain_fields

Verdict = Literal["adequate", "missing", "unknown", "insufficient"]


class ReportedParameter(NamedTuple):
    """Value and standard uncertainty of a parameter, and their unit; None where the captures and
    the station's priors do not determine it.
    """

    value: float | None
    u: Spread | None
    unit: Name


@dataclass(frozen=True, slots=True)
class Separation(PlainRecord):
    """An experiment that separates two effects.

    Attributes
    ----------
    against
        The other effect.
    experiment
        What to record, in one line.
    power
        Predicted power at the 1 % level [1]; None where it cannot be predicted.

    """

    against: str
    experiment: str
    power: float | None


@dataclass(frozen=True, slots=True)
class RankedEffect(PlainRecord):
    """The evidence for one effect.

    Attributes
    ----------
    effect
        Its name.
    score
        Fall of the deviance (−2 log L) less the BIC penalty of its parameters [1].
    held_out_drop
        Share of the removable held-out error that goes with it [1].
    p_value
        Chance of such a score without the effect.
    confused_with
        Names of effects that explain the same within uncertainty.
    explanation, experiment
        What it does, and the test that would show it best.
    parameters
        Value, standard uncertainty and unit by name, where it was fitted.
    separation
        Experiments that would separate it from others.
    size
        Largest amplitude over the least that matters [1]; of an effect that is not missing.
    shortfall
        Why it is not reported as missing.
    headline
        One phrase with its size, for people.

    """

    effect: Name
    score: float
    held_out_drop: float
    p_value: Share
    confused_with: tuple[Name, ...]
    explanation: str
    experiment: str
    parameters: Extension[Mapping[str, ReportedParameter]]
    separation: Extension[tuple[Separation, ...]] = ()
    size: Extension[float | None] = None
    shortfall: Extension[str] = ""
    headline: Extension[str] = ""

    @property
    def slight(self) -> bool:
        """Whether the captures show it, too small to matter."""
        return self.score > 0.0 and self.size is not None and self.size < 1.0


@dataclass(frozen=True, slots=True)
class StepError(PlainRecord):
    """Held-out error of one signal's window means beside their noise floor [unit]."""

    rmse: Spread
    noise_floor: Spread
    unit: str


@dataclass(frozen=True, slots=True)
class Signature(PlainRecord):
    """The mean error of a signal over what it depends on, before and after an effect was added.

    Attributes
    ----------
    signal, unit
        Glossary name, and the unit of `before` and `after`.
    variable
        Glossary name of what the error depends on.
    capture
        The capture, None where all captures are taken together.
    at
        Centres [n] of the cells of the variable [its unit]; with an `order` above 1, the angle
        [rad] within one of that many waves a turn, folded onto each other.
    before, after
        Mean errors [n] without the effect and with it.
    order
        Waves a turn of the variable.

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
class StepRecord(PlainRecord):
    """One step of the search: a model, and its held-out error.

    Attributes
    ----------
    effects
        Effects in the model.
    held_out
        Held-out error over the noise floor [1].
    signals
        Rms held-out error of each signal [its unit].
    errors
        The same beside their noise floors.
    parameters
        Parameters of the effects on this step.
    maps, histograms
        Where the error lies, and how it is distributed.
    signature
        What shows the effect that this step added.

    """

    effects: tuple[Name, ...]
    held_out: Spread
    signals: Mapping[str, Spread]
    errors: Extension[Mapping[str, StepError]] = field(default_factory=dict)
    parameters: Extension[Mapping[str, ReportedParameter]] = field(default_factory=dict)
    maps: Extension[tuple[ErrorMap, ...]] = field(default=())
    histograms: Extension[tuple[Histogram, ...]] = field(default=())
    signature: Extension[Signature | None] = None

    def map_of(self, signal: str, *variables: str) -> ErrorMap | None:
        """The error map of a signal over one or two variables.

        Parameters
        ----------
        signal
            Glossary name.
        *variables
            The one variable, or those of x and y, in that order.

        Returns
        -------
        ErrorMap or None
            None where there is none of just these variables.

        """
        maps = (m for m in self.maps if m.signal == signal and m.variables == variables)
        return next(maps, None)


@dataclass(frozen=True, slots=True)
class Remainder(PlainRecord):
    """One place where error over the noise floor is left: χ²/n, its size [unit of signal], and
    whether that matters in use.
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

    term: Name
    coefficient: float
    unit: Name


class AlternativeVariables(NamedTuple):
    """Variables that explain nearly as much, with their share of the held-out evidence [1]."""

    variables: tuple[str, ...]
    share: float


@dataclass(frozen=True, slots=True)
class UnknownStructure(PlainRecord):
    """Error that no known effect explains: where it acts, on what it depends, and its shape.

    Attributes
    ----------
    signal
        The signal in which it shows.
    variables
        Glossary names of what it depends on.
    shape
        The dependence in words.
    sketch
        Terms of the dependence with their coefficients.
    expression
        The same as one formula.
    curve
        Over the first of `variables`, temperatures counted from 25 degC.
    times
        What multiplies the curve.
    alternatives
        Variables that explain nearly as much, with their share of the held-out evidence.
    effect, source
        Name of an effect, and the text of a file that defines it.

    """

    signal: Name
    variables: tuple[Name, ...]
    shape: str
    sketch: tuple[SketchTerm, ...]
    expression: Extension[str] = ""
    curve: Extension[tuple[CurvePoint, ...]] = ()
    times: Extension[str] = ""
    alternatives: Extension[tuple[AlternativeVariables, ...]] = ()
    effect: Extension[str] = ""
    source: Extension[str] = ""

    def document(self) -> dict[str, Any]:
        """The JSON form of `contract/outputs.md`; `source` has a file of its own."""
        written = plain_fields(self)
        del written["source"]
        return written


@dataclass(frozen=True, slots=True)
class Unexcited(PlainRecord):
    """An effect of which these captures can say nothing.

    Attributes
    ----------
    effect
        Its name.
    tests, experiment
        The tests that would show it, and what to do in them.
    signals
        Signals that the captures of these tests lack.

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
    """The verdict on the model of one motor, with the search that leads to it.

    Attributes
    ----------
    motor_id, model
        The motor, and the name of the model.
    verdict
        `adequate`, `missing`, `unknown` or `insufficient`.
    missing
        Effects that the model lacks.
    ranking
        Evidence for each effect.
    ladder
        Steps of the search; the first holds the model as requested.
    unknown
        What no known effect explains; None where nothing is left.
    remainder
        Where error over the noise floor is left.
    notes
        Remarks, one sentence each.
    unexcited
        Effects that these captures cannot show.
    asked
        Effects that were requested beside the model's own.
    combinations
        What is known of parameters of the last step that are not known one by one.
    policy
        Digest of the constants of judgement.
    constants
        Constants of the machine by their names in a datasheet, fitted with all effects of the last
        step; those that the captures determine.

    """

    motor_id: Name
    model: str
    verdict: Verdict
    missing: tuple[Name, ...]
    ranking: tuple[RankedEffect, ...] = field(repr=False)
    ladder: tuple[StepRecord, ...] = field(repr=False)
    unknown: UnknownStructure | None
    remainder: Extension[tuple[Remainder, ...]] = field(repr=False)
    notes: Extension[tuple[str, ...]]
    unexcited: Extension[tuple[Unexcited, ...]] = field(default=(), repr=False)
    asked: Extension[tuple[Name, ...]] = ()
    combinations: Extension[tuple[KnownCombination, ...]] = field(default=(), repr=False)
    policy: Extension[str] = field(default="", repr=False)
    constants: Extension[Mapping[str, ReportedParameter]] = field(default_factory=dict, repr=False)

    @property
    def whole_model(self) -> str:
        """The model as asked for, in words."""
        signs = (f"- {name[1:]}" if name.startswith("-") else f"+ {name}" for name in self.asked)
        return " ".join((f"model {self.model}", *signs))

    def document(self) -> dict[str, Any]:
        """The JSON form of `contract/outputs.md`, schema model-diagnosis/1."""
        notes = [*self.notes, *(one.words for one in self.unexcited)]
        return {**plain_fields(self), "schema": "model-diagnosis/1", "notes": notes}
