"""What several captures of one motor say together, one contradiction at a time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.contracts.motor import agree
from pipeline.records.capture import Campaign, Capture
from tests.faults.healthy import (
    TESTS,
    Motor,
    cogging,
    column,
    current_step,
    lcr,
    open_circuit,
    resistance,
    spin_down,
    torque_map,
    with_column,
    with_rows,
)

MOTOR = Motor()


def _campaign(*captures: Capture) -> Campaign:
    named = tuple(replace(c, path=f"{i}_{c.path}") for i, c in enumerate(captures))
    return Campaign("made-up-1", named)


def test_healthy_campaign(rng: np.random.Generator) -> None:
    """Nothing is said of a motor with all its tests."""
    captures = [make(MOTOR, rng) for make in TESTS.values()]
    assert agree(_campaign(*captures, cogging(MOTOR, rng, -1.0))) == ()


@pytest.mark.parametrize(
    ("key", "value"), [("pole_pairs", 14), ("winding", "delta"), ("motor_type", "other")]
)
def test_captures_that_disagree(key: str, value: object, rng: np.random.Generator) -> None:
    """Warned, neither refused: the finding stands at the odd one out and names the other file."""
    odd = spin_down(MOTOR, rng)
    odd = replace(odd, meta=replace(odd.meta, **{key: value}))
    findings = agree(_campaign(resistance(MOTOR, rng), odd, lcr(MOTOR, rng)))
    assert [(f.file, f.code, f.severity) for f in findings] == [
        ("1_spin_down.csv", f"{key}_contradiction", "warning")
    ]
    assert str(value) in findings[0].message
    assert "0_resistance.csv" in findings[0].message


def test_the_most_frequent_nameplate_counts(rng: np.random.Generator) -> None:
    """Whatever the order of the files: two of three say wye, and one lot is as good as another."""
    captures = [make(MOTOR, rng) for make in (spin_down, resistance, lcr)]
    stated = ("delta", "wye", "wye")
    captures = [
        replace(c, meta=replace(c.meta, winding=w)) for c, w in zip(captures, stated, strict=True)
    ]
    assert _campaign(*captures).nameplate("winding") == "wye"
    (finding,) = agree(_campaign(*captures))
    assert finding.file == "0_spin_down.csv"
    assert "delta here alone" in finding.message
    assert _campaign(*captures[:2]).nameplate("winding") == "delta"
    assert _campaign(*captures).nameplate("lot") is None


def test_two_captures_that_disagree(rng: np.random.Generator) -> None:
    """Warned once, whichever way round the two come."""
    one, other = resistance(MOTOR, rng), open_circuit(MOTOR, rng)
    other = replace(other, meta=replace(other.meta, pole_pairs=14))
    for captures in ((one, other), (other, one)):
        codes = [f.code for f in agree(_campaign(*captures))]
        assert codes == ["pole_pairs_contradiction"]


def test_one_test_only(rng: np.random.Generator) -> None:
    """Warned: a motor with one test only is told what to ask next."""
    findings = agree(_campaign(resistance(MOTOR, rng), resistance(MOTOR, rng)))
    assert [f.code for f in findings] == ["one_test_only"]
    assert "`plan`" in findings[0].remedy
    assert "made-up-1" in findings[0].message


def test_one_direction_of_cogging(rng: np.random.Generator) -> None:
    """Warned: two captures, both forward; silent as soon as one goes back."""
    others = (resistance(MOTOR, rng), cogging(MOTOR, rng))
    findings = agree(_campaign(*others, cogging(MOTOR, rng)))
    assert [f.code for f in findings] == ["direction_coverage"]
    assert agree(_campaign(*others, cogging(MOTOR, rng, -1.0))) == ()


@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_both_directions_in_one_capture(sense: float, rng: np.random.Generator) -> None:
    """Silent: one capture that turns there and back, whichever way it starts."""
    capture = cogging(MOTOR, rng)
    angle = column(capture, "theta_mech_rad")
    there_and_back = sense * 2.0 * np.minimum(angle, angle[::-1])
    capture = with_column(capture, "theta_mech_rad", there_and_back)
    assert agree(_campaign(resistance(MOTOR, rng), capture)) == ()


def test_one_sign_of_torque(rng: np.random.Generator) -> None:
    """Warned: motoring only, over all torque maps of the motor together."""
    motoring = with_rows(torque_map(MOTOR, rng), np.arange(16000) >= 8000)
    braking = with_rows(torque_map(MOTOR, rng), np.arange(16000) < 8000)
    other = resistance(MOTOR, rng)
    assert [f.code for f in agree(_campaign(motoring, other))] == ["current_coverage"]
    assert agree(_campaign(motoring, braking, other)) == ()


def test_a_step_of_another_clock(rng: np.random.Generator) -> None:
    """Warned at the capture whose `t_s` is in milliseconds, and not at the other two."""
    steps = [current_step(MOTOR, rng) for _ in range(3)]
    steps[1] = with_column(steps[1], "t_s", 1e3 * column(steps[1], "t_s"))
    found = [f for f in agree(_campaign(*steps)) if f.code == "clock_contradiction"]
    assert [(f.file, f.severity) for f in found] == [("1_current_step.csv", "warning")]
    assert "t_s" in found[0].remedy
