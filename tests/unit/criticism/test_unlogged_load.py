"""Drives without a transducer: the motion of a free shaft counts, that of a loaded one does not."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from pipeline.criticism.comparison import compare
from pipeline.criticism.data.drive_log import DriveLog, drive_log
from pipeline.criticism.data.machine_scale import machine_of
from pipeline.criticism.data.segment import Sensors
from pipeline.criticism.data.unlogged_load import unexplained_share
from pipeline.criticism.parameter import Machine
from pipeline.criticism.residuals.segments import segments
from pipeline.records.capture import Campaign
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants
from pipeline.simulator.bench import campaign
from pipeline.simulator.design import EXACT, Bench, Motor
from pipeline.simulator.truth import truth
from tests.simulated import campaign_of, design

MOTOR = replace(design("gimbal-5208"), effects={})
TRUE = truth(MOTOR)["constants"]
J, PSI, DRY = TRUE["j_rotor_kgm2"], TRUE["psi_pm_wb"], TRUE["torque_coulomb_nm"]
AXES = ("id_a", "iq_a", "vd_v", "vq_v", "theta_mech_rad", "temp_winding_degc", "temp_magnet_degc")
FREE, LOADED = {"load": 0.0}, {}
REACH = 2.576
SCALES = {"current_a": 1.0, "voltage_v": 1.0, "speed_rad_s": 10.0, "torque_nm": 1.0}
MACHINE = Machine(3, 9, SCALES)
UNEXPLAINED = MACHINE.policy.cutting.unexplained_share


def driven(how: dict[str, float], keep: Collection[str] = AXES, motor: Motor = MOTOR) -> Campaign:
    whole = campaign_of(campaign(motor, Bench(instruments=EXACT), 2, (("d", "drive", how),)))
    (one,) = whole.captures
    tables = (t.select([n for n in t.columns if n in {"t_s", *keep}]) for t in one.tables)
    return replace(whole, captures=(replace(one, tables=tuple(tables)),))


def share(part: Campaign) -> float | None:
    machine = machine_of(part, Constants())
    return unexplained_share(drive_log(part.captures[0], machine), machine)


def kinds(part: Campaign) -> set[str]:
    return {one.kind for one in segments(part, machine_of(part, Constants()))}


@pytest.mark.parametrize("keep", [AXES, ("iq_a", "vq_v", "theta_mech_rad")])
def test_only_a_free_shaft_has_an_equation_of_motion(keep):
    assert "motion" in kinds(driven(FREE, keep))
    assert "motion" not in kinds(driven(LOADED, keep))


def test_a_transducer_tells_the_load_whatever_it_is():
    assert kinds(driven(FREE, (*AXES, "torque_shaft_nm"))) == {"dq"}


def test_a_shaft_at_rest_says_nothing_of_a_load():
    """Half a second is appended in which a load of half the friction is held by it."""
    moving = driven(FREE)
    (capture,) = moving.captures
    (table,) = capture.tables
    end_s, period = table["t_s"][-1], table["t_s"][1] - table["t_s"][0]
    rest = pl.concat([table.tail(1)] * round(0.5 / period)).with_columns(
        t_s=end_s + period * (1.0 + pl.int_range(pl.len()))
    )
    both = replace(capture, tables=(pl.concat([table, rest]),))
    (motion,) = (
        one
        for one in segments(replace(moving, captures=(both,)), machine_of(moving, Constants()))
        if one.kind == "motion"
    )
    last = motion.recorded["t_s"][motion.weak.starts + motion.weak.length // 2]
    assert last.max() < end_s - table["t_s"][0]
    assert last.max() > 0.9 * (end_s - table["t_s"][0])


def test_what_a_load_leaves_is_far_from_what_a_free_shaft_leaves():
    assert share(driven(FREE)) < UNEXPLAINED / 4
    assert share(driven(LOADED)) > 4 * UNEXPLAINED


def turned(acceleration: Callable[[float, float, float], float], seconds: float = 4.0) -> DriveLog:
    """A log with a swinging current, and a shaft that goes by d²θ/dt² of (i, θ, t)."""
    period = 1e-3
    time = period * np.arange(round(seconds / period))
    amps = np.sin(8.0 * np.pi * time)
    theta, speed = [0.0], 2.0
    for t, i in zip(time[1:], amps[1:], strict=True):
        speed += period * acceleration(i, theta[-1], t)
        theta.append(theta[-1] + period * speed)
    columns = {"theta_mech_rad": np.array(theta), "iq_a": amps}
    sensors = Sensors(dict.fromkeys(columns, 1e-09))
    return DriveLog(period, columns, np.ones(time.size, dtype=bool), sensors, False, True)


def cogging(i: float, theta: float, _: float) -> float:
    return 50.0 * (i + 0.5 * np.cos(MACHINE.pole_pairs * theta))


def load(i: float, _: float, t: float) -> float:
    return 50.0 * (i + 0.5 * np.sign(np.sin(11.0 * t)))


def test_waves_of_the_angle_are_no_load_and_steps_in_time_are():
    assert unexplained_share(turned(cogging), MACHINE) < UNEXPLAINED
    assert unexplained_share(turned(load), MACHINE) > 4 * UNEXPLAINED


def test_a_shaft_that_dry_friction_holds_is_not_loaded() -> None:
    """It stands while the current is too small to break it loose, and accelerates by none of it."""
    log = turned(lambda *_: 0.0)
    amps = np.repeat(np.random.default_rng(1).uniform(-1.0, 1.0, 40), 100)
    theta, omega = [0.0], 0.0
    for i in amps[1:]:
        driven_by = i - 0.6 * np.sign(omega or i)
        after = omega + log.period_s * 500.0 * driven_by
        stands = omega * after < 0.0 or (omega == 0.0 and abs(i) < 0.6)
        omega = 0.0 if stands else after
        theta.append(theta[-1] + log.period_s * omega)
    held = replace(log, columns={"iq_a": amps, "theta_mech_rad": np.array(theta)})
    assert unexplained_share(held, MACHINE) < UNEXPLAINED / 4


def test_an_encoder_off_its_centre_is_no_load():
    """Its error once a turn accelerates by the square of the speed, as no torque's wave does."""
    log = turned(lambda i, *_: 50.0 * i + 20.0)
    theta = log.columns["theta_mech_rad"]
    assert np.ptp(theta) > 20.0
    wobble = {**log.columns, "theta_mech_rad": theta + 0.01 * np.sin(theta + 0.3)}
    assert unexplained_share(replace(log, columns=wobble), MACHINE) < UNEXPLAINED


