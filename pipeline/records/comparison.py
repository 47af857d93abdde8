"""A model against the recordings: errors fitted and held out, and where they live."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal


@dataclass(frozen=True, slots=True)
class ModelSpec:
    """Which model: `ideal` or `standard`, plus effects, less those whose name starts with `-`.

    `effects_path`: a folder of the user's own effects.
    """

    name: str = "standard"
    effects: tuple[str, ...] = ()
    effects_path: str | None = None


@dataclass(frozen=True, slots=True)
class ModelParameter:
    """One fitted parameter with its standard uncertainty from scatter [unit]."""

    value: float
    u: float
    unit: str
    at_bound: bool = False

    def document(self) -> dict[str, Any]:
        """The JSON form of `contract/outputs.md`."""
        return {"value": self.value, "u": self.u, "unit": self.unit, "at_bound": self.at_bound}


@dataclass(frozen=True, slots=True)
class SignalError:
    """Error of one signal of one capture, as means over smooth windows [unit of the signal]."""

    signal: str
    capture: str
    split: Literal["fit", "held_out"]
    rmse: float
    noise_floor: float
    n: int
    n_eff: float

    def document(self) -> dict[str, Any]:
        """The JSON form of `contract/outputs.md`."""
        return {
            "signal": self.signal,
            "capture": self.capture,
            "split": self.split,
            "rmse": self.rmse,
            "noise_floor": self.noise_floor,
            "n": self.n,
            "n_eff": self.n_eff,
        }


@dataclass(frozen=True, slots=True)
class Dependence:
    """How much of a signal's error variance a variable explains, as a binned curve."""

    signal: str
    variable: str
    explained: float
    p_value: float

    def document(self) -> dict[str, Any]:
        """The JSON form of `contract/outputs.md`."""
        return {
            "signal": self.signal,
            "variable": self.variable,
            "explained": self.explained,
            "p_value": self.p_value,
        }


@dataclass(frozen=True, slots=True)
class Comparison:
    """One model of one motor: parameters, errors, and where the error lives."""

    motor_id: str
    name: str
    effects: tuple[str, ...]
    parameters: Mapping[str, ModelParameter]
    errors: tuple[SignalError, ...]
    held_out: float
    where: tuple[Dependence, ...]
    notes: tuple[str, ...] = field(default=())

    def document(self) -> dict[str, Any]:
        """The JSON form of `contract/outputs.md`, schema model-comparison/1."""
        return {
            "schema": "model-comparison/1",
            "motor_id": self.motor_id,
            "model": {
                "name": self.name,
                "effects": list(self.effects),
                "parameters": {n: p.document() for n, p in self.parameters.items()},
            },
            "errors": [error.document() for error in self.errors],
            "total": {"held_out": self.held_out},
            "where": [dependence.document() for dependence in self.where],
            "notes": list(self.notes),
        }
