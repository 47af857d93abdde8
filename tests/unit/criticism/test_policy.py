"""An override reaches the fit, the workers' keys, the captures that a command reads, the output."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pipeline.criticism.diagnosis import diagnose
from pipeline.criticism.library.named_models import model_of
from pipeline.criticism.policy.policy import DEFAULT, policy_changes, policy_of
from pipeline.criticism.regression.gauss_newton import gauss_newton
from pipeline.criticism.regression.linear_system import linear_system
from pipeline.execution.caches.keys import ModelParts, key_of
from pipeline.records.capture import Campaign
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants
from pipeline.records.policy import policy_digest
from pipeline.settings import DiagnoseSettings, ModelSettings
from pipeline.stages.steps.criticism import Judged, each_motor
from tests.unit.criticism.machines import fitted, log, machine

CHANGES = policy_changes({"selection": {"tie": 9.0}, "fit": {"settled": 0.1, "converged": 1e12}})


def test_a_model_carries_it_to_fits_and_systems():
    model = model_of(ModelSpec(policy=CHANGES), machine())
    assert model.policy == policy_of(CHANGES) != DEFAULT
    assert model.without("coulomb_friction").policy is model.policy
    assert model_of(ModelSpec(), machine()).policy is DEFAULT


def test_a_fit_goes_by_it():
    segments = (log(noise=1.0),)
    near = fitted(segments)
    start = replace(near, values={**near.values, "psi_wb": 0.5 * near.values["psi_wb"]})
    plain = gauss_newton(start).fit
    once = replace(
        start, model=replace(start.model, machine=replace(machine(), policy=policy_of(CHANGES)))
    )
    system = gauss_newton(once)
    stayed = system.fit
    assert stayed.values == start.values != plain.values
    assert system.policy == once.policy == policy_of(CHANGES)
    assert linear_system(once).normal_equations().policy.settled == 0.1


def test_a_kept_verdict_of_another_policy_does_not_count():
    keys = {
        key_of(ModelParts("code", "libraries", [], spec, [], None, search=True))
        for spec in (ModelSpec(), ModelSpec(policy=CHANGES))
    }
    assert len(keys) == 2


@pytest.mark.parametrize("changes", [(), CHANGES])
def test_a_diagnosis_names_its_policy(changes):
    found = diagnose(Campaign("m", ()), ModelSpec(policy=changes), Constants(()))
    assert found.document()["policy"] == policy_digest(policy_of(changes))


def test_a_command_hands_it_on(tmp_path):
    seen = []

    def judge(task):
        seen.append(task.spec)
        return Judged(document={}, text="", undecided=False)

    settings = DiagnoseSettings(
        input="data/demo",
        output=str(tmp_path),
        motor="G52-1402",
        model=ModelSettings(name="ideal"),
        policy={"selection": {"tie": 9.0}},
    )
    each_motor(
        settings,
        judge,
        "pipeline.criticism.diagnosis",
        "diagnosis",
        "pipeline.io.recordings.ladder",
    )
    assert [spec.policy for spec in seen] == [(("selection.tie", 9.0),)]
