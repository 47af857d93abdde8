"""Derived constants, and all electrical estimators on the rig's motors."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest

from pipeline.estimation.estimators import (
    current_step,
    derived,
    derived_electrical,
    heat_run,
    open_circuit,
    resistance,
)
from pipeline.records.capture import Campaign
from pipeline.records.constants import Constants
from pipeline.records.estimate import Estimate
from pipeline.records.uncertainty import type_b
from tests.unit.estimation.signals import estimates, known_value

RIG = Path(__file__).parents[4] / "shared" / "data" / "rig"


# Derived


def test_derived_constants_and_cancelling_gains():
    ld = Estimate("ld_h", 2e-4, "H", "measured", "x", type_b("current@s", -4e-7))
    lq = Estimate("lq_h", 3e-4, "H", "measured", "x", type_b("current@s", -6e-7))
    psi, pairs = known_value("psi_pm_wb", 2.5908e-3, 1e-6, "Wb"), known_value("pole_pairs", 7)
    r, j = known_value("r_phase_ohm", 0.05, 0.0, "ohm"), known_value("j_rotor_kgm2", 1e-5)
    kt = known_value("kt_peak_nm_a", 0.0272, 1e-5, "N·m/A")
    known = Constants((ld, lq, psi, pairs, r, j, kt))
    found = estimates(derived_electrical.ESTIMATOR, known=known)
    assert found["saliency_ratio"].number == pytest.approx(1.5)
    assert found["saliency_ratio"].u == pytest.approx(0.0, abs=1e-15)
    assert found["kt_from_ke_nm_a"].number == pytest.approx(0.027204, rel=1e-4)
    assert found["kt_from_ke_nm_a"].u == pytest.approx(10.5e-6)
    assert found["tau_elec_s"].number == pytest.approx(0.006)
    found = estimates(derived.ESTIMATOR, known=known)
    assert found["kt_rms_nm_a"].number == pytest.approx(0.0272 * math.sqrt(2.0))
    assert found["motor_constant_nm_sqrt_w"].number == pytest.approx(0.0272 / math.sqrt(0.075))
    k = 7 * 2.5908e-3
    assert found["tau_mech_s"].number == pytest.approx(1e-5 * 0.05 / (1.5 * k * k))
    assert found["tau_mech_s"].u == pytest.approx(found["tau_mech_s"].number * 2e-6 / 2.5908e-3)


# The rig's motors with hidden effects


@pytest.mark.skipif(not RIG.is_dir(), reason="../shared/data/rig is not here")
@pytest.mark.parametrize(
    "motor", ["P1", *(pytest.param(f"P{n}", marks=pytest.mark.slow) for n in (0, 2, 3, 4))]
)
def test_hidden_effects_do_not_spoil_the_electrical_constants(motor):
    from pipeline.io.ingest.capture_reader import read_capture, survey

    wanted = ("resistance", "current_step", "open_circuit", "heat_run")
    folder = RIG / motor
    entries = [e for e in survey(folder, {}).entries if e.stated["test"] in wanted]
    campaign = Campaign(motor, tuple(read_capture(folder, entry) for entry in entries))
    true = json.loads((folder / "truth.json").read_bytes())["constants"]
    known = Constants()
    modules = (resistance, open_circuit, current_step, heat_run)
    for module in modules:
        fit = module.ESTIMATOR.fit(campaign, known, module.ESTIMATOR.options)
        known = known.adding(fit.estimates)
    limits = {"r_phase_ohm": 0.003, "ld_h": 0.01, "lq_h": 0.01, "psi_pm_wb": 0.002}
    for name, limit in limits.items():
        assert known.best(name).number == pytest.approx(true[name], rel=limit), name
    assert known.best("pole_pairs").value == true["pole_pairs"]
    for name in (*limits, "temp_coeff_copper_1_k", "temp_coeff_magnet_1_k"):
        low, high = known.best(name).interval()
        assert low <= true[name] <= high, name
