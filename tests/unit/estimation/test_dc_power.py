"""Motor constant and drag by a balance of power: battery, shaft torque and speed, nothing else."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.contracts.schemas import check_columns
from pipeline.estimation.estimators.dc_power import ESTIMATOR, EXPERIMENT
from pipeline.records.capture import Capture
from pipeline.records.errors import CaptureError
from tests.unit.estimation.signals import capture, estimates

KM, COULOMB_NM, VISCOUS, STANDBY_W = 0.06, 0.02, 3e-5, 4.0
TRUE = {
    "motor_constant_nm_sqrt_w": KM,
    "torque_coulomb_nm": COULOMB_NM,
    "b_visc_nm_s_rad": VISCOUS,
    "standby_w": STANDBY_W,
}


def bench(seed: int, u_rel: float = 5e-4, propeller: bool = False, **gains: float) -> Capture:
    """A grid of torque and speed, four seconds each, both senses; or a propeller's curve alone."""
    rng = np.random.default_rng(seed)
    speeds = np.array([60.0, 150.0, 300.0, -60.0, -150.0, -300.0])
    omega, torque = (part.ravel() for part in np.meshgrid(speeds, np.linspace(-0.1, 0.4, 6)))
    torque = torque * np.sign(omega)
    if propeller:
        omega = np.repeat(np.linspace(50.0, 600.0, 36), 1)
        torque = 1.1e-6 * omega**2
    omega, torque = np.repeat(omega, 80), np.repeat(torque, 80)
    air_gap = torque + COULOMB_NM * np.sign(omega) + VISCOUS * omega
    power = air_gap * omega + (air_gap / KM) ** 2 + STANDBY_W
    volts = 24.0 - 0.01 * power
    n = omega.size
    return capture(
        "drive",
        f"b{seed}",
        t_s=0.05 * np.arange(n),
        vdc_v=volts * (1.0 + gains.get("volts", 0.0)) + 5e-3 * rng.normal(size=n),
        idc_a=power / volts * (1.0 + gains.get("amps", 0.0)) + 0.02 * rng.normal(size=n),
        omega_mech_rad_s=omega + 0.2 * rng.normal(size=n),
        torque_shaft_nm=torque * (1.0 + gains.get("force", 0.0)) + 2e-3 * rng.normal(size=n),
        temp_winding_degc=np.full(n, 25.0),
        u_rel_voltage=u_rel,
        u_rel_current=u_rel,
        u_rel_torque=u_rel,
    )


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_balance_of_power_gives_motor_constant_and_drag(seed: int) -> None:
    """Each within its interval, on a grid of torque and speed of both senses, with gains drawn."""
    rng = np.random.default_rng(seed)
    drawn = dict(zip(("volts", "amps", "force"), 5e-4 * rng.choice([-1.0, 1.0], 3), strict=True))
    found = estimates(ESTIMATOR, bench(seed, **drawn))
    for name, true in TRUE.items():
        one = found[name]
        assert one.known, (name, one.note)
        assert abs(one.number - true) < 2.5 * one.u, name
    assert found["motor_constant_nm_sqrt_w"].u < 0.02 * KM
    assert found["torque_coulomb_nm"].u < 0.1 * COULOMB_NM


def test_a_gain_of_one_per_cent_is_a_tenth_of_the_losses() -> None:
    """Losses are a difference of two powers: their uncertainty is the gains', not the noise's."""
    sure, unsure = (
        estimates(ESTIMATOR, bench(4, u_rel))["motor_constant_nm_sqrt_w"] for u_rel in (5e-4, 5e-3)
    )
    assert unsure.u > 3.0 * sure.u


def test_a_propeller_alone_shows_little_and_says_so() -> None:
    """Torque is a function of speed: with gains of one per cent drag is hardly parted."""
    found = estimates(ESTIMATOR, bench(5, 0.01, propeller=True))
    for name, true in TRUE.items():
        one = found[name]
        if one.known:
            assert abs(one.number - true) < 2.0 * one.u, name
        else:
            assert EXPERIMENT in one.note
    assert found["motor_constant_nm_sqrt_w"].u > 0.02 * KM


def test_a_ride_says_what_would_determine_something() -> None:
    """Battery and speed alone: refused, with the columns that would help."""
    t_s = np.arange(0.0, 100.0, 0.2)
    ride = capture(
        "drive", "r", t_s=t_s, vdc_v=48 + 0 * t_s, idc_a=5 + 0 * t_s, omega_mech_rad_s=t_s
    )
    with pytest.raises(CaptureError) as refused:
        check_columns(ride)
    assert "torque_shaft_nm" in refused.value.remedy
    assert "iq_a" in refused.value.remedy
    check_columns(bench(6))
