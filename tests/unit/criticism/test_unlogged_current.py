"""A log without its d current says neither that a motor is sound nor what it lacks."""

from __future__ import annotations

from dataclasses import replace

import pytest

import pipeline
from pipeline.simulator.bench import CAMPAIGN, campaign
from pipeline.simulator.design import EXACT, Bench, Motor
from pipeline.simulator.outside import with_unknown
from tests.simulated import campaign_of, design

MAP = "torque_map_backward"
SOUND = replace(design("joint-11p"), effects={})


def found(*gone: str, motor: Motor = SOUND, log: str = MAP) -> pipeline.Diagnosis:
    """Of a motor by one log beside a spin, some of its columns not recorded."""
    names = (log, "open_circuit_forward") if log != MAP else (log,)
    plan = tuple(step for step in CAMPAIGN if step[0] in names)
    made = campaign_of(campaign(motor, Bench(instruments=EXACT), 2, plan))
    short = tuple(
        replace(c, tables=(c.tables[0].drop(gone),)) if c.path == f"{log}.mcap" else c
        for c in made.captures
    )
    whole = replace(made, captures=short)
    return pipeline.diagnose(pipeline.Recordings({"m": whole}))["m"]


@pytest.mark.parametrize("gone", [("id_a",), ("id_a", "vd_v")])
def test_what_a_map_misses_without_its_d_current_is_insufficient(gone: tuple[str, ...]) -> None:
    """Reluctance torque of the current that was not recorded was `unknown`, at 8 and 83 floors."""
    diagnosis = found(*gone)
    assert (diagnosis.verdict, diagnosis.missing) == ("insufficient", ())
    assert any(left.matters for left in diagnosis.remainder)
    assert any("id_a that was not recorded" in note for note in diagnosis.notes)


def test_what_a_drive_misses_without_its_d_current_is_insufficient() -> None:
    """It weakens its field: what the reluctance makes of that was `unknown`, at 44 floors."""
    sound = replace(design("servo-ipm"), effects={})
    diagnosis = found("id_a", motor=sound, log="drive_0")
    assert (diagnosis.verdict, diagnosis.missing) == ("insufficient", ())
    assert any(left.matters for left in diagnosis.remainder)
    assert any("id_a that was not recorded" in note for note in diagnosis.notes)


def test_what_goes_with_the_angle_alone_is_of_no_current() -> None:
    """A tight spot of the shaft is no effect of the library, and as unknown as in a whole log."""
    diagnosis = found(
        "id_a", motor=with_unknown(replace(design("servo-ipm"), effects={}), "tight_spot", 3.0)
    )
    assert diagnosis.verdict == "unknown"
    assert diagnosis.unknown is not None
    assert diagnosis.unknown.variables == ("theta_mech_rad",)


def test_a_whole_map_misses_nothing_and_needs_no_note() -> None:
    diagnosis = found()
    assert (diagnosis.verdict, diagnosis.remainder) == ("insufficient", ())
    assert not any("not recorded" in note for note in diagnosis.notes)
