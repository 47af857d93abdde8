"""Drawing the cases: what is hidden in each campaign, at random from one master seed."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

import numpy as np

from pipeline.simulator.design import Motor
from pipeline.simulator.effects import ALWAYS, FORMS, parameters
from pipeline.simulator.outside import OUTSIDE
from tests.benchmark.bench import MOTORS, STEMS, station
from tests.benchmark.cases import Case, Values, case_from
from tests.benchmark.sensitivity import Sensitivity, sensitivity, typical

MULTIPLES = (1.0, 2.0, 5.0, 20.0)
SHARES = (0.1, 0.3, 1.0)
NULLS = ("clean", "drift", "hum", "mis-stated noise")
NULLS_EACH = 25
COUNTS = {"set": 50, "crowd": 30, "form": 30, "outside": 30, "tie": 20, "gap": 20}
CROWD = 25
UNSEEN = 1.0
"""Noncentrality below which an effect leaves no trace that any test could find."""

TURNED = ("phase_rad", "angle_deg", "phase")
ALONE = ("backlash", "compliance")
COMPANIONS = {"backlash": ("compliance",)}
"""What comes with an effect by nature: a gap is in a coupling, and a coupling gives."""

HEARD_OF = ("trapezoid",)
"""Terms of the simulator that an effect of the library is: a flat-topped back-EMF is its harmonics
6 and 12, and naming these with the error at its floor is no mistake."""

FORM_CHANGES: Mapping[str, tuple[Values, ...]] = {
    "saturation": ({"form": 1.0}, {"exponent": 6.0}),
    "dead_time": ({"knee_share": 0.12},),
    "windage": ({"exponent": 1.5}, {"exponent": 3.0}),
    "stribeck": ({"omega_s_share": 0.2},),
    "iron_eddy": ({"knee_share": 0.4},),
    "skin_effect": ({"knee": 0.5},),
    "cogging": ({"order_slots": 0.6}, {"order_poles": 0.8}),
    "bemf_harmonics": ({"eleventh": 1.2, "thirteenth": 0.9},),
    "inductance_harmonics": ({"ratio_d": 2.5},),
    "copper_temperature": ({},),
}
"""Shapes that the usual form of an effect does not take; a `_share` is of the motor's rating."""

TIE_PLANS: tuple[tuple[str, ...], ...] = (
    ("torque_map_0", "resistance_ab", "resistance_bc", "resistance_ca"),
    ("torque_map_0", "torque_map_1", "torque_map_2"),
    ("torque_map_0", "cogging_cw", "cogging_ccw"),
    ("drive_0", "drive_1"),
    ("torque_map_1", "heat_run_0"),
)
GAP_TESTS = {
    "skin_effect": ("lcr", "torque_map", "drive"),
    "dead_time": ("torque_map", "heat_run", "drive"),
    "sample_delay": ("torque_map", "drive"),
    "torque_lag": ("torque_map", "drive"),
    "current_scale": ("lcr", "torque_map", "drive"),
    "angle_offset": ("open_circuit", "torque_map", "drive"),
    "saturation": ("current_step", "torque_map", "drive"),
    "cross_saturation": ("torque_map", "drive"),
    "bemf_harmonics": ("open_circuit", "torque_map", "drive"),
    "load_dependent_friction": ("torque_map", "drive"),
    "iron_eddy": ("torque_map", "spin_down", "drive"),
    "windage": ("torque_map", "spin_down", "drive"),
    "torque_scale": ("torque_map", "drive"),
}
"""Tests without which an effect cannot be seen."""


@dataclass(frozen=True, slots=True)
class Draw:
    """Where random numbers and sensitivities come from."""

    master: int
    folder: Path

    def rng(self, family: str, number: int) -> np.random.Generator:
        """A generator that hangs on nothing but the master seed, the family and the number."""
        text = hashlib.sha256(f"{self.master}/{family}/{number}".encode()).digest()
        return np.random.default_rng(int.from_bytes(text[:8], "big"))

    def sensitivity(self, motor: str) -> Sensitivity:
        """What captures of a motor can tell."""
        return sensitivity(motor, self.folder)


def cases(master: int, folder: Path) -> Iterator[Case]:
    """Every case of the full benchmark, in a fixed order."""
    draw = Draw(master, folder)
    yield from _singles(draw)
    yield from _nulls(draw)
    yield from _sets(draw)
    yield from _crowds(draw)
    yield from _forms(draw)
    yield from _outside(draw)
    yield from _ties(draw)
    yield from _gaps(draw)


SMALL = {"size": 2, "null": 1, "set": 2, "crowd": 1, "form": 2, "outside": 2, "tie": 2, "gap": 1}


