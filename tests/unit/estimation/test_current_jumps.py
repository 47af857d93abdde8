"""Set points that change in step with a log's rows: its snapshots do not show when."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pipeline.estimation.estimators import inertia
from pipeline.records.constants import Constants
from tests.unit.estimation.signals import capture, estimates, known_value

KT, J_KGM2, DRY_NM, VISCOUS = 0.5, 2e-3, 0.05, 4e-4
STEP_S, ROW, HOLD_ROWS = 1e-4, 10, 50


def drive(first_step: int, limit_a: float):
    """Six seconds of a speed loop: each set point makes a pulse of current that decays in 6 ms,
    below a limit. It begins so many steps behind a row.
    """
    rng = np.random.default_rng(1)
    decay = np.exp(-STEP_S * np.arange(HOLD_ROWS * ROW) / 6e-3)
    pulses = np.clip(np.outer(rng.uniform(-9.0, 9.0, 120), decay), -limit_a, limit_a)
    current = np.append(np.roll(pulses.ravel(), first_step), 0.0)
    omega, theta = 0.0, 0.0
    angles, holding = np.empty(current.size), np.empty(current.size)
    for n, ampere in enumerate(current):
        angles[n] = theta
        friction = DRY_NM * math.tanh(omega / 0.05) + VISCOUS * omega
        # a speed loop carries the friction, and pulls the shaft back
        holding[n] = ampere + (friction - 4e-3 * omega) / KT
        omega += STEP_S / J_KGM2 * (KT * holding[n] - friction)
        theta += STEP_S * omega
    rows, count = slice(None, None, ROW), 2.0 * math.pi / 65536
    measured = holding[rows] + rng.normal(0.0, 2e-3, holding[rows].size)
    return capture(
        "drive",
        "drive",
        t_s=STEP_S * np.arange(current.size)[rows],
        theta_mech_rad=count * np.floor(angles[rows] / count),
        iq_a=measured,
        id_a=rng.normal(0.0, 2e-3, measured.size),
        temp_magnet_degc=np.full(measured.size, 25.0),
    )


@pytest.mark.parametrize("first_step", [1, 3, 5, 9])
@pytest.mark.parametrize(("limit_a", "u"), [(3.0, 0.015), (9.0, 0.06)])
def test_a_jump_may_be_anywhere_between_its_rows(first_step: int, limit_a: float, u: float) -> None:
    """As straight lines, steps just behind a row made J 7 % too small, just before one 6 % large.

    Pulses of one shape leave open whether they jump or are late, and so the inertia.
    """
    known = Constants((known_value("kt_peak_nm_a", KT, 1e-4 * KT),))
    found = estimates(inertia.ESTIMATOR, drive(first_step, limit_a), known=known)["j_rotor_kgm2"]
    assert abs(found.number - J_KGM2) < 3.0 * found.u
    assert found.u < u * J_KGM2


def propeller(seed: int):
    """Twelve seconds of a speed loop with a propeller, logged at 100 Hz without an angle: mean
    currents, and the speed of an observer of 100 Hz at the end of each row.
    """
    inertia_kgm2, kt, dry, square, limit_a = 8.3e-5, 0.26, 0.02, 1.1e-5, 7.2
    gain, step_s, row, observer = 0.022, 1e-4, 100, 2.0 * math.pi * 100.0
    rng = np.random.default_rng(seed)
    points = np.repeat(rng.uniform(110.0, 310.0, 18), 70 * row)[: 1200 * row]
    current, speed = np.empty(points.size), np.empty(points.size)
    omega = theta = seen = seen_theta = integral = 0.0
    for n, wanted in enumerate(points):
        integral = float(
            np.clip(integral + 6.0 * gain * step_s * (wanted - seen), -limit_a, limit_a)
        )
        current[n] = np.clip(gain * (wanted - seen) + integral, -limit_a, limit_a)
        drag = dry * math.tanh(omega / 0.1) + square * omega * abs(omega)
        omega += step_s / inertia_kgm2 * (kt * current[n] - drag)
        theta += step_s * omega
        ahead = theta - seen_theta
        seen_theta += step_s * (seen + 2.0 * observer * ahead)
        seen += step_s * observer**2 * ahead
        speed[n] = seen
    rows = np.arange(row - 1, points.size, row)
    means = current.reshape(-1, row).mean(axis=1) + rng.normal(0.0, 1e-3, rows.size)
    columns = {"t_s": step_s * rows, "omega_mech_rad_s": speed[rows], "iq_a": means}
    return capture("drive", f"drive_{seed}", **columns), inertia_kgm2, kt


@pytest.mark.parametrize("seed", [1, 2])
def test_what_a_smoothed_speed_hides_is_no_torque_of_a_jumping_current(seed: int) -> None:
    """Columns of the current's instant took the torque's place: J was twice what it is."""
    made, true, kt = propeller(seed)
    known = Constants((known_value("kt_peak_nm_a", kt, 1e-4 * kt),))
    found = estimates(inertia.ESTIMATOR, made, known=known)["j_rotor_kgm2"]
    assert not found.known or abs(found.number - true) < 3.0 * found.u


def test_a_current_of_a_few_rows_a_period_is_late_to_second_order_too() -> None:
    """Its rate of change leaves cos(ωτ) of a torque: J of a servo in blocks of four rows was 5.6 %
    too large at 5 u.
    """
    rng, row_s, late_s = np.random.default_rng(3), 5e-3, 5e-3
    t = row_s * np.arange(4000)
    speed, theta, torque = np.full(t.size, 40.0), 40.0 * t, np.zeros(t.size)
    for hz, rad_s, phase in ((12.0, 12.0, 0.3), (0.4, 25.0, 1.0)):
        w = 2.0 * math.pi * hz
        speed += rad_s * np.sin(w * t + phase)
        theta -= rad_s / w * np.cos(w * t + phase)
        # a current of the time t - τ
        torque += J_KGM2 * rad_s * w * np.cos(w * (t - late_s) + phase)
        torque += VISCOUS * rad_s * np.sin(w * (t - late_s) + phase)
    torque += DRY_NM + VISCOUS * 40.0
    made = capture(
        "drive",
        "drive",
        t_s=t,
        theta_mech_rad=theta,
        iq_a=torque / KT + rng.normal(0.0, 2e-3, t.size),
        temp_magnet_degc=np.full(t.size, 25.0),
    )
    known = Constants((known_value("kt_peak_nm_a", KT, 1e-4 * KT),))
    found = estimates(inertia.ESTIMATOR, made, known=known)["j_rotor_kgm2"]
    assert found.number == pytest.approx(J_KGM2 / math.cos(24.0 * math.pi * late_s), rel=0.02)
    assert abs(found.number - J_KGM2) < 3.0 * found.u
    assert found.u < 0.1 * J_KGM2
