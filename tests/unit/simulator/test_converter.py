"""Phase equations and control: energy balance, steady state, timing, closed forms."""

import math

import numpy as np
import pytest

from pipeline.simulator import converter
from pipeline.simulator.bench import record
from pipeline.simulator.control import Control
from pipeline.simulator.converter import COLUMNS
from pipeline.simulator.field import energy
from pipeline.simulator.locked import pair_step
from pipeline.simulator.plant import plant_of
from tests.simulated import QUIET, design

AT = {name: k for k, name in enumerate(COLUMNS)}


def loop(motor, period_s=5e-5, **change):
    width = 2 * math.pi / (25 * period_s)
    values = {
        "pole_pairs": float(motor.pole_pairs),
        "period_s": period_s,
        "substeps": 16,
        "substeps_before": 8,
        "v_limit": motor.vdc_v / math.sqrt(3),
        "l_d": motor.ld_h,
        "l_q": motor.lq_h,
        "psi": motor.psi_pm_wb,
        "kp_d": width * motor.ld_h,
        "kp_q": width * motor.lq_h,
        "ki": width * motor.r_phase_ohm,
        "speed_loop": False,
        "kp_speed": 0.0,
        "ki_speed": 0.0,
        "i_limit": 1e9,
        "held_speed": False,
        "dyno_nms": 0.0,
        "dyno_nm": 0.0,
        "in_coupling": False,
        "at_stator": False,
        **{f"gain_{x}": 1.0 for x in "abc"},
        **{f"offset_{x}": 0.0 for x in "abc"},
        "lsb_current": 0.0,
        "delay_s": 0.0,
        "angle_offset": 0.0,
        "angle_wobble": 0.0,
        "angle_wobble_phase": 0.0,
        "angle_wobble_order": 1.0,
        "angle_play": 0.0,
        "angle_late_s": 0.0,
        "lsb_angle": 0.0,
        "speed_lag_s": 5e-4,
        "ambient": 25.0,
        "temp_winding": 25.0,
        "temp_magnet": 25.0,
        "theta": 0.3,
        "omega": 0.0,
    }
    return Control(**{**values, **change})


FIELD = {
    "saturation": {"size": 0.2, "size_d": 0.1},
    "cross_saturation": 0.1,
    "bemf_harmonics": 0.02,
    "inductance_harmonics": {"size": 0.1},
    "cogging": 0.01,
    "dead_time": {"size": 0.2, "knee_a": 0.2},
    "phase_imbalance": 0.05,
    "skin_effect": 0.1,
    "coulomb_friction": 0.0,
    "magnet_temperature": 0.0,
}


