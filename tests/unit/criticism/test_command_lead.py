"""A drive commands its voltage before it acts, and turns it ahead to where the rotor will be."""

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

LEAD = 1.5
"""Hold periods, which are sample periods here: computed in one, held in the next."""


def early(noise: float = 0.0, seed: int = 5) -> Segment:
    """A plain machine's log whose voltages are those that act one and a half samples later.

    The q current has steps of 2 A in four samples, as a torque map has them.
    """
    plain = log(noise=noise, seed=seed)
    n, ts = plain.recorded["iq_a"].size, plain.ts_s
    step = np.interp(np.arange(n) % 400, [0, 4, 200, 204, 400], [0.0, 2.0, 2.0, 0.0, 0.0])
    omega_e = 7 * (-60.0 + 400.0 * ts * np.arange(n))
    extra = BASE["r_ohm"] * 1j * step + BASE["lq_h"] * 1j * np.gradient(step, ts)
    extra = extra - omega_e * BASE["lq_h"] * step
    volts = plain.recorded["vd_v"] + 1j * plain.recorded["vq_v"] + extra
    at = np.arange(n) + LEAD
    ahead = np.interp(at, np.arange(n), volts.real) + 1j * np.interp(at, np.arange(n), volts.imag)
    torque = plain.recorded["torque_shaft_nm"] + 1.5 * 7 * step * (
        BASE["psi_wb"] + (BASE["ld_h"] - BASE["lq_h"]) * plain.recorded["id_a"]
    )
    recorded = {
        **plain.recorded,
        "iq_a": plain.recorded["iq_a"] + step,
        "vd_v": ahead.real,
        "vq_v": ahead.imag,
        "torque_shaft_nm": torque,
    }
    return replace(
        plain, instrument=replace(plain.instrument, meter="gain_commanded"), recorded=recorded
    )


def left(segment: Segment, **changed: float) -> float:
    """What is left of the voltages [V, rms] away from the ends."""
    found = residual(segment, Model(machine(), ()), {**BASE, **changed})
    return float(np.sqrt(np.mean(found[:2, 60:-60] ** 2)))


def test_a_command_is_early_by_what_its_drive_computes_ahead() -> None:
    drive = early()
    plain = left(drive)
    assert left(drive, command_lead=LEAD) < 0.7 * plain
    assert left(drive, command_lead=-LEAD) > 1.3 * plain


def test_a_voltmeter_commands_nothing() -> None:
    measured = replace(early(), instrument=log().instrument)
    assert left(measured, command_lead=LEAD) == left(measured)


def test_an_early_command_is_a_nuisance_and_no_name() -> None:
    base = fit_of([early(0.3), early(0.3, seed=6)], Model(machine(), ()))
    fit = base.system.fit
    assert fit.values["command_lead"] == pytest.approx(LEAD, rel=0.3)
    names = ("current_delay", "torque_lag", "sample_delay")
    offered = candidates({n: effects()[n] for n in names}, fit.model)
    scores = score_all(widened(fit, offered), offered)
    assert not [s.candidate.effect.name for s in scores if s.passes]
