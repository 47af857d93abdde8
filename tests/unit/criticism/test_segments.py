"""From captures to segments: windows that a short or a long recording leaves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from pipeline.criticism.data.machine_scale import machine_of
from pipeline.criticism.data.segment import Sensors, clock, projected, segment_of
from pipeline.criticism.machine.model import Model
from pipeline.criticism.regression.noise_floors import window_gain
from pipeline.criticism.residuals.residual import residual
from pipeline.criticism.residuals.segments import segments
from pipeline.criticism.validation.held_out import free_run
from pipeline.records.capture import Campaign, Capture, CaptureMeta
from pipeline.records.constants import Constants
from tests.unit.criticism.machines import BASE, machine


def slow_turn(turns):
    t = np.arange(int(8000 * turns)) * 1e-3
    theta = 2 * np.pi * t / 8.0
    torque = 0.01 * np.sin(84 * theta) + np.random.default_rng(2).normal(0, 1e-4, t.size)
    table = pl.DataFrame({"t_s": t, "theta_mech_rad": theta, "torque_shaft_nm": torque})
    return Capture("cog.mcap", "0", "verified", CaptureMeta("m", "cogging"), (table,))


@pytest.mark.parametrize("turns", [1.0, 1.1, 2.0, 2.5])
def test_a_slow_turn_has_a_window_a_turn_whatever_its_length(turns):
    """One whole turn once gave no window at all, and its cogging went unseen."""
    found = segments(Campaign("m", (slow_turn(turns),)), machine())
    assert len(found) == 1
    assert found[0].weak.starts.size >= 1
    weak = found[0].weak.project(found[0].recorded["torque_shaft_nm"][None])[0]
    own = weak[0, found[0].weak.orders == 84]
    gain = np.sqrt(found[0].weak.length) / 2
    assert np.hypot(*own) > 0.5 * 0.01 * gain * 0.7


def at_speed(test, omega, step, n=8000, eccentric=0.0):
    """A log whose angle an encoder rounded, and its file once more; dq signals that say nothing."""
    t = np.arange(n) * 5e-5
    turned = 0.3 + np.cumsum(np.broadcast_to(omega, n)) * 5e-5
    turned = turned + eccentric * np.sin(turned)
    random = np.random.default_rng(4)
    columns = {name: random.normal(0.0, 0.01, n) for name in ("id_a", "iq_a", "vd_v", "vq_v")}
    theta = np.round(np.round(turned / step) * step * 2**18) / 2**18
    torque = random.normal(0.0, 1e-3, n)
    table = pl.DataFrame({"t_s": t, **columns, "theta_mech_rad": theta, "torque_shaft_nm": torque})
    meta = CaptureMeta("m", test, pole_pairs=4)
    return Capture(f"{test}.mcap", "0", "verified", meta, (table,))


def test_the_angle_of_a_map_is_even_but_for_the_step_that_the_drive_s_encoder_shows():
    """46.94 steps a sample: by its own differences the angle looks finer than its encoder is, and
    the rest of its rounding, times J, was taken for torque.
    """
    step = 2.0 * np.pi / 2**17
    drive = at_speed("drive", np.linspace(-40.0, 60.0, 8000), step)
    held = at_speed("torque_map", 45.0, step, eccentric=0.0005)
    campaign = Campaign("m", (drive, held))
    own = machine_of(campaign, Constants())
    assert own.encoder_rad == pytest.approx(step, rel=1e-6)
    known, blind = (
        next(s for s in segments(campaign, one) if s.test == "torque_map")
        for one in (own, replace(own, encoder_rad=0.0))
    )
    bends = [np.diff(s.recorded["theta_mech_rad"], 2)[:300].std() for s in (known, blind)]
    assert bends[0] < 0.02 * step < bends[1]


@pytest.mark.parametrize("counts", [2**12, 4000])
def test_an_angle_that_turns_by_whole_steps_a_sample_is_as_coarse_as_the_drive_s(counts):
    """13 steps a sample exactly: no difference shows the step, and all rounding is periodic."""
    step = 2.0 * np.pi / counts
    drive = at_speed("drive", np.linspace(-40.0, 60.0, 8000), step)
    even = at_speed("heat_run", 13.0 * step / 5e-5, step)
    fine = at_speed("heat_run", 13.3 * step / 5e-5, step / 2**9)
    for other, told in ((even, step), (fine, 0.0)):
        campaign = Campaign("m", (drive, other))
        found = segments(campaign, machine_of(campaign, Constants()))
        log = next(s for s in found if s.test == "heat_run")
        assert log.sensors.angle_step_rad == pytest.approx(told, rel=1e-6, abs=0.1 * step)


def test_logs_that_disagree_on_the_encoder_tell_of_none():
    ramp = np.linspace(-40.0, 60.0, 8000)
    logs = tuple(at_speed("drive", ramp, 2.0 * np.pi / 2**bits) for bits in (15, 17))
    assert machine_of(Campaign("m", logs), Constants()).encoder_rad == 0.0


def test_a_capture_that_lacks_its_equations_signals_is_left_out():
    table = pl.DataFrame({"t_s": [0.0, 1.0, 2.0], "id_a": [0.0, 1.0, 2.0]})
    capture = Capture("x.csv", "0", "verified", CaptureMeta("m", "torque_map"), (table,))
    assert segments(Campaign("m", (capture,)), machine()) == ()


def test_harmonics_of_a_high_cogging_order_are_found_too():
    """24 slots and 11 pole pairs make order 264; its second harmonic was past the search's end."""
    t = np.arange(40_000) * 1e-3
    theta = 2 * np.pi * t / 20.0
    wave = 0.01 * np.sin(264 * theta) + 0.002 * np.sin(528 * theta)
    torque = wave + np.random.default_rng(2).normal(0, 1e-5, t.size)
    table = pl.DataFrame({"t_s": t, "theta_mech_rad": theta, "torque_shaft_nm": torque})
    meta = CaptureMeta("m", "cogging", pole_pairs=11, slots=24)
    found = machine_of(
        Campaign("m", (Capture("cog.mcap", "0", "verified", meta, (table,)),)), Constants()
    )
    assert {264, 528} <= set(found.torque_orders)


