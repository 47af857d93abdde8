"""The reference captures of an independent bench simulator: what was hidden in them is found.

All are slow; `tests/e2e/test_rig.py` has the one with nothing hidden in the default run.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from pipeline.criticism.comparison import compare
from pipeline.criticism.diagnosis import diagnose
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants
from pipeline.stages.steps.campaigns import campaigns

RIG = Path(__file__).parents[4] / "shared" / "data" / "rig"
pytestmark = pytest.mark.skipif(not RIG.is_dir(), reason="shared rig captures are not here")


def campaign(name):
    return campaigns(str(RIG / name))[0][0]


def truth(name):
    return json.loads((RIG / name / "truth.json").read_text(encoding="utf-8"))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["P1", "P2", "P3"])
def test_what_is_hidden_is_named_exactly(name):
    result = diagnose(campaign(name), ModelSpec(), Constants())
    assert result.verdict == "missing"
    assert set(result.missing) == set(truth(name)["hidden"])
    assert result.ladder[-1].held_out < 0.3 * result.ladder[0].held_out
    if name == "P3":
        shown = {step.effects[-1]: step.signature for step in result.ladder[1:]}
        told = {effect: (s.signal, s.variable) for effect, s in shown.items() if s is not None}
        assert told == {
            "angle_eccentricity": ("vd_v", "theta_mech_rad"),
            "stribeck": ("torque_nm", "omega_mech_rad_s"),
        }
        bump = shown["stribeck"]
        fast = np.abs(bump.at) > 4.0 * truth(name)["sizes"]["ws"]
        assert np.abs(bump.before).max() > 20.0 * np.abs(np.array(bump.before)[fast]).max()


@pytest.mark.slow
def test_an_effect_of_nobodys_library_is_unknown_with_its_variable():
    result = diagnose(campaign("P4"), ModelSpec(), Constants())
    assert (result.verdict, result.missing) == ("unknown", ())
    assert result.unknown is not None
    assert result.unknown.signal == "torque_shaft_nm"
    assert result.unknown.variables == ("omega_mech_rad_s",)


@pytest.mark.slow
def test_compare_knows_the_constants_and_the_size_of_what_was_added():
    spec = ModelSpec("standard", ("angle_eccentricity", "stribeck"))
    result = compare(campaign("P3"), spec, Constants())
    true, sizes = truth("P3")["constants"], truth("P3")["sizes"]
    value = {name: p.value for name, p in result.parameters.items()}
    assert value["r_ohm"] == pytest.approx(true["r_phase_ohm"], rel=2e-3)
    assert value["ld_h"] == pytest.approx(true["ld_h"], rel=5e-3)
    assert value["psi_wb"] == pytest.approx(true["psi_pm_wb"], rel=1e-3)
    assert value["j_kgm2"] == pytest.approx(true["j_rotor_kgm2"], rel=5e-3)
    size = (
        value["angle_eccentricity.sine_rad"] ** 2 + value["angle_eccentricity.cosine_rad"] ** 2
    ) ** 0.5
    assert size == pytest.approx(sizes["enc_ecc"], rel=0.01)
    assert value["stribeck.speed_rad_s"] == pytest.approx(sizes["ws"], rel=0.02)
    excess = sizes["ts"] - true["torque_coulomb_nm"]
    assert value["stribeck.excess_nm"] == pytest.approx(excess, rel=0.02)
