"""Designs, effects and fleets from plain documents: texts, lists and maps."""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields, replace
from types import MappingProxyType
from typing import Any

import numpy as np

from pipeline.simulator.design import Bench, Effects, Motor, Size
from pipeline.simulator.effects import FORMS, NEVER_NEGATIVE, parameters
from pipeline.simulator.outside import OUTSIDE, with_unknown

_ITEM = re.compile(r"(?P<name>[a-z_]+)(?:\.(?P<key>[a-z0-9_]+))?(?:=(?P<value>[-+.eE0-9]+))?")
SPREADS = {
    "r_phase_ohm": ("r_phase_ohm",),
    "inductance": ("ld_h", "lq_h"),
    "psi_pm_wb": ("psi_pm_wb",),
    "j_rotor_kgm2": ("j_rotor_kgm2",),
    "torque_coulomb_nm": ("torque_coulomb_nm",),
    "b_visc_nm_s_rad": ("b_visc_nm_s_rad",),
}


def _number(value: object, what: str) -> float:
    try:
        number = float(str(value))
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise ValueError(f"{what}: {value!r} is no number")
    return number


def _fields(kind: type, document: Mapping[str, Any], what: str) -> dict[str, Any]:
    """Values of a dataclass from texts, each by the kind of its field."""
    known = {f.name: str(f.type) for f in fields(kind)}
    values: dict[str, Any] = {}
    for key, value in document.items():
        if key not in known:
            raise ValueError(f"{what} has no {key}; it has {', '.join(sorted(known))}")
        if known[key] == "int":
            values[key] = int(_number(value, key))
        elif known[key] == "str":
            values[key] = str(value)
        else:
            values[key] = _number(value, key)
    return values


def motor_from(document: Mapping[str, Any]) -> Motor:
    """A motor from the document of a design.

    Parameters
    ----------
    document
        Fields of `Motor` by name, and `effects`; `bench` is left aside.

    Returns
    -------
    Motor
        With its effects.

    Raises
    ------
    ValueError
        A field is unknown, missing or no number, or an effect impossible.

    """
    plain = {k: v for k, v in document.items() if k not in {"effects", "bench"}}
    values = _fields(Motor, plain, "a motor")
    needed = {f.name for f in fields(Motor) if f.default is f.default_factory is MISSING}
    if missing := sorted(needed - set(values)):
        raise ValueError(f"a motor needs {', '.join(missing)}")
    motor = Motor(**values)
    return motor.having(**effects_from(document.get("effects") or {}, motor))


def effects_from(document: Mapping[str, Any], motor: Motor) -> Effects:
    """Effects of a document, checked against the library.

    Parameters
    ----------
    document
        Size, or mapping of parameters, by name of the effect.
    motor
        Whose ratings make the typical sizes.

    Returns
    -------
    dict
        The same as numbers.

    Raises
    ------
    ValueError
        An effect or parameter is unknown, a value no number, or a size below 0 of an effect without
        sign.

    """
    effects: dict[str, Size] = {}
    for name, value in document.items():
        size: Size
        if isinstance(value, Mapping):
            size = {key: _number(word, f"{name}.{key}") for key, word in value.items()}
        else:
            size = _number(value, name)
        _possible(name, parameters(name, motor, size))
        effects[name] = size
    return effects


def _possible(name: str, full: Mapping[str, float]) -> None:
    """Raises ValueError for a size below 0 of an effect that has no sign."""
    if name in NEVER_NEGATIVE and full["size"] < 0.0:
        raise ValueError(f"{name}={full['size']:g} is below 0, and {name} has no sign")


def bench_from(document: Mapping[str, Any]) -> Bench:
    """A bench from the `bench` of a design.

    Parameters
    ----------
    document
        The section of a configuration file.

    """
    return Bench(**_fields(Bench, document, "a bench"))


