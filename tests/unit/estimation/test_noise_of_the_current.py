"""The inertia of logs whose torque is friction most of all, and of currents of one size."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from pipeline.estimation.estimators import inertia
from pipeline.estimation.mechanical.torque_share import has_torque_of_its_own, is_apart
from pipeline.records.constants import Constants
from tests.unit.estimation.signals import capture, estimates, known_value

KT, J_KGM2, DRY_NM, VISCOUS = 1.0, 0.009, 0.18, 0.012
KNOWN = Constants((known_value("kt_peak_nm_a", KT, 1e-3 * KT),))


def log(t_s, theta_rad, current_a, noise_a, counts, seed=1):
    """A drive's log of an angle and a noisy current."""
    rng, count = np.random.default_rng(seed), 2.0 * math.pi / counts
    return capture(
        "drive",
        "drive",
        t_s=t_s,
        theta_mech_rad=count * np.floor(theta_rad / count),
        iq_a=current_a + rng.normal(0.0, noise_a, t_s.size),
        temp_magnet_degc=np.full(t_s.size, 25.0),
    )


def gentle(rate_hz: float, noise_a: float, load_nm: float = 0.0):
    """A joint that follows two sines of the angle, and what moves it; a load that is not logged."""
    t = np.arange(0.0, 60.0, 1.0 / rate_hz)
    theta, omega, alpha = np.zeros((3, t.size))
    for amplitude, hz, phase in ((0.8, 0.31, 0.0), (0.25, 0.83, 1.0)):
        w = 2.0 * math.pi * hz
        theta += amplitude * np.sin(w * t + phase)
        omega += amplitude * w * np.cos(w * t + phase)
        alpha -= amplitude * w**2 * np.sin(w * t + phase)
    torque = J_KGM2 * alpha + DRY_NM * np.tanh(omega / 0.02) + VISCOUS * omega
    torque += load_nm * np.sin(2.0 * math.pi * 0.57 * t)
    return log(t, theta, torque / KT, noise_a, 147_456)


@pytest.mark.parametrize("rate_hz", [50.0, 200.0])
def test_noise_of_the_current_is_not_taken_for_inertia(rate_hz: float) -> None:
    """It made 1/J too small by a third to a half: the torque is friction most of all, and so the
    noise is much of what is left to accelerate.
    """
    found = estimates(inertia.ESTIMATOR, gentle(rate_hz, 0.014), known=KNOWN)
    for name, true in (("j_rotor_kgm2", J_KGM2), ("torque_coulomb_nm", DRY_NM)):
        assert abs(found[name].number - true) < 3.0 * found[name].u
        assert found[name].u < 0.08 * true


def test_a_load_that_is_not_logged_is_no_noise_of_the_current() -> None:
    """Beside a load of ten times the noise the inertia is not known."""
    found = estimates(inertia.ESTIMATOR, gentle(200.0, 0.014, load_nm=0.1), known=KNOWN)
    assert not found["j_rotor_kgm2"].known


@pytest.mark.parametrize(("beside", "own"), [("q current cubed", False), ("eccentric cos", True)])
def test_nuisances_of_a_current_of_one_size_leave_its_torque_a_part(beside: str, own: bool) -> None:
    """The cube of a current that is plus or minus one size is that current, but for its noise. With
    it the inertia of a joint with play came out at half its size, sure to 6 %.
    """
    rng = np.random.default_rng(3)
    current = rng.choice([-5.6, 5.6], 400) + rng.normal(0.0, 0.014, 400)
    speed = rng.normal(0.0, 3.0, 400)
    column = current**3 if beside.startswith("q") else rng.normal(0.0, 1.0, 400)
    design = np.column_stack([KT * current, -np.sign(speed), -speed, column])
    drag = SimpleNamespace(design=design, names=("torque", "coulomb", "viscous", beside))
    assert has_torque_of_its_own(drag) == own


def test_what_the_timing_takes_of_a_torque_is_not_held_against_its_size() -> None:
    """Of a drive between two currents the cube left 6 % of the torque beside friction and timing,
    which was more than 5 % of it beside friction alone: J came out at half of what it is.
    """
    rng = np.random.default_rng(4)
    current = rng.choice([-7.0, 7.0], 400) + rng.normal(0.0, 0.3, 400)
    late, speed = rng.normal(0.0, 8.0, 400), rng.normal(0.0, 3.0, 400)
    torque = KT * (current + late)
    names = ("torque", "coulomb", "viscous", "current lag", "q current cubed")
    design = np.column_stack([torque, -np.sign(speed), -speed, KT * late, current**3])
    assert not has_torque_of_its_own(SimpleNamespace(design=design, names=names))
    alone = SimpleNamespace(design=design[:, :4], names=names[:4])
    assert has_torque_of_its_own(alone)


def test_rows_that_are_means_up_to_their_time_are_late_by_half_a_row() -> None:
    """J - τB stands for J under a current that is τ late; it was J, sure to a percent."""
    row_s, parts, viscous = 5e-3, 50, 0.5
    fine = np.arange(0.0, 60.0, row_s / parts)
    theta, omega, alpha = 6.0 * fine, np.full(fine.size, 6.0), np.zeros(fine.size)
    for amplitude, hz, phase in ((0.8, 0.31, 0.0), (0.25, 0.83, 1.0)):
        w = 2.0 * math.pi * hz
        theta += amplitude * np.sin(w * fine + phase)
        omega += amplitude * w * np.cos(w * fine + phase)
        alpha -= amplitude * w**2 * np.sin(w * fine + phase)
    torque = J_KGM2 * alpha + DRY_NM + viscous * omega
    means = torque.reshape(-1, parts).mean(axis=1) / KT
    rows = slice(parts - 1, None, parts)
    made = log(fine[rows], theta[rows], means, 0.014, 147_456)
    found = estimates(inertia.ESTIMATOR, made, known=KNOWN)["j_rotor_kgm2"]
    late_kgm2 = 0.5 * row_s * viscous
    assert found.number == pytest.approx(J_KGM2 - late_kgm2, abs=0.5 * late_kgm2)
    assert abs(found.number - J_KGM2) < 3.0 * found.u
    assert found.u < late_kgm2


def test_a_ripple_of_the_torque_at_an_angle_of_few_steps_is_the_torque() -> None:
    """An angle of six steps an electrical turn shows the sixth wave at its crest alone. T_c of a
    sound motor was 5e-13 N·m, its torque counted to a ripple.
    """
    current = np.random.default_rng(4).normal(0.0, 1.0, 50)
    column = 2.0 * current
    rows = SimpleNamespace(columns={"order 300 q current cos": column, "order 300 cos": column})
    assert not is_apart(rows, current, "order 300 q current cos")
    assert is_apart(rows, current, "order 300 cos")