def small(found: Iterator[Case]) -> list[Case]:
    """A fixed subset with some cases of every line, those of least digest first."""
    lines: dict[tuple[str, str], list[Case]] = {}
    for case in found:
        lines.setdefault((case.family, case.line), []).append(case)
    chosen = []
    for (family, _), members in lines.items():
        chosen += sorted(members, key=lambda case: case.key)[: SMALL[family]]
    return chosen


def _seed(rng: np.random.Generator) -> int:
    return int(rng.integers(1, 2**31))


def shaped(name: str, motor: Motor, size: float, rng: np.random.Generator) -> Values:
    """Parameters of an effect at a size, its phases and faulty phase drawn at random."""
    full = parameters(name, motor)
    sign = -1.0 if full["size"] < 0.0 else 1.0
    values = {"size": sign * size}
    for key in TURNED:
        if key not in full:
            continue
        if key == "phase":
            values[key] = float(rng.integers(0, 3))
        else:
            values[key] = float(rng.uniform(0.0, 360.0 if key == "angle_deg" else 2.0 * math.pi))
    return values


def alone(name: str, values: Values) -> dict[str, Values]:
    """The effects of a campaign whose one missing effect is `name`.

    Of those that every motor has, the others are switched off and the model asked about is ideal.
    """
    if name not in ALWAYS:
        return {name: values}
    return {**{other: {"size": 0.0} for other in ALWAYS}, name: values}


def model_for(name: str) -> str:
    """The model that lacks an effect."""
    return "ideal" if name in ALWAYS else "standard"


def _singles(draw: Draw) -> Iterator[Case]:
    number = 0
    for motor_name in MOTORS:
        known, motor = draw.sensitivity(motor_name), station(motor_name).motor
        for effect in FORMS:
            whole = typical(effect, motor)
            star = min(known.a_star[effect], 10.0 * whole)
            sizes = [(f"{k:g} a*", k * star) for k in MULTIPLES]
            sizes += [(f"{k:g} typical", k * whole) for k in SHARES]
            for line, wanted in sizes:
                rng = draw.rng("size", number)
                size = min(wanted, _largest(effect))
                yield _single(draw, "size", line, number, motor_name, effect, size, rng)
                number += 1


def _largest(effect: str) -> float:
    from tests.benchmark.sensitivity import LARGEST

    return LARGEST.get(effect, math.inf)


def _single(
    draw: Draw,
    family: str,
    line: str,
    number: int,
    motor_name: str,
    effect: str,
    size: float,
    rng: np.random.Generator,
    keep: tuple[str, ...] = STEMS,
    further: Mapping[str, float] = MappingProxyType({}),
) -> Case:
    motor, known, model = station(motor_name).motor, draw.sensitivity(motor_name), model_for(effect)
    values = {**shaped(effect, motor, size, rng), **further}
    seen = known.noncentrality(effect, size, keep, model)
    return Case(
        family,
        line,
        number,
        motor_name,
        model,
        _seed(rng),
        keep,
        alone(effect, values),
        truth=(effect,),
        accepted={effect: known.rivals(effect, size, keep, model)},
        nothing=seen < UNSEEN,
        of_typical=size / typical(effect, motor),
        allowed=COMPANIONS.get(effect, ()),
    )


