"""A shaft that sticks at its reversals, and still yields there."""

from __future__ import annotations

import numpy as np

import pipeline
from pipeline.criticism.regression.standstill import _rests
from pipeline.records.capture import Campaign
from tests.unit.estimation.signals import capture

KT = {"kt_peak_nm_a": 0.0945, "u_kt_peak_nm_a": 0.0002}
INERTIA, COULOMB, VISCOUS = 9e-5, 0.03, 1.1e-4


def gentle(seed: int, yields_rad_s: float = 0.06, time_s: float = 30.0) -> pipeline.Recordings:
    """Slow sines of a speed loop of 8 Hz. Below `yields_rad_s` friction is viscous, so that the
    shaft creeps by an encoder's count or two a row where the current does not overcome it.
    """
    rng, period = np.random.default_rng(seed), 2.5e-4
    t = period * np.arange(round(time_s / period))
    waves = zip((0.21, 0.37, 0.83), rng.uniform(0.0, 6.3, 3), strict=True)
    wanted = sum(5.0 * np.sin(2.0 * np.pi * f * t + phase) for f, phase in waves)
    omega, torque, integral = np.zeros(t.size), np.zeros(t.size), 0.0
    pull = 2.0 * np.pi * 8.0 * INERTIA
    for n in range(1, t.size):
        error = wanted[n] - omega[n - 1]
        integral += period * error
        torque[n] = pull * error + 2.0 * np.pi * 2.0 * pull * integral
        # implicit in the speed, as the slope of what yields is steep
        free = omega[n - 1] + period / INERTIA * torque[n]
        slope = 1.0 + period / INERTIA * (VISCOUS + COULOMB / yields_rad_s)
        inside = free / slope
        slides = free - np.sign(free) * period / INERTIA * COULOMB
        sliding = slides / (1.0 + period / INERTIA * VISCOUS)
        omega[n] = inside if abs(inside) < yields_rad_s else sliding
    theta, count = period * np.cumsum(omega), 2.0 * np.pi / 16384
    rows = slice(None, None, 20)
    noise = rng.normal(0.0, 0.008, t[rows].size)
    log = capture(
        "drive",
        "log",
        t_s=t[rows],
        iq_a=torque[rows] / KT["kt_peak_nm_a"] + noise,
        theta_mech_rad=count * np.floor(theta[rows] / count),
    )
    return pipeline.Recordings({"m": Campaign("m", (log,))})


def test_creep_of_a_shaft_that_sticks_is_nothing_that_a_model_lacks() -> None:
    (found,) = pipeline.diagnose(gentle(1), constants=KT).motors.values()
    assert found.verdict == "insufficient"
    assert not found.missing
    assert found.ladder[-1].held_out < 1.2


def test_a_rest_is_neither_a_slow_turn_nor_a_pass_through_zero() -> None:
    """Speeds in rad/s at 200 Hz; slower than 0.15 counts, for two rows and twice a pass."""
    braking = np.linspace(2.0, 0.0, 20, endpoint=False)
    still = np.array([0.08, -0.02, 0.0, 0.05, 0.0, -0.06, 0.03, 0.0])
    stuck = np.concatenate([braking, still, -braking[::-1]])
    passing = np.linspace(2.0, -2.0, 41)
    turning = np.full(400, 0.1)
    rests = [
        _rests(speed, 0.15, 2, 0.1 * 200.0, 2.0).nonzero()[0] for speed in (stuck, passing, turning)
    ]
    assert {*range(20, 28)} <= {*rests[0].tolist()} <= {*range(18, 30)}
    assert rests[1].size == rests[2].size == 0


def test_a_shaft_that_comes_to_rest_slowly_may_leave_at_once() -> None:
    """The rest counted as a pass of the slow side both ways, and its friction as that of motion:
    sound drives had presliding, or cogging, beside a log of a short circuit.
    """
    coming, leaving = np.linspace(0.6, 0.0, 30, endpoint=False), np.linspace(0.0, 3.0, 13)
    rests = _rests(np.concatenate([coming, np.zeros(12), leaving]), 0.15, 2, 20.0, 2.0)
    assert {*range(30, 42)} <= {*rests.nonzero()[0].tolist()}
    for turned in (leaving, -leaving):
        assert not _rests(np.concatenate([coming, turned]), 0.15, 2, 20.0, 2.0).any()
