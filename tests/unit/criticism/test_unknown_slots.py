"""Cogging of a motor whose slots nobody stated, in logs without a slow turn."""

from __future__ import annotations

from dataclasses import replace

import pytest

import pipeline
from pipeline.criticism.effects import cogging
from pipeline.simulator.bench import campaign
from pipeline.simulator.design import EXACT, Bench
from tests.simulated import campaign_of, design
from tests.unit.criticism.machines import machine

MOTOR = design("gimbal-5208")
PLAN = (
    ("drive_0", "drive", {}),
    ("drive_1", "drive", {"temp_winding_degc": 55.0, "temp_magnet_degc": 42.0}),
    ("spin_down", "spin_down", {}),
)


@pytest.mark.parametrize(("effects", "missing"), [(MOTOR.effects, ("cogging",)), ({}, ())])
def test_cogging_is_named_without_the_number_of_slots(effects, missing):
    """12 slots and 14 poles cog 84 times a turn, twelve times a pole pair: order 6p is empty."""
    motor = replace(MOTOR, effects=effects)
    one = campaign_of(campaign(motor, Bench(instruments=EXACT), 1, PLAN))
    captures = tuple(replace(c, meta=replace(c.meta, slots=None)) for c in one.captures)
    recordings = pipeline.Recordings({one.motor_id: replace(one, captures=captures)})
    assert pipeline.diagnose(recordings)[one.motor_id].missing == missing


def test_orders_are_multiples_of_the_poles_that_windows_observe_or_logs_show():
    """What a log shows beside them counts where that many poles can make it; a turn decides."""
    unknown = replace(machine(7, None), torque_orders=())
    assert cogging.orders(unknown) == (14, 42, 84)
    assert cogging.orders(replace(unknown, load_orders=(8.5, 21, 126))) == (14, 42, 84, 126)
    assert cogging.orders(replace(unknown, torque_orders=(28,), load_orders=(126,))) == (28,)
    assert len({p.optional for p in cogging.EFFECT.parameters_of(unknown)} - {0}) == 3