def _nulls(draw: Draw) -> Iterator[Case]:
    for number in range(len(NULLS) * NULLS_EACH):
        rng = draw.rng("null", number)
        kind = NULLS[number // NULLS_EACH]
        motor = MOTORS[number % len(MOTORS)]
        yield Case("null", kind, number, motor, "standard", _seed(rng), corruption=kind)


def _visible(draw: Draw, motor_name: str, effect: str, size: float) -> bool:
    return size >= 5.0 * draw.sensitivity(motor_name).a_star[effect]


def _sets(draw: Draw) -> Iterator[Case]:
    """Two to five effects at 0.3 to 1 typical size, each of them at least 5 a*."""
    for number in range(COUNTS["set"]):
        rng = draw.rng("set", number)
        motor_name = MOTORS[number % len(MOTORS)]
        motor = station(motor_name).motor
        drawn = {
            name: min(
                typical(name, motor) * float(np.exp(rng.uniform(math.log(0.3), 0.0))),
                _largest(name),
            )
            for name in FORMS
        }
        able = [
            name
            for name, size in drawn.items()
            if name not in (*ALWAYS, *ALONE) and _visible(draw, motor_name, name, size)
        ]
        chosen = sorted(rng.choice(able, size=int(rng.integers(2, 6)), replace=False).tolist())
        known = draw.sensitivity(motor_name)
        yield Case(
            "set",
            "2 to 5 effects",
            number,
            motor_name,
            "standard",
            _seed(rng),
            effects={name: shaped(name, motor, drawn[name], rng) for name in chosen},
            truth=tuple(chosen),
            accepted={name: known.rivals(name, drawn[name]) for name in chosen},
        )


def _crowds(draw: Draw) -> Iterator[Case]:
    """One effect at typical size among 25 others at 1 to 5 % of theirs."""
    for number in range(COUNTS["crowd"]):
        rng = draw.rng("crowd", number)
        motor_name = MOTORS[number % len(MOTORS)]
        motor = station(motor_name).motor
        able = [n for n in FORMS if n not in (*ALWAYS, *ALONE)]
        able = [n for n in able if _visible(draw, motor_name, n, typical(n, motor))]
        main = str(rng.choice(able))
        others = [n for n in FORMS if n not in (*ALWAYS, *ALONE, main)]
        few = sorted(rng.choice(others, size=min(CROWD, len(others)), replace=False).tolist())
        effects = {
            n: shaped(n, motor, typical(n, motor) * float(rng.uniform(0.01, 0.05)), rng)
            for n in few
        }
        effects[main] = shaped(main, motor, typical(main, motor), rng)
        yield Case(
            "crowd",
            f"among {CROWD} others",
            number,
            motor_name,
            "standard",
            _seed(rng),
            effects=effects,
            truth=(main,),
            accepted={main: draw.sensitivity(motor_name).rivals(main, typical(main, motor))},
            of_typical=1.0,
            allowed=tuple(few),
        )


def _forms(draw: Draw) -> Iterator[Case]:
    """Effects of the library in a shape that their usual form does not take."""
    pool = [(name, change) for name, changes in FORM_CHANGES.items() for change in changes]
    for number in range(COUNTS["form"]):
        rng = draw.rng("form", number)
        motor_name = MOTORS[number % len(MOTORS)]
        effect, change = pool[int(rng.integers(len(pool)))]
        motor = station(motor_name).motor
        size = min(typical(effect, motor) * float(rng.uniform(1.0, 2.0)), _largest(effect))
        further = _in_units(effect, change, motor)
        case = _single(
            draw, "form", "wrong form", number, motor_name, effect, size, rng, further=further
        )
        if effect == "copper_temperature":
            document = {**case.document(), "outside": "hot_spot", "outside_size": 1.0}
            case = case_from(document)
        yield case


def _in_units(effect: str, change: Values, motor: Motor) -> Values:
    """A change of form with shares of the motor's ratings put into units."""
    rated = {
        "dead_time": ("knee_a", motor.current_rated_a),
        "stribeck": ("omega_s_rad_s", motor.speed_rated_rad_s),
        "iron_eddy": ("knee_rad_s", motor.speed_rated_rad_s),
    }
    values = {}
    for key, value in change.items():
        if key.endswith("_share"):
            name, whole = rated[effect]
            values[name] = value * whole
        else:
            values[key] = value
    return values


def _outside(draw: Draw) -> Iterator[Case]:
    for number in range(COUNTS["outside"]):
        rng = draw.rng("outside", number)
        unheard = [name for name in sorted(OUTSIDE) if name not in HEARD_OF]
        name = unheard[number % len(unheard)]
        size = 1.0 if name == "hot_spot" else float(rng.uniform(1.0, 2.0))
        motor = MOTORS[int(rng.integers(len(MOTORS)))]
        yield Case(
            "outside",
            "not in the library",
            number,
            motor,
            "standard",
            _seed(rng),
            outside=name,
            outside_size=size,
            of_typical=size,
        )


def _ties(draw: Draw) -> Iterator[Case]:
    """Effects at typical size that a short programme cannot part from others."""
    pool = []
    for motor_name in MOTORS:
        known, motor = draw.sensitivity(motor_name), station(motor_name).motor
        for keep in TIE_PLANS:
            for effect in FORMS:
                size = min(typical(effect, motor), _largest(effect))
                if effect in ALWAYS or known.noncentrality(effect, size, keep) < 25.0:
                    continue
                if known.rivals(effect, size, keep):
                    pool.append((motor_name, keep, effect, size))
    for number in range(COUNTS["tie"]):
        rng = draw.rng("tie", number)
        motor_name, keep, effect, size = pool[int(rng.integers(len(pool)))]
        yield _single(draw, "tie", "cannot be parted", number, motor_name, effect, size, rng, keep)


def _gaps(draw: Draw) -> Iterator[Case]:
    """Effects at typical size where the tests that would show them were not recorded."""
    for number in range(COUNTS["gap"]):
        rng = draw.rng("gap", number)
        motor_name = MOTORS[number % len(MOTORS)]
        motor, known = station(motor_name).motor, draw.sensitivity(motor_name)
        able = []
        for effect, gone in GAP_TESTS.items():
            keep = tuple(stem for stem in STEMS if not stem.startswith(gone))
            if known.noncentrality(effect, typical(effect, motor), keep) < UNSEEN:
                able.append((effect, keep))
        effect, keep = able[int(rng.integers(len(able)))]
        size = typical(effect, motor)
        yield _single(draw, "gap", "test missing", number, motor_name, effect, size, rng, keep)
