"""What the captures of one motor say against each other."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from pipeline.contracts import motor
from pipeline.records.capture import Campaign, Capture
from tests.unit.contracts.test_gate_limits import capture


def test_time_constants_of_steps_count_where_there_is_an_edge() -> None:
    """t_s a hundred times slower is named; with two of each, both are, the usual in between."""
    t = np.arange(-2000, 8000)
    current = np.where(t > 0, -np.expm1(-t / 1000.0), 0.0)

    def step(scale, path):
        return capture("current_step", path=path, ia_a=current, t_s=t * 1e-6 * scale)

    flat = capture("current_step", path="flat.csv", ia_a=np.full(9, 2.0), t_s=np.arange(9.0))
    assert motor._settling_s(step(1.0, "a")) == pytest.approx(1e-3, rel=0.01)
    assert motor._settling_s(flat) == math.inf
    made = (step(1.0, "a.csv"), step(1.0, "b.csv"), step(130.0, "c.csv"), flat)
    found = [f for f in motor.agree(Campaign("m", made)) if f.code == "clock_contradiction"]
    assert [f.file for f in found] == ["c.csv"]
    assert "settles in 0.13 s, where 0.000999 s is usual" in found[0].message


def test_what_captures_state_differently_is_named() -> None:
    def stated(path, value):
        extra = {} if value is None else {"r_phase_ohm": f"{value}", "u_r_phase_ohm": "0.01"}
        return capture("drive", path=path, iq_a=1.0, meta={"extra": extra})

    made = (stated("a.csv", None), stated("b.csv", 0.5), stated("c.csv", 0.7), stated("d.csv", 0.5))
    found = [f for f in motor.agree(Campaign("m", made)) if f.code == "statement_contradiction"]
    assert [f.file for f in found] == ["c.csv"]
    assert "stated as 0.7, but as 0.5" in found[0].message
    assert "in b.csv and 1 more" in found[0].message


def held(path: str, *ends: float) -> Capture:
    """Angles held from one end to the next [turns]."""
    ways = [np.linspace(a, b, 200) for a, b in pairwise(ends)]
    return capture(
        "holding_current", path=path, theta_mech_rad=2.0 * np.pi * np.concatenate(ways), iq_a=1.0
    )


def directions(*captures: Capture) -> list[str]:
    found = motor.agree(Campaign("m", captures))
    return [f.file for f in found if f.code == "direction_coverage"]


@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_both_senses_of_holding_may_be_in_one_capture_or_in_two(sense: float) -> None:
    """Less than half of the way back, over all captures of the motor, is one sense alone."""
    assert directions(held("a", 0.0, sense), held("b", sense, 0.0)) == []
    assert directions(held("a", 0.0, sense, 0.48 * sense)) == []
    assert directions(held("a", 0.0, sense, 0.52 * sense)) == ["a"]
    assert directions(held("a", 0.0, sense), held("b", 0.0, sense)) == ["a"]
