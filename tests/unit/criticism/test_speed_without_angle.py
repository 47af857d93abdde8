"""A coast of which a speed is recorded and no angle."""

from __future__ import annotations

import numpy as np
import polars as pl
import pytest

from pipeline.criticism.comparison import compare
from pipeline.records.capture import Campaign, Capture, CaptureMeta
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants

DRY_RAD_S2, VISCOUS_1_S = 70.0, 0.25


def coast(seed: int, noise_rad_s: float, begins_rad_s: float) -> Capture:
    """The speed of a shaft with dry and viscous friction alone, once a millisecond."""
    dry = DRY_RAD_S2 / VISCOUS_1_S
    ends_s = np.log1p(begins_rad_s / dry) / VISCOUS_1_S
    t_s = np.arange(0.0, 0.98 * ends_s, 1e-3)
    speed = (begins_rad_s + dry) * np.exp(-VISCOUS_1_S * t_s) - dry
    noise = noise_rad_s * np.random.default_rng(seed).standard_normal(t_s.size)
    table = pl.DataFrame({"t_s": t_s, "omega_mech_rad_s": speed + noise})
    meta = CaptureMeta("m", "spin_down", pole_pairs=2)
    return Capture(f"coast_{seed}.csv", f"{seed}", "verified", meta, (table,))


@pytest.mark.parametrize("noise_rad_s", [0.02, 0.2])
def test_a_speed_s_noise_is_the_floor_of_the_acceleration(noise_rad_s: float) -> None:
    """White noise of a speed walks in its integral; it was taken as white in the angle."""
    coasts = tuple(coast(seed, noise_rad_s, 450.0) for seed in (1, 2, 3))
    found = compare(Campaign("m", coasts), ModelSpec(), Constants({}))
    errors = [e for e in found.errors if e.signal == "alpha_mech_rad_s2"]
    assert len(errors) >= 3
    for error in errors:
        assert 0.8 < error.rmse / error.noise_floor < 1.25
