"""Friction that grows with the torque: a rotor that is held shows none of it beside its own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from pipeline.criticism.data.machine_scale import machine_of
from pipeline.criticism.diagnosis import diagnose
from pipeline.criticism.library.registry import effects
from pipeline.criticism.machine.model import Model
from pipeline.criticism.residuals.residual import residual
from pipeline.criticism.residuals.segments import segments
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants
from pipeline.simulator.bench import campaign
from pipeline.simulator.design import Bench
from tests.simulated import campaign_of, design
from tests.unit.criticism.machines import BASE
from tests.unit.estimation.signals import capture as signal_capture

MOTOR = replace(design("gimbal-5208"), effects={})


def recorded(*tests: str):
    return campaign_of(campaign(MOTOR, Bench(), 3, tuple((t, t, {}) for t in tests)))


@pytest.mark.parametrize("beside", ["spin_down", "torque_table"])
def test_a_held_rotor_that_lacks_nothing_has_no_friction_of_its_torque(beside) -> None:
    """A share of a half took half of the residual, noise and all: the fit was twice as good."""
    found = diagnose(recorded("holding_current", beside), ModelSpec(), Constants())
    assert (found.verdict, found.missing) == ("insufficient", ())


@pytest.mark.parametrize("share", [0.0, 0.02, 0.3])
def test_an_ampere_is_an_ampere_of_the_residual_whatever_the_friction(share) -> None:
    whole = recorded("holding_current")
    machine = machine_of(whole, Constants())
    assert machine is not None
    (held,) = segments(whole, machine)
    names = ("coulomb_friction", "load_dependent_friction")
    model = Model(machine, tuple(effects()[name] for name in names))
    values = {
        **BASE,
        **dict.fromkeys(machine.unlogged, 0.0),
        "psi_wb": MOTOR.psi_pm_wb,
        "coulomb_friction.torque_nm": MOTOR.torque_coulomb_nm,
        "load_dependent_friction.share": share,
    }
    more = {**held.recorded, "iq_a": held.recorded["iq_a"] + 0.01}
    change = residual(held, model, values, more) - residual(held, model, values)
    assert change == pytest.approx(0.01)
    holds = residual(held, model, values) - held.recorded["iq_a"]
    torque = 1.5 * machine.pole_pairs * MOTOR.psi_pm_wb * np.abs(holds)
    assert torque == pytest.approx(MOTOR.torque_coulomb_nm / (1.0 - share), rel=share**3 + 1e-9)


@pytest.mark.parametrize("share", [0.5, 0.8, 1.3])
def test_a_held_rotor_has_any_friction_up_to_stiction(share) -> None:
    """A rotor at rest had a fifth less friction than one that turned: `iron_eddy` was named."""
    whole = recorded("holding_current", "drive", "spin_down")
    ampere = MOTOR.torque_coulomb_nm / (1.5 * MOTOR.pole_pairs * MOTOR.psi_pm_wb)
    lacking = (share - 1.0) * ampere * pl.col("iq_a").sign()
    captures = [
        replace(c, tables=tuple(t.with_columns(pl.col("iq_a") + lacking) for t in c.tables))
        if c.meta.test == "holding_current"
        else c
        for c in whole.captures
    ]
    found = diagnose(replace(whole, captures=tuple(captures)), ModelSpec(), Constants())
    assert found.missing == ()
    assert found.verdict != "unknown"


def test_the_pace_of_a_held_rotor_is_no_speed_of_its_winding() -> None:
    """The voltage of a resistance over 0.04 rad/s made a flux a thousand times too large, and
    nothing that a table or a held rotor shows was of a size that matters.
    """
    still = recorded("holding_current", "torque_table", "resistance")
    machine = machine_of(still, Constants())
    assert machine is not None
    assert machine.scales["flux_wb"] == pytest.approx(MOTOR.psi_pm_wb, rel=0.2)
    table = still.of("torque_table")[0].arrays("torque_shaft_nm")["torque_shaft_nm"]
    assert machine.scales["torque_nm"] == pytest.approx(np.max(np.abs(table)), rel=0.05)


def test_a_turn_by_hand_without_an_angle_is_one_turn_in_its_time() -> None:
    seconds = np.linspace(0.0, 1.5, 300)
    turned = signal_capture("hand_turn", t_s=seconds, vab_v=np.sin(40.0 * seconds))
    whole = recorded("holding_current")
    machine = machine_of(replace(whole, captures=(*whole.captures, turned)), Constants())
    assert machine is not None
    assert machine.scales["speed_rad_s"] == pytest.approx(2.0 * np.pi / 1.5)
