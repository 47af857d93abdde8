"""Published recordings that nobody made for this project: the right story on each."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.criticism.data.holding_cells import holding_orders
from pipeline.criticism.diagnosis import diagnose
from pipeline.criticism.policy.policy import DEFAULT
from pipeline.criticism.regression.goodness import signal_errors
from pipeline.execution.tasks.start import start_constants
from pipeline.records.comparison import ModelSpec
from tests.sectors import sector_errors
from tests.stories.fits import REAL, campaign, fit, without

pytestmark = pytest.mark.skipif(not REAL.is_dir(), reason="shared real recordings are not here")
IDEAL = ModelSpec("ideal")


def found(folder, motor=None):
    captures = campaign(folder, motor)
    return diagnose(captures, IDEAL, start_constants(captures))


def in_sample(made):
    return signal_errors(made.system, made.system.residual)


def parameters(made):
    """Names of the constants and effect parameters that the captures tell of, gains aside."""
    observed = np.any(made.system.matrix != 0.0, axis=0)
    names = [c.name for n, c in enumerate(made.system.columns) if observed[n]]
    return [name for name in names if not name.startswith("gain_")]


def test_a_sweep_of_d_current_is_read_with_pole_pairs_and_mechanical_speed():
    captures = campaign("moteus", "be8108").captures
    rows = captures[0].arrays("id_a", "omega_mech_rad_s", "vq_v")
    assert captures[0].meta.pole_pairs == 21
    assert rows["id_a"].size == 44
    first = np.flatnonzero(rows["id_a"] == 0.0)[0]
    assert rows["omega_mech_rad_s"][first] * 21 == pytest.approx(783.2057526)
    assert rows["vq_v"][first] == pytest.approx(1.643519248)


def test_l_d_falls_with_positive_d_current_once_levels_have_their_offsets():
    """Constant L_d, then an offset a level, then one term of saturation, to the noise."""
    motor = campaign("moteus", "mj5208")
    bare, level = fit(motor, offsets=False), fit(motor)
    bent = fit(motor, "saturation")
    assert in_sample(bare)["vq_v"] == pytest.approx(0.0378, rel=0.02)
    assert in_sample(level)["vq_v"] == pytest.approx(0.0102, rel=0.02)
    assert in_sample(bent)["vq_v"] == pytest.approx(0.0034, rel=0.03)
    assert bent.held_out["vq_v"] < 0.3 * level.held_out["vq_v"]
    assert parameters(bent) == ["ld_h", "psi_wb", "saturation.d_odd"]
    assert 0.7 < bent.values["saturation.d_odd"] < 1.4
    apparent = bent.values["ld_h"] * (1.0 + bent.values["saturation.d_odd"])
    assert apparent == pytest.approx(5.68e-5, rel=0.06)


@pytest.mark.parametrize("motor", ["mj5208", pytest.param("be8108", marks=pytest.mark.slow)])
def test_saturation_is_what_the_sweep_lacks(motor: str):
    """Forty rows are enough where they miss their floor fourfold in variance."""
    result = found("moteus", motor)
    assert (result.verdict, result.missing) == ("missing", ("saturation",))
    assert result.ladder[-1].held_out < 1.3


def test_a_flux_map_needs_both_saturations_and_few_terms_of_them():
    machine = campaign("baldor")
    ladder = [fit(machine, *e) for e in ((), ("saturation",), ("saturation", "cross_saturation"))]
    psi_q = [one.held_out["psi_q_wb"] for one in ladder]
    psi_d = [one.held_out["psi_d_wb"] for one in ladder]
    assert psi_q == pytest.approx([0.223, 0.0452, 0.0146], rel=0.04)
    assert psi_d[:2] == pytest.approx([0.0417, 0.0403], rel=0.02)
    assert psi_d[2] < 0.0155
    counts = [len(parameters(one)) for one in ladder]
    assert all(count <= most for count, most in zip(counts, (3, 8, 11), strict=True)), counts


def test_the_last_flux_model_is_reciprocal():
    """∂ψ_d/∂i_q = ∂ψ_q/∂i_d by differences over the measured grid's own middle points."""
    made = fit(campaign("baldor"), "saturation", "cross_saturation")
    _, told = made.curves("flux_map")
    psi = (told[0] + 1j * told[1]).reshape(21, 27)
    # second mixed differences of one co-energy: around every cell the line integral is zero
    along_d = psi.real[1:] + psi.real[:-1]
    along_q = psi.imag[:, 1:] + psi.imag[:, :-1]
    around = (along_d[:, 1:] - along_d[:, :-1]) - (along_q[1:] - along_q[:-1])
    measured = made.curves("flux_map")[0]
    wild = (measured[0] + 1j * measured[1]).reshape(21, 27)
    wild_d, wild_q = wild.real[1:] + wild.real[:-1], wild.imag[:, 1:] + wild.imag[:, :-1]
    rest = (wild_d[:, 1:] - wild_d[:, :-1]) - (wild_q[1:] - wild_q[:-1])
    # the trapezoidal rule leaves its own error where the curves bend
    assert np.abs(around).max() < 0.25 * np.abs(rest).max()


