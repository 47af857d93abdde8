"""Free shafts whose current has waves that the rows of a slow log take at one phase."""

from __future__ import annotations

import numpy as np
import polars as pl
import pytest

from pipeline.criticism.comparison import compare
from pipeline.criticism.data.machine_scale import machine_of
from pipeline.criticism.equations import motion
from pipeline.records.capture import Campaign, Capture, CaptureMeta
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants

ROW_S, FINER, ROWS = 1e-3, 20, 30_000
PAIRS, PSI_WB, J_KGM2, DRY_NM = 14, 8e-3, 1.2e-4, 0.02
KT = 1.5 * PAIRS * PSI_WB
WAVE_A, NOISE_A, STEP_RAD = 0.15, 0.01, 2.0 * np.pi / 16384
"""The wave of six a turn, by whose multiple of the rows' frequency the speed passes: 75 rad/s."""


def log(wave_a: float, seed: int = 1) -> Campaign:
    """Half a minute in which levels of current turn a shaft either way, at up to 90 rad/s."""
    random, step = np.random.default_rng(seed), ROW_S / FINER
    signs, sizes = np.array([1.0, -1.0, -1.0, 1.0]), random.uniform(0.2, 0.5, ROWS // 250)
    omega = theta = current = 0.0
    rows = np.empty((ROWS, 3))
    for row in range(ROWS):
        level = signs[row // 250 % 4] * sizes[row // 250]
        for part in range(FINER):
            current += step / 3e-3 * (level - current)
            total = current + wave_a * np.cos(6.0 * PAIRS * theta + 0.4)
            if part == 0:
                rows[row] = row * ROW_S, total, theta
            omega += step / J_KGM2 * (KT * total - DRY_NM * np.tanh(omega / 0.05))
            theta += step * omega
    t_s, i_q, angle = rows.T
    table = pl.DataFrame(
        {
            "t_s": t_s,
            "id_a": NOISE_A * random.standard_normal(ROWS),
            "iq_a": i_q + NOISE_A * random.standard_normal(ROWS),
            "theta_mech_rad": STEP_RAD * np.floor(angle / STEP_RAD),
        }
    )
    meta = CaptureMeta("m", "drive", pole_pairs=PAIRS, pwm_hz=16000.0)
    known = {"psi_pm_wb": PSI_WB, "u_psi_pm_wb": 1e-3 * PSI_WB}
    return Campaign("m", (Capture("log.csv", "1", "verified", meta, (table,)),), known)


@pytest.fixture(scope="module")
def waved() -> Campaign:
    return log(WAVE_A)


def test_what_rows_miss_of_a_wave_is_no_torque(waved: Campaign) -> None:
    found = compare(waved, ModelSpec(), Constants({}))
    (error,) = found.errors
    assert error.rmse < 1.1 * error.noise_floor
    dry, inertia = found.parameters["coulomb_friction.torque_nm"], found.parameters["j_kgm2"]
    assert dry.value == pytest.approx(DRY_NM, rel=0.02)
    assert dry.u is not None and dry.u < 0.05 * DRY_NM
    assert inertia.value == pytest.approx(J_KGM2, rel=0.01)


def test_windows_of_a_thinned_log_have_the_rows_that_show_waves(waved: Campaign) -> None:
    machine = machine_of(waved, Constants())
    segment = motion.cut(waved.captures[0], machine)
    assert segment is not None and segment.size < ROWS
    breaks = np.flatnonzero(np.diff(segment.recorded["t_s"]) > 1.5 * ROW_S) + 1
    runs = np.diff([0, *breaks.tolist(), segment.size])
    assert runs.min() >= machine.policy.ripple.rows
