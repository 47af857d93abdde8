"""A coast of which a speed is recorded and no angle."""

from __future__ import annotations

import numpy as np
import polars as pl
import pytest
from numpy.typing import NDArray

from pipeline.criticism.comparison import compare
from pipeline.criticism.data.shaft_angle import held_speed
from pipeline.criticism.equations.dq import cut
from pipeline.criticism.equations.free_shaft import cut as cut_coast
from pipeline.criticism.library.registry import effects
from pipeline.criticism.machine.model import Model
from pipeline.criticism.operating import Array
from pipeline.criticism.policy.policy import DEFAULT
from pipeline.criticism.regression.noise_floors import window_gain
from pipeline.criticism.regression.noise_propagation import noise_floor
from pipeline.criticism.residuals.residual import residual
from pipeline.records.capture import Campaign, Capture, CaptureMeta
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants
from tests.unit.criticism.machines import BASE, machine

DRY_RAD_S2, VISCOUS_1_S = 70.0, 0.25
CURRENT_A = 10.0


def coast(
    seed: int, noise_rad_s: float, begins_rad_s: float, until: float = 0.98, step_rad_s: float = 0.0
) -> Capture:
    """The speed of a shaft with dry and viscous friction alone, once a millisecond, until a share
    of the time at which it stops; in steps where one is given.
    """
    dry = DRY_RAD_S2 / VISCOUS_1_S
    ends_s = np.log1p(begins_rad_s / dry) / VISCOUS_1_S
    t_s = np.arange(0.0, until * ends_s, 1e-3)
    speed = (begins_rad_s + dry) * np.exp(-VISCOUS_1_S * t_s) - dry
    noise = noise_rad_s * np.random.default_rng(seed).standard_normal(t_s.size)
    recorded = speed + noise
    if step_rad_s:
        recorded = np.round(recorded / step_rad_s) * step_rad_s
    table = pl.DataFrame({"t_s": t_s, "omega_mech_rad_s": recorded})
    meta = CaptureMeta("m", "spin_down", pole_pairs=2)
    return Capture(f"coast_{seed}.csv", f"{seed}", "verified", meta, (table,))


@pytest.mark.parametrize("noise_rad_s", [pytest.param(0.02, marks=pytest.mark.slow), 0.2])
def test_a_speed_s_noise_is_the_floor_of_the_acceleration(noise_rad_s: float) -> None:
    """White noise of a speed walks in its integral; it was taken as white in the angle."""
    coasts = tuple(coast(seed, noise_rad_s, 450.0) for seed in (1, 2, 3))
    found = compare(Campaign("m", coasts), ModelSpec(), Constants({}))
    errors = [e for e in found.errors if e.signal == "alpha_mech_rad_s2"]
    assert len(errors) >= 3
    for error in errors:
        assert 0.8 < error.rmse / error.noise_floor < 1.25


NO_NOISE = pytest.mark.xfail(
    strict=True, reason="without noise the pace of small steps is spread by too little: 1.35 floors"
)


@pytest.mark.parametrize(
    ("step_rad_s", "noise_steps"),
    [
        pytest.param(0.1, 0.0, marks=[pytest.mark.slow, NO_NOISE]),
        pytest.param(0.1, 0.2, marks=pytest.mark.slow),
        pytest.param(1.0, 0.0, marks=pytest.mark.slow),
        (1.0, 0.2),
    ],
)
def test_a_rounded_speed_is_the_floor_of_the_acceleration(
    step_rad_s: float, noise_steps: float
) -> None:
    """Its integral is in steps as well, and was taken for a rounded angle: a floor of a tenth.

    It may be up to twice what is there: to a step a window, a pace is taken as unknown.
    """
    noise_rad_s = noise_steps * step_rad_s
    coasts = tuple(
        coast(seed, noise_rad_s, begins, step_rad_s=step_rad_s)
        for seed, begins in ((1, 450.0), (2, 310.0), (3, 150.0))
    )
    found = compare(Campaign("m", coasts), ModelSpec(), Constants({}))
    errors = [e for e in found.errors if e.signal == "alpha_mech_rad_s2"]
    assert len(errors) >= 3
    for error in errors:
        assert 0.5 < error.rmse / error.noise_floor < 1.3


def slow_map(recorded: str) -> Capture:
    """Three seconds at a hundredth of a turn each, with noise in every column."""
    random, t_s = np.random.default_rng(4), np.arange(0.0, 3.0, 1e-3)
    columns = dict.fromkeys(("vd_v", "id_a"), np.zeros(t_s.size))
    columns |= dict.fromkeys(("vq_v", "iq_a"), np.full(t_s.size, CURRENT_A))
    noisy = {name: one + random.normal(0.0, 1e-3, t_s.size) for name, one in columns.items()}
    motion = {"theta_mech_rad": 0.1 * t_s, "omega_mech_rad_s": np.full(t_s.size, 0.1)}
    moved = motion[recorded] + random.normal(0.0, 1e-5, t_s.size)
    meta = CaptureMeta("m", "torque_map", pole_pairs=7)
    table = pl.DataFrame({"t_s": t_s, **noisy, recorded: moved})
    return Capture("map.csv", "1", "verified", meta, (table,))