def test_cross_saturation_is_named_after_saturation():
    result = found("baldor")
    assert (result.verdict, result.missing) == ("missing", ("saturation", "cross_saturation"))
    assert result.ladder[-1].signals["psi_q_wb"] < 0.02


@pytest.mark.slow
def test_a_handful_of_orders_hold_the_rotor_and_all_below_160_are_a_trap():
    captures = campaign("laas_solo").of("holding_current")
    orders = holding_orders(captures, (12, 18), DEFAULT, 400)
    assert {12, 18, 24, 72} <= set(orders)
    assert len(orders) <= 10
    assert sector_errors(captures, (), DEFAULT)[0] == pytest.approx(0.138, abs=0.001)
    assert sector_errors(captures, (72,), DEFAULT) == pytest.approx((0.048, 0.0486), abs=0.001)
    fitted, held = sector_errors(captures, orders, DEFAULT)
    assert fitted < 0.0225
    assert held < 0.0235
    fitted, held = sector_errors(captures, range(1, 160), DEFAULT)
    assert fitted < 0.0185
    assert held > 0.14


@pytest.mark.slow
def test_a_late_speed_is_what_the_resistance_was_hiding():
    """By the drive's own speed, taken as on time, R is far from the 0.485 ohm of standstill."""
    log = campaign("laas_solo")
    by_speed = without(log, "theta_mech_rad")
    blind, own = fit(by_speed, kinds=("q",), on_time=True), fit(by_speed, kinds=("q",))
    plain, late = fit(log, kinds=("q",)), fit(log, "sample_delay", kinds=("q",))
    far, near = (abs(one.values["r_ohm"] - 0.485) for one in (blind, own))
    assert near < 0.02
    assert near < 0.25 * far
    assert 1.5e-3 < own.values["late_speed_s"] < 2.5e-3
    assert own.held_out["vq_v"] < blind.held_out["vq_v"]
    assert 0.47 < plain.values["r_ohm"] < 0.56
    assert late.values["r_ohm"] == pytest.approx(plain.values["r_ohm"], rel=0.02)
    assert late.values["sample_delay.of_speed"] == 1.0
    assert late.values["sample_delay.delay_s"] == pytest.approx(1.8e-3, rel=0.05)
    assert late.held_out["omega_mech_rad_s"] < 0.2 * plain.held_out["omega_mech_rad_s"]
    ke = 12 * late.values["psi_wb"]
    assert 0.0184 < ke < 0.0195


@pytest.mark.slow
def test_timing_is_named_before_anything_else_that_lowers_the_voltage_error():
    result = found("laas_solo")
    assert {"sample_delay", "cogging", "coulomb_friction"} <= set(result.missing)
    voltage = [n for n in result.missing if n in ("sample_delay", "dead_time", "skin_effect")]
    assert voltage[0] == "sample_delay"
    cogging = next(r for r in result.ranking if r.effect == "cogging")
    assert "sin_72_nm" in cogging.parameters
    assert len(cogging.parameters) <= 20
