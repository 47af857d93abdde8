"""Named parameters against the truth, where the simulator's and the library's mean the same.

Other effects have different forms in simulator and library, by design; their parameters are not
compared.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from pipeline.simulator.design import Instruments
from pipeline.simulator.effects import cogging_order
from pipeline.stages.benchmark.bench import station
from pipeline.stages.benchmark.cases import Case

Fitted = Mapping[str, Mapping[str, Any]]
True_ = Callable[[float, Instruments], float]
COVER = 1.96


@dataclass(frozen=True, slots=True)
class Compared:
    """One named parameter: its relative error, and whether its 95 % interval holds the truth."""

    effect: str
    error: float
    covered: bool


def _same(size: float, _: Instruments) -> float:
    return size


PARAMETERS: Mapping[str, tuple[tuple[str, ...], True_]] = {
    "torque_scale": (("gain",), lambda s, i: (1.0 + s) * i.torque - 1.0),
    "voltage_scale": (("gain_drive",), lambda s, i: (1.0 + s) * i.voltage_commanded - 1.0),
    "current_scale": (("gain_drive",), lambda s, i: (1.0 + s) * i.current - 1.0),
    "torque_offset": (("offset_nm",), _same),
    "torque_lag": (("lag_s",), _same),
    "sample_delay": (("delay_s",), _same),
    "current_delay": (("delay_s",), _same),
    "angle_offset": (("offset_rad",), _same),
    "unbalance": (("sin_nm", "cos_nm"), _same),
    "angle_eccentricity": (("sine_rad", "cosine_rad"), _same),
    "copper_temperature": (("alpha_1_k",), _same),
    "magnet_temperature": (("alpha_1_k",), _same),
    "coulomb_friction": (("torque_nm",), _same),
    "load_dependent_friction": (("share",), _same),
}
"""Parameters of an effect whose magnitude (of a sine and a cosine together) is the size.

A gain is what the fault and the station's own gain make together.
"""


def compared(case: Case, document: Mapping[str, Any]) -> Iterator[Compared]:
    """Every hidden parameter of a case that was named and can be compared."""
    fitted = {r["effect"]: r.get("parameters") or {} for r in document.get("ranking", [])}
    for effect in case.truth:
        if effect not in document.get("missing", []):
            continue
        names, true = _names(effect, case)
        found = fitted.get(effect, {})
        if not names or any(found.get(name, {}).get("u") is None for name in names):
            continue
        value, u = _magnitude([(found[n]["value"], found[n]["u"]) for n in names])
        want = abs(true(case.effects[effect]["size"], _instruments(case)))
        if want > 0.0:
            error = abs(value - want)
            yield Compared(effect, error / want, error <= COVER * u)


def _names(effect: str, case: Case) -> tuple[tuple[str, ...], True_]:
    if effect == "cogging":
        order = cogging_order(station(case.motor).motor)
        return (f"sin_{order}_nm", f"cos_{order}_nm"), _same
    return PARAMETERS.get(effect, ((), _same))


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
