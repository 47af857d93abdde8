"""Friction of a capture that changes with time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.simulator.bench import record
from tests.simulated import QUIET, design

MOTOR = replace(design("gimbal-5208"), effects={})


def speed(test: str, **protocol: object) -> np.ndarray:
    rng = np.random.default_rng(1)
    return record(test, MOTOR, QUIET, rng, **protocol).tables[0]["omega_mech_rad_s"]


@pytest.mark.parametrize(("test", "how"), [("spin_down", {}), ("drive", {"segments": 2})])
def test_a_share_that_stays_is_a_motor_of_that_friction(test, how):
    more = {name: 1.5 * getattr(MOTOR, name) for name in ("torque_coulomb_nm", "b_visc_nm_s_rad")}
    course = ((0.0, 1.5), (1.0, 1.5))
    one, other = speed(test, friction_over_time=course, **how), speed(test, changed=more, **how)
    both = min(one.size, other.size)
    assert one[:both] == pytest.approx(other[:both], abs=0.01)
    assert np.abs(one[:both] - speed(test, **how)[:both]).max() > 0.05


def test_a_coast_slows_by_the_friction_of_its_time() -> None:
    """Half of the friction from 0.3 s on is half of the deceleration there, at nearly one speed."""
    coasted = speed("spin_down", friction_over_time=((0.0, 1.0), (0.3, 1.0), (0.301, 0.5)),
                    rate_hz=1000.0)  # fmt: skip
    slope = np.gradient(coasted, 1e-3)
    assert slope[305] / slope[295] == pytest.approx(0.5, rel=0.03)


def test_no_other_test_has_a_friction_that_changes() -> None:
    with pytest.raises(ValueError, match="no friction changes"):
        speed("cogging", friction_over_time=((0.0, 1.5),))
