"""What too few rows to fit it leave open of a shaft: reluctance, and instants of samples."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.estimation.registry import fit_all
from pipeline.numerics.integrals import trapezoid
from pipeline.records.capture import Campaign, Capture
from tests.unit.estimation.signals import capture

KT_NM_A, J_KGM2, COULOMB_NM, VISCOUS = 0.3, 0.018, 0.27, 4e-4
STATED = {"kt_peak_nm_a": KT_NM_A, "u_kt_peak_nm_a": 4e-4}


def braked(seed: int, per_a: float, rate_hz: int = 20) -> Capture:
    """A shaft that is driven to and fro, and braked by a current of both axes: 12 s.

    `per_a` [1/A] is the torque that reluctance adds for each ampere of d current, over the
    magnet's.

    """
    rng = np.random.default_rng(seed)
    t_s = np.arange(0.0, 12.0, 1e-3)
    place = (t_s / 0.75).astype(int)
    drive = rng.choice([-1.0, 1.0], place.max() + 1) * rng.uniform(0.3, 1.0, place.max() + 1)
    omega, gain = np.zeros(t_s.size), np.zeros(t_s.size)
    direct, quadrature = np.zeros(t_s.size), np.zeros(t_s.size)
    for k in range(t_s.size):
        braking = place[k] % 3 == 2
        quadrature[k] = -0.1 * omega[k] if braking else 12.0 * drive[place[k]]
        direct[k] = -0.003 * omega[k] ** 2 if braking else 0.0
        torque = KT_NM_A * quadrature[k] * (1.0 + per_a * direct[k])
        friction = COULOMB_NM * np.tanh(omega[k] / 0.05) + VISCOUS * omega[k]
        gain[k] = (torque - friction) / J_KGM2
        if k + 1 < t_s.size:
            omega[k + 1] = omega[k] + 1e-3 * gain[k]
    rows = slice(None, None, round(1000 / rate_hz))
    return capture(
        "drive",
        f"b{seed}",
        t_s=t_s[rows],
        iq_a=(quadrature + 2e-3 * rng.normal(size=t_s.size))[rows],
        id_a=direct[rows],
        theta_mech_rad=trapezoid(t_s, omega)[rows],
        temp_magnet_degc=np.full(t_s.size, 25.0)[rows],
    )


@pytest.mark.parametrize(("seed", "per_a"), [(0, -0.05), (2, -0.05), (4, 0.0), (6, 0.0)])
def test_what_too_few_rows_show_is_in_doubt(seed: int, per_a: float) -> None:
    """Friction of a sound motor was 47 % off at 6 u in a log of 20 Hz."""
    known = fit_all(Campaign("m", (braked(seed, per_a),), STATED), {})[0]
    truth = {"j_rotor_kgm2": J_KGM2, "torque_coulomb_nm": COULOMB_NM, "b_visc_nm_s_rad": VISCOUS}
    for name, true in truth.items():
        one = known.best(name)
        assert one is None or abs(one.number - true) < 3.0 * one.u, name
