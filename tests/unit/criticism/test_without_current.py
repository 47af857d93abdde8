"""Coasts and open-circuit spins alone: an inertia that nothing gives, and effects all the same."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pipeline.criticism.diagnosis import diagnose
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants
from pipeline.simulator.bench import CAMPAIGN, campaign
from pipeline.simulator.design import Bench
from tests.simulated import campaign_of, design

COASTS = tuple(step for step in CAMPAIGN if step[0].startswith("spin_down"))
SPINS = tuple(step for step in CAMPAIGN if step[0].startswith("open_circuit"))


@pytest.mark.parametrize(
    ("hidden", "plan"),
    [
        pytest.param((), COASTS + SPINS, marks=pytest.mark.slow),
        pytest.param(("windage",), COASTS, marks=pytest.mark.slow),
        (("bemf_harmonics",), SPINS),
    ],
)
def test_what_turns_without_current_is_enough_for_a_diagnosis(hidden, plan):
    """A drag is known over the inertia alone; a harmonic in its own size."""
    motor = replace(design("gimbal-5208"), effects={}).having(**dict.fromkeys(hidden))
    result = diagnose(campaign_of(campaign(motor, Bench(), 5, plan)), ModelSpec(), Constants())
    assert result.missing == hidden
    ratios = [note for note in result.notes if note.startswith("windage.drag_nm/j_kgm2 = ")]
    assert len(ratios) == ("windage" in hidden)
