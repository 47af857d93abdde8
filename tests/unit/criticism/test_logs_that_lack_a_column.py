"""Logs of current and torque alone: they have the errors that any log of a drive has."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pipeline.criticism.diagnosis import diagnose
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants
from pipeline.simulator.bench import campaign
from pipeline.simulator.design import Bench
from tests.simulated import campaign_of, design

VOLTS = ("vd_v", "vq_v")
DRIVES = tuple((f"drive_{n}", "drive", {"segments": 6}) for n in range(2))


@pytest.mark.parametrize("lost", [VOLTS, ("theta_mech_rad", *VOLTS)])
def test_logs_of_current_and_torque_have_the_errors_of_any_drive(lost) -> None:
    """Rest, pulses and lines of the encoder were no errors of theirs: `current_delay`."""
    still = replace(design("gimbal-5208"), effects={})
    whole = campaign_of(campaign(still, Bench(), 3, DRIVES))
    captures = tuple(
        replace(one, tables=tuple(t.drop(lost, strict=False) for t in one.tables))
        for one in whole.captures
    )
    found = diagnose(replace(whole, captures=captures), ModelSpec(), Constants())
    assert found.verdict in ("adequate", "insufficient")
    assert not found.missing
