"""The time of `diagnose` grows with the samples and no faster."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import pytest

from pipeline.criticism.data.machine_scale import machine_of
from pipeline.criticism.diagnosis import diagnose
from pipeline.criticism.residuals.segments import segments
from pipeline.records.capture import Campaign
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants
from pipeline.stages.steps.campaigns import campaigns

RIG = Path(__file__).parents[3] / "shared" / "data" / "rig"
pytestmark = pytest.mark.skipif(not RIG.is_dir(), reason="shared rig captures are not here")


def repeated(campaign: Campaign, times: int) -> Campaign:
    """Every capture that many times, as if it had been recorded again."""
    captures = tuple(
        replace(capture, path=f"{number}/{capture.path}")
        for number in range(times)
        for capture in campaign.captures
    )
    return replace(campaign, captures=captures)


@pytest.mark.slow
def test_twice_and_four_times_the_samples_take_twice_and_four_times_as_long(monkeypatch) -> None:
    # an order that a copy of a capture has as well is in no second capture
    monkeypatch.setattr("pipeline.criticism.search.orders_left", lambda *_: ())
    once = campaigns(str(RIG / "P0"))[0][0]
    told = []
    for times in (1, 2, 4):
        campaign = repeated(once, times)
        found = segments(campaign, machine_of(campaign, Constants()))
        begun = time.process_time()
        assert diagnose(campaign, ModelSpec(), Constants()).verdict == "adequate"
        told.append((sum(s.size for s in found), time.process_time() - begun))
    (first, least), *others = told
    for samples, seconds in others:
        assert seconds / least < 1.2 * samples / first
