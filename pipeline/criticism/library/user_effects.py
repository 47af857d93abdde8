"""Effects of a user's files: what is wrong with one is reported with its file, line and remedy.

A hook of theirs is called through a `Hook`; hooks of the library are not, and cost nothing.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.criticism.effect import RECORDERS, Effect
from pipeline.criticism.machine.model import BASE
from pipeline.criticism.operating import Operating, Recorded, Samples, ShaftState
from pipeline.criticism.parameter import SCALES, Machine, Parameter
from pipeline.records.errors import PipelineError, UsageError, meant

_HOOKS = (
    "coenergy",
    "drop",
    "torque",
    "parallel",
    "angle",
    "current",
    "load",
    "voltage",
    "shaft",
    "speed",
    "clock",
)
_OF_RECORDED = ("i_a", "torque_nm", "eps_rad", "omega_e_rad_s")
_OF_MACHINE = ("drop", "flux", "motion", "torque")
"""Hooks of the base constants that are of the machine, and no nuisance."""
_REAL = ("torque", "angle", "load", "shaft", "speed", "clock")
"""Hooks whose value is no voltage or current of both axes, and no derivative by a complex step."""
_ABSENT = ("drop", "torque")
"""Hooks that give nothing where all amplitudes are zero."""
_MEND = "correct the file"
_TRIED = 3
"""Samples that a hook is tried on: a few, since it may difference them."""


@dataclass(frozen=True, slots=True)
class Hook:
    """A hook of the effect of a user's file; what it gives is a finite number a sample, a `real`
    one or one of both axes.

    Raises UsageError where it does not, or fails.
    """

    call: Callable[..., Any]
    what: str
    file: str
    real: bool = False

    def __call__(self, *arguments: Any) -> Any:
        """The hook's value [n]."""
        q = next((a for a in arguments if isinstance(a, Mapping)), {})
        with errors_of(Path(self.file), self.what, q):
            value = self.call(*arguments)
        inputs = _inputs(arguments[0])
        if not inputs:
            return value
        self._look(value, inputs)
        shape = inputs[0].shape
        return value if np.shape(value) == shape else np.broadcast_to(value, shape).copy()

    def _look(self, value: Any, inputs: list[NDArray[Any]]) -> None:
        shape, answer = inputs[0].shape, np.asarray(value)
        where = f"{Path(self.file).name}{_at(getattr(self.call, '__code__', None))}: {self.what}"
        if answer.dtype.kind not in "bifc":
            message = f"{where} gives {type(value).__name__} and no numbers"
            raise UsageError(message, "return an array of one number a sample")
        if self.real and answer.dtype.kind == "c":
            raise UsageError(f"{where} gives complex numbers", "return real ones")
        try:
            fits = np.broadcast_shapes(answer.shape, shape) == shape
        except ValueError:
            fits = False
        if not fits:
            message = f"{where} gives an array of shape {answer.shape} for samples of shape {shape}"
            raise UsageError(message, "return one number a sample")
        if np.isfinite(answer).all():
            return
        known = np.logical_and.reduce([np.isfinite(one) for one in inputs if one.shape == shape])
        gaps = np.broadcast_to(~np.isfinite(answer), shape) & known
        if gaps.any():
            message = f"{where} gives no finite number at {np.count_nonzero(gaps)} of {gaps.size}"
            raise UsageError(f"{message} samples", "give one for every current, speed and angle")


def _inputs(first: Any) -> list[NDArray[Any]]:
    """The arrays [n] that a hook is given, by its first argument."""
    if isinstance(first, np.ndarray):
        return [first]
    names: tuple[str, ...] = ()
    if isinstance(first, Operating):
        # the angle since a reversal is infinite before the first, and no fault of a hook's
        names = ("omega_rad_s", *(one.name for one in fields(Samples) if one.name != "travel_rad"))
    elif isinstance(first, Recorded):
        names = _OF_RECORDED
    return [np.asarray(getattr(first, name)) for name in names]


