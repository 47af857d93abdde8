"""A commanded q voltage that acts later than it is logged."""

from __future__ import annotations

import numpy as np
import polars as pl
import pytest

from pipeline.criticism.equations.q_axis import EQUATION, cut
from pipeline.criticism.machine.model import Model, evaluate
from pipeline.criticism.residuals.residual import operate
from pipeline.records.capture import Capture, CaptureMeta
from tests.unit.criticism.machines import BASE, machine

ROW_S, PWM_S, LEAD = 1e-3, 1e-4, 1.5


def segment(kind: str, timing: str):
    t = ROW_S * np.arange(4000)
    columns = {
        "t_s": t,
        "theta_mech_rad": 20.0 * t + 3.0 * np.sin(5.0 * t),
        "iq_a": 2.0 * np.sin(40.0 * t) + np.cos(200.0 * t),
        "vq_v": np.zeros(t.size),
    }
    meta = CaptureMeta("m", "drive", voltage_kind=kind, voltage_timing=timing, pwm_hz=1.0 / PWM_S)
    one = cut(Capture("a.mcap", "0", "verified", meta, (pl.DataFrame(columns),)), machine())
    assert one is not None
    return one


def voltage(kind: str, lead: float, timing: str = "instant"):
    one, values = segment(kind, timing), {**BASE, "command_lead": lead}
    model = Model(machine(), ())
    x = operate(one, one.recorded, model, values)
    return EQUATION.predicted(one, x, evaluate(model, x, values), model, values)[0]


def test_what_is_logged_acts_a_period_and_a_half_later():
    at_once, logged = voltage("commanded", 0.0), voltage("commanded", LEAD)
    rows = np.arange(at_once.size, dtype=float)
    later = np.interp(rows + LEAD * PWM_S / ROW_S, rows, at_once)
    moved = (logged - at_once)[3:-3]
    assert moved == pytest.approx((later - at_once)[3:-3], abs=0.1 * np.abs(moved).max())
    assert np.abs(moved).max() > 1e-3


@pytest.mark.parametrize(("kind", "timing"), [("measured", "instant"), ("commanded", "centred")])
def test_a_measured_voltage_is_that_of_its_instant_and_a_mean_that_of_its_middle(kind, timing):
    assert voltage(kind, LEAD, timing) == pytest.approx(voltage(kind, 0.0, timing))


def test_the_fit_leaves_it_free():
    assert "command_lead" in EQUATION.observes.constants
    assert machine().policy.priors.command_lead == LEAD
