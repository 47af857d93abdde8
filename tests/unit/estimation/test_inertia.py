"""Inertia and friction of coasting shafts and drives on simulated benches whose truth is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from pipeline.estimation.estimators.cogging import ESTIMATOR as COGGING
from pipeline.estimation.estimators.inertia import ESTIMATOR as INERTIA
from pipeline.estimation.estimators.spin_down import ESTIMATOR as SPIN_DOWN
from pipeline.estimation.estimators.torque_map import ESTIMATOR as TORQUE_MAP
from pipeline.estimation.registry import fit_all
from pipeline.records.capture import Campaign
from pipeline.records.constants import Constants
from pipeline.simulator.bench import CAMPAIGN, campaign
from tests.simulated import campaign_of, design
from tests.unit.estimation.mechanical import (
    EXACT_BENCH,
    MECHANICAL,
    chain,
    fitted,
    number,
    recorded,
)
from tests.unit.estimation.signals import known_value


@pytest.mark.parametrize("name", ["gimbal-5208", "drone-2306", "servo-15kw"])
def test_coast_down_ratios(name: str) -> None:
    motor = design(name)
    known = chain(recorded("", name, ("spin_down",)), SPIN_DOWN)
    coulomb = number(known, "spin_down", "coast_coulomb_rad_s2")
    viscous = number(known, "spin_down", "coast_viscous_1_s")
    assert coulomb == pytest.approx(motor.torque_coulomb_nm / motor.j_rotor_kgm2, rel=2e-4)
    assert viscous == pytest.approx(motor.b_visc_nm_s_rad / motor.j_rotor_kgm2, rel=2e-3)


@pytest.mark.parametrize(
    "effect",
    [
        "windage",
        pytest.param("stribeck", marks=pytest.mark.slow),
        pytest.param("angle_eccentricity", marks=pytest.mark.slow),
    ],
)
def test_coast_down_ratios_with_more_than_coulomb_and_viscous(effect: str) -> None:
    motor = design("gimbal-5208")
    known = chain(recorded(effect), SPIN_DOWN)
    coulomb = number(known, "spin_down", "coast_coulomb_rad_s2")
    assert coulomb == pytest.approx(motor.torque_coulomb_nm / motor.j_rotor_kgm2, rel=0.02)


OTHERS = ("windage", "unbalance", "bemf_harmonics", "torque_lag")


@pytest.mark.parametrize(
    "effect",
    ["", "stribeck", *(pytest.param(one, marks=pytest.mark.slow) for one in ("cogging", *OTHERS))],
)
def test_inertia_and_friction(effect: str) -> None:
    motor = design("gimbal-5208")
    known = chain(recorded(effect), SPIN_DOWN, TORQUE_MAP, COGGING, INERTIA)
    assert number(known, "inertia", "j_rotor_kgm2") == pytest.approx(motor.j_rotor_kgm2, rel=0.004)
    friction = number(known, "inertia", "torque_coulomb_nm")
    assert friction == pytest.approx(motor.torque_coulomb_nm, rel=0.02)
    viscous = number(known, "inertia", "b_visc_nm_s_rad")
    assert viscous == pytest.approx(motor.b_visc_nm_s_rad, rel=0.06)


def test_inertia_carries_the_torque_gain_and_not_the_current_gain() -> None:
    """J = Kt i / alpha and Kt = T / i: the current gain cancels, the torque gain stays."""
    known = chain(recorded(), SPIN_DOWN, TORQUE_MAP, COGGING, INERTIA)
    inertia = known.by("inertia", "j_rotor_kgm2")
    assert inertia is not None
    shares = {part.source: part.u / inertia.number for part in inertia.budget}
    assert shares["torque@sim-1"] == pytest.approx(0.002, rel=0.01)
    assert abs(shares.get("current@sim-1", 0.0)) < 2e-5


def test_currents_of_the_wrong_sign_give_no_friction() -> None:
    """Viscous friction came out as measured and below zero beside an inertia that was withheld."""
    plan = tuple((s, t, {**how, "load": 0.0}) for s, t, how in CAMPAIGN if t == "drive")
    motor = replace(design("gimbal-5208"), effects={})
    drives = with_currents(campaign_of(campaign(motor, EXACT_BENCH, 11, plan)), -1.0)
    unloaded = (
        replace(c, tables=tuple(t.drop("torque_shaft_nm") for t in c.tables))
        for c in drives.captures
    )
    known = fit_all(replace(drives, captures=tuple(unloaded)), {})[0]
    for name in ("j_rotor_kgm2", "torque_coulomb_nm", "b_visc_nm_s_rad"):
        assert known.best(name) is None, name
    (viscous,) = (e for e in known.all_of("b_visc_nm_s_rad") if e.method == "inertia")
    assert "look at the signs of iq_a" in viscous.note


def with_currents(captures: Campaign, gain: float) -> Campaign:
    """The same campaign with the currents of its drives read high by a factor."""
    read = [pl.col("id_a") * gain, pl.col("iq_a") * gain]
    return Campaign(
        captures.motor_id,
        tuple(
            replace(c, tables=tuple(table.with_columns(read) for table in c.tables))
            if c.meta.test == "drive"
            else c
            for c in captures.captures
        ),
    )


@pytest.mark.slow
def test_a_current_gain_enters_once_by_the_magnet_and_squared_by_reluctance() -> None:
    """Lq twice Ld, torque constants from elsewhere, a free shaft: u is half of what J moves between
    currents read high and low by their u, with the same columns; more than the gain by itself.
    """
    motor = design("servo-ipm")
    plan = tuple(
        (stem, test, {**protocol, "id_level": 1.0, "load": 0.0} if test == "drive" else protocol)
        for stem, test, protocol in CAMPAIGN
        if test in ("drive", "spin_down")
    )
    captures = campaign_of(campaign(replace(motor, effects={}), EXACT_BENCH, 11, plan))
    kt = 1.5 * motor.pole_pairs * motor.psi_pm_wb
    reluctance = 1.5 * motor.pole_pairs * (motor.ld_h - motor.lq_h)
    known = Constants(
        (
            known_value("kt_peak_nm_a", kt, unit="N·m/A"),
            known_value("kt_reluctance_nm_a2", reluctance, unit="N·m/A²"),
        )
    )
    meta = captures.of("drive")[0].meta
    u_rel = meta.instrument_u("u_rel_current")
    alone = {"level": 0.0}
    inertia = INERTIA.fit(captures, known, alone).estimates[0]
    (part,) = (p for p in inertia.budget if p.source == f"current@{meta.station}")
    high, low = (
        INERTIA.fit(with_currents(captures, gain), known, alone).estimates[0].number
        for gain in (1.0 + u_rel, 1.0 - u_rel)
    )
    assert part.u == pytest.approx((high - low) / 2.0, rel=0.02)
    assert part.u > 1.05 * u_rel * inertia.number


def with_short_drives(captures: Campaign, start_s: float, length_s: float) -> Campaign:
    """The same campaign with a piece of each drive."""
    inside = pl.col("t_s").is_between(start_s, start_s + length_s)
    cut = tuple(
        replace(c, tables=tuple(table.filter(inside) for table in c.tables))
        if c.meta.test == "drive"
        else c
        for c in captures.captures
    )
    return Campaign(captures.motor_id, cut)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    "start_s",
    [
        0.1,
        pytest.param(0.33, marks=pytest.mark.slow),
        pytest.param(0.6, marks=pytest.mark.slow),
        0.8,
    ],
)
def test_a_drive_of_a_few_windows_is_refused_with_the_experiment(start_s: float) -> None:
    """30 ms hold two windows: any column of its own would fit them without a residual."""
    known = chain(recorded(), SPIN_DOWN, TORQUE_MAP, COGGING)
    found = fitted(INERTIA, with_short_drives(recorded(), start_s, 0.03), known).estimates
    assert {e.name for e in found} == {"j_rotor_kgm2", "torque_coulomb_nm", "b_visc_nm_s_rad"}
    assert {e.status for e in found} == {"not_identifiable"}
    assert all("share no sample" in e.note for e in found)
    assert all("record a drive of at least a second and a turn" in e.note for e in found)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    "length_s",
    [
        0.06,
        pytest.param(0.15, marks=pytest.mark.slow),
        *(pytest.param(s, marks=pytest.mark.slow) for s in (0.1, 0.3)),
    ],
)
def test_inertia_of_a_short_drive_is_right_or_refused(length_s: float) -> None:
    motor = design("gimbal-5208")
    known = chain(recorded(), SPIN_DOWN, TORQUE_MAP, COGGING)
    given = 0
    for start_s in (0.05, 0.2, 0.35, 0.5, 0.65):
        captures = with_short_drives(recorded(), start_s, length_s)
        estimate = fitted(INERTIA, captures, known).estimates[0]
        if estimate.value is None:
            assert "record a drive" in estimate.note
            continue
        given += 1
        assert abs(estimate.number - motor.j_rotor_kgm2) < 3.0 * estimate.u
        scatter = [p.u for p in estimate.budget if p.source.startswith("scatter:inertia")]
        assert np.linalg.norm(scatter) > 1e-6 * estimate.number
    assert given == 5 if length_s >= 0.15 else given < 5


def test_torque_that_is_friction_in_disguise_is_not_parted() -> None:
    from pipeline.estimation.mechanical.drive_windows import torque_is_separable

    sense, speed = np.ones(40), np.linspace(1.0, 3.0, 40)
    rest = [sense, speed]
    assert not torque_is_separable(np.column_stack([0.2 * sense + 0.1 * speed, *rest]), sense)
    assert torque_is_separable(np.column_stack([speed**2, *rest]), sense)


def test_what_inertia_added_is_said_and_claims_no_effect() -> None:
    known = chain(recorded("windage"), SPIN_DOWN, TORQUE_MAP, COGGING, INERTIA)
    found = known.by("inertia", "j_rotor_kgm2")
    assert found is not None
    assert "allowed for in this fit, no finding (diagnose tells effects): " in found.note
    assert "demand" not in found.note
    assert "windage" in found.note


def test_inertia_without_a_torque_constant_says_so() -> None:
    found = fitted(INERTIA, recorded()).estimates
    assert {e.status for e in found} == {"not_identifiable"}
    assert all("torque constant" in e.note for e in found)


def test_drag_of_another_form_is_not_called_viscous() -> None:
    """A brake whose drag peaks and falls: J holds, B is refused, Coulomb is allowed for."""
    from pipeline.simulator.outside import with_unknown

    motor = with_unknown(replace(design("gimbal-5208"), effects={}), "eddy_brake", 3.0)
    plan = tuple(step for step in CAMPAIGN if step[1] in MECHANICAL)
    captures = campaign_of(campaign(motor, EXACT_BENCH, 2, plan))
    known = chain(captures, SPIN_DOWN, TORQUE_MAP, COGGING, INERTIA)
    assert number(known, "inertia", "j_rotor_kgm2") == pytest.approx(motor.j_rotor_kgm2, rel=0.006)
    assert known.by("inertia", "b_visc_nm_s_rad") is None
    friction = known.by("inertia", "torque_coulomb_nm")
    assert friction is not None
    low, high = friction.interval()
    assert low <= motor.torque_coulomb_nm <= high


def test_plots_over_time_name_their_capture() -> None:
    """A recording shows only series that say which capture they belong to."""
    captures = recorded("")
    coasting = fitted(SPIN_DOWN, captures)
    known = Constants(coasting.estimates).adding(fitted(TORQUE_MAP, captures).estimates)
    paths = {c.path for c in captures.of("drive", "spin_down")}
    for found in (coasting, fitted(INERTIA, captures, known)):
        timed = [one for one in found.evidence if one.x_name == "t_s"]
        assert timed
        assert {one.capture for one in timed} <= paths
        assert all(series.fitted.size == series.x.size for one in timed for series in one.series)
