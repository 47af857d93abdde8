"""Turns by hand, put together."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pipeline.estimation.electrical.hand_turns import Turn as Turn_
from pipeline.estimation.estimators import (
    hand_turn,
)
from pipeline.records.constants import Constants
from tests.unit.estimation.signals import capture, known_value


def turn_of(name, psi, u, *, channel="vab_v", dof=math.inf, cycles=7.0, temp=25.0, **meta):
    made = capture("hand_turn", name, t_s=np.arange(2.0), temp_magnet_degc=np.full(2, temp), **meta)
    return made, Turn_(channel, cycles, psi, u, dof, np.arange(2.0), np.zeros(2), np.zeros(0))


def flux_of_turns(turns):
    options = hand_turn.ESTIMATOR.options
    return hand_turn._flux(turns, Constants((known_value("temp_coeff_magnet_1_k", -0.001, 1e-4),)),
                           options)  # fmt: skip


def test_turns_that_agree_have_their_own_scatter() -> None:
    """Weights 1, 1/4, 1/4: u is that of the weighted mean."""
    turns = [turn_of("a", 0.010, 1e-4), turn_of("b", 0.010, 2e-4), turn_of("c", 0.010, 2e-4)]
    found = flux_of_turns(turns)
    assert found.number == pytest.approx(0.010)
    assert found.u_a == pytest.approx(1e-4 / math.sqrt(1.5))


def test_turns_that_differ_scatter_as_three_do() -> None:
    """Equal weights: sd of the mean of three, with two degrees of freedom."""
    values = np.array([0.0100, 0.0103, 0.0098])
    found = flux_of_turns([turn_of(f"{k}", v, 1e-6) for k, v in enumerate(values)])
    assert found.number == pytest.approx(values.mean())
    scatter = next(p for p in found.budget if p.kind == "A")
    assert scatter.u == pytest.approx(math.sqrt(np.mean((values - values.mean()) ** 2) / 2.0))
    assert scatter.dof == 2.0


def test_a_warm_turn_and_a_cold_one_come_to_25_degrees() -> None:
    """20 K above and 10 K below: the coefficient acts by the weighted excess of both."""
    turns = [turn_of("a", 0.98e-2, 1e-4, temp=45.0), turn_of("b", 1.01e-2, 2e-4, temp=15.0)]
    found = flux_of_turns(turns)
    values = 0.98e-2 / 0.98, 1.01e-2 / 1.01
    assert found.number == pytest.approx(0.8 * values[0] + 0.2 * values[1])
    parts = {p.source: p.u for p in found.budget}
    assert parts["test:temp_coeff_magnet_1_k"] == pytest.approx(-found.number * 14.0 * 1e-4)
    assert found.at["temp_measured_degc"] == pytest.approx(39.0)
    assert parts["voltage@s"] == pytest.approx(0.001 * found.number)


def test_the_count_of_a_turn_is_that_of_the_middle_channel() -> None:
    turns = [turn_of("a", 0.01, 1e-4, cycles=c) for c in (6.2, 7.0, 7.01)]
    assert hand_turn._pole_pairs(turns).value == 7
    odd = [turn_of("a", 0.01, 1e-4, cycles=c) for c in (6.2, 6.5, 7.0)]
    assert "6.500 electrical cycles a turn" in hand_turn._pole_pairs(odd).note
