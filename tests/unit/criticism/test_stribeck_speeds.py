"""Friction that falls with speed, at whatever speed it does, in coasts that end above it."""

from __future__ import annotations

import pytest

from pipeline.criticism.diagnosis import diagnose
from pipeline.records.capture import Campaign
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants
from tests.unit.criticism.coasts import Shaft
from tests.unit.estimation.signals import capture


@pytest.mark.parametrize("slow_rad_s", [6.0, 11.0, 25.0])
def test_the_speed_at_which_friction_falls_is_looked_for_everywhere(slow_rad_s: float) -> None:
    """Trial speeds three times apart left a fit at 3.5 rad/s, or none, for 6 and for 25."""
    shaft = Shaft(dry=20.0, excess=20.0, slow_rad_s=slow_rad_s, viscous=0.133)
    captures = [capture("spin_down", f"coast{s}", **shaft.coast(s)) for s in (1.0, -1.0)]
    found = diagnose(Campaign("m", tuple(captures)), ModelSpec(), Constants())
    assert found.missing == ("stribeck",)
