"""Stated constants in `compare` and `diagnose`: priors that the captures may speak against."""

from __future__ import annotations

from dataclasses import replace

import pytest

import pipeline
from pipeline.criticism.data.machine_scale import stated_parameters
from pipeline.records.capture import Campaign
from pipeline.records.estimate import Estimate
from pipeline.records.uncertainty import type_b
from pipeline.simulator.bench import campaign
from pipeline.simulator.design import EXACT, Bench
from pipeline.simulator.truth import truth
from tests.simulated import campaign_of, design

MOTOR = replace(design("gimbal-5208"), effects={})
TRUE = truth(MOTOR)["constants"]
J, PSI, PAIRS = TRUE["j_rotor_kgm2"], TRUE["psi_pm_wb"], TRUE["pole_pairs"]
REACH = 1.96


def recorded(*tests: str) -> pipeline.Recordings:
    plan = tuple((test, test, {}) for test in tests)
    one: Campaign = campaign_of(campaign(MOTOR, Bench(instruments=EXACT), 1, plan))
    return pipeline.Recordings({one.motor_id: one})


def compared(recordings: pipeline.Recordings, **constants: float):
    (found,) = pipeline.compare(recordings, constants=constants).motors.values()
    return found


def test_a_stated_inertia_gives_the_drags_of_a_coast_their_size():
    coast = recorded("spin_down")
    bare = compared(coast).parameters
    assert bare["coulomb_friction.torque_nm"].value is None
    assert bare["j_kgm2"].status == "not_identifiable"
    found = compared(coast, j_rotor_kgm2=J, u_j_rotor_kgm2=0.02 * J)
    told = found.parameters
    assert (told["j_kgm2"].value, told["j_kgm2"].u, told["j_kgm2"].status) == (
        J, 0.02 * J, "stated",
    )  # fmt: skip
    dry = told["coulomb_friction.torque_nm"]
    assert dry.status == "measured"
    assert dry.u == pytest.approx(0.02 * TRUE["torque_coulomb_nm"], rel=0.2)
    assert abs(dry.value - TRUE["torque_coulomb_nm"]) < REACH * dry.u
    assert found.combinations == ()
    assert not any("stated" in note for note in found.notes)


def test_what_the_captures_speak_against_is_told():
    spin = recorded("open_circuit")
    honest = compared(spin, psi_pm_wb=PSI, u_psi_pm_wb=0.01 * PSI)
    assert honest.parameters["psi_wb"].status == "measured"
    assert not any("stated" in note for note in honest.notes)
    wrong = compared(spin, psi_pm_wb=1.2 * PSI, u_psi_pm_wb=0.01 * PSI)
    (note,) = (note for note in wrong.notes if "stated" in note)
    assert "psi_wb is stated as" in note
    assert abs(float(note.split(" say ")[1].split(" ")[0]) / PSI - 1.0) < 5e-3


def test_a_diagnosis_rests_on_what_is_stated_as_well():
    coast = recorded("spin_down", "resistance", "current_step")
    stated = {"j_rotor_kgm2": J, "u_j_rotor_kgm2": 0.02 * J}
    (found,) = pipeline.diagnose(coast, constants=stated).motors.values()
    value, u, *_ = found.ladder[-1].parameters["coulomb_friction.torque_nm"]
    assert abs(value - TRUE["torque_coulomb_nm"]) < REACH * u


@pytest.mark.parametrize(
    "size_nm",
    [pytest.param(0.0, marks=pytest.mark.slow), pytest.param(0.02, marks=pytest.mark.slow)],
)
def test_a_stated_torque_constant_is_enough_for_a_log_of_current_and_motion(size_nm):
    """A drive without voltages and transducer was `insufficient`, whatever the motor."""
    motor = MOTOR.having(cogging=size_nm) if size_nm else MOTOR
    plan = tuple((f"drive_{n}", "drive", {"load": 0.0}) for n in range(2))
    logs = campaign_of(campaign(motor, Bench(instruments=EXACT), 5, plan))
    lacking = ("vd_v", "vq_v", "torque_shaft_nm")
    bare = tuple(
        replace(one, tables=tuple(t.drop(lacking, strict=False) for t in one.tables))
        for one in logs.captures
    )
    free = pipeline.Recordings({logs.motor_id: replace(logs, captures=bare)})
    (blind,) = pipeline.diagnose(free).motors.values()
    assert (blind.verdict, blind.ladder) == ("insufficient", ())
    kt = 1.5 * PAIRS * PSI
    (found,) = pipeline.diagnose(
        free, constants={"kt_peak_nm_a": kt, "u_kt_peak_nm_a": 0.01 * kt}
    ).motors.values()
    assert found.missing == (("cogging",) if size_nm else ())
    value, u, *_ = found.ladder[-1].parameters["coulomb_friction.torque_nm"]
    assert abs(value - TRUE["torque_coulomb_nm"]) < REACH * u < 0.2 * value


def test_a_constant_that_cannot_be_stated_is_refused():
    with pytest.raises(pipeline.records.errors.UsageError, match="no constant 'kt_peak'"):
        pipeline.compare(recorded("spin_down"), constants={"kt_peak": 0.1})


@pytest.mark.parametrize(
    ("name", "value", "parameter", "factor"),
    [
        ("kt_peak_nm_a", 0.15, "psi_wb", 1.0 / 1.5 / 7.0),
        ("ke_ll_peak_v_s_rad", 0.2, "psi_wb", 1.0 / 3.0**0.5 / 7.0),
        ("r_ll_ohm", 0.5, "r_ohm", 0.5),
        ("b_visc_nm_s_rad", 1e-5, "b_nm_s_rad", 1.0),
    ],
)
def test_the_parameter_that_a_stated_constant_is(name, value, parameter, factor):
    one = Estimate(name, value, "-", "stated", "stated", type_b("s", 0.1 * value))
    ((found, (centre, u)),) = stated_parameters([one], 7).items()
    assert found == parameter
    assert centre == pytest.approx(factor * value)
    assert u == pytest.approx(0.1 * factor * value)


def test_of_two_that_say_one_parameter_the_better_counts():
    both = [
        Estimate("kt_peak_nm_a", 0.15, "-", "stated", "s", type_b("s", 0.015)),
        Estimate("psi_pm_wb", 0.02, "-", "stated", "s", type_b("s", 0.0001)),
    ]
    assert (
        stated_parameters(both, 7) == stated_parameters(both[::-1], 7) == {"psi_wb": (0.02, 1e-4)}
    )
