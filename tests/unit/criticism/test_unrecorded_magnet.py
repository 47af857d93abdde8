"""A magnet whose temperature nobody records makes two logs differ, and that is no name."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.criticism.machine.model import Model
from pipeline.criticism.regression.gauss_newton import gauss_newton
from pipeline.criticism.regression.linear_system import Fitted, floors
from tests.unit.criticism.machines import BASE, log, machine

KE = 7 * BASE["psi_wb"]


def warmed(share, seed, recorded=False):
    """The log of a magnet that has lost a share of its flux."""
    segment = log(seed=seed, noise=1.0)
    found = dict(segment.recorded)
    omega = np.gradient(found["theta_mech_rad"], segment.ts_s)
    found["vq_v"] = found["vq_v"] - share * KE * omega
    found["torque_shaft_nm"] = found["torque_shaft_nm"] - 1.5 * share * KE * found["iq_a"]
    if not recorded:
        del found["temp_magnet_degc"]
    fixed = {**segment.fixed, "ke_v_s_rad": KE}
    return replace(segment, capture=f"log_{seed}", recorded=found, fixed=fixed)


def worst(*segments):
    model = Model(machine(), ())
    start = Fitted(model, dict(BASE), floors(segments, model, BASE), BASE)
    fitted, around = gauss_newton(segments, start)
    return float(around.spreads(around.residual).max()), fitted.values["psi_wb"]


def test_two_logs_whose_flux_differs_by_two_kelvin_are_at_the_floor():
    left, psi = worst(warmed(0.0, 5), warmed(0.0024, 6))
    assert left < 1.5
    assert psi == pytest.approx((1 - 0.0012) * BASE["psi_wb"], rel=1.2e-3)


@pytest.mark.parametrize(("share", "recorded"), [(0.0024, True), (0.2, False)])
def test_what_a_record_or_any_test_s_warmth_rules_out_stays_over_it(share, recorded):
    left, _ = worst(warmed(0.0, 5, recorded), warmed(share, 6, recorded))
    assert left > 3.0