@pytest.mark.parametrize(
    "effects", [{"coulomb_friction": 0.0, "cogging": 0.0}, FIELD], ids=["linear", "all"]
)
def test_energy_in_is_heat_plus_field_plus_motion(effects):
    """Frictionless run-up with reversals of torque: every joule is accounted for to 1e-5."""
    from dataclasses import replace

    motor = replace(design("gimbal-5208"), b_visc_nm_s_rad=0.0).having(**effects)
    plant = plant_of(motor)
    n = 1200
    want = np.zeros((n, 4))
    want[:, 0] = -3.0
    want[:, 1] = np.where(np.arange(n) // 300 % 2 == 0, 3.0, -2.0)
    rows = converter.drive(want, np.ones(n), np.zeros((n, 4)), loop(motor), plant, plant, 0)
    theta, omega = rows[:, AT["theta"]], rows[:, AT["omega"]]
    eps = motor.pole_pairs * theta
    psi = (rows[:, AT["psi_alpha"]] + 1j * rows[:, AT["psi_beta"]]) * np.exp(-1j * eps)
    field = np.array(
        [energy(x.real, x.imag, e, 25.0, plant) for x, e in zip(psi, eps, strict=True)]
    )
    lines = zip(plant.cog_amplitude, plant.cog_order, plant.cog_phase, strict=True)
    slots = sum(a / k * np.cos(k * theta + f) for a, k, f in lines if k > 0)
    motion = 0.5 * motor.j_rotor_kgm2 * omega**2
    spent = rows[:, AT["work_copper"]] + rows[:, AT["work_switches"]]
    balance = rows[:, AT["work_in"]] - spent - field - motion - slots
    assert np.max(motion) > 0.02
    assert np.ptp(field) > 1e-3
    assert np.ptp(balance) < 1e-5 * np.max(rows[:, AT["work_in"]])


def test_steady_state_is_the_voltage_equation():
    """At held speed the dq voltage of a linear motor, each term by hand."""
    motor = design("gimbal-5208").having(cogging=0.0, copper_temperature=0.0)
    n, omega = 3000, 100.0
    want = np.tile([-2.0, 5.0, 0.0, omega], (n, 1))
    c = loop(motor, held_speed=True, omega=omega)
    plant = plant_of(motor)
    rows = converter.drive(want, np.ones(n), np.zeros((n, 4)), c, plant, plant, 0)[-1]
    turn = np.exp(-1j * motor.pole_pairs * rows[AT["theta"]])
    v = complex(rows[AT["v_alpha"]], rows[AT["v_beta"]]) * turn
    i = complex(rows[AT["i_alpha_true"]], rows[AT["i_beta_true"]]) * turn
    assert i == pytest.approx(-2.0 + 5.0j, abs=2e-3)
    w = motor.pole_pairs * omega
    v_d = 0.42 * -2.0 - w * 2.35e-4 * 5.0
    v_q = 0.42 * 5.0 + w * (7.1e-3 + 1.9e-4 * -2.0)
    assert v.real == pytest.approx(v_d, abs=4e-3)
    assert v.imag == pytest.approx(v_q, abs=4e-3)
    torque = 1.5 * 7 * (7.1e-3 * 5.0 + (1.9e-4 - 2.35e-4) * -2.0 * 5.0)
    drag = 5.5e-3 + 1.6e-5 * omega
    assert rows[AT["torque_em"]] == pytest.approx(torque, rel=1e-3)
    assert rows[AT["torque_shaft"]] == pytest.approx(torque - drag, rel=1e-3)


@pytest.mark.parametrize(("before", "right"), [(8, "centred"), (0, "held")])
def test_logged_voltage_makes_the_flux_change_that_its_timing_says(before, right):
    """From sample to sample the flux changes by (v - R i) Ts.

    With `centred`, half of each neighbour's vector acts; with `held`, the earlier one alone. The
    wrong reading is off by half the angle of a period (0.026 rad) or more, the right one by the
    bow of the current (below 1e-3).
    """
    motor = design("gimbal-5208").having(cogging=0.0, copper_temperature=0.0)
    want = np.tile([0.0, 4.0, 0.0, 150.0], (400, 1))
    c = loop(motor, held_speed=True, omega=150.0, substeps_before=before)
    plant = plant_of(motor)
    rows = converter.drive(want, np.ones(400), np.zeros((400, 4)), c, plant, plant, 0)
    psi = rows[:, AT["psi_alpha"]] + 1j * rows[:, AT["psi_beta"]]
    v = rows[:, AT["v_alpha"]] + 1j * rows[:, AT["v_beta"]]
    i = rows[:, AT["i_alpha_true"]] + 1j * rows[:, AT["i_beta_true"]]
    loss = 0.42 * 0.5 * (i[1:] + i[:-1])
    change = np.diff(psi) / 5e-5
    readings = {"centred": 0.5 * (v[1:] + v[:-1]), "held": v[:-1]}
    errors = {
        name: float(np.max(np.abs(volt - loss - change)[200:]) / np.max(np.abs(change[200:])))
        for name, volt in readings.items()
    }
    wrong = "held" if right == "centred" else "centred"
    assert errors[right] < 1e-3
    assert errors[wrong] > 0.02


@pytest.mark.parametrize("early", [0.0, 0.3, 0.95])
@pytest.mark.parametrize("source_ohm", [0.0, 0.2])
@pytest.mark.parametrize(("theta_deg", "henry"), [(-30.0, 2 * 1.9e-4), (60.0, 2 * 2.35e-4)])
def test_locked_step_is_the_exponential(theta_deg, henry, source_ohm, early):
    """Pair ab at -30 deg sees 2 Ld, at 60 deg 2 Lq: i = V/R (1 - exp(-t R/L)).

    The edge lies `early` of a sample before sample 100, and the supply has a resistance.
    """
    motor = design("gimbal-5208")
    source = np.zeros((1201, 2))
    source[100:, 0] = 2.0
    source[:, 1] = early
    pair = (1.0, -1.0 / math.sqrt(3.0), 0.84, source_ohm)
    plant = plant_of(motor)
    out = pair_step(source, (2e-6, 2), pair, math.radians(theta_deg), (25.0, 25.0), plant)
    t = (np.arange(1100) + early) * 2e-6
    loop = 0.84 + source_ohm
    current = 2.0 / loop * (1 - np.exp(-t * loop / henry))
    assert out[100:, 1] == pytest.approx(current, abs=1e-9)
    assert out[100:, 0] == pytest.approx(2.0 - source_ohm * current, abs=1e-9)
    assert out[:100, 1] == pytest.approx(0.0, abs=1e-15)


def test_locked_step_keeps_the_third_terminal_without_current():
    """Under saturation and cross-saturation as well: the flux path stays on i_c = 0."""
    motor = design("servo-ipm")
    recording = record(
        "current_step", motor, QUIET, np.random.default_rng(0), theta_elec_deg=20.0, level=0.9
    )
    i = recording.tables[0]["ia_a"]
    v = recording.tables[0]["vab_v"]
    settled = (i > 0.999 * np.max(i)) & (v > 0.5 * np.max(v))
    assert v[settled][-1] / i[settled][-1] == pytest.approx(2 * motor.r_phase_ohm, rel=2e-3)
