"""Orders of cogging in logs without a slow turn, of slots that are stated or not."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest

import pipeline
from pipeline.criticism.effects import cogging
from pipeline.simulator.bench import campaign
from pipeline.simulator.design import EXACT, Bench, Extra
from tests.simulated import campaign_of, design
from tests.unit.criticism.machines import machine

MOTOR = design("gimbal-5208")
PLAN = (
    ("drive_0", "drive", {}),
    ("drive_1", "drive", {"temp_winding_degc": 55.0, "temp_magnet_degc": 42.0}),
    ("spin_down", "spin_down", {}),
)


@pytest.mark.parametrize(
    ("effects", "missing"),
    [(MOTOR.effects, ("cogging",)), pytest.param({}, (), marks=pytest.mark.slow)],
)
def test_cogging_is_named_without_the_number_of_slots(effects, missing):
    """12 slots and 14 poles cog 84 times a turn, twelve times a pole pair: order 6p is empty."""
    motor = replace(MOTOR, effects=effects)
    one = campaign_of(campaign(motor, Bench(instruments=EXACT), 1, PLAN))
    captures = tuple(replace(c, meta=replace(c.meta, slots=None)) for c in one.captures)
    recordings = pipeline.Recordings({one.motor_id: replace(one, captures=captures)})
    assert pipeline.diagnose(recordings)[one.motor_id].missing == missing


def test_cogging_of_the_slots_alone_is_named():
    """One magnet that is weaker than the others cogs once a slot, and not LCM(slots, 2p) times."""
    turn_rad = np.linspace(0.0, 2.0 * math.pi, 10 * MOTOR.slots + 1)
    size_nm = 0.02 * MOTOR.torque_rated_nm
    wave = Extra(
        "torque", "theta_mech_rad", tuple(turn_rad), tuple(size_nm * np.sin(12 * turn_rad))
    )
    motor = replace(MOTOR, effects={}, extras=(wave,))
    one = campaign_of(campaign(motor, Bench(instruments=EXACT), 1, PLAN[2:]))
    diagnosis = pipeline.diagnose(pipeline.Recordings({one.motor_id: one}))[one.motor_id]
    assert (diagnosis.verdict, diagnosis.missing) == ("missing", ("cogging",))
    assert diagnosis.ladder[-1].held_out < 1.3


@pytest.mark.parametrize(
    ("name", "seed", "order", "size_nm"),
    [
        pytest.param("gimbal-5208", 1, 84, 0.0085, marks=pytest.mark.slow),
        ("servo-ipm", 2, 72, 0.06),
    ],
)
def test_one_coast_shows_cogging_and_its_size_over_the_inertia(name, seed, order, size_nm):
    """Where it is slow. Nothing was said of one, and of the other a friction of low speeds."""
    motor = design(name)
    motor = replace(motor, effects={"cogging": motor.effects["cogging"]})
    one = campaign_of(campaign(motor, Bench(instruments=EXACT), seed, PLAN[2:]))
    result = pipeline.diagnose(pipeline.Recordings({one.motor_id: one}))[one.motor_id]
    assert result.missing == ("cogging",)
    says = "".join(note for note in result.notes if f"_{order}_nm/j_kgm2" in note)
    parts = [float(word) for word in re.findall(r"= (-?[\d.]+) ±", says.replace("−", "-"))]
    assert len(parts) == 2
    assert math.hypot(*parts) * motor.j_rotor_kgm2 == pytest.approx(size_nm, rel=0.05)


@pytest.mark.parametrize("name", ["servo-ipm", pytest.param("gimbal-5208", marks=pytest.mark.slow)])
def test_a_slow_turn_beside_a_torque_map_shows_its_cogging(name):
    """Its parameters paid for all rows of the map, which tell nothing of them: -8 of evidence."""
    motor = design(name)
    motor = replace(motor, effects={"cogging": motor.effects["cogging"]})
    plan = (
        ("cogging_cw", "cogging", {"direction": 1}),
        ("torque_map_slow", "torque_map", {"speed": 0.2}),
    )
    one = campaign_of(campaign(motor, Bench(instruments=EXACT), 1, plan))
    result = pipeline.diagnose(pipeline.Recordings({one.motor_id: one}))[one.motor_id]
    assert result.missing == ("cogging",)
    assert result.ranking[0].score > 0.0


def test_orders_are_those_that_magnets_and_slots_make():
    """A slow turn decides; without one, p, 2p, the slots, their LCM and its double may be there,
    and what logs show where it is a multiple of them.
    """
    known, unknown = machine(7, 12), machine(7, None)
    assert cogging.orders(replace(known, torque_orders=())) == (7, 12, 14, 84, 168)
    assert cogging.orders(replace(unknown, torque_orders=())) == (7, 14, 42, 84)
    logs = {"torque_orders": (), "load_orders": (8.5, 10, 36, 126)}
    assert cogging.orders(replace(known, **logs)) == (7, 12, 14, 36, 84, 126, 168)
    # slots that nobody states are a multiple of three
    assert cogging.orders(replace(unknown, **logs)) == (7, 14, 36, 42, 84, 126)
    assert cogging.orders(replace(unknown, torque_orders=(28,), load_orders=(126,))) == (28,)
    assert cogging.orders(replace(machine(1, None), torque_orders=())) == (2, 6, 12)
    optional = {p.optional for p in cogging.EFFECT.parameters_of(replace(known, torque_orders=()))}
    assert optional == {1, 2, 3, 4, 5}
