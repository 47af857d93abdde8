"""A loose encoder, a constant that changes, a transducer with a past, a dead time half undone."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pipeline.simulator.bench import record
from tests.simulated import QUIET, design

MOTOR = replace(design("gimbal-5208"), effects={})


def logged(bench=QUIET, motor=MOTOR, test="drive", **how):
    return record(test, motor, bench, np.random.default_rng(4), **how).tables[0]


def test_a_loose_encoder_is_half_its_play_behind_in_each_sense():
    play = 0.004
    loose = replace(QUIET, encoder_play_rad=play)
    for direction in (1, -1):
        true = logged(test="cogging", turns=0.5, direction=direction)["theta_mech_rad"]
        seen = logged(loose, test="cogging", turns=0.5, direction=direction)["theta_mech_rad"]
        behind = (true - seen)[true.size // 10 :]
        assert behind == pytest.approx(direction * play / 2, abs=1e-9)


def test_a_magnet_loses_flux_within_a_log():
    how = {"speed": 0.5, "id_levels": (0.0,), "iq_levels": (0.3,), "dwell_s": 0.2}
    weak = {"psi_pm_wb": 0.9 * MOTOR.psi_pm_wb}
    before = logged(test="torque_map", **how)
    within = logged(test="torque_map", **how, changed=weak, changed_from=0.5)
    half = before["t_s"].size // 2
    kept = {name: within[name][half:][-half // 2 :].mean() for name in ("vq_v", "torque_shaft_nm")}
    for name, end in kept.items():
        assert within[name][: half - 1] == pytest.approx(before[name][: half - 1])
        was = before[name][half:][-half // 2 :].mean()
        unmoved = 0.42 * 0.3 * 9.0 if name == "vq_v" else -MOTOR.torque_coulomb_nm
        assert (end - unmoved) / (was - unmoved) == pytest.approx(0.9, abs=0.01)
    with pytest.raises(ValueError, match="within a cogging"):
        logged(test="cogging", changed=weak, changed_from=0.5)


def test_a_transducer_reads_more_on_the_way_down_and_bends():
    rated = MOTOR.torque_rated_nm
    up = (0.0, 0.5, 1.0, 0.5, 0.0, -0.5)
    how = {"speed": 0.2, "id_levels": (0.0,), "iq_levels": up, "dwell_s": 0.1}
    true = logged(test="torque_map", **how)["torque_shaft_nm"]
    worn = replace(QUIET, torque_hysteresis_rel=0.01)
    lag = logged(worn, test="torque_map", **how)["torque_shaft_nm"] - true
    each = true.size // len(up)
    at = [float(lag[(n + 1) * each - 5]) for n in range(len(up))]
    assert at[3] - at[1] == pytest.approx(0.01 * rated, rel=0.02)
    assert abs(at[2] + 0.005 * rated) < 1e-4 * rated
    bent = replace(QUIET, torque_bend_rel=0.02)
    more = logged(bent, test="torque_map", **how)["torque_shaft_nm"] - true
    assert more == pytest.approx(0.02 * true**3 / rated**2, abs=1e-6 * rated)


def test_a_compensated_dead_time_is_gone_but_near_zero_current():
    volt, ramp = 0.4, 1.0
    dead = {"size": volt, "knee_a": 1e-3, "compensated": 1.0, "ramp_a": ramp}
    how = {"speed": 0.0, "id_levels": (0.03, 1.0), "iq_levels": (0.0,), "dwell_s": 0.2}
    clean = logged(test="torque_map", **how)
    left = logged(test="torque_map", motor=MOTOR.having(dead_time=dead), **how)
    whole = logged(
        test="torque_map", motor=MOTOR.having(dead_time=dead | {"compensated": 0.0}), **how
    )
    half = clean["t_s"].size // 2

    def lost(log, rows):
        moved = [log[name][rows] - clean[name][rows] for name in ("vd_v", "vq_v")]
        return float(np.hypot(*(part[-50:].mean() for part in moved)))

    small, large = slice(0, half), slice(half, None)
    assert lost(left, large) < 0.02 * lost(whole, large)
    assert 0.5 * lost(whole, small) < lost(left, small) < lost(whole, small)
    assert math.isclose(lost(whole, large), 4.0 / 3.0 * volt, rel_tol=0.15)


def test_an_encoder_that_is_read_late_shows_where_the_rotor_was():
    how = {"speed": 0.5, "id_levels": (0.0,), "iq_levels": (0.3,), "dwell_s": 0.2}
    late_s = 4e-6
    true = logged(test="torque_map", **how)
    seen = logged(replace(QUIET, late_angle_s=late_s), test="torque_map", **how)
    behind = true["theta_mech_rad"] - seen["theta_mech_rad"]
    assert behind == pytest.approx(late_s * true["omega_mech_rad_s"], rel=1e-3)
