"""Named parameters against the truth, where simulator and library can be compared.

Where a parameter means the same on both sides, its value and interval are compared. Other effects
have different forms by design: of those, the size of what they do at one point is compared.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from pipeline.simulator.design import Instruments, Motor
from pipeline.simulator.effects import cogging_order, parameters
from tests.benchmark.bench import station
from tests.benchmark.cases import Case

Truth = Callable[[float, Instruments], float]
Size = Callable[[Mapping[str, float], Motor], float]
COVER = 1.96
TOP_SPEED = 0.95
"""Highest speed of the programme, in rated speeds."""
FAMILIES = ("size", "set")


@dataclass(frozen=True, slots=True)
class Compared:
    """One hidden effect: relative error, and whether the 95 % interval holds the truth.

    `covered` is None where only the size of what the effect does is compared.
    """

    effect: str
    error: float
    covered: bool | None


def _same(size: float, _: Instruments) -> float:
    return size


PARAMETERS: Mapping[str, tuple[tuple[str, ...], float, Truth]] = {
    "torque_scale": (("gain",), 1.0, lambda s, i: (1.0 + s) * i.torque - 1.0),
    "voltage_scale": (("gain",), 1.0, lambda s, i: (1.0 + s) * i.voltage_commanded - 1.0),
    "current_scale": (("gain",), 1.0, lambda s, i: (1.0 + s) * i.current - 1.0),
    "torque_offset": (("offset_nm",), 1.0, _same),
    "torque_lag": (("lag_s",), 1.0, _same),
    "sample_delay": (("delay_s",), 1.0, _same),
    "current_delay": (("delay_s",), 1.0, _same),
    "angle_offset": (("offset_rad",), 1.0, _same),
    "unbalance": (("sin_nm", "cos_nm"), 1.0, _same),
    "angle_eccentricity": (("sine_rad", "cosine_rad"), 1.0, _same),
    "phase_imbalance": (("cosine", "sine"), 2.0, _same),
    "current_gain": (("cosine", "sine"), 3.0, _same),
    "current_offset": (("alpha_a", "beta_a"), 1.5, _same),
    "copper_temperature": (("alpha_1_k",), 1.0, _same),
    "magnet_temperature": (("alpha_1_k",), 1.0, _same),
    "coulomb_friction": (("torque_nm",), 1.0, _same),
    "load_dependent_friction": (("share",), 1.0, _same),
}
"""Parameters whose magnitude (root of the sum of squares) times the factor is the size.

A gain is what the fault and the station's own gain make together. One phase's offset o is 2/3 o in
alpha and beta, its gain error g is g/3 of the current's conjugate; unequal resistances
R (1 + s cos) are s/2 of it.
"""


def _top(motor: Motor) -> float:
    return TOP_SPEED * motor.speed_rated_rad_s


def _skin(q: Mapping[str, float], _: Motor) -> float:
    return q["size"] * TOP_SPEED**2 / (1.0 + (TOP_SPEED / q["knee"]) ** 2)


def _eddy(q: Mapping[str, float], motor: Motor) -> float:
    return q["size"] * _top(motor) / (1.0 + (_top(motor) / q["knee_rad_s"]) ** 2)


def _standing(q: Mapping[str, float], _: Motor) -> float:
    return q["size"]


SIZES: Mapping[str, tuple[tuple[str, ...], Size]] = {
    "windage": (("drag_nm",), lambda q, motor: q["size"] * _top(motor) ** 2),
    "iron_eddy": (("drag_nm", "excess_nm"), _eddy),
    "iron_hysteresis": (("drag_nm",), _standing),
    "stribeck": (("excess_nm",), _standing),
    "skin_effect": (("rise",), _skin),
    "dead_time": (("loss_v",), _standing),
}
"""What an effect does, by all its terms that are there: drag [N·m] and rise of resistance at the
highest speed and the magnet's flux, drag at standstill, voltage [V] a phase loses at large
current."""


def compared(case: Case, document: Mapping[str, Any]) -> Iterator[Compared]:
    """Every hidden effect of a case that was named and can be compared."""
    if case.family not in FAMILIES:
        return
    fitted = {r["effect"]: r.get("parameters") or {} for r in document.get("ranking", [])}
    for effect in case.truth:
        if effect not in document.get("missing", []):
            continue
        found = _value(effect, case, fitted.get(effect, {}))
        if found is None:
            found = _size(effect, case, fitted.get(effect, {}))
        if found is not None:
            yield found


Fitted = Mapping[str, Mapping[str, Any]]


def _value(effect: str, case: Case, fitted: Fitted) -> Compared | None:
    names, factor, true = _names(effect, case)
    if not names or any(fitted.get(name, {}).get("u") is None for name in names):
        return None
    value, u = _magnitude([(fitted[n]["value"], fitted[n]["u"]) for n in names])
    want = abs(true(case.effects[effect]["size"], _instruments(case)))
    error = abs(factor * value - want)
    return Compared(effect, error / want, error <= COVER * factor * u)


def _size(effect: str, case: Case, fitted: Fitted) -> Compared | None:
    names, size = SIZES.get(effect, ((), _standing))
    values = [fitted.get(name, {}).get("value") for name in names]
    there = [value for value in values if value is not None]
    if not there:
        return None
    motor = station(case.motor).motor
    want = size(parameters(effect, motor, case.effects[effect]), motor)
    return Compared(effect, abs(sum(there) / want - 1.0), None)


def _names(effect: str, case: Case) -> tuple[tuple[str, ...], float, Truth]:
    if effect == "cogging":
        order = cogging_order(station(case.motor).motor)
        return (f"sin_{order}_nm", f"cos_{order}_nm"), 1.0, _same
    return PARAMETERS.get(effect, ((), 1.0, _same))


def _magnitude(parts: list[tuple[float, float]]) -> tuple[float, float]:
    """Root of the sum of squares and its standard uncertainty."""
    size = math.hypot(*(value for value, _ in parts))
    if size == 0.0:
        return 0.0, math.hypot(*(u for _, u in parts))
    return size, math.hypot(*(value * u / size for value, u in parts))


def _instruments(case: Case) -> Instruments:
    """The gains that the station of a case really had."""
    import numpy as np

    bench = station(case.motor).bench
    first = np.random.SeedSequence(case.seed).spawn(1)[0]
    return bench.drawn(np.random.default_rng(first))
