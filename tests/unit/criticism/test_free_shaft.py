"""A log of both axes without a transducer tells of the motion: nothing but drags load the shaft."""

from __future__ import annotations

import numpy as np
import polars as pl
import pytest

from pipeline.criticism.data.machine_scale import machine_of
from pipeline.criticism.library.registry import chosen
from pipeline.criticism.machine.model import Model
from pipeline.criticism.regression.gauss_newton import first_fit, rough_fit
from pipeline.criticism.residuals.segments import segments
from pipeline.records.capture import Campaign, Capture, CaptureMeta
from pipeline.records.constants import Constants

P, TS, R, L, PSI, J, B, T_C, PULL = 4, 2e-4, 0.4, 6e-4, 0.012, 9e-5, 4e-5, 6e-3, 4e-3


def drive(seed=0, pull=0.0, transducer=False):
    """Speed that swings through zero by a current that its inertia and drags need; id = 0."""
    rng = np.random.default_rng(seed)
    t = np.arange(15000) * TS
    pace = 2 * np.pi * (1.0 + 0.3 * seed)
    omega = 120.0 * np.sin(pace * t)
    theta = 120.0 / pace * (1.0 - np.cos(pace * t))
    torque = J * 120.0 * pace * np.cos(pace * t) + B * omega + T_C * np.sign(omega) + pull
    iq = torque / (1.5 * P * PSI)
    slope = np.gradient(iq, TS)
    columns = {
        "t_s": t,
        "theta_mech_rad": theta + rng.normal(0, 2e-6, t.size),
        "id_a": rng.normal(0, 2e-3, t.size),
        "iq_a": iq + rng.normal(0, 2e-3, t.size),
        "vd_v": -P * omega * L * iq + rng.normal(0, 5e-3, t.size),
        "vq_v": R * iq + L * slope + P * omega * PSI + rng.normal(0, 5e-3, t.size),
    }
    if transducer:
        columns["torque_shaft_nm"] = rng.normal(0, 1e-4, t.size)
    meta = CaptureMeta("m", "drive", pole_pairs=P, voltage_kind="commanded")
    return Capture(f"drive_{seed}", "0", "verified", meta, (pl.DataFrame(columns),))


def fitted(campaign, *effects):
    machine = machine_of(campaign, Constants())
    rows = segments(campaign, machine)
    model = Model(machine, tuple(chosen(effects).values()))
    return first_fit(rows, rough_fit(rows, model))


def test_motion_is_there_where_no_transducer_is():
    machine = machine_of(Campaign("m", (drive(),)), Constants())
    for capture, kinds in ((drive(), ["dq", "motion"]), (drive(transducer=True), ["dq"])):
        assert [s.kind for s in segments(Campaign("m", (capture,)), machine)] == kinds


def test_inertia_and_friction_come_from_current_and_motion():
    fit, _ = fitted(Campaign("m", (drive(0), drive(1))), "coulomb_friction")
    assert fit.values["j_kgm2"] == pytest.approx(J, rel=0.01)
    assert fit.values["coulomb_friction.torque_nm"] == pytest.approx(T_C, rel=0.02)
    assert fit.values["b_nm_s_rad"] == pytest.approx(B, rel=0.1)


def test_a_constant_load_of_a_free_shaft_is_known_by_its_size():
    campaign = Campaign("m", (drive(0, PULL), drive(1, PULL)))
    fit, around = fitted(campaign, "coulomb_friction", "constant_load")
    assert fit.values["constant_load.torque_nm"] == pytest.approx(PULL, rel=0.02)
    _, without = fitted(campaign, "coulomb_friction")
    assert without.misfit > around.misfit + 100.0