def pulsating(i: float, _: float, t: float) -> float:
    return 50.0 * (i + 0.5 * np.sin(70.0 * t))


def test_a_load_that_pulsates_is_no_spring():
    """Of one frequency its fourth derivative is a multiple of its second, as a spring's is not."""
    assert unexplained_share(turned(pulsating), MACHINE) > 4 * UNEXPLAINED


def sprung(hertz: float, share: float) -> Motor:
    """The motor with a share of its inertia behind a spring, by the resonance of both parts."""
    stiff = J * share * (1.0 - share) * (2.0 * np.pi * hertz) ** 2
    return MOTOR.having(compliance={"size": 1.0 / stiff, "load_fraction": share})


@pytest.mark.parametrize(("hertz", "part"), [(35.0, 0.6), (17.0, 0.3)])
def test_a_spring_in_the_shaft_is_no_load_and_hides_none(hertz, part):
    motor = sprung(hertz, part)
    assert share(driven(FREE, motor=motor)) < UNEXPLAINED / 4
    assert share(driven(LOADED, motor=motor)) > 4 * UNEXPLAINED


def test_a_shaft_that_stands_or_a_log_of_a_moment_says_nothing():
    assert unexplained_share(turned(lambda *_: 0.0, 0.04), MACHINE) is None
    assert unexplained_share(turned(cogging, 0.05), MACHINE) is None


@pytest.fixture(scope="module")
def free():
    return compare(driven(FREE), ModelSpec(), Constants())


@pytest.fixture(scope="module")
def loaded():
    return compare(driven(LOADED), ModelSpec(), Constants())


def test_a_log_of_both_axes_alone_has_inertia_and_friction(free):
    for name, true in (("psi_wb", PSI), ("j_kgm2", J), ("coulomb_friction.torque_nm", DRY)):
        one = free.parameters[name]
        assert abs(one.value - true) <= REACH * one.u, name
    assert free.parameters["j_kgm2"].u < 0.05 * J
    assert not any("nothing recorded turns" in note for note in free.notes)


def test_no_constant_of_the_shaft_comes_from_a_load_that_nobody_logged(loaded):
    assert loaded.parameters["psi_wb"].value is not None
    assert loaded.parameters["j_kgm2"].value is None
    assert not any("j_kgm2" in one.of for one in loaded.combinations)
    (note,) = (note for note in loaded.notes if "nothing recorded turns" in note)
    assert "d.mcap" in note
    assert "torque_shaft_nm" in note
