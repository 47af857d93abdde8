"""A torque map without its d current says neither that a motor is sound nor what it lacks."""

from __future__ import annotations

from dataclasses import replace

import pytest

import pipeline
from pipeline.simulator.bench import CAMPAIGN, campaign
from pipeline.simulator.design import EXACT, Bench
from tests.simulated import campaign_of, design

MAP = "torque_map_backward"


def found(*gone: str, **effects: float) -> pipeline.Diagnosis:
    """Of a motor by one torque map, some columns of it not recorded."""
    motor = replace(design("joint-11p"), effects={}).having(**effects)
    plan = tuple(step for step in CAMPAIGN if step[0] == MAP)
    made = campaign_of(campaign(motor, Bench(instruments=EXACT), 2, plan))
    (log,) = made.captures
    short = replace(log, tables=(log.tables[0].drop(gone),))
    whole = replace(made, captures=(short,))
    return pipeline.diagnose(pipeline.Recordings({"m": whole}))["m"]


@pytest.mark.parametrize("gone", [("id_a",), ("id_a", "vd_v")])
def test_what_a_map_misses_without_its_d_current_is_insufficient(gone: tuple[str, ...]) -> None:
    """Reluctance torque of the current that was not recorded was `unknown`, at 8 and 83 floors."""
    diagnosis = found(*gone)
    assert (diagnosis.verdict, diagnosis.missing) == ("insufficient", ())
    assert any(left.matters for left in diagnosis.remainder)
    assert any("id_a that was not recorded" in note for note in diagnosis.notes)


def test_a_whole_map_misses_nothing_and_needs_no_note() -> None:
    diagnosis = found()
    assert (diagnosis.verdict, diagnosis.remainder) == ("insufficient", ())
    assert not any("not recorded" in note for note in diagnosis.notes)
