"""Friction that falls with speed, at whatever speed it does, in coasts that end above it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pipeline.criticism.diagnosis import diagnose
from pipeline.records.capture import Campaign
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants
from tests.unit.estimation.signals import capture

TOP_RAD_S, ROW_S = 96.0, 5e-3


def coast(sense: float, slow_rad_s: float) -> dict[str, np.ndarray]:
    """A coast from 96 to 2.9 rad/s under 20 rad/s², twice that at rest, its angle to 60 µrad."""

    def motion(_: float, state: np.ndarray) -> list[float]:
        omega = state[1]
        return [omega, -20.0 * (1.0 + np.exp(-((omega / slow_rad_s) ** 2))) - 0.133 * omega]

    def ended(_: float, state: np.ndarray) -> float:
        return state[1] - 2.9

    ended.terminal = True
    solved = solve_ivp(
        motion, (0.0, 20.0), (0.0, TOP_RAD_S), events=ended, dense_output=True, rtol=1e-10
    )
    t_s = np.arange(0.0, solved.t[-1], ROW_S)
    noise = np.random.default_rng(4).normal(0.0, 6e-5, t_s.size)
    return {"t_s": t_s, "theta_mech_rad": sense * solved.sol(t_s)[0] + noise}


@pytest.mark.parametrize("slow_rad_s", [6.0, 11.0, 25.0])
def test_the_speed_at_which_friction_falls_is_looked_for_everywhere(slow_rad_s: float) -> None:
    """Trial speeds three times apart left a fit at 3.5 rad/s, or none, for 6 and for 25."""
    captures = [capture("spin_down", f"coast{s}", **coast(s, slow_rad_s)) for s in (1.0, -1.0)]
    found = diagnose(Campaign("m", tuple(captures)), ModelSpec(), Constants())
    assert found.missing == ("stribeck",)
