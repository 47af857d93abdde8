"""Whether a model of the motor explains its captures down to the noise, as a datasheet says it."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

from pipeline.records.diagnosis import ReportedParameter, Unexcited
from pipeline.records.field_kinds import Count, Extension, Name, Spread
from pipeline.records.plain_form import PlainRecord, plain_fields, record_of

ModelState = Literal["adequate", "missing", "unknown", "insufficient", "not_tested"]
Parameters = Mapping[str, ReportedParameter]
"""Value, standard uncertainty and unit of an effect's parameters, by name."""
MODEL_REASON = "model: "
"""How a reason in `why` begins that is about the model: a person may approve in spite of it."""


@dataclass(frozen=True, slots=True)
class Excess(PlainRecord):
    """Where a residual is over its noise floor: rms over the floor [1] and the part of the rms
    that the floor does not explain [unit of the signal]; `order` a turn of the shaft, 0 for means.

    Attributes
    ----------
    capture, signal
        Where it was found.
    order
        Order a turn of the shaft; 0 for means.
    floors
        Rms over the noise floor [1].
    size, unit
        Part of the rms that the floor does not explain.

    """

    capture: Name
    signal: Name
    order: Spread
    floors: Spread
    size: Spread
    unit: str

    @property
    def description(self) -> str:
        """`vd_v of drive_0.mcap by 12 noise floors`, with the order where there is one."""
        order = f", {self.order:g} a turn," if self.order else ""
        return f"{self.signal}{order} of {self.capture} by {number(self.floors)} noise floors"


@dataclass(frozen=True, slots=True)
class FoundEffect(PlainRecord):
    """An effect that a model lacks.

    Attributes
    ----------
    parameters
        Value, standard uncertainty and unit by name.
    headline
        One phrase with its size.
    confused_with
        Effects that explain the same within uncertainty.
    experiment
        What would separate them.

    """

    parameters: Parameters
    headline: Extension[str] = ""
    confused_with: Extension[tuple[Name, ...]] = ()
    experiment: Extension[str] = ""


