"""A dynamometer's log of minutes, with a speed, a torque and no angle."""

from __future__ import annotations

import numpy as np
import polars as pl

from pipeline.criticism.diagnosis import diagnose
from pipeline.records.capture import Campaign, Capture, CaptureMeta
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants

R_OHM, LD_H, LQ_H, PSI_WB, PAIRS = 0.4, 2.1e-3, 4.3e-3, 0.05, 4


def log(windage: float = 0.0) -> Campaign:
    """Two rows a second of set points that are held for 20 s and reached within 2 s."""
    rng = np.random.default_rng(5)
    rows = np.arange(2400)
    at = 40.0 * np.arange(61)

    def course(low, high):
        points = np.repeat(rng.uniform(low, high, at.size), 2)
        return np.interp(rows, np.sort(np.concatenate([at, at + 4.0])), np.roll(points, -1))

    w, i_q, i_d = course(20.0, 250.0), course(-9.0, 9.0), course(-5.0, 0.0)
    psi_d, psi_q = PSI_WB + LD_H * i_d, LQ_H * i_q
    torque = 1.5 * PAIRS * (psi_d * i_q - psi_q * i_d) - 0.08 - 4e-4 * w - windage * w**2
    noise = rng.normal(size=(5, rows.size))
    columns = {
        "t_s": 0.5 * rows,
        "omega_mech_rad_s": np.round(w, 2),
        "id_a": i_d + 3e-3 * noise[0],
        "iq_a": i_q + 3e-3 * noise[1],
        "vd_v": R_OHM * i_d - PAIRS * w * psi_q + 1e-2 * noise[2],
        "vq_v": R_OHM * i_q + PAIRS * w * psi_d + 1e-2 * noise[3],
        "torque_shaft_nm": torque + 2e-3 * noise[4],
        "temp_winding_degc": np.full(rows.size, 25.0),
        "temp_magnet_degc": np.full(rows.size, 25.0),
    }
    meta = CaptureMeta("m", "drive", pole_pairs=PAIRS, voltage_kind="measured")
    return Campaign("m", (Capture("a.csv", "0", "verified", meta, (pl.DataFrame(columns),)),))


def test_a_drag_shows_in_the_torque_of_held_speeds():
    """No torque was looked at, and windage of 6 % of it was silent."""
    found = diagnose(log(windage=6e-6), ModelSpec("standard", ()), Constants())
    assert found.missing == ("windage",)
    assert found.ladder[-1].held_out < 1.2


def test_a_sound_log_is_quiet():
    found = diagnose(log(), ModelSpec("standard", ()), Constants())
    assert found.missing == () and found.verdict != "unknown"
