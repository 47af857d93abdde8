"""Simulated campaigns of every design are healthy to the gates, with hidden effects or without.

A hidden effect is for the model's critics to find; none of them makes a capture unusable.
"""

from __future__ import annotations

from dataclasses import replace

import pytest

from pipeline.contracts.motor import agree
from pipeline.contracts.validate import validate
from pipeline.io.storage.plain_yaml import load_plain
from pipeline.settings import configuration_folder
from pipeline.simulator.bench import campaign
from pipeline.simulator.catalogue import bench_from, motor_from, with_effects
from pipeline.simulator.effects import FORMS
from tests.simulated import campaign_of

DESIGNS = sorted(path.stem for path in (configuration_folder() / "motor").glob("*.yaml"))


def codes(design: str, effects: str, seed: int) -> list[str]:
    """Every finding on a campaign; a refusal raises."""
    path = configuration_folder() / "motor" / f"{design}.yaml"
    document = load_plain(path.read_bytes(), path.name)
    motor = with_effects(motor_from(document), effects)
    whole = campaign_of(campaign(motor, bench_from(document.get("bench") or {}), seed))
    passed = [validate(capture, {}) for capture in whole.captures]
    kept = replace(whole, captures=tuple(capture for capture, _ in passed))
    findings = [f for _, found in passed for f in found] + list(agree(kept))
    return [finding.line() for finding in findings]


@pytest.mark.parametrize(
    "design",
    [
        pytest.param(n, marks=() if n in ("gimbal-5208", "joint-11p") else pytest.mark.slow)
        for n in DESIGNS
    ],
)
def test_designs(design: str) -> None:
    assert codes(design, "", 11) == []


@pytest.mark.slow
@pytest.mark.parametrize("effect", sorted(FORMS))
def test_effects(effect: str) -> None:
    assert codes("joint-11p", effect, 12) == []