@dataclass(frozen=True, slots=True)
class ModelVerdict(PlainRecord):
    """The residual test of one motor against the noise floors of `diagnose`.

    Attributes
    ----------
    verdict
        That of a diagnosis of the same model, or `not_tested`. `missing` with no effects in
        `missing` means that something is missing and was not searched for.
    model, effects
        Name of the model, and effects that were requested beside its own.
    missing
        Effects that were found, by name.
    held_out
        Error of captures that were predicted without themselves [noise floors]; None where no model
        was fitted.
    residual
        Largest residual of any signal in any capture [noise floors].
    worst
        The largest residual of a size that matters.
    over
        How many residuals of such a size there are.
    note
        Why there was no test.
    held_out_with
        `held_out` with the effects that were found [noise floors].
    unknown
        What depends on what, where no known effect explains it.
    unexcited
        Effects that no capture would show.
    fitted
        Parameters of `effects`.
    scales
        Sizes of the machine [unit of the name's suffix] that parameters of effects are multiples
        of.
    touches
        Constants of a datasheet that mean something else where the effects of `sizes` act, and
        what they are then.
    in_friction
        By effect of `sizes`, its part of each friction constant, which is separated from the
        datasheet's.
    far_inertia
        By effect of `sizes`, the share of the inertia of all that turns which is beyond a coupling
        [1]; the datasheet's is of the rotor alone.
    constants
        Constants of the machine that the captures determine, fitted with all effects of `sizes`; of
        all that turns.

    """

    verdict: ModelState
    model: Extension[Name] = "standard"
    effects: Extension[tuple[Name, ...]] = ()
    missing: Mapping[str, FoundEffect] = field(default_factory=dict)
    held_out: Spread | None = None
    residual: Spread | None = None
    worst: Extension[Excess | None] = None
    over: Extension[Count] = 0
    note: Extension[str] = ""
    held_out_with: Extension[Spread | None] = None
    unknown: Extension[str] = ""
    unexcited: Extension[tuple[Unexcited, ...]] = ()
    fitted: Extension[Mapping[str, Parameters]] = field(default_factory=dict)
    scales: Extension[Mapping[str, Spread]] = field(default_factory=dict)
    touches: Extension[Mapping[str, str]] = field(default_factory=dict)
    in_friction: Extension[Mapping[str, Parameters]] = field(default_factory=dict)
    far_inertia: Extension[Mapping[str, ReportedParameter]] = field(default_factory=dict)
    constants: Extension[Parameters] = field(default_factory=dict)

    @property
    def sizes(self) -> dict[str, Parameters]:
        """The parameters of all effects that are known of the motor, asked for or found."""
        return {**self.fitted, **{name: one.parameters for name, one in self.missing.items()}}

    @property
    def tested(self) -> bool:
        """Whether a model was fitted and its residuals held against the noise floors."""
        return self.residual is not None

    @property
    def passed(self) -> bool:
        """Whether the residuals were tested and nothing that matters is left in them."""
        return self.tested and self.verdict in ("adequate", "insufficient")

    @property
    def name(self) -> str:
        """The model in words: `the standard model with cogging`."""
        more = [name for name in self.effects if not name.startswith("-")]
        less = [name[1:] for name in self.effects if name.startswith("-")]
        words = f"the {self.model} model"
        words += f" with {' and '.join(more)}" if more else ""
        return words + (f" without {' and '.join(less)}" if less else "")

    @property
    def errors(self) -> str:
        """The error of captures predicted without themselves, and with the effects found, in noise
        floors: `15 → 0.61`; empty where no model was fitted.
        """
        held_out = [one for one in (self.held_out, self.held_out_with) if one is not None]
        return " → ".join(map(number, held_out))

    def command(self, motor_id: str, folder: str = "FOLDER") -> str:
        """The command that diagnoses the captures of a folder.

        Parameters
        ----------
        motor_id
            The motor.
        folder
            A datasheet does not know its folder: the same captures give the same bytes anywhere.

        """
        where = f"input={shlex.quote(folder)} motor={shlex.quote(motor_id)}"
        return f"diagnose {where}{self._model_flags(self.effects)}"

    def adding(self, folder: str = "FOLDER") -> str:
        """The command that runs a folder with the effects that were found; empty where none was.

        Parameters
        ----------
        folder
            As the user wrote it.

        """
        if not self.missing:
            return ""
        return f"run input={shlex.quote(folder)}{self._model_flags((*self.effects, *self.missing))}"

    def _model_flags(self, effects: Sequence[str]) -> str:
        model = "" if self.model == "standard" else f" model={self.model}"
        return model + effects_key(effects)

    def headline(self) -> str:
        """What the test came to, in one sentence without a full stop."""
        if self.verdict == "not_tested":
            return f"no model was held against the captures: {self.note}"
        if not self.tested:
            return self.note
        if self.passed:
            largest = number(self.residual or 0.0)
            return f"{self.name} leaves nothing that matters; largest residual {largest} floors"
        if self.missing:
            return f"{self.name} lacks {self._found()}"
        left = f"; no known effect explains it: {self.unknown}" if self.unknown else ""
        if self.worst is None:
            return f"{self.name} lacks an effect that shows below the noise floors{left}"
        more = f" and {self.over - 1} more" if self.over > 1 else ""
        return f"{self.name} misses {self.worst.description}{more}{left}"

    def _found(self) -> str:
        """The effects found with their sizes, and what adding them does to the error."""
        headlines = [one.headline or name.replace("_", " ") for name, one in self.missing.items()]
        text = " and ".join(filter(None, (", ".join(headlines[:-1]), headlines[-1])))
        if self.held_out is not None and self.held_out_with is not None:
            text += f"; {error_with(len(headlines), self.held_out, self.held_out_with)}"
        if self.verdict == "unknown":
            text += "; what is left no known effect explains"
            text += f": {self.unknown}" if self.unknown else ""
        return text

    def reason(self, motor_id: str) -> str | None:
        """Why the datasheet is not released by itself.

        Parameters
        ----------
        motor_id
            The motor, for the command in the text.

        Returns
        -------
        str or None
            Begins with `MODEL_REASON`; None where the test was passed.

        """
        if self.passed:
            return None
        remedy = ""
        if self.missing:
            remedy = f"; `{self.adding()}` adds {'it' if len(self.missing) == 1 else 'them'}"
        elif self.tested:
            remedy = f"; `{self.command(motor_id)}` tells more"
        return f"{MODEL_REASON}{self.headline()}{remedy}"

    def document(self) -> dict[str, Any]:
        """The JSON form of `contract/outputs.md`, with more keys."""
        written = plain_fields(self)
        written["name"] = written.pop("model")
        written["missing"] = [{"effect": n} | one for n, one in written["missing"].items()]
        fitted = written["fitted"].items()
        return written | {"fitted": [{"effect": n, "parameters": one} for n, one in fitted]}

    @classmethod
    def of(cls, document: Mapping[str, Any]) -> ModelVerdict:
        """The record that `document` wrote.

        Parameters
        ----------
        document
            Its JSON form.

        Returns
        -------
        ModelVerdict
            Keys that later versions added have their defaults where they are missing.

        Raises
        ------
        KeyError, TypeError, ValueError
            The document has another form.

        """
        fitted = document.get("fitted", ())
        changed = {
            "model": document.get("name", "standard"),
            "missing": {one["effect"]: one for one in document["missing"]},
            "fitted": {one["effect"]: one["parameters"] for one in fitted},
        }
        return record_of(cls, {**document, **changed})


def effects_key(effects: Sequence[str]) -> str:
    """The key that gives a model its effects, quoted as every shell takes it; empty for none.

    Parameters
    ----------
    effects
        Names of effects.

    """
    return " " + shlex.quote(f"model.effects=[{','.join(effects)}]") if effects else ""


def number(floors: float) -> str:
    """A number of noise floors for people: two digits below a hundred.

    Parameters
    ----------
    floors
        [noise floors].

    """
    return f"{floors:.0f}" if floors >= 10.0 else f"{floors:.2g}"


def error_with(count: int, without: float, after: float) -> str:
    """What adding effects does to the error of captures held out, in words.

    Parameters
    ----------
    count
        Number of effects.
    without, after
        Error without and with them [noise floors].

    Returns
    -------
    str
        One clause, which claims a fall only where there is one. Below the floor an effect shows in
        means of many samples alone.

    """
    them = {1: "it", 2: "both"}.get(count, f"all {count}")
    first, last = number(without), number(after)
    if after < without and first != last:
        return f"with {them}, the error falls from {first} to {last} noise floors"
    went = f"stays at {last}" if first == last else f"goes from {first} to {last}"
    shown = "it shows" if count == 1 else "they show"
    where = f"; {shown} in means of many samples only" if max(without, after) < 1.0 else ""
    return f"with {them}, the error {went} noise floors{where}"
