"""Pole pairs of logs in which an electrical angle, or a voltage, turns with the shaft."""

from __future__ import annotations

import numpy as np
import polars as pl
import pytest

from pipeline.crosscheck.rules.pole_pairs_nameplate import RULE
from pipeline.estimation.registry import fit_all
from pipeline.records.capture import Campaign, Capture, CaptureMeta
from pipeline.records.estimate import Estimate

N, PERIOD_S, PAIRS = 8000, 1e-3, 5
T_S = PERIOD_S * np.arange(N)
OMEGA = 40.0 * np.sin(0.9 * T_S) + 12.0
THETA = np.cumsum(OMEGA) * PERIOD_S
THIRD = 2.0 * np.pi / 3.0


def back_emf(pairs: float, theta: np.ndarray = THETA) -> dict[str, np.ndarray]:
    """Phase voltages of a magnet, with a current's that turns along."""
    rng = np.random.default_rng(1)
    axis = pairs * theta + 0.4
    vector = (1j * 0.05 * OMEGA + 0.3 - 0.2j) * np.exp(1j * axis)
    return {
        f"v{letter}_v": np.real(vector * np.exp(-1j * k * THIRD)) + rng.normal(0.0, 0.05, N)
        for k, letter in enumerate("abc")
    }


def counted(noise_rad: float = 1e-3, rows: int = N, **columns: np.ndarray) -> Estimate:
    """What a drive with these columns counts; the shaft's angle has noise of its own."""
    rng = np.random.default_rng(2)
    theta = THETA + rng.normal(0.0, noise_rad, N) if noise_rad else THETA
    columns = {"t_s": T_S, "theta_mech_rad": theta, "iq_a": np.sin(T_S), **columns}
    table = pl.DataFrame(columns).head(rows)
    capture = Capture("log.csv", "0" * 64, "verified", CaptureMeta("m", "drive"), (table,))
    known, _, _ = fit_all(Campaign("m", (capture,)), {}, only=frozenset({"pole_pairs"}))
    return next(e for e in known.all_of("pole_pairs") if e.method == "electrical_turns")


def test_two_angles_and_the_voltage_count_the_same() -> None:
    found = counted(theta_elec_rad=PAIRS * THETA + 0.7, **back_emf(PAIRS))
    assert (found.status, found.number) == ("measured", PAIRS)
    assert "so does the voltage" in found.note


def test_the_voltage_counts_alone() -> None:
    found = counted(**back_emf(PAIRS))
    assert (found.status, found.number) == ("measured", PAIRS)


def test_voltages_of_the_rotor_s_frame_are_turned_back() -> None:
    found = counted(theta_elec_rad=PAIRS * THETA, vd_v=0.3 + 0.0 * OMEGA, vq_v=0.05 * OMEGA)
    assert "so does the voltage" in found.note


def test_angles_without_a_voltage_may_be_the_drive_s_setting() -> None:
    """Of a computed angle the slope is what the drive was set to, and the note says so."""
    found = counted(theta_elec_rad=PAIRS * THETA)
    assert (found.status, found.number) == ("measured", PAIRS)
    assert "set to" in found.note
    assert "one reading" not in found.note
    assert "one reading" in counted(0.0, theta_elec_rad=PAIRS * THETA).note


def test_a_drive_set_to_another_number_than_the_motor_s_is_named() -> None:
    found = counted(theta_elec_rad=(PAIRS + 1) * THETA, **back_emf(PAIRS))
    assert found.status == "not_identifiable"
    assert f"the voltage {PAIRS} times" in found.note


@pytest.mark.parametrize("slope", [PAIRS + 0.3, PAIRS / 9.0, -PAIRS])
def test_a_slope_that_is_no_count_is_none(slope: float) -> None:
    """A gear, a coupling that slips, an angle of the wrong sign."""
    found = counted(theta_elec_rad=slope * THETA)
    assert found.status == "not_identifiable"
    assert "no whole number above 0" in found.note


def test_noise_over_few_turns_is_too_rough_a_count() -> None:
    rng = np.random.default_rng(4)
    noisy = PAIRS * THETA + np.cumsum(rng.normal(0.0, 0.05, N))
    found = counted(rows=1000, theta_elec_rad=noisy)
    assert found.status == "not_identifiable"
    assert "too rough a count" in found.note


def test_a_voltage_that_turns_against_the_shaft_is_named() -> None:
    found = counted(**back_emf(-PAIRS))
    assert "exchange two phases" in found.note


def test_a_contradiction_is_named_where_the_nameplate_is_judged() -> None:
    columns = {"t_s": T_S, "theta_mech_rad": THETA, "theta_elec_rad": 4.3 * THETA, "iq_a": OMEGA}
    meta = CaptureMeta("m", "drive", pole_pairs=PAIRS)
    capture = Capture("log.csv", "0" * 64, "verified", meta, (pl.DataFrame(columns),))
    campaign = Campaign("m", (capture,))
    known, _, _ = fit_all(campaign, {}, only=frozenset({"pole_pairs"}))
    judged = RULE.check(known, campaign, {})
    assert judged.status == "not_evaluated"
    assert "theta_elec_rad turns 4.3000" in judged.meaning
