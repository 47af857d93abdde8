"""Changes between two datasheets, against sums done by hand."""

from __future__ import annotations

import math

import pytest

from pipeline.records.difference import Change, changes
from pipeline.records.estimate import Estimate, not_identifiable
from pipeline.records.uncertainty import type_a, type_b


def resistance(value: float, scatter: float, instrument: float, station: str = "rig-1") -> Estimate:
    budget = type_a("scatter:resistance:r", scatter) + type_b(f"voltage@{station}", instrument)
    return Estimate("r_phase_ohm", value, "ohm", "measured", "resistance", budget)


def test_change_in_units_of_combined_uncertainty() -> None:
    """u1 = (3, 4) and u2 = (5, 12) mohm: 5 and 13, together sqrt(194) = 13.928."""
    change = Change("r", resistance(0.300, 0.003, 0.004), resistance(0.340, 0.005, 0.012))
    assert change.change == pytest.approx(0.040)
    assert change.in_u == pytest.approx(40.0 / math.sqrt(194.0))


def test_one_instrument_cancels_in_the_difference_and_scatter_does_not() -> None:
    """Scatter 3 and 4, one gain of 12 and 12 mohm: u_d = 5; on two stations sqrt(25 + 288)."""
    one, other = resistance(0.300, 0.003, 0.012), resistance(0.310, 0.004, 0.012)
    assert Change("r", one, other).in_u_of_difference == pytest.approx(2.0)
    elsewhere = resistance(0.310, 0.004, 0.012, station="rig-2")
    assert Change("r", one, elsewhere).in_u_of_difference == pytest.approx(10.0 / math.sqrt(313.0))


def test_whole_numbers_without_uncertainty() -> None:
    seven = Estimate("pole_pairs", 7, "1", "measured", "open_circuit")
    eight = Estimate("pole_pairs", 8, "1", "measured", "open_circuit")
    assert Change("p", seven, eight).in_u == math.inf
    assert Change("p", eight, seven).in_u == -math.inf
    assert Change("p", seven, seven).in_u == 0.0


def test_what_came_went_or_is_unknown_has_no_change() -> None:
    known, unknown = resistance(0.3, 1e-3, 0.0), not_identifiable("r_phase_ohm", "ohm", "r", "spin")
    told = changes({"r": known, "a": known}, {"r": unknown, "z": known})
    assert [change.name for change in told] == ["a", "r", "z"]
    assert [(change.change, change.in_u, change.in_u_of_difference) for change in told] == [
        (None, None, None)
    ] * 3
