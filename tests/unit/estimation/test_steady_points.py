"""Settled points of a shaft that turns: an efficiency map says what its motor is."""

from __future__ import annotations

import pytest

from pipeline.estimation.estimators import steady_points, torque_map, torque_table
from pipeline.records.capture import Campaign
from pipeline.records.constants import Constants
from tests.unit.settled import (
    COULOMB_NM,
    KT,
    LD_H,
    LQ_H,
    PSI_WB,
    R_OHM,
    VISCOUS,
    settled,
)

TRUE = {"r_phase_ohm": R_OHM, "ld_h": LD_H, "lq_h": LQ_H, "psi_pm_wb": PSI_WB}


def fitted(module, *captures):
    estimator = module.ESTIMATOR
    fit = estimator.fit(Campaign("m", captures), Constants(), estimator.options)
    return {e.name: e for e in fit.estimates}


def assert_right(found, true, share=0.01):
    for name, value in true.items():
        estimate = found[name]
        assert abs(estimate.number - value) < 3.0 * estimate.u, name
        assert estimate.u < share * value, name


def test_voltages_of_settled_points_give_the_winding_and_the_magnet():
    assert_right(fitted(steady_points, settled()), TRUE)


def test_iron_that_saturates_bends_the_flux_of_q_and_not_its_slope_at_no_current():
    found = fitted(steady_points, settled(knee_a=12.0))
    assert "iq^3" in found["lq_h"].note
    assert_right(found, TRUE, 0.05)


@pytest.mark.parametrize("seed", range(6))
def test_a_bend_that_noise_hides_is_in_doubt(seed):
    """It is in the slope of a straight line: L_q was too small at up to 11 u."""
    found = fitted(steady_points, settled(knee_a=24.0, volts=0.5, seed=seed))
    assert abs(found["lq_h"].number - LQ_H) < 3.0 * found["lq_h"].u


def test_one_sense_of_rotation_and_one_of_torque_are_enough():
    found = fitted(steady_points, settled(speeds=(60.0, 150.0)))
    assert_right(found, TRUE)


def test_without_a_d_current_nothing_is_said_of_its_inductance():
    made = settled()
    (table,) = made.tables
    rows = table.filter(table["id_a"].abs() < 0.5).with_columns(id_a=0.0)
    found = fitted(steady_points, type(made)(made.path, "0", "verified", made.meta, (rows,)))
    assert not found["ld_h"].known
    assert_right(found, {k: v for k, v in TRUE.items() if k != "ld_h"})


def test_without_pole_pairs_or_rows_nothing_is_said():
    assert not any(e.known for e in fitted(steady_points, settled(pole_pairs=None)).values())
    assert not any(e.known for e in fitted(steady_points).values())


def test_a_commanded_voltage_leaves_switches_and_leads_in_the_resistance():
    found = fitted(steady_points, settled(voltage_kind="commanded", vdc_v=48.0))
    assert found["r_phase_ohm"].u > 2.0 * fitted(steady_points, settled())["r_phase_ohm"].u


def test_their_torque_gives_kt_and_drag():
    found = fitted(torque_map, settled())
    assert_right(found, {"kt_peak_nm_a": KT})
    assert_right(found, {"torque_coulomb_nm": COULOMB_NM, "b_visc_nm_s_rad": VISCOUS}, 0.1)


def test_they_are_no_clamped_shafts():
    assert not any(e.known for e in fitted(torque_table, settled()).values())


@pytest.mark.parametrize("seed", range(3))
def test_friction_of_all_of_the_torque_is_not_taken_for_dry_friction(seed):
    """That of the reluctance's part too: with the magnet's alone T_c was a fifth too small."""
    found = fitted(torque_map, settled(load_share=0.04, seed=seed))
    assert_right(found, {"torque_coulomb_nm": COULOMB_NM, "kt_peak_nm_a": KT}, 0.1)
