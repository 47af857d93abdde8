"""The torque constant of a torque map on simulated benches whose truth is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from pipeline.estimation.estimators.torque_map import ESTIMATOR as TORQUE_MAP
from pipeline.records.capture import Campaign
from pipeline.simulator.bench import campaign
from pipeline.simulator.catalogue import with_effects
from tests.simulated import campaign_of, design
from tests.unit.estimation.mechanical import EXACT_BENCH, chain, fitted, number, recorded


def test_torque_constant_and_reluctance() -> None:
    motor = design("gimbal-5208")
    known = chain(recorded(), TORQUE_MAP)
    kt, reluctance = known.best("kt_peak_nm_a"), known.best("kt_reluctance_nm_a2")
    assert kt is not None
    assert reluctance is not None
    assert kt.number == pytest.approx(1.5 * motor.pole_pairs * motor.psi_pm_wb, rel=3e-4)
    saliency = 1.5 * motor.pole_pairs * (motor.ld_h - motor.lq_h)
    assert abs(reluctance.number - saliency) < 4.0 * reluctance.u_a
    shares = {part.source: part.u / kt.number for part in kt.budget}
    assert shares["torque@sim-1"] == pytest.approx(0.002, rel=1e-6)
    assert shares["current@sim-1"] == pytest.approx(-0.002, rel=1e-3)


@pytest.mark.parametrize("effects", [pytest.param("", marks=pytest.mark.slow), "windage"])
def test_drag_of_a_map_that_misses_its_line_has_the_freedom_of_the_speeds(effects: str) -> None:
    """Five speeds less two of drag and the transducer's zero: two, where windage bends the drag;
    that of the points where the line holds.
    """
    machine = replace(design("gimbal-5208"), effects={})
    machine = with_effects(machine, effects) if effects else machine
    speeds = (0.15, 0.35, 0.55, -0.25, -0.45)
    plan = tuple((f"at_{s}", "torque_map", {"speed": s}) for s in speeds)
    captures = campaign_of(campaign(machine, EXACT_BENCH, 11, plan))
    for name in ("torque_coulomb_nm", "b_visc_nm_s_rad"):
        drag = chain(captures, TORQUE_MAP).by("torque_map", name)
        assert drag is not None
        scatter = next(p for p in drag.budget if p.source == f"scatter:torque_map:{name}")
        assert (scatter.dof == 2) == bool(effects)
        assert scatter.dof == 2 or scatter.dof > 100


def test_saturation_does_not_bend_the_torque_constant() -> None:
    """Saturating q flux takes torque from large currents only; K is the slope at small ones."""
    motor = design("servo-ipm")
    known = chain(recorded("saturation,cross_saturation", "servo-ipm"), TORQUE_MAP)
    kt = known.best("kt_peak_nm_a")
    assert kt is not None
    low, high = kt.interval()
    assert low <= 1.5 * motor.pole_pairs * motor.psi_pm_wb <= high
    assert kt.u / kt.number < 0.006


@pytest.mark.parametrize(
    "effects", ["saturation,cross_saturation", "cross_saturation=0.15", "saturation=0.25"]
)
def test_a_bent_map_leaves_the_small_current_torque_constant(effects: str) -> None:
    """1.5 p psi within 0.06 % whatever bends the map, and within what the budget says of form."""
    motor = design("servo-ipm")
    kt = chain(recorded(effects, "servo-ipm", ("torque_map",)), TORQUE_MAP).best("kt_peak_nm_a")
    assert kt is not None
    truth = 1.5 * motor.pole_pairs * motor.psi_pm_wb
    assert kt.number == pytest.approx(truth, rel=6e-4)
    form = next((p.u for p in kt.budget if p.source == "assumed:torque_form"), 0.0)
    assert abs(kt.number - truth) < 3.0 * float(np.hypot(kt.u_a, form))
    assert form < 5e-3 * truth


def test_the_torque_constant_has_the_freedom_of_the_points_that_it_is_fitted_to() -> None:
    """16 points without d current less 3 speeds and 4 odd powers, where saturation bends the map;
    44 points less 3 speeds, i_q and i_d i_q, where it does not. Never that of their samples.
    """
    bent = recorded("saturation,cross_saturation", "servo-ipm", ("torque_map",))
    straight = recorded(tests=("torque_map",))
    for captures, dof in ((bent, 9), (straight, 39)):
        kt = chain(captures, TORQUE_MAP).best("kt_peak_nm_a")
        assert kt is not None
        scatter = next(p for p in kt.budget if p.source == "scatter:torque_map:kt_peak_nm_a")
        assert scatter.dof == dof


@pytest.mark.parametrize("effect", ["torque_offset", "torque_lag", "load_dependent_friction"])
def test_sensor_and_friction_do_not_reach_the_torque_constant(effect: str) -> None:
    motor = design("gimbal-5208")
    kt = number(chain(recorded(effect), TORQUE_MAP), "torque_map", "kt_peak_nm_a")
    assert kt == pytest.approx(1.5 * motor.pole_pairs * motor.psi_pm_wb, rel=1.5e-3)


def test_torque_map_without_steps_names_the_experiment() -> None:
    captures = recorded()
    first = captures.of("torque_map")[0]
    short = replace(first, tables=(first.tables[0].head(30),))
    found = fitted(TORQUE_MAP, Campaign("m", (short,))).estimates
    assert {e.status for e in found} == {"not_identifiable"}
    assert all("hold each level for longer" in e.note for e in found)


def test_masked_rows_are_not_used() -> None:
    """Rows with no number anywhere are left out and everything else stays."""
    captures = recorded()
    holed = []
    for capture in captures.of("torque_map"):
        table = capture.tables[0]
        torque = table["torque_shaft_nm"].to_numpy().copy()
        torque[1000:1003] = np.nan
        holed.append(
            replace(capture, tables=(table.with_columns(pl.Series("torque_shaft_nm", torque)),))
        )
    kt = fitted(TORQUE_MAP, Campaign("m", tuple(holed))).estimates[0]
    whole = fitted(TORQUE_MAP, captures).estimates[0]
    assert kt.number == pytest.approx(whole.number, rel=1e-3)
