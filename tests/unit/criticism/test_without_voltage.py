"""Logs that lack a voltage: the torque or the motion alone, and what follows from them."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace

import pytest

import pipeline
from pipeline.simulator.bench import campaign
from pipeline.simulator.design import EXACT, Bench
from pipeline.simulator.truth import truth
from tests.simulated import campaign_of, design

MOTOR = replace(design("gimbal-5208"), effects={})
TRUE = truth(MOTOR)["constants"]
J, PSI, DRY = TRUE["j_rotor_kgm2"], TRUE["psi_pm_wb"], TRUE["torque_coulomb_nm"]
DRY_NAME = "coulomb_friction.torque_nm"
PAIRS = {"pole_pairs": TRUE["pole_pairs"]}
REACH = 2.576


def recorded(
    *plan: tuple[str, Mapping[str, object]], keep: Collection[str], **meta: object
) -> pipeline.Recordings:
    """Captures of a plan with these columns, and what is said of them."""
    steps = tuple((f"{test}_{n}", test, how) for n, (test, how) in enumerate(plan))
    whole = campaign_of(campaign(MOTOR, Bench(instruments=EXACT), 2, steps))
    cut = []
    for one in whole.captures:
        tables = (t.select([n for n in t.columns if n in {"t_s", *keep}]) for t in one.tables)
        meta_of = replace(one.meta, **{"pole_pairs": None, **meta})
        cut.append(replace(one, meta=meta_of, tables=tuple(t for t in tables if t.width > 1)))
    return pipeline.Recordings({whole.motor_id: replace(whole, captures=tuple(cut))})


def compared(recordings: pipeline.Recordings, **constants: float):
    (found,) = pipeline.compare(recordings, constants=constants).motors.values()
    return found


def holds(one, true: float) -> bool:
    return bool(abs(one.value - true) <= REACH * one.u)


MAP = (("torque_map", {"speed": 0.3}), ("torque_map", {"speed": -0.5}))


def test_a_torque_map_without_voltages():
    keep = ("id_a", "iq_a", "torque_shaft_nm", "theta_mech_rad", "temp_magnet_degc")
    found = compared(recorded(*MAP, keep=keep, **PAIRS))
    psi = found.parameters["psi_wb"]
    assert holds(psi, PSI)
    assert psi.u < 0.02 * PSI
    assert {one.signal for one in found.errors} == {"torque_shaft_nm"}
    assert found.held_out < 1.5
    (salient,) = (one for one in found.combinations if "lq_h" in one.of)
    assert salient.expression == "ld_h - 1*lq_h"
    assert holds(salient, TRUE["ld_h"] - TRUE["lq_h"])


def test_a_torque_map_without_its_d_current_is_as_uncertain_as_that_makes_it():
    keep = ("iq_a", "torque_shaft_nm", "theta_mech_rad", "temp_magnet_degc")
    psi = compared(recorded(*MAP, keep=keep, **PAIRS)).parameters["psi_wb"]
    assert holds(psi, PSI)
    assert psi.u > 0.015 * PSI


def test_a_drive_of_current_and_angle_has_the_inertia_over_the_flux():
    free = ("drive", {"load": 0.0})
    found = compared(recorded(free, keep=("iq_a", "theta_mech_rad"), **PAIRS))
    assert found.parameters["j_kgm2"].value is None
    together = {one.expression: one for one in found.combinations}
    assert holds(together["j_kgm2/psi_wb"], J / PSI)
    # the torque constant is stated at 25 °C, so the magnet's temperature belongs to it
    log = recorded(free, keep=("id_a", "iq_a", "theta_mech_rad", "temp_magnet_degc"), **PAIRS)
    with_flux = compared(log, psi_pm_wb=PSI, u_psi_pm_wb=0.01 * PSI).parameters
    assert holds(with_flux["j_kgm2"], J)
    assert with_flux["j_kgm2"].u == pytest.approx(0.01 * J, rel=0.3)
    assert with_flux["psi_wb"].status == "stated"


@pytest.mark.slow
def test_a_q_axis_log_has_its_winding_temperature_and_its_torque():
    keep = ("iq_a", "vq_v", "theta_mech_rad", "temp_winding_degc", "torque_shaft_nm")
    found = compared(recorded(("drive", {}), keep=keep, **PAIRS))
    assert {one.signal for one in found.errors} >= {"vq_v", "torque_shaft_nm"}
    assert not any("no temp_winding_degc" in note for note in found.notes)


@pytest.mark.slow
def test_a_log_that_lacks_the_d_voltage_alone_has_its_d_current():
    keep = ("id_a", "iq_a", "vq_v", "theta_mech_rad", "torque_shaft_nm")
    told = compared(recorded(("drive", {}), keep=keep, **PAIRS)).parameters
    assert holds(told["ld_h"], TRUE["ld_h"])
    assert told["ld_h"].u < 0.1 * TRUE["ld_h"]


@pytest.mark.slow
def test_coasts_ask_for_no_pole_pairs():
    coasts = recorded(("spin_down", {"direction": 1}), ("spin_down", {"direction": -1}),
                      keep=("theta_mech_rad", "omega_mech_rad_s"))  # fmt: skip
    found = compared(coasts)
    together = {one.expression: one for one in found.combinations}
    assert holds(together[f"{DRY_NAME}/j_kgm2"], DRY / J)
    turned = recorded(("drive", {}), keep=("id_a", "iq_a", "vd_v", "vq_v", "theta_mech_rad"))
    assert "pole pairs" in compared(turned).notes[0]


def test_without_pole_pairs_a_q_axis_has_no_flux_but_its_back_emf():
    """One pole pair was taken for granted, and the flux linkage was that many times too large."""
    found = compared(recorded(("drive", {}), keep=("iq_a", "vq_v", "theta_mech_rad")))
    assert found.parameters["psi_wb"].value is None
    together = {one.expression: one for one in found.combinations}
    assert holds(together["pole_pairs*psi_wb"], TRUE["pole_pairs"] * PSI)


def test_without_pole_pairs_a_table_of_torque_has_its_torque_constant_alone():
    keep = ("iq_a", "torque_shaft_nm")
    found = compared(recorded(("torque_table", {}), keep=keep), ld_h=1.0, u_ld_h=0.1)
    assert all(found.parameters[name].value is None for name in ("psi_wb", "ld_h", "lq_h"))
    (ke,) = found.combinations
    assert ke.of == ("psi_wb",)
    assert holds(ke, TRUE["pole_pairs"] * PSI)


def test_a_heat_run_between_two_terminals():
    keep = ("vab_v", "ia_a", "temp_winding_degc")
    log = recorded(("resistance", {}), keep=keep)
    (whole,) = log.campaigns.values()
    warm = replace(whole.captures[0], meta=replace(whole.captures[0].meta, test="heat_run"))
    turned = replace(log, campaigns={whole.motor_id: replace(whole, captures=(warm,))})
    assert holds(compared(turned).parameters["r_ohm"], TRUE["r_phase_ohm"])


def test_coasts_of_two_set_ups_are_named_and_left_out():
    """Pooled, they had friction over inertia between the two, with the u of one."""
    coasts = recorded(("spin_down", {"direction": 1}), ("spin_down", {"direction": -1}),
                      keep=("theta_mech_rad",))  # fmt: skip
    (whole,) = coasts.campaigns.values()
    slower = [_slowed(one, 1.5) for one in whole.captures]
    mixed = replace(whole, captures=(*whole.captures, *slower))
    found = compared(replace(coasts, campaigns={whole.motor_id: mixed}))
    assert found.combinations == ()
    (note,) = found.notes
    assert "2 set-ups" in note
    assert all(one.path in note for one in mixed.captures)


def _slowed(one, factor: float):
    """The coast as it is where the shaft takes longer for it."""
    tables = tuple(t.with_columns(t["t_s"] * factor) for t in one.tables)
    return replace(one, path=f"with_chain/{one.path}", tables=tables)


def test_a_heat_run_of_one_axis_has_the_resistance_and_its_coefficient():
    """At rest the axes are alike, so what d was driven with stands for q."""
    log = recorded(("heat_run", {}), keep=("id_a", "vd_v", "temp_winding_degc"), **PAIRS)
    (whole,) = log.campaigns.values()
    (one,) = whole.captures
    named = {"id_a": "iq_a", "vd_v": "vq_v"}
    one = replace(one, tables=tuple(t.rename(named, strict=False) for t in one.tables))
    turned = replace(log, campaigns={whole.motor_id: replace(whole, captures=(one,))})
    told = compared(turned).parameters
    assert holds(told["r_ohm"], TRUE["r_phase_ohm"])
    assert holds(told["copper_temperature.alpha_1_k"], TRUE["temp_coeff_copper_1_k"])
    assert told["r_ohm"].u < 0.02 * TRUE["r_phase_ohm"]
