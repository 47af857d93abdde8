"""A torque that is sampled more slowly than the current that makes it."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.contracts.clocks import held_apart
from pipeline.estimation.registry import fit_all
from pipeline.numerics.integrals import trapezoid
from pipeline.records.capture import Campaign, Capture
from tests.unit.estimation.signals import capture

KT_NM_A, J_KGM2, COULOMB_NM, VISCOUS = 0.4, 1.4e-5, 0.02, 7e-5
TRUE = {"kt_peak_nm_a": KT_NM_A, "j_rotor_kgm2": J_KGM2}


def log(seed: int, rows: int) -> Capture:
    """Two machines back to back, the other one six times as heavy: current of 0.5 to 60 Hz in rows
    of 0.5 ms, and a torque that is new in each of `rows`.
    """
    rng = np.random.default_rng(seed)
    t_s = np.arange(0.0, 5.0, 5e-4)
    phase = 2.0 * np.pi * np.outer(t_s, np.geomspace(0.5, 60.0, 20)) + rng.uniform(0.0, 6.28, 20)
    current = 0.3 * np.sin(phase).sum(axis=1)
    slow = 250.0 + 45.0 * np.sin(2.5 * t_s)
    gain = np.gradient(slow, t_s) + KT_NM_A * current / (7.0 * J_KGM2)
    omega = slow[0] + trapezoid(t_s, gain)
    load = KT_NM_A * current - COULOMB_NM - VISCOUS * omega - J_KGM2 * gain
    load = load + 4e-4 * rng.normal(size=t_s.size)
    step = 2.0 * np.pi / 65536
    return held_apart(
        capture(
            "drive",
            f"d{seed}",
            t_s=t_s,
            iq_a=current + 1e-3 * rng.normal(size=t_s.size),
            id_a=0.0 * t_s,
            theta_mech_rad=np.round(trapezoid(t_s, omega) / step) * step,
            torque_shaft_nm=load[np.arange(t_s.size) // rows * rows],
            temp_magnet_degc=np.full(t_s.size, 25.0),
        )
    )[0]


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("rows", [10, 20])
def test_a_torque_of_100_or_200_hz_beside_a_current_of_60_hz(seed: int, rows: int) -> None:
    """Between two of its samples a load that follows the current is no straight line."""
    known = fit_all(Campaign("m", (log(seed, rows),)), {})[0]
    for name, true in TRUE.items():
        one = known.best(name)
        assert one is None or abs(one.number - true) < 3.0 * one.u, name
    kt = known.best("kt_peak_nm_a")
    assert kt is not None
    assert kt.u < 0.03 * KT_NM_A


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_current_of_200_hz_beside_an_angle_of_2_khz(seed: int) -> None:
    """Straight lines between its samples lack an eighth of a wave of 40 Hz, and J lacked a part."""
    rng = np.random.default_rng(seed)
    t_s = np.arange(0.0, 8.0, 5e-4)
    phase = 2.0 * np.pi * np.outer(t_s, np.geomspace(8.0, 40.0, 12)) + rng.uniform(0.0, 6.28, 12)
    current = 0.4 * np.sin(phase).sum(axis=1)
    slow = 100.0 * np.sin(1.3 * t_s)
    inertia = 2e-3
    gain = (KT_NM_A * current) / inertia + np.gradient(slow, t_s)
    omega = 250.0 + trapezoid(t_s, gain)
    drag = COULOMB_NM * np.sign(omega) + VISCOUS * omega
    current = current + (drag + inertia * np.gradient(slow, t_s)) / KT_NM_A
    step = 2.0 * np.pi / 65536
    drive = capture(
        "drive",
        f"c{seed}",
        t_s=t_s,
        iq_a=(current + 1e-3 * rng.normal(size=t_s.size))[np.arange(t_s.size) // 10 * 10],
        theta_mech_rad=np.round(trapezoid(t_s, omega) / step) * step,
        temp_magnet_degc=np.full(t_s.size, 25.0),
    )
    stated = {"kt_peak_nm_a": KT_NM_A, "u_kt_peak_nm_a": 4e-4}
    campaign = Campaign("m", (held_apart(drive)[0],), stated)
    known = fit_all(campaign, {})[0]
    inertia_found = known.best("j_rotor_kgm2")
    assert inertia_found is not None
    assert inertia_found.number == pytest.approx(inertia, rel=0.005)


def slow(seed: int) -> Capture:
    """The same two machines in rows of 10 ms: means of current, torques of their start."""
    rng = np.random.default_rng(seed)
    t_s = np.arange(0.0, 4.0, 5e-4)
    phase = 2.0 * np.pi * np.outer(t_s, np.geomspace(0.5, 40.0, 20)) + rng.uniform(0.0, 6.28, 20)
    current = 0.3 * np.sin(phase).sum(axis=1)
    held = np.zeros(t_s.size)
    speed, angle = 60.0 * 7.0 * J_KGM2, 20.0 * 60.0 * 7.0 * J_KGM2
    omega = np.full(t_s.size, 150.0)
    wish = 150.0 * (1.0 + 0.3 * np.sin(2.5 * t_s))
    gain = np.zeros(t_s.size)
    for k in range(t_s.size - 1):
        held[k + 1] = held[k] + 5e-4 * (wish[k] - omega[k])
        drag = COULOMB_NM + VISCOUS * omega[k]
        other = speed * (wish[k] - omega[k]) + angle * held[k]
        gain[k] = (KT_NM_A * current[k] - drag + other) / (7.0 * J_KGM2)
        omega[k + 1] = omega[k] + 5e-4 * gain[k]
    load = KT_NM_A * current - COULOMB_NM - VISCOUS * omega - J_KGM2 * gain
    rows = t_s.size // 20 * 20

    def means(signal: np.ndarray) -> np.ndarray:
        return signal[:rows].reshape(-1, 20).mean(axis=1)

    theta = trapezoid(t_s, omega)
    return capture(
        "drive",
        f"s{seed}",
        t_s=t_s[19:rows:20],
        iq_a=means(current + 1e-3 * rng.normal(size=t_s.size)),
        id_a=np.zeros(rows // 20),
        theta_mech_rad=theta[19:rows:20],
        torque_shaft_nm=load[0:rows:20] + 4e-4 * rng.normal(size=rows // 20),
        temp_magnet_degc=np.full(rows // 20, 25.0),
    )


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_two_torques_whose_difference_is_as_small_as_half_a_row_of_delay(seed: int) -> None:
    """The other machine is six times as heavy: what accelerates the shaft is a seventh."""
    stated = {"kt_peak_nm_a": KT_NM_A, "u_kt_peak_nm_a": 4e-4}
    inertia = fit_all(Campaign("m", (slow(seed),), stated), {})[0].best("j_rotor_kgm2")
    assert inertia is None or abs(inertia.number - J_KGM2) < 3.0 * inertia.u
