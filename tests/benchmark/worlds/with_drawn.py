"""World `drawn`: benches that nobody chose, of this project's simulator.

Each case draws a motor, a station, one to nine tests of the usual campaign, and what is left of
the logs. Many of these parts cannot show what is hidden in them, which no mark knows: to find
nothing is then right and counts as silent. The table is for false names, sound motors that are
called faulty, and diagnoses that break down.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from pipeline.contracts.validate import validate
from pipeline.records.capture import Campaign, Capture
from pipeline.records.errors import CaptureError
from pipeline.simulator.bench import CAMPAIGN
from pipeline.simulator.bench import campaign as recorded
from pipeline.simulator.design import Bench, Motor
from pipeline.simulator.effects import ALWAYS, FORMS, parameters
from tests.benchmark.sealing import MOTOR_TYPE, captures
from tests.benchmark.worlds.case import WorldCase
from tests.benchmark.worlds.damage import JUDGED, KINDS, Damage, damaged
from tests.simulated import design

MOTORS = ("drone-2306", "gimbal-5208", "joint-11p", "servo-15kw", "servo-ipm")
EFFECTS = {group: tuple(sorted(FORMS.keys() - {*ALWAYS, "backlash"})) for group in KINDS}
"""Groups of damages are the programmes. A gap alone is none: its coupling gives as well."""

EACH = 15
"""Sound motors, and as many with something hidden, of each group."""
TWO = 0.3
"""Share of the latter that hide two effects."""
COUNTS, COUNT_SHARES = (1, 2, 3, 4, 6, 9), (0.1, 0.2, 0.25, 0.2, 0.15, 0.1)
SHAFT_TESTS = ("drive", "spin_down", "torque_map", "open_circuit")
PREFERRED = 4.0
"""How much likelier a test of a turning shaft is in a part than any other: it shows more."""


@dataclass(frozen=True, slots=True)
class Draw:
    """A motor, its station, the tests that were done, and what is lost of them."""

    motor: Motor
    bench: Bench
    plan: tuple[int, ...]
    kind: str
    damage: tuple[Damage, ...]


def drawn(draw: int) -> list[WorldCase]:
    """The cases of a draw, from 1: sound motors, and those with one or two effects."""
    found = []
    for place, (group, effects) in enumerate(EFFECTS.items()):
        for seed in range(EACH * 2 * (draw - 1), EACH * 2 * draw):
            rng = np.random.default_rng([seed, place, 2])
            hidden = {}
            if seed % 2:
                names = rng.choice(effects, 1 + int(rng.uniform() < TWO), replace=False)
                hidden = dict(zip(map(str, names), (1.0, 0.5), strict=False))
            found.append(WorldCase("drawn", group, seed, hidden))
    return found


def draw_of(case: WorldCase) -> Draw:
    """What is drawn for a case: of its group and seed alone, whatever is hidden."""
    rng = np.random.default_rng([case.seed, list(KINDS).index(case.programme)])
    motor = _motor(str(rng.choice(MOTORS)), rng)
    bench = _bench(motor, rng)
    count = int(rng.choice(COUNTS, p=COUNT_SHARES))
    weight = np.array([PREFERRED if test in SHAFT_TESTS else 1.0 for _, test, _ in CAMPAIGN])
    plan = rng.choice(len(CAMPAIGN), size=count, replace=False, p=weight / weight.sum())
    kinds = KINDS[case.programme]
    kind = list(kinds)[rng.integers(len(kinds))]
    return Draw(motor, bench, tuple(sorted(map(int, plan))), kind, kinds[kind])


def campaign(case: WorldCase) -> Campaign:
    """The campaign of a case, as the reader would hand it on."""
    draw = draw_of(case)
    sizes = {n: share * parameters(n, draw.motor)["size"] for n, share in case.effects.items()}
    hidden = replace(draw.motor, motor_id=f"M{case.key[:10]}", motor_type=MOTOR_TYPE)
    plan = tuple(CAMPAIGN[k] for k in draw.plan)
    made = captures(recorded(hidden.having(**sizes), draw.bench, case.seed, plan))
    rng = np.random.default_rng([case.seed, 3])
    left = (damaged(capture, draw.damage, rng) for capture in made)
    kept = (capture for capture in left if capture is not None)
    if case.programme in JUDGED:
        kept = (found for found in map(_judged, kept) if found is not None)
    return Campaign(hidden.motor_id, tuple(kept))


def _judged(capture: Capture) -> Capture | None:
    """A capture as a reader hands it on, None where it refuses it."""
    try:
        return validate(capture, {})[0]
    except CaptureError:
        return None


def _motor(name: str, rng: np.random.Generator) -> Motor:
    """A design with constants up to half as large again, or two thirds, and without effects."""
    plain = replace(design(name), effects=MappingProxyType({}))

    def share() -> float:
        return float(np.exp(rng.uniform(-0.4, 0.4)))

    inductance = share()
    return replace(
        plain,
        r_phase_ohm=plain.r_phase_ohm * share(),
        ld_h=plain.ld_h * inductance,
        lq_h=plain.lq_h * inductance,
        j_rotor_kgm2=plain.j_rotor_kgm2 * share(),
        b_visc_nm_s_rad=plain.b_visc_nm_s_rad * share(),
        torque_coulomb_nm=plain.torque_coulomb_nm * share(),
    )


def _bench(motor: Motor, rng: np.random.Generator) -> Bench:
    """A station: switching frequency, resolution, noise, encoder, and where the torque is read.

    The electrical angle of a switching period stays below a radian at rated speed, as in any drive
    that is meant for its motor.
    """
    slowest = motor.pole_pairs * motor.speed_rated_rad_s
    usual = [hz for hz in (8e3, 10e3, 20e3, 40e3) if hz > slowest]
    reaction = bool(rng.uniform() < 0.15)
    return Bench(
        station="bench-1",
        pwm_hz=float(rng.choice(usual[:3])),
        encoder_bits=int(rng.choice([11, 12, 13, 14, 17])),
        encoder_noise_rad=float(rng.choice([0.0, 0.0, 1e-4, 5e-4])),
        noise_scale=float(rng.choice([0.3, 1.0, 1.0, 3.0])),
        adc_bits=int(rng.choice([12, 14, 16])),
        jitter_s=float(rng.choice([0.0, 0.0, 0.0, 2e-5])),
        u_rel_current=float(rng.choice([1e-3, 2e-3, 1e-2])),
        u_rel_voltage=float(rng.choice([1e-3, 5e-3])),
        dyno_hz=0.0 if reaction else float(rng.choice([0.0, 0.0, 3.0, 10.0])),
        torque_at_stator=reaction,
    )