def guarded(effect: Effect, path: Path, text: str) -> Effect:
    """A user's effect with its hooks behind `Hook`s; raises UsageError for what is wrong with it.

    Its scales must be known, and every hook is called once, to see that it asks for no parameter
    that is not there, and gives nothing without an amplitude; `text` is the file's.

    Parameters
    ----------
    effect
        The effect.
    path
        Its file.
    text
        Content of the file, to find lines in.

    Returns
    -------
    Effect
        Its hooks are behind `Hook`.

    Raises
    ------
    UsageError
        A scale is not known, a hook asks for a parameter that the effect has not, or a drop or drag
        is there without an amplitude; every hook is called once to see that.

    """
    label = f"effect {effect.name}"
    for parameter in effect.parameters:
        _known_scale(parameter, path, label, text)
    _known_nuisance(effect, path)
    hooks = {name: getattr(effect, name) for name in _HOOKS}
    behind: dict[str, Any] = {
        name: Hook(hook, f"{name} of {label}", str(path), real=name in _REAL)
        for name, hook in hooks.items()
        if hook is not None
    }
    if effect.expand is not None:
        behind["expand"] = _Expand(effect.expand, label, str(path))
    wrapped = replace(effect, **behind)
    _try(wrapped, path)
    return wrapped


@dataclass(frozen=True, slots=True)
class _Expand:
    """`expand` of a user's effect, held against the scales that there are."""

    call: Callable[[Machine], tuple[Parameter, ...]]
    what: str
    file: str

    def __call__(self, machine: Machine) -> tuple[Parameter, ...]:
        with errors_of(Path(self.file), f"expand of {self.what}"):
            parameters = tuple(self.call(machine))
        for parameter in parameters:
            _known_scale(parameter, Path(self.file), self.what)
        return parameters


def _known_scale(parameter: Parameter, path: Path, label: str, text: str = "") -> None:
    if parameter.scale == "1" or parameter.scale in SCALES:
        return
    quoted = (f'"{parameter.scale}"', f"'{parameter.scale}'")
    places = [
        n for n, line in enumerate(text.splitlines(), 1) if any(one in line for one in quoted)
    ]
    at = f", line {places[0]}" if places else ""
    message = f"{path.name}{at}: {label}: {parameter.name} has the scale {parameter.scale!r}"
    similar = get_close_matches(parameter.scale, SCALES, 1)
    hint = f"did you mean {similar[0]!r}? " if similar else ""
    raise UsageError(message, f"{hint}scales are 1, {', '.join(SCALES)}")


def _known_nuisance(effect: Effect, path: Path) -> None:
    """Refuses an effect `in_place_of` what there is not."""
    if effect.in_place_of is None:
        return
    named = tuple(effect.in_place_of)
    message = f"{path.name}: effect {effect.name}: in_place_of is {named!r}"
    nuisances = [constant.name for constant in BASE if constant.hook not in _OF_MACHINE]
    own = [parameter.name for parameter in effect.parameters]
    if len(named) != 2:
        raise UsageError(message, "name a nuisance and a parameter of the effect")
    for name, known in zip(named, (nuisances, own), strict=True):
        if name not in known:
            raise UsageError(message, meant(name, known))


class _NoNameError(KeyError):
    """A name that a table has not."""


class _Named(dict[str, float]):
    """A table of names, such as parameters or scales, that all are known."""

    def __missing__(self, name: str) -> float:
        raise _NoNameError(name)


def _try(effect: Effect, path: Path) -> None:
    """Calls every hook once; raises UsageError where it asks for a parameter that is not there, or
    gives a drop or drag though all amplitudes are zero.

    Other errors do not count here, since this machine is no motor: they are reported on captures.
    """
    x, r = _operating(), _recorded()
    line: NDArray[Any] = np.ones(_TRIED)
    calls = {
        "coenergy": (x,),
        "drop": (x,),
        "torque": (x,),
        "angle": (x,),
        "current": (r,),
        "load": (r,),
        "shaft": (line,),
    }
    try:
        parameters = effect.every(x.machine)
        q = _Named({p.name: p.scan[0] if p.scan else 0.0 for p in parameters})
    except UsageError:
        return
    for name, arguments in calls.items():
        value = _ask(getattr(effect, name), (*arguments, q), q, path)
        if name in _ABSENT and _is_there(value):
            message = f"{path.name}: {name} of effect {effect.name} is not zero at zero parameters"
            raise UsageError(message, "multiply it by a parameter that is its size")
    _ask(effect.speed, (line, q, x.ts_s), q, path)
    _ask(effect.voltage, (line + 0j, x, q, "drive"), q, path)
    _ask(effect.clock, (RECORDERS[0], q), q, path)


