"""Where a transducer of torque sits is told by the captures: no metadata state it."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pipeline.criticism.diagnosis import diagnose
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants
from pipeline.simulator.bench import CAMPAIGN, campaign
from pipeline.simulator.design import Bench
from tests.simulated import campaign_of, design

TESTS = ("resistance_ab", "torque_map_slow", "torque_map_backward", "drive_0", "spin_down_forward")
PLACES = {
    "in the shaft": Bench(dyno_hz=12.0, encoder_bits=14),
    "at the stator": Bench(dyno_hz=12.0, encoder_bits=14, torque_at_stator=True),
}


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("hidden", [(), ("stribeck",)])
def test_the_place_of_a_transducer_is_told_and_is_no_effect(place, hidden):
    """Expected: the same name and the floor at either place, and a note at the stator alone."""
    motor = replace(design("gimbal-5208"), effects={}).having(**dict.fromkeys(hidden))
    plan = tuple(step for step in CAMPAIGN if step[0] in TESTS)
    recorded = campaign_of(campaign(motor, PLACES[place], 5, plan))
    result = diagnose(recorded, ModelSpec(), Constants())
    assert result.missing == hidden
    assert result.ladder[-1].held_out < 1.0
    notes = [note for note in result.notes if "read at the stator" in note]
    told = ["torque_shaft_nm of 3 captures"] if place == "at the stator" else []
    assert [note[: len(told[0])] for note in notes] == told