def test_what_goes_with_the_angle_is_noise_where_no_angle_is_recorded() -> None:
    """A slow log of voltages holds a wave of two a turn, whose phase nothing tells."""
    floors = {}
    for recorded in ("theta_mech_rad", "omega_mech_rad_s"):
        segment = cut(slow_map(recorded), machine())
        assert segment is not None
        model = Model(machine(), (effects(None)["phase_imbalance"],))
        uneven = BASE | {"phase_imbalance.cosine": 0.03, "phase_imbalance.sine": 0.0}
        even = uneven | {"phase_imbalance.cosine": 0.0}
        floors[recorded] = [
            float(noise_floor(segment, model, values, 1)[0]) / window_gain(segment)
            for values in (even, uneven)
        ]
    assert floors["theta_mech_rad"][1] == pytest.approx(floors["theta_mech_rad"][0], rel=0.2)
    # the difference of a wave of 0.03 R i and the same wave somewhere else: its amplitude, as rms
    wave_v = 0.03 * BASE["r_ohm"] * CURRENT_A
    assert floors["omega_mech_rad_s"][1] == pytest.approx(wave_v, rel=0.35)
    assert floors["omega_mech_rad_s"][0] < 0.1 * wave_v


def test_what_a_filter_makes_of_a_shaft_that_has_stopped_is_no_coast() -> None:
    """A filtered speed fades and is never zero, so its sign is that of a shaft that turns."""
    moving = coast(1, 0.02, 200.0, until=1.0)
    speed = moving.tables[0]["omega_mech_rad_s"].to_numpy()
    fading = speed[-1] * np.exp(-np.arange(40) / 2.0)
    record = np.concatenate([speed, fading])
    table = pl.DataFrame({"t_s": 1e-3 * np.arange(record.size), "omega_mech_rad_s": record})
    stopped = Capture("coast.csv", "1", "verified", moving.meta, (table,))
    segment = cut_coast(stopped, machine())
    assert segment is not None and segment.weak is not None
    recorded = np.gradient(segment.recorded["theta_mech_rad"], segment.ts_s)
    slowest = recorded[segment.weak.starts + segment.weak.length - 1].min()
    assert 0.1 < slowest < 6.0


def held_map(test: str, sag_rad_s: float = 0.0) -> Capture:
    """Three seconds at 20 and three at 40 rad/s, half a second between, a speed and no angle."""
    random, t_s = np.random.default_rng(4), np.arange(0.0, 6.5, 1e-3)
    speed = np.interp(t_s, [3.0, 3.5], [20.0, 40.0]) + sag_rad_s * np.sin(40.0 * t_s)
    columns = dict.fromkeys(("vd_v", "id_a"), np.zeros(t_s.size))
    columns |= {"vq_v": 7.0 * BASE["psi_wb"] * speed, "iq_a": np.zeros(t_s.size)}
    columns |= {"torque_shaft_nm": -BASE["b_nm_s_rad"] * speed, "omega_mech_rad_s": speed}
    sizes = {"omega_mech_rad_s": 0.1, "torque_shaft_nm": 1e-5}
    noisy = {
        n: one + random.normal(0.0, sizes.get(n, 1e-3), t_s.size) for n, one in columns.items()
    }
    table = pl.DataFrame({"t_s": t_s, **noisy})
    return Capture("map.csv", "1", "verified", CaptureMeta("m", test, pole_pairs=7), (table,))


@pytest.mark.parametrize("test", ["torque_map", "drive"])
def test_a_torque_beside_a_speed_that_is_held_counts_without_inertia(test: str) -> None:
    """Where the speed changes is left out; the noise of a speed times J would be a torque."""
    segment = cut(held_map(test), machine())
    assert segment is not None and segment.weak is not None
    assert "torque_shaft_nm" in segment.channels
    middle = segment.recorded["t_s"][segment.weak.starts + segment.weak.length // 2]
    assert middle.min() < 3.0
    assert middle.max() > 3.5
    assert not np.any((middle > 3.02) & (middle < 3.48))
    torque = segment.channels.index("torque_shaft_nm")
    model = Model(machine(), ())
    missed = [
        residual(segment, model, BASE | {"j_kgm2": inertia})[torque]
        for inertia in (0.0, 10.0 * BASE["j_kgm2"])
    ]
    assert np.array_equal(*missed)


@pytest.mark.parametrize("test", ["torque_map", "drive"])
def test_a_torque_beside_a_speed_that_moves_needs_the_angle(test: str) -> None:
    segment = cut(held_map(test, 2.0), machine())
    assert segment is not None and segment.weak is not None
    assert "torque_shaft_nm" not in segment.channels
    assert segment.weak.starts.size


def _speeds(moving: Array) -> NDArray[np.bool_]:
    """Where a speed of 100 rad/s, a part of it `moving`, is held: 1 kHz, noise of 0.1 rad/s."""
    noise = 0.1 * np.random.default_rng(1).standard_normal(moving.size)
    theta = 1e-3 * np.cumsum(100.0 + moving + noise)
    return held_speed(theta, 1e-4, 50, DEFAULT.cutting)


def test_a_speed_is_held_where_neither_its_means_nor_its_samples_move():
    """A ramp moves the means; a swing of a window's length moves the samples alone."""
    t_s = 1e-3 * np.arange(1000)
    assert _speeds(0.0 * t_s)[100:-100].mean() > 0.95
    assert not _speeds(5.0 * t_s)[100:-100].any()
    assert not _speeds(2.0 * np.sin(2.0 * np.pi * t_s / 0.051))[100:-100].any()
    assert not _speeds(0.0 * t_s[:120]).any()
