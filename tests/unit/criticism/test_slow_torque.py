"""A torque that is new in every twentieth row of a log, beside a current of up to 60 Hz."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from pipeline.contracts.clocks import held_apart
from pipeline.criticism.comparison import compare
from pipeline.criticism.diagnosis import diagnose
from pipeline.numerics.integrals import trapezoid
from pipeline.records.capture import Campaign, Capture, CaptureMeta
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants

R_OHM, LD_H, LQ_H, PSI_WB, PAIRS = 0.4, 2.1e-3, 4.3e-3, 0.05, 4
J_KGM2, FAR_KGM2, PERIOD_S, ROWS = 2e-4, 1e-3, 5e-4, 20


def log(seed: int, windage: float = 0.0) -> Campaign:
    """Two machines back to back, whose transducer is read 100 times a second."""
    rng = np.random.default_rng(seed)
    t_s = np.arange(0.0, 6.0, PERIOD_S)
    rates = 2.0 * np.pi * np.geomspace(0.5, 60.0, 20)

    def wave(size, phases):
        angle = np.outer(t_s, rates) + phases
        return size * np.sin(angle).sum(axis=1), size * (rates * np.cos(angle)).sum(axis=1)

    i_q, slope_q = wave(0.9, rng.uniform(0.0, 6.28, rates.size))
    i_d, slope_d = wave(0.3, rng.uniform(0.0, 6.28, rates.size))
    psi_d, psi_q = PSI_WB + LD_H * i_d, LQ_H * i_q
    air_gap = 1.5 * PAIRS * (psi_d * i_q - psi_q * i_d)
    slow = 300.0 + 60.0 * np.sin(2.5 * t_s)
    gain = np.gradient(slow, t_s) + air_gap / (J_KGM2 + FAR_KGM2)
    w = slow[0] + trapezoid(t_s, gain)
    load = air_gap - 0.08 - 4e-4 * w - windage * w * np.abs(w) - J_KGM2 * gain
    noise = rng.normal(size=(5, t_s.size))
    load = (load + 2e-3 * noise[4])[np.arange(t_s.size) // ROWS * ROWS]
    step = 2.0 * np.pi / 65536
    columns = {
        "t_s": t_s,
        "theta_mech_rad": np.round(trapezoid(t_s, w) / step) * step,
        "id_a": i_d + 3e-3 * noise[0],
        "iq_a": i_q + 3e-3 * noise[1],
        "vd_v": R_OHM * i_d + LD_H * slope_d - PAIRS * w * psi_q + 1e-2 * noise[2],
        "vq_v": R_OHM * i_q + LQ_H * slope_q + PAIRS * w * psi_d + 1e-2 * noise[3],
        "torque_shaft_nm": load,
        "temp_winding_degc": np.full(t_s.size, 25.0),
        "temp_magnet_degc": np.full(t_s.size, 25.0),
    }
    meta = CaptureMeta("m", "drive", pole_pairs=PAIRS, voltage_kind="measured")
    capture = Capture(f"{seed}.csv", "0", "verified", meta, (pl.DataFrame(columns),))
    return Campaign("m", (held_apart(capture)[0],))


def run(campaign: Campaign):
    return diagnose(campaign, ModelSpec("standard", ()), Constants())


@pytest.mark.parametrize("seed", [1, 2])
def test_what_a_load_does_between_its_samples_has_no_name(seed: int) -> None:
    """On straight lines between them it lags behind the current: that was a coupling."""
    found = run(log(seed))
    assert found.missing == ()
    assert found.verdict != "unknown"


def test_a_drag_shows_in_such_a_torque() -> None:
    found = run(log(3, windage=8e-6))
    assert found.missing == ("windage",)


def of_slow_currents(seed: int, windage: float = 0.0) -> Campaign:
    """A free shaft whose angle and voltages are new in every row of 0.5 ms, and whose currents, of
    up to 40 Hz, come by a bus of 200 Hz.
    """
    rng = np.random.default_rng(seed)
    t_s = np.arange(0.0, 8.0, PERIOD_S)
    rates = 2.0 * np.pi * np.geomspace(0.4, 40.0, 16)
    angle = np.outer(t_s, rates) + rng.uniform(0.0, 6.28, rates.size)
    torque = 0.3 * np.sin(angle).sum(axis=1)
    w = np.zeros(t_s.size)
    for k in range(t_s.size - 1):
        dry = 0.08 * np.tanh(w[k] / 0.3) + 4e-4 * w[k] + windage * w[k] * abs(w[k])
        w[k + 1] = w[k] + PERIOD_S * (torque[k] - dry) / J_KGM2 / 4.0
    i_q = torque / (1.5 * PAIRS * PSI_WB)
    noise = rng.normal(size=(4, t_s.size))
    held = np.arange(t_s.size) // 10 * 10
    step = 2.0 * np.pi / 65536
    columns = {
        "t_s": t_s,
        "theta_mech_rad": np.round(trapezoid(t_s, w) / step) * step,
        "id_a": (3e-3 * noise[0])[held],
        "iq_a": (i_q + 3e-3 * noise[1])[held],
        "vd_v": -PAIRS * w * LQ_H * i_q + 1e-2 * noise[2],
        "vq_v": R_OHM * i_q + LQ_H * np.gradient(i_q, t_s) + PAIRS * w * PSI_WB + 1e-2 * noise[3],
        "temp_winding_degc": np.full(t_s.size, 25.0),
        "temp_magnet_degc": np.full(t_s.size, 25.0),
    }
    meta = CaptureMeta("m", "drive", pole_pairs=PAIRS, voltage_kind="measured")
    capture = Capture(f"{seed}.csv", "0", "verified", meta, (pl.DataFrame(columns),))
    return Campaign("m", (held_apart(capture)[0],))


@pytest.mark.parametrize("seed", [1, 2])
def test_what_straight_lines_miss_of_a_slow_current_is_noise(seed: int) -> None:
    """The noise of a row was that of straight lines, which is none."""
    found = run(of_slow_currents(seed))
    assert found.missing == ()
    assert found.verdict != "unknown"


def test_a_log_too_slow_for_a_free_run_shows_what_its_equations_predict():
    """A comparison had no trace of it: neither a plot, nor a residual, nor a recording."""
    campaign = log(1)
    (quick,) = campaign.captures
    slow = replace(quick, tables=(quick.tables[0][:: 2 * ROWS],))
    of_slow = replace(campaign, captures=(slow,))
    found = compare(of_slow, ModelSpec("standard", ()), Constants()).traces
    assert {(one.signal, one.kind) for one in found} == {("vd_v", "equation"), ("vq_v", "equation")}
    for trace in found:
        measured, model = (np.ma.masked_invalid(one) for one in (trace.measured, trace.model))
        assert np.ma.std(measured - model) < 0.1 * np.ma.std(measured)