@pytest.mark.parametrize(("lead_s", "left"), [(0.0, 0.0), (0.01, 0.0), (0.6, 0.6)])
def test_a_shaft_that_is_held_at_its_speed_does_not_coast(lead_s, left):
    """A record from before the switch is opened: no drag of the machine's balances what holds it.
    A moment of it, as any trigger leaves, is within the windows of the first speed anyhow.
    """
    t = 1e-3 * np.arange(3000)
    rate = BASE["b_nm_s_rad"] / BASE["j_kgm2"]
    late = np.maximum(t - lead_s, 0.0)
    theta = 200.0 * np.minimum(t, lead_s) + 200.0 / rate * -np.expm1(-rate * late)
    noisy = theta + np.random.default_rng(3).normal(0.0, 2e-6, t.size)
    table = pl.DataFrame({"t_s": t, "theta_mech_rad": noisy})
    meta = CaptureMeta("m", "spin_down", pole_pairs=7)
    capture = Capture("coast.mcap", "0", "verified", meta, (table,))
    (found,) = segments(Campaign("m", (capture,)), machine())
    assert found.ts_s * float(found.weak.starts[0]) >= left
    assert found.ts_s * float(found.weak.starts[0]) < left + 0.1


@pytest.mark.parametrize(("seconds", "windows"), [(3, 147), (20, 48)])
def test_of_a_long_coast_an_even_selection_of_windows_is_kept(seconds, windows):
    """With what the equations make of each window as it was, and its place in time."""
    t = 1e-3 * np.arange(1000 * seconds)
    theta = 60.0 * seconds * -np.expm1(-t / seconds)
    noisy = theta + np.random.default_rng(3).normal(0.0, 2e-6, t.size)
    table = pl.DataFrame({"t_s": t, "theta_mech_rad": noisy})
    meta = CaptureMeta("m", "spin_down", pole_pairs=7)
    capture = Capture("coast.mcap", "0", "verified", meta, (table,))
    (found,) = segments(Campaign("m", (capture,)), machine())
    assert found.weak.starts.size == windows
    middle = clock(found)[found.weak.starts + found.weak.length // 2]
    assert np.ptp(middle) > 0.95 * t[-1]
    assert np.diff(middle) == pytest.approx(np.diff(middle).mean(), abs=0.05)
    # of a machine without drags dω/dt is left over
    free = {**BASE, "b_nm_s_rad": 0.0}
    left = projected(found, residual(found, Model(machine(), ()), free))[0, :, 0]
    expected = -60.0 / seconds * np.exp(-middle / seconds)
    assert left / window_gain(found) == pytest.approx(expected, rel=0.05)
    # a run on its own has nothing of one window in the next
    slowed = {**BASE, "b_nm_s_rad": BASE["j_kgm2"] / seconds}
    run = free_run(found, Model(machine(), ()), slowed)
    speed = 60.0 * np.exp(-run.t_s / seconds)
    assert len(run.t_s) == (windows if seconds == 20 else 73)
    assert np.abs(run.simulated["omega_mech_rad_s"] - speed).max() < 0.02
    assert np.abs(run.recorded["omega_mech_rad_s"] - speed).max() < 0.02


def test_rounding_is_that_of_the_columns_a_segment_holds():
    """A log of the q axis is cut into voltage and motion; the latter once asked for the former."""
    sensors = Sensors({"theta_mech_rad": 1e-4, "vq_v": 0.1}, {"theta_mech_rad": 1e-3, "vq_v": 0.2})
    turned = {"theta_mech_rad": np.linspace(0.0, 1.0, 50)}
    made = segment_of(
        slow_turn(1.0),
        "motion",
        "drive",
        1e-3,
        recorded=turned,
        sensors=sensors,
        channels=("torque_shaft_nm",),
        weak=None,
    )
    assert made.sensors.steps == {"theta_mech_rad": 1e-3}
