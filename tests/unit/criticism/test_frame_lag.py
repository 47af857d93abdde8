"""A drive turns its voltage ahead by a speed of its own, and where that lags so does its frame."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.criticism.data.segment import Segment
from pipeline.criticism.library.registry import effects
from pipeline.criticism.machine.model import Model
from pipeline.criticism.residuals.residual import residual
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
