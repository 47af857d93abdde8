"""A model against the recordings: errors fitted and held out, and where they live."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal, get_args

from pipeline.records.error_map import Array, ErrorMap
from pipeline.records.field_kinds import Count, Extension, Name, Share, Spread
from pipeline.records.plain_form import PlainRecord, plain_of
from pipeline.records.policy import Overrides

Signal = Literal[
    "vd_v", "vq_v", "torque_shaft_nm", "omega_mech_rad_s", "iq_a", "psi_d_wb", "psi_q_wb"
]
SIGNALS: tuple[str, ...] = get_args(Signal)
Split = Literal["fit", "held_out"]
ParameterStatus = Literal["measured", "stated", "not_identifiable"]


@dataclass(frozen=True, slots=True)
class ModelSpec:
    """Which model of a motor is meant.

    Attributes
    ----------
    name
        `ideal` or `standard`.
    effects
        Names that are added; one that begins with `-` is taken out.
    effects_path
        Folder with effects of the user's own.
    policy
        Constants of judgement that differ from the default ones, by their full names.

    """

    name: str = "standard"
    effects: tuple[str, ...] = ()
    effects_path: str | None = None
    policy: Overrides = ()

    def bare(self) -> ModelSpec:
        """The same model without the effects that were added."""
        return replace(self, effects=tuple(e for e in self.effects if e.startswith("-")))


@dataclass(frozen=True, slots=True)
class ModelParameter(PlainRecord):
    """One fitted parameter with its standard uncertainty [unit]; both are None where the captures
    and the station's priors do not determine it. `stated`: only a stated value does.

    Attributes
    ----------
    value, u
        Value and standard uncertainty (k = 1) [unit].
    at_bound
        Whether the fit ended at a bound of its range.
    stated
        Whether only a statement, and no data, determines it.

    """

    value: float | None
    u: Spread | None
    unit: Name
    at_bound: bool = False
    stated: bool = False

    @property
    def known(self) -> bool:
        """Whether there is a value."""
        return self.value is not None

    @property
    def status(self) -> ParameterStatus:
        """As in a datasheet."""
        if not self.known:
            return "not_identifiable"
        return "stated" if self.stated else "measured"

    def document(self) -> dict[str, Any]:
        """The JSON form of `contract/outputs.md`."""
        return {
            "value": self.value,
            "u": self.u,
            "unit": self.unit,
            "at_bound": self.at_bound,
            "status": self.status,
        }


@dataclass(frozen=True, slots=True)
class KnownCombination(PlainRecord):
    """What is determined of parameters that are not, one by one: a ratio, a product or a sum, with
    its standard uncertainty [unit]. `of` are the parameters in it.
    """

    expression: Name
    value: float
    u: Spread
    unit: Name
    of: tuple[Name, ...]


@dataclass(frozen=True, slots=True)
class Move(PlainRecord):
    """A parameter before and after effects were added, with standard uncertainties [unit]."""

    parameter: str
    unit: str
    before: float
    u_before: float
    after: float
    u_after: float

    @property
    def in_u(self) -> float:
        """The change over the uncertainty it had before; 0 where it had none."""
        return (self.after - self.before) / self.u_before if self.u_before > 0 else 0.0

    def document(self) -> dict[str, Any]:
        """The JSON form: an extension of `contract/outputs.md`."""
        return {
            "parameter": self.parameter,
            "unit": self.unit,
            "before": {"value": self.before, "u": self.u_before},
            "after": {"value": self.after, "u": self.u_after},
            "change_in_u": self.in_u,
        }


@dataclass(frozen=True, slots=True)
class SignalError(PlainRecord):
    """Error of one signal of one capture, as means over smooth windows.

    Attributes
    ----------
    signal, unit
        Glossary name, and the unit of `rmse` and `noise_floor`.
    capture
        Its path.
    split
        `held_out` where the model was fitted without this capture or stretch, else `fit`.
    rmse
        Root mean square of the window means' error.
    noise_floor
        The rms that noise and the instruments' uncertainty alone would give.
    n, n_eff
        Windows, and how many of them count as independent.
    kind
        What an `equation` misses by, sample by sample, or what a `free_run` of the model away from
        each window's start does.

    """

    signal: Name
    capture: Name
    split: Split
    rmse: Spread
    noise_floor: Spread
    n: Count
    n_eff: Spread
    unit: Extension[str] = ""
    kind: Extension[Literal["equation", "free_run"]] = "equation"


@dataclass(frozen=True, slots=True)
class Dependence(PlainRecord):
    """How much of a signal's error variance a variable explains, as a binned curve.

    `p_value` is None where there are too few stretches of record.
    """

    signal: Name
    variable: Name
    explained: Share
    p_value: Share | None


@dataclass(frozen=True, slots=True)
class Trace:
    """A signal of a capture as recorded and as the model makes it [n, unit], NaN between windows.

    The model is fitted without this capture where `split` is `held_out`. `before` is what the model
    makes without what was added to it; None where nothing was.
    """

    capture: str
    signal: str
    kind: Literal["equation", "free_run"]
    split: Split
    t_s: Array
    measured: Array
    model: Array
    before: Array | None = None


@dataclass(frozen=True, slots=True)
class Comparison:
    """One model of one motor: its parameters, its errors, and where the errors lie.

    Attributes
    ----------
    motor_id, name, effects
        The motor, and the model with what was added to it.
    parameters
        Fitted parameters by name.
    errors
        One a signal, capture and split.
    held_out
        Error of captures that the model was not fitted to, over the noise floor [1]; None where no
        capture could be used.
    where
        What variables the error depends on.
    notes
        Remarks, one sentence each.
    maps
        Mean error over cells of one or two variables.
    moved
        Parameters with and without the effects that were added.
    bare
        `held_out` without those effects; None where none were added.
    traces
        Samples for plots; no part of the document.
    combinations
        What is known of parameters that are not, one by one.
    before
        Errors of the equations without the effects that were added.
    added
        The effects that `before` is without.

    """

    motor_id: str
    name: str
    effects: tuple[str, ...]
    parameters: Mapping[str, ModelParameter]
    errors: tuple[SignalError, ...] = field(repr=False)
    held_out: float | None
    where: tuple[Dependence, ...] = field(repr=False)
    notes: tuple[str, ...] = field(default=())
    maps: tuple[ErrorMap, ...] = field(default=(), repr=False)
    moved: tuple[Move, ...] = field(default=())
    bare: float | None = None
    traces: tuple[Trace, ...] = field(default=(), repr=False)
    combinations: tuple[KnownCombination, ...] = field(default=(), repr=False)
    before: tuple[SignalError, ...] = field(default=(), repr=False)
    added: tuple[str, ...] = field(default=())

    def document(self) -> dict[str, Any]:
        """The JSON form of `contract/outputs.md`, schema model-comparison/1.

        Signals that the contract does not name are under `errors_other` and `where_other`.
        """
        errors = [(e.signal in SIGNALS, e.document()) for e in self.errors]
        where = [(d.signal in SIGNALS, d.document()) for d in self.where]
        return {
            "schema": "model-comparison/1",
            "motor_id": self.motor_id,
            "model": {
                "name": self.name,
                "effects": list(self.effects),
                "parameters": plain_of(self.parameters),
                "combinations": plain_of(self.combinations),
            },
            "errors": [one for named, one in errors if named],
            "errors_other": [one for named, one in errors if not named],
            "errors_before": plain_of(self.before),
            "total": {"held_out": self.held_out, "without_effects": self.bare},
            "where": [one for named, one in where if named],
            "where_other": [one for named, one in where if not named],
            "maps": plain_of(self.maps),
            "moved": plain_of(self.moved),
            "notes": list(self.notes),
        }
