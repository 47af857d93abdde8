"""A drive that samples its current a little off the middle of late pulses, beside a coast."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import polars as pl
import pytest

from pipeline.estimation.estimators.inertia import ESTIMATOR as INERTIA
from pipeline.estimation.estimators.torque_map import ESTIMATOR as TORQUE_MAP
from pipeline.estimation.mechanical.sampled_current import sampling_drag
from pipeline.records.capture import Campaign, Capture, CaptureMeta
from pipeline.records.constants import Constants
from pipeline.records.estimate import Estimate
from pipeline.records.uncertainty import type_b
from pipeline.simulator.bench import CAMPAIGN, campaign
from pipeline.simulator.design import EXACT, Bench
from pipeline.simulator.truth import truth
from tests.simulated import campaign_of, design
from tests.unit.estimation.mechanical import chain

MOTOR = replace(design("servo-ipm"), effects={})
TRUE = truth(MOTOR)["constants"]
SPEEDS = (0.15, -0.3, 0.6)
PLAN = (
    *((f"map_{n}", "torque_map", {"speed": speed}) for n, speed in enumerate(SPEEDS)),
    *(step for step in CAMPAIGN if step[0] in ("drive_0", "spin_down_forward")),
)
LATE_S = 0.7e-6
VISCOUS = "b_visc_nm_s_rad"


def late(capture: Capture, late_s: float) -> Capture:
    """A log whose q current moves on by p ω ψ τ/L_q from the middle of its pulse to its sample."""
    if not capture.has("iq_a", "theta_mech_rad"):
        return capture
    data = capture.arrays("t_s", "theta_mech_rad")
    per_speed = MOTOR.pole_pairs * MOTOR.psi_pm_wb * late_s / MOTOR.lq_h
    moved = per_speed * np.gradient(data["theta_mech_rad"], data["t_s"])
    (table,) = capture.tables
    return replace(capture, tables=(table.with_columns(pl.col("iq_a") - pl.Series(moved)),))


@cache
def viscous(coasts: bool, late_s: float = LATE_S, encoder_bits: int = 17) -> dict[str, Estimate]:
    """B by method, of such logs."""
    bench = Bench(instruments=EXACT, encoder_bits=encoder_bits)
    whole = campaign_of(campaign(MOTOR, bench, 4, PLAN))
    kept = (c for c in whole.captures if coasts or c.meta.test != "spin_down")
    used = [late(c, late_s) for c in kept]
    inductance = Estimate("lq_h", MOTOR.lq_h, "H", "measured", "lcr", type_b("lcr", 1e-3))
    found = chain(
        Campaign(whole.motor_id, tuple(used)), TORQUE_MAP, INERTIA, known=Constants((inductance,))
    )
    return {one.method: one for one in found.all_of(VISCOUS)}


def test_a_coast_shows_viscous_friction_without_what_a_late_sample_adds() -> None:
    """Drives alone have it 14 % low."""
    found = viscous(True)["inertia"]
    assert found.number == pytest.approx(TRUE[VISCOUS], abs=3.0 * found.u)
    assert found.u < 0.02 * found.number
    assert "sampled current" in found.note


def test_beside_a_coast_a_late_sample_moves_nothing_however_little_shows() -> None:
    """By a coarse encoder 0.3 us are no sure part of the fit, and moved it by half of its u."""
    before, after = (viscous(True, late_s, 10)["inertia"] for late_s in (0.0, 0.3e-6))
    assert after.number == pytest.approx(before.number, abs=0.02 * before.u)
    assert before.number == pytest.approx(TRUE[VISCOUS], abs=3.0 * before.u)


@pytest.mark.parametrize(
    ("told", "counts"),
    [
        ({"voltage_kind": "commanded", "voltage_timing": "centred"}, True),
        ({"voltage_kind": "measured", "voltage_timing": "held"}, True),
        ({"voltage_kind": "measured", "voltage_timing": "instant"}, False),
    ],
)
def test_a_log_in_step_with_an_inverter_has_that_doubt(told: dict[str, str], counts: bool) -> None:
    """K²/(1.5 L_q) is 34.8 N·m·s/rad a second; half a microsecond of it."""
    capture = Capture("d.csv", "1", "verified", CaptureMeta("m", "drive", **told), ())
    inductance = Estimate("lq_h", 6.2e-4, "H", "measured", "lcr", type_b("lcr", 1e-6))
    parts = sampling_drag([capture], 0.18, Constants((inductance,)))
    assert [part.u for part in parts] == ([pytest.approx(1.742e-5, rel=1e-3)] if counts else [])


@pytest.mark.parametrize("method", ["torque_map", "inertia"])
def test_without_a_coast_it_is_in_the_uncertainty(method: str) -> None:
    found = viscous(False)[method]
    assert found.number == pytest.approx(TRUE[VISCOUS], abs=3.0 * found.u)
    assert any(part.source == "assumed:sampled_current" for part in found.budget)
