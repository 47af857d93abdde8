"""How large a machine is, before any fit."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pipeline.criticism.data.machine_scale import machine_of
from pipeline.records.constants import Constants
from pipeline.simulator.bench import CAMPAIGN, campaign
from pipeline.simulator.design import Bench
from tests.simulated import campaign_of, design

VOLTAGES = ("vd_v", "vq_v")


@pytest.mark.parametrize("name", ["servo-15kw", "drone-2306", "servo-ipm"])
@pytest.mark.parametrize("beside", [(), ("resistance_ab",)])
def test_the_flux_of_a_motor_without_voltages_is_that_of_its_torque(
    name: str, beside: tuple[str, ...]
) -> None:
    """The voltage of a resistance test is none of a turning winding's."""
    motor = replace(design(name), effects={})
    plan = tuple(step for step in CAMPAIGN if step[0] in ("torque_map_fast", *beside))
    found = campaign_of(campaign(motor, Bench(), 1, plan))
    logs = tuple(
        replace(c, tables=tuple(t.drop(VOLTAGES, strict=False) for t in c.tables))
        for c in found.captures
    )
    machine = machine_of(replace(found, captures=logs), Constants())
    assert machine is not None
    assert 0.4 < machine.scales["flux_wb"] / motor.psi_pm_wb < 2.5
