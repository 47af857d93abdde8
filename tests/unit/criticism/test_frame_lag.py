"""A drive turns its voltage ahead by a speed of its own, and where that lags so does its frame."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.criticism.data.machine_scale import base_scales
from pipeline.criticism.data.segment import Segment
from pipeline.criticism.library.registry import effects
from pipeline.criticism.machine.model import Model
from pipeline.criticism.regression.columns import base_columns
from pipeline.criticism.residuals.residual import operate, residual
from pipeline.criticism.selection.candidates import candidates, widened
from pipeline.criticism.selection.requested_model import fit_of
from pipeline.criticism.selection.score_test import score_all
from tests.unit.criticism.machines import BASE, log, machine

LAG_S = 8e-3
ACCELERATION = 7 * 400.0
"""Electrical [rad/s²], of `log`."""
ANGLE_RAD = 1.5 * 5e-5 * LAG_S * ACCELERATION
"""One and a half sample periods ahead, by a speed that is behind by lag times acceleration."""


def lagging(noise: float = 0.0, seed: int = 5) -> Segment:
    """A plain machine's log, whose drive turns every vector ahead by a speed that lags."""
    plain = log(noise=noise, seed=seed)
    volts = (plain.recorded["vd_v"] + 1j * plain.recorded["vq_v"]) * np.exp(1j * ANGLE_RAD)
    drive = replace(plain.instrument, meter="gain_commanded")
    recorded = {**plain.recorded, "vd_v": volts.real, "vq_v": volts.imag}
    return replace(plain, instrument=drive, recorded=recorded)


def left(segment: Segment, **changed: float) -> float:
    """Largest voltage [V] that is left away from the ends."""
    found = residual(segment, Model(machine(), ()), {**BASE, **changed})
    return float(np.abs(found[:2, 60:-60]).max())


def test_the_lag_of_a_drives_speed_turns_the_frame_of_its_voltage() -> None:
    speed, drive = 7 * 100.0, lagging()
    plain = left(drive)
    assert plain == pytest.approx(ANGLE_RAD * speed * BASE["psi_wb"], rel=0.4)
    assert left(drive, frame_lag_s=LAG_S) < 0.02 * plain
    assert left(drive, frame_lag_s=-LAG_S) > 1.9 * plain


def test_a_voltmeter_knows_of_no_drives_speed() -> None:
    """Measured voltages are turned by the angle beside them."""
    measured = replace(lagging(), instrument=log().instrument)
    assert left(measured, frame_lag_s=LAG_S) == left(measured)


def test_a_lag_is_a_nuisance_and_no_name() -> None:
    noise = 0.1
    base = fit_of([lagging(noise), lagging(noise, seed=6)], Model(machine(), ()))
    fit = base.system.fit
    assert fit.values["frame_lag_s"] == pytest.approx(LAG_S, rel=0.3)
    names = ("cross_saturation", "saturation", "sample_delay", "angle_offset", "current_delay")
    offered = candidates({n: effects()[n] for n in names}, fit.model)
    scores = score_all(widened(fit, offered), offered)
    assert not [s.candidate.effect.name for s in scores if s.passes]


BEND_S2 = 1.5e-6
"""Of a loop of 820 rad/s."""


def reversing(segment: Segment, bend_s2: float = 0.0, noise: float = 0.0, seed: int = 5) -> Segment:
    """The machine of `log` on a free shaft that its current throws to and fro, in a frame that is
    behind by acceleration: i_q makes the acceleration.
    """
    rng, ts, p = np.random.default_rng(seed), segment.ts_s, 7
    t = np.arange(segment.size) * ts
    kt = 1.5 * p * BASE["psi_wb"]
    current = 3.0 + 4.0j * np.cos(40.0 * t)
    inertia = 2e-6
    gathers = kt * current.imag / inertia
    omega = kt * 4.0 / (40.0 * inertia) * np.sin(40.0 * t)
    theta = kt * 4.0 / (1600.0 * inertia) * (1.0 - np.cos(40.0 * t))
    psi = BASE["ld_h"] * current.real + BASE["psi_wb"] + 1j * BASE["lq_h"] * current.imag
    slope = 1j * BASE["lq_h"] * -160.0 * np.sin(40.0 * t)
    volts = BASE["r_ohm"] * current + slope + 1j * p * omega * psi
    behind = np.exp(1j * bend_s2 * p * gathers)
    seen, volts = current * behind, volts * behind
    made = {"id_a": seen.real, "iq_a": seen.imag, "vd_v": volts.real, "vq_v": volts.imag}
    made = {n: column + noise * rng.normal(0.0, 0.01, t.size) for n, column in made.items()}
    still = dict.fromkeys(("temp_winding_degc", "temp_magnet_degc"), np.full(t.size, 25.0))
    recorded = {**segment.recorded, **made, **still, "theta_mech_rad": theta}
    return replace(segment, recorded=recorded, channels=("vd_v", "vq_v"))


def test_a_frame_that_is_behind_by_acceleration_is_turned_back_and_the_shaft_is_not() -> None:
    values, plain = {**BASE, "bend_angle_s2": BEND_S2}, Model(machine(), ())
    drive, lagging_drive = reversing(log()), reversing(log(), BEND_S2)
    inside = slice(80, -80)
    off = residual(lagging_drive, plain, BASE)[:2, inside]
    left_over = residual(lagging_drive, plain, values)[:2, inside]
    clean = residual(drive, plain, BASE)[:2, inside]
    assert np.abs(left_over).max() < 0.05 * np.abs(off).max() + np.abs(clean).max()
    theta = [
        operate(s, s.recorded, plain, v).theta_rad
        for s, v in ((drive, BASE), (lagging_drive, values))
    ]
    assert np.array_equal(*theta)


def test_the_step_of_a_lag_is_as_small_as_the_lag() -> None:
    """A thousandth of a second squared would turn the frame many times."""
    columns = base_columns(machine(), base_scales(machine()))
    step = next(column.step for column in columns if column.name == "bend_angle_s2")
    assert step <= Model(machine(), ()).priors()["bend_angle_s2"][1]
