"""Noise floors of open-circuit spins: an encoder's beat with the sampling, a phase of voltages."""

from __future__ import annotations

import numpy as np
import polars as pl
import pytest

import pipeline
from pipeline.criticism.data.rounding import smoothed
from pipeline.criticism.policy.policy import DEFAULT
from pipeline.records.capture import Campaign, Capture, CaptureMeta

POLE_PAIRS, PSI_WB = 15, 0.0205
PERIOD_S = 3.0 / 16_000.0


def spin(
    *,
    encoder: bool,
    seed: int = 1,
    speeds: tuple[float, ...] = (8.0, 20.0, 32.0),
    noise_v: float = 0.035,
    counts: int = 4000,
    pairs: int = POLE_PAIRS,
) -> Capture:
    """Line voltages of a hub motor at speeds [rad/s], beside counts of an encoder or a speed."""
    rng, rows = np.random.default_rng(seed), round(0.8 / PERIOD_S)
    levels = np.repeat(np.array(speeds), rows)
    ramp = np.ones(800) / 800
    omega = np.convolve(np.pad(levels, 400, mode="edge"), ramp, "valid")[: levels.size]
    theta = np.cumsum(omega) * PERIOD_S
    emf = pairs * PSI_WB * omega * 1j * np.exp(1j * pairs * theta)
    a, b, c = (np.real(emf * np.exp(-2j * np.pi * k / 3)) for k in range(3))
    step = 2.0 * np.pi / counts
    noise = rng.normal(0.0, noise_v, (2, theta.size))
    columns = {
        "t_s": PERIOD_S * np.arange(theta.size),
        "vab_v": a - b + noise[0],
        "vbc_v": b - c + noise[1],
        "temp_magnet_degc": np.full(theta.size, 25.0),
    }
    if encoder:
        columns["theta_mech_rad"] = step * (np.floor(theta / step) + 0.5)
    else:
        columns["omega_mech_rad_s"] = omega * (1.0 + rng.normal(0.0, 2e-4, theta.size))
    meta = CaptureMeta("m", "open_circuit", pole_pairs=pairs, voltage_kind="measured")
    return Capture("spin.csv", "0", "verified", meta, (pl.DataFrame(columns),))


@pytest.mark.parametrize("encoder", [True, False])
def test_a_sound_spin_is_at_its_floor(encoder):
    campaign = Campaign("m", (spin(encoder=encoder),))
    diagnosis = pipeline.diagnose(pipeline.Recordings({"m": campaign}))["m"]
    assert (diagnosis.verdict, diagnosis.missing) == ("insufficient", ())
    assert 0.7 < diagnosis.ladder[-1].held_out < 1.2


@pytest.mark.parametrize("seed", [1, 2])
def test_a_harmonic_of_the_counts_that_meets_an_order_in_every_window_is_in_the_floor(seed):
    """At -22 and 38.5 rad/s it was left out, and a sound spin was `unknown` at the sixth wave."""
    speeds = (38.5, -22.0, -37.9)
    one = spin(encoder=True, seed=seed, speeds=speeds, noise_v=0.007, counts=4096, pairs=8)
    campaign = Campaign("m", (one,))
    diagnosis = pipeline.diagnose(pipeline.Recordings({"m": campaign}))["m"]
    assert (diagnosis.verdict, diagnosis.missing) == ("insufficient", ())
    assert 0.7 < diagnosis.ladder[-1].held_out < 1.15


@pytest.mark.parametrize("pace", [0.02, 0.3, 0.953, 1.045, 2.97])
@pytest.mark.parametrize("rows", [155, 700])
def test_a_rounded_ramp_is_smoothed_to_the_ramp(pace, rows):
    """Its error goes up and down as the steps beat with the samples: 51 samples may leave more of
    it than a rounding does, and all of them less.
    """
    ramp = pace * np.arange(rows) + 0.3
    error = smoothed(np.round(ramp), 1.0, DEFAULT.sensor_noise) - ramp
    assert error.std() < 0.16