def _is_there(value: Any) -> bool:
    """Whether any finite number of a hook's value is not zero."""
    numbers = np.asarray(value)
    return numbers.dtype.kind in "bifc" and bool((np.isfinite(numbers) & (numbers != 0)).any())


def _ask(hook: Any, arguments: tuple[Any, ...], q: Mapping[str, float], path: Path) -> Any:
    """The value of a hook, None without one; raises UsageError where it asks for a parameter that
    its effect has not.
    """
    if hook is None:
        return None
    try:
        with np.errstate(all="ignore"):
            return hook.call(*arguments)
    except _NoNameError as error:
        raise _fault(error, path, hook.what, q) from error
    except (Exception, SystemExit):  # noqa: BLE001 (see `_try`)
        return None


@contextmanager
def errors_of(path: Path, label: str = "", q: Mapping[str, float] | None = None) -> Iterator[None]:
    """Reports whatever goes wrong in a user's file as one line of file, line and remedy.

    Parameters
    ----------
    path
        The file.
    label
        Which hook of which effect.
    q
        Its parameters.

    Raises
    ------
    UsageError
        In place of the error inside the block; errors of this package pass.

    """
    try:
        yield
    except PipelineError:
        raise
    except (Exception, SystemExit) as error:
        raise _fault(error, path, label, q or {}) from error


def _fault(error: BaseException, path: Path, label: str, q: Mapping[str, float]) -> UsageError:
    line = _line(error, path)
    where = path.name + ("" if line is None else f", line {line}") + (f": {label}" if label else "")
    if isinstance(error, SystemExit):
        return UsageError(f"{where}: it ends the program", "take the exit out of the file")
    if isinstance(error, KeyError) and q and error.args and error.args[0] not in q:
        lacking = f"{where}: asks for {error.args[0]!r}"
        return UsageError(
            lacking, f"its parameters are {', '.join(q)}; scales are {', '.join(SCALES)}"
        )
    lines = (error.msg if isinstance(error, SyntaxError) else str(error)).splitlines()
    message = ": ".join(filter(None, [type(error).__name__, lines[0] if lines else ""]))
    return UsageError(f"{where}: {message}", _MEND)


def _line(error: BaseException, path: Path) -> int | None:
    """The line of the file that is nearest to the error."""
    if isinstance(error, SyntaxError) and error.filename == str(path):
        return error.lineno
    line, trace = None, error.__traceback__
    while trace is not None:
        if trace.tb_frame.f_code.co_filename == str(path):
            line = trace.tb_lineno
        trace = trace.tb_next
    return line


def _at(code: Any) -> str:
    return "" if code is None else f", line {code.co_firstlineno}"


def _operating() -> Operating:
    """A few samples of a machine of size one."""
    steps = np.linspace(0.1, 0.3, _TRIED)
    machine = Machine(2, 12, _Named.fromkeys(SCALES, 1.0), (12,))
    base = dict.fromkeys(("r_ohm", "ld_h", "lq_h", "psi_wb"), 1.0)
    return Operating(
        machine=machine,
        base=base,
        id_a=steps,
        iq_a=steps,
        eps_rad=2.0 * steps,
        theta_rad=steps,
        omega_rad_s=steps,
        winding_k=steps,
        magnet_k=steps,
        travel_rad=np.full(_TRIED, math.inf),
        inverter=True,
        freq_hz=steps,
        ts_s=1e-4,
        psi_wb=steps.astype(np.complex128),
        torque_em_nm=steps,
        shaft=ShaftState(run=np.zeros(_TRIED, dtype=np.int64), runs_rad=steps[:1]),
    )


def _recorded() -> Recorded:
    steps = np.linspace(0.1, 0.3, _TRIED)
    return Recorded(
        steps.astype(np.complex128), steps, steps, steps, 1e-4, inverter=True, instrument="drive"
    )
