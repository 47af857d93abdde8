"""Whether a model of the motor explains its captures down to the noise, as a datasheet says it."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from pipeline.records.diagnosis import ToldParameter

ModelState = Literal["adequate", "missing", "unknown", "insufficient", "not_tested"]
MODEL_REASON = "model: "
"""How a reason in `why` begins that is about the model: a person may approve in spite of it."""


@dataclass(frozen=True, slots=True)
class Excess:
    """Where a residual is over its noise floor: rms over the floor [1] and the part of the rms
    that the floor does not explain [unit of the signal]; `order` a turn of the shaft, 0 for means.
    """

    capture: str
    signal: str
    order: float
    floors: float
    size: float
    unit: str

    @property
    def description(self) -> str:
        """`vd_v of drive_0.mcap by 12 noise floors`, with the order where there is one."""
        order = f", {self.order:g} a turn," if self.order else ""
        return f"{self.signal}{order} of {self.capture} by {number(self.floors)} noise floors"

    def document(self) -> dict[str, Any]:
        """The JSON form: an extension of `contract/outputs.md`."""
        return {
            "capture": self.capture,
            "signal": self.signal,
            "order": self.order,
            "floors": self.floors,
            "size": self.size,
            "unit": self.unit,
        }


@dataclass(frozen=True, slots=True)
class ModelVerdict:
    """The residual test of one motor against the noise floors of `diagnose`.

    `verdict` is that of a diagnosis of the same model, or `not_tested`. `missing` with an empty
    list of effects says that something is missing and was not searched for. `held_out` and
    `residual` [noise floors] are the error of captures predicted without themselves and the largest
    residual of any signal in any capture; None where no model was fitted. `worst` is the largest
    one of a size that matters, `over` how many of that size there are. `effects` were asked for
    beside the `model`'s own.
    """

    verdict: ModelState
    model: str = "standard"
    effects: tuple[str, ...] = ()
    missing: Mapping[str, Mapping[str, ToldParameter]] = field(default_factory=dict)
    held_out: float | None = None
    residual: float | None = None
    worst: Excess | None = None
    over: int = 0
    note: str = ""

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

    def command(self, motor_id: str, folder: str = "FOLDER") -> str:
        """The command that says what is missing in the captures of a `folder`.

        A datasheet does not know its folder: the same captures give the same bytes anywhere.
        """
        effects = f" model.effects=[{','.join(self.effects)}]" if self.effects else ""
        model = "" if self.model == "standard" else f" model={self.model}"
        where = f"input={shlex.quote(folder)} motor={shlex.quote(motor_id)}"
        return f"diagnose {where}{model}{effects}"

    def headline(self) -> str:
        """What the test came to, in one sentence without a full stop."""
        if self.verdict == "not_tested":
            return f"no model was held against the captures: {self.note}"
        if not self.tested:
            return self.note
        if self.passed:
            largest = number(self.residual or 0.0)
            return f"{self.name} leaves nothing that matters; largest residual {largest} floors"
        names = f"; found: {', '.join(self.missing)}" if self.missing else ""
        if self.worst is None:
            return f"{self.name} lacks an effect that shows below the noise floors{names}"
        more = f" and {self.over - 1} more" if self.over > 1 else ""
        return f"{self.name} misses {self.worst.description}{more}{names}"

    def reason(self, motor_id: str) -> str | None:
        """Why the datasheet is not released by itself; None where the test was passed."""
        if self.passed:
            return None
        remedy = ""
        if self.tested:
            remedy = f"; `{self.command(motor_id)}` tells more"
        return f"{MODEL_REASON}{self.headline()}{remedy}"

    def document(self) -> dict[str, Any]:
        """The JSON form of `contract/outputs.md`, with more keys."""
        return {
            "verdict": self.verdict,
            "missing": [
                {
                    "effect": effect,
                    "parameters": {
                        name: {"value": value, "u": u, "unit": unit}
                        for name, (value, u, unit) in parameters.items()
                    },
                }
                for effect, parameters in self.missing.items()
            ],
            "held_out": self.held_out,
            "residual": self.residual,
            "name": self.model,
            "effects": list(self.effects),
            "worst": None if self.worst is None else self.worst.document(),
            "over": self.over,
            "note": self.note,
        }

    @classmethod
    def of(cls, document: Mapping[str, Any]) -> ModelVerdict:
        """The record that `document` wrote; raises LookupError or TypeError for anything else."""
        worst = document.get("worst")
        return cls(
            verdict=document["verdict"],
            model=document.get("name", "standard"),
            effects=tuple(document.get("effects", ())),
            missing={
                one["effect"]: {
                    name: (parameter["value"], parameter["u"], parameter["unit"])
                    for name, parameter in one["parameters"].items()
                }
                for one in document["missing"]
            },
            held_out=document["held_out"],
            residual=document["residual"],
            worst=None if worst is None else Excess(**worst),
            over=document.get("over", 0),
            note=document.get("note", ""),
        )


def number(floors: float) -> str:
    """A number of noise floors for people: two digits below a hundred."""
    return f"{floors:.0f}" if floors >= 10.0 else f"{floors:.2g}"
