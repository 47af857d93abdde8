"""Friction that falls with speed over most of the range: no drag helps a shaft."""

from __future__ import annotations

import math

import numpy as np

from pipeline.estimation.estimators import inertia
from tests.unit.estimation.signals import estimates
from tests.unit.estimation.test_noise_of_the_current import KNOWN, KT, log

J_KGM2, DRY_NM, VISCOUS = 2.4e-4, 0.02, 1.2e-4


def drive(excess: float, width_rad_s: float):
    """Forty seconds of torques of 0.2 s each, friction with a wide excess at low speed."""
    rng, step = np.random.default_rng(1), 1e-3
    torque = np.repeat(rng.uniform(-0.25, 0.25, 200), 200)
    theta, speed = np.zeros(torque.size), 0.0
    for n in range(torque.size - 1):
        dry = DRY_NM * (1.0 + excess * math.exp(-((speed / width_rad_s) ** 2)))
        torque[n] -= 3e-3 * speed
        friction = dry * math.tanh(speed / 0.05) + VISCOUS * speed
        speed += step / J_KGM2 * (torque[n] - friction)
        theta[n + 1] = theta[n] + step * speed
    return log(step * np.arange(torque.size), theta, torque / KT, 1e-4, 65536)


def test_a_drag_by_the_square_of_speed_is_not_below_zero() -> None:
    """It took up what was left of another form, and made b too large and T_c too small."""
    found = estimates(inertia.ESTIMATOR, drive(0.3, 80.0), known=KNOWN)
    assert "windage" not in found["torque_coulomb_nm"].note
    assert "windage" not in found["j_rotor_kgm2"].note
    assert abs(found["j_rotor_kgm2"].number - J_KGM2) < 3.0 * found["j_rotor_kgm2"].u
