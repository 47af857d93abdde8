"""Logs of the q axis whose current changes within a row: what samples of the voltage say of L_q."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import pipeline
from pipeline.records.comparison import ModelParameter

PAIRS, R_OHM, L_H, PSI_WB = 7, 0.11, 9e-5, 3.5e-3
J_KGM2, COULOMB_NM, FINE_S, ROW_S = 6e-4, 0.02, 5e-5, 1e-3


def log(bandwidth_hz: float, *, in_step: bool, both_axes: bool = False) -> str:
    """A current loop follows steps; rows of 1 ms hold the voltage of their instant."""
    rng = np.random.default_rng(5)
    count, wide = round(5.0 / FINE_S), 2.0 * np.pi * bandwidth_hz
    gaps = np.full(200, 0.05) if in_step else rng.uniform(0.025, 0.075, 200)
    levels = rng.uniform(-10.0, 10.0, 201)
    asked = levels[np.searchsorted(np.cumsum(gaps), FINE_S * np.arange(count), side="right")]
    ke, amps, omega, theta, lack = PAIRS * PSI_WB, 0.0, 0.0, 0.0, 0.0
    rows = np.zeros((5, count))
    for k in range(count):
        error = asked[k] - amps
        lack += R_OHM * wide * error * FINE_S
        volts = L_H * wide * error + lack + ke * omega
        rows[:, k] = amps, volts, theta, omega, k * FINE_S
        amps += FINE_S * (volts - R_OHM * amps - ke * omega) / L_H
        torque = 1.5 * ke * amps
        if omega or abs(torque) > COULOMB_NM:
            omega += FINE_S * (torque - COULOMB_NM * np.sign(omega or torque)) / J_KGM2
        theta += FINE_S * omega
    iq, vq, angle, speed, t = rows[:, :: round(ROW_S / FINE_S)]
    columns = {
        "t_s": t,
        "iq_a": iq + 0.01 * rng.standard_normal(t.size),
        "vq_v": vq + 2e-3 * rng.standard_normal(t.size),
        "theta_mech_rad": np.round(angle / (2 * np.pi) * 16384) / 16384 * 2 * np.pi,
    }
    if both_axes:
        columns["id_a"] = 0.01 * rng.standard_normal(t.size)
        columns["vd_v"] = -PAIRS * speed * L_H * iq + 2e-3 * rng.standard_normal(t.size)
    head = ["# contract: 1", "# motor_id: M", "# test: drive", f"# pole_pairs: {PAIRS}"]
    lines = [
        ",".join(f"{value:.7g}" for value in row) for row in zip(*columns.values(), strict=True)
    ]
    return "\n".join([*head, ",".join(columns), *lines, ""])


def inductance(folder: Path, text: str) -> ModelParameter:
    (folder / "drive.csv").write_text(text)
    found = pipeline.compare(pipeline.read(folder))["M"].parameters
    assert found["r_ohm"].value == pytest.approx(R_OHM, abs=2.0 * found["r_ohm"].u)
    return found["lq_h"]


@pytest.mark.parametrize(
    ("bandwidth_hz", "in_step"),
    [
        (30.0, False),
        pytest.param(100.0, False, marks=pytest.mark.slow),
        pytest.param(600.0, True, marks=pytest.mark.slow),
    ],
)
def test_q_inductance_holds_or_is_not_given(
    tmp_path: Path, bandwidth_hz: float, in_step: bool
) -> None:
    """The steps of the last one begin at a row, which shows four times their row's mean voltage."""
    one = inductance(tmp_path, log(bandwidth_hz, in_step=in_step))
    assert one.value is None or abs(one.value - L_H) < 2.0 * one.u
    assert (one.value is None) == (bandwidth_hz > 30.0)


def test_both_axes_show_it_at_steady_speed(tmp_path: Path) -> None:
    one = inductance(tmp_path, log(100.0, in_step=False, both_axes=True))
    assert abs(one.value - L_H) < 2.0 * one.u
    assert one.u < 0.05 * L_H
