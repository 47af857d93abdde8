"""Where the back-EMF of a driven motor puts its magnet, beside its inductances."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.numerics.turning_voltage import magnet_angle

PAIRS, R_OHM, PSI_WB = 5, 0.3, 0.02


def driven(
    offset_rad: float, direct_a: float, ld_h: float, lq_h: float, *, with_speed: bool = False
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Two seconds of a speed that swings through zero, at one d current, as stator vectors; some of
    the q current may follow the speed.
    """
    rng, t_s = np.random.default_rng(3), np.arange(0.0, 2.0, 1e-4)
    omega, theta = 80.0 * np.cos(5.0 * t_s), 16.0 * np.sin(5.0 * t_s)
    electrical = PAIRS * omega
    i_d, i_q = np.full(t_s.size, direct_a), 4.0 * np.sin(7.0 * t_s)
    if with_speed:
        i_q = 0.25 * i_q + 4.0 * np.cos(5.0 * t_s) ** 2
    slope_q = np.gradient(i_q, t_s)
    v_d = R_OHM * i_d - electrical * lq_h * i_q
    v_q = R_OHM * i_q + lq_h * slope_q + electrical * (ld_h * i_d + PSI_WB)
    turned = np.exp(1j * (PAIRS * theta + offset_rad))
    noise = 0.02 * (rng.normal(size=(2, t_s.size)) + 1j * rng.normal(size=(2, t_s.size)))
    return (v_d + 1j * v_q) * turned + noise[0], (i_d + 1j * i_q) * turned + noise[1], theta, omega


@pytest.mark.parametrize("offset_rad", [0.0, 0.4, -2.9])
@pytest.mark.parametrize("direct_a", [0.0, -3.0])
@pytest.mark.parametrize(("ld_h", "lq_h"), [(4e-4, 4e-4), (4e-4, 9e-4)])
def test_a_d_current_that_is_held_is_no_back_emf(offset_rad, direct_a, ld_h, lq_h) -> None:
    """Complex inductances were a back-EMF of any angle: 0.13 rad of a sound motor."""
    found = magnet_angle(*driven(offset_rad, direct_a, ld_h, lq_h), PAIRS)
    assert found.offset_rad == pytest.approx(offset_rad, abs=3e-3)
    assert found.u_rad < 2e-3


def test_a_saliency_is_along_the_magnet() -> None:
    """Across it, a q current that follows the speed would turn the magnet by 2 mrad."""
    found = magnet_angle(*driven(0.4, -3.0, 4e-4, 9e-4, with_speed=True), PAIRS)
    assert found.offset_rad == pytest.approx(0.4, abs=1e-3)