def with_effects(motor: Motor, text: str) -> Motor:
    """A motor with effects as typed: `[cogging, dead_time=0.3, saturation.size_d=0.1]`.

    Parameters
    ----------
    motor
        Design and the effects that it has.
    text
        Names, which alone have their typical size; those of `outside.OUTSIDE` are understood as
        well, their value a factor on the typical size [1].

    Returns
    -------
    Motor
        With these effects further.

    Raises
    ------
    ValueError
        The text is not understood, or a size below 0 of an effect without sign.

    """
    inside = text.strip().removeprefix("[").removesuffix("]")
    chosen: dict[str, dict[str, float]] = {}
    for word in (part.strip() for part in inside.split(",")):
        if not word:
            continue
        match = _ITEM.fullmatch(word)
        if match is None:
            raise ValueError(f"effects: {word!r} is no name, name=size or name.parameter=value")
        name, key, value = match["name"], match["key"], match["value"]
        if name in OUTSIDE and key is None:
            motor = with_unknown(motor, name, _number(value or "1", name))
            continue
        if name not in FORMS:
            known = ", ".join([*sorted(FORMS), *sorted(OUTSIDE)])
            raise ValueError(f"no effect {name}; there are {known}")
        sizes = {} if value is None else {key or "size": _number(value, word)}
        chosen[name] = {**chosen.get(name, {}), **sizes}
        _possible(name, parameters(name, motor, chosen[name]))
    return motor.having(**chosen)


@dataclass(frozen=True, slots=True)
class Fleet:
    """Motors of one design in lots, each with its own share of the production's spread."""

    design: str
    seed: int
    station: str
    motors: tuple[Motor, ...]
    started_at: Mapping[str, str]
    tests: tuple[str, ...] = ()


def fleet_from(document: Mapping[str, Any], design: Mapping[str, Any]) -> Fleet:
    """The motors of a fleet document.

    Parameters
    ----------
    document
        `seed`, `station`, `motor` and `lots`; `spread` is the relative standard deviation between
        motors of one lot [1], `shift` a lot's own relative departure from the design [1], `effects`
        those of all motors of a lot, `faults` those of single motors, `tests` the captures of the
        campaign that are recorded, all without it.
    design
        The document of the design.

    Returns
    -------
    Fleet
        Each motor's draw depends on the seed and its serial number alone.

    Raises
    ------
    ValueError
        Something in either document is unknown or no number, or a fault is of a motor that no lot
        holds.

    """
    base, seed = motor_from(design), int(_number(document["seed"], "seed"))
    spread = {k: _number(v, k) for k, v in (document.get("spread") or {}).items()}
    faults = document.get("faults") or {}
    motors, started = [], {}
    for lot, words in document["lots"].items():
        shift = {k: _number(v, k) for k, v in (words.get("shift") or {}).items()}
        for motor_id in words["motors"]:
            motor = replace(base, motor_id=motor_id, lot=lot)
            motor = motor.having(**effects_from(words.get("effects") or {}, motor))
            motor = _one_of_many(motor, spread, shift, seed_of(seed, motor_id))
            motors.append(motor.having(**effects_from(faults.get(motor_id) or {}, motor)))
            started[motor_id] = words["started_at"]
    stray = set(faults) - set(started)
    if stray:
        raise ValueError(f"faults of motors that no lot holds: {', '.join(sorted(stray))}")
    tests = tuple(document.get("tests") or ())
    station = str(document["station"])
    return Fleet(str(document["motor"]), seed, station, tuple(motors), started, tests)


def seed_of(seed: int, motor_id: str) -> int:
    """A seed of its own for each motor of a fleet.

    Parameters
    ----------
    seed
        Seed of the fleet.
    motor_id
        The motor.

    """
    digest = hashlib.sha256(f"{seed}/{motor_id}".encode()).digest()
    return int.from_bytes(digest[:8], "big")


def _one_of_many(
    motor: Motor, spread: Mapping[str, float], shift: Mapping[str, float], seed: int
) -> Motor:
    rng = np.random.default_rng(seed)
    stray = (set(spread) | set(shift)) - set(SPREADS) - {"cogging"}
    if stray:
        raise ValueError(f"no spread in {', '.join(sorted(stray))}; there is {', '.join(SPREADS)}")
    changed: dict[str, float] = {}
    for name, names in SPREADS.items():
        factor = 1.0 + shift.get(name, 0.0) + spread.get(name, 0.0) * rng.standard_normal()
        changed.update({field: getattr(motor, field) * factor for field in names})
    motor = replace(motor, **changed)  # type: ignore[arg-type]
    lean = 1.0 + shift.get("cogging", 0.0) + spread.get("cogging", 0.0) * rng.standard_normal()
    if "cogging" not in motor.effects:
        return motor
    cogging = parameters("cogging", motor, motor.effects["cogging"])
    cogging["size"] *= lean
    cogging["phase_rad"] += rng.uniform(0.0, 2.0 * np.pi)
    return motor.having(cogging=MappingProxyType(cogging))
