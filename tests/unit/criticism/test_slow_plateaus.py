"""A motor held at one speed after another in slow rows: what drove it between two is in none."""

from __future__ import annotations

import numpy as np
import pytest

import pipeline
from pipeline.records.capture import Campaign
from tests.unit.estimation.signals import capture

J_KGM2, DRY_NM, VISCOUS = 2e-4, 0.045, 2.2e-4
KT = {"kt_peak_nm_a": 0.435, "u_kt_peak_nm_a": 0.002}


def telemetry(rate_hz: float, loop_s: float, limit_nm: float) -> pipeline.Recordings:
    """A no-load run of 16 speeds, 3 s each, by a speed loop with a limit; snapshots of both."""
    rng, step = np.random.default_rng(3), 1e-3
    speeds = rng.permutation(np.concatenate([sense * np.linspace(20, 90, 8) for sense in (-1, 1)]))
    wanted = np.repeat(speeds, 3000)
    speed, torque = np.zeros((2, wanted.size))
    for n in range(1, wanted.size):
        friction = DRY_NM * np.tanh(speed[n - 1]) + VISCOUS * speed[n - 1]
        own = J_KGM2 / loop_s * (wanted[n] - speed[n - 1]) + friction
        torque[n - 1] = np.clip(own, -limit_nm, limit_nm)
        speed[n] = speed[n - 1] + step / J_KGM2 * (torque[n - 1] - friction)
    rows = slice(rng.integers(0, 50), -1, round(1.0 / (step * rate_hz)))
    time = step * np.arange(wanted.size)[rows]
    current = torque[rows] / KT["kt_peak_nm_a"] + rng.normal(0.0, 2e-3, time.size)
    shaft = speed[rows] + rng.normal(0.0, 0.02, time.size)
    log = capture("drive", "log", t_s=time - time[0], iq_a=current, omega_mech_rad_s=shaft)
    return pipeline.Recordings({"m": Campaign("m", (log,))})


@pytest.mark.parametrize(
    ("rate_hz", "loop_s", "limit_nm"), [(10.0, 0.03, 0.5), (20.0, 0.1, 0.5), (50.0, 0.03, 0.2)]
)
def test_a_sound_no_load_run_is_quiet(rate_hz: float, loop_s: float, limit_nm: float) -> None:
    """A window across a change of the speed was unknown, or needed longer levels than there are;
    one that began just behind it named current_delay.
    """
    (found,) = pipeline.diagnose(telemetry(rate_hz, loop_s, limit_nm), constants=KT).motors.values()
    assert found.verdict == "insufficient"
    assert found.missing == ()
    assert found.ladder[0].held_out < 1.5
