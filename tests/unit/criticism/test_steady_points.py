"""The diagnosis of settled points of a shaft that turns."""

from __future__ import annotations

import pytest

from pipeline.criticism.data.machine_scale import machine_of
from pipeline.criticism.diagnosis import diagnose
from pipeline.criticism.machine.model import Model
from pipeline.criticism.regression.gauss_newton import first_fit, rough_fit
from pipeline.criticism.residuals.segments import segments
from pipeline.records.capture import Campaign
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants
from tests.unit.settled import LD_H, LQ_H, PSI_WB, R_OHM, settled

SPEC = ModelSpec("standard", ())


def test_a_fit_of_the_rows_has_the_motors_constants():
    campaign = Campaign("m", (settled(),))
    machine = machine_of(campaign, Constants())
    (segment,) = segments(campaign, machine)
    assert segment.kind == "points"
    assert segment.channels == ("vd_v", "vq_v", "torque_shaft_nm")
    values = first_fit(rough_fit((segment,), Model(machine, ()))).fit.values
    for name, true in (("r_ohm", R_OHM), ("ld_h", LD_H), ("lq_h", LQ_H), ("psi_wb", PSI_WB)):
        assert values[name] == pytest.approx(true, rel=0.01), name


def test_sound_rows_are_within_their_noise():
    found = diagnose(Campaign("m", (settled(),)), SPEC, Constants())
    assert found.missing == () and found.verdict != "unknown"
    assert found.ladder[0].held_out < 1.2


@pytest.mark.parametrize(
    ("effect", "made"),
    [
        ("windage", {"windage": 6e-6}),
        ("load_dependent_friction", {"load_share": 0.04}),
        ("saturation", {"knee_a": 12.0}),
    ],
)
def test_what_they_lack_is_named(effect, made):
    found = diagnose(Campaign("m", (settled(**made),)), SPEC, Constants())
    assert found.missing == (effect,)
    assert found.ladder[-1].held_out < 1.2
