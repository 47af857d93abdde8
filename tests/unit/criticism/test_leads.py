"""What lies between an inverter and a motor is in commanded voltages, and in no measured one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from pipeline.criticism.diagnosis import diagnose
from pipeline.criticism.library.registry import effects
from pipeline.criticism.machine.model import Model, evaluate, lead_ohm
from pipeline.criticism.residuals.residual import operate
from pipeline.criticism.residuals.segments import segments
from pipeline.records.capture import Campaign, Capture, CaptureMeta, VoltageKind
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants
from pipeline.simulator.bench import campaign
from pipeline.simulator.design import EXACT, Bench
from tests.simulated import campaign_of, design
from tests.unit.criticism.machines import BASE, machine, operating

MOTOR = replace(design("servo-15kw"), effects={})
PLAN = (
    *((f"resistance_{pair}", "resistance", {"pair": pair}) for pair in ("ab", "bc", "ca")),
    ("torque_map", "torque_map", {}),
    ("drive_0", "drive", {}),
    ("drive_1", "drive", {}),
)
LEADS_OHM = 0.02


def behind_leads(capture: Capture) -> Capture:
    """A map of measured voltages; a drive's commanded ones, leads between it and the motor."""
    if capture.meta.test == "torque_map":
        return replace(capture, meta=replace(capture.meta, voltage_kind="measured"))
    axes = [(pl.col(f"v{n}_v") + LEADS_OHM * pl.col(f"i{n}_a")).alias(f"v{n}_v") for n in "dq"]
    tables = tuple(t.with_columns(axes) if "vq_v" in t.columns else t for t in capture.tables)
    return replace(capture, tables=tables)


def test_leads_of_a_seventh_of_the_resistance_are_no_missing_effect() -> None:
    whole = campaign_of(campaign(MOTOR, Bench(instruments=EXACT), 4, PLAN))
    found: Campaign = replace(whole, captures=tuple(map(behind_leads, whole.captures)))
    result = diagnose(found, ModelSpec(), Constants())
    assert 0.15 * MOTOR.r_phase_ohm < LEADS_OHM
    assert (result.verdict in ("adequate", "insufficient"), result.missing) == (True, ())
    assert result.ladder[-1].held_out < 0.8


@pytest.mark.parametrize(("impedance_ohm", "ohm"), [(None, 5e-3), (0.4, 5e-3), (100.0, 0.43)])
def test_switches_of_a_small_current_have_tenths_of_an_ohm(
    impedance_ohm: float | None, ohm: float
) -> None:
    """At 5 mOhm a sound motor at a drive of 300 V and 3 A was clock_scale and voltage_scale. Where
    no current is on record, none is known.
    """
    usual = machine()
    known = {} if impedance_ohm is None else {"impedance_ohm": impedance_ohm}
    model = Model(replace(usual, scales={**usual.scales, **known}), ())
    assert model.priors()["lead_ohm"] == (0.0, pytest.approx(ohm))


@pytest.mark.parametrize("kind", ["measured", "commanded", None])
def test_a_voltage_is_measured_only_where_that_is_stated(kind: VoltageKind | None) -> None:
    """A log whose kind nobody stated may hold its inverter's commands, and then its leads."""
    assert CaptureMeta("m", "drive").voltage_kind is None
    (made,) = campaign_of(campaign(MOTOR, Bench(instruments=EXACT), 4, PLAN[-1:])).captures
    log = replace(made, meta=replace(made.meta, voltage_kind=kind))
    (found,) = segments(Campaign("m", (log,)), machine())
    x = operate(found, found.recorded, Model(machine(), ()), BASE)
    leads = 0.0 if kind == "measured" else LEADS_OHM
    assert lead_ohm(x, {**BASE, "lead_ohm": LEADS_OHM}) == leads


@pytest.mark.parametrize("measured", [False, True])
def test_a_measured_voltage_holds_no_loss_of_an_inverter(measured: bool) -> None:
    effect = effects()["dead_time"]
    x = operating().fed(measured=measured)
    q = {p.name: 0.0 for p in effect.every(machine())} | {"loss_v": 0.5, "width_a": 0.1}
    assert effect.drop is not None
    assert np.any(effect.drop(x, q)) is np.bool_(not measured)
    plain = Model(machine(), ())
    with_leads, without = (
        evaluate(plain, x, {**BASE, "lead_ohm": ohm}).drop_v for ohm in (LEADS_OHM, 0.0)
    )
    leads = 0.0 if measured else LEADS_OHM
    assert with_leads - without == pytest.approx(leads * x.i_a, abs=1e-12)
