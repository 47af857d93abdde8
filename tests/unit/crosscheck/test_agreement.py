"""Captures of two motors under one name are parted and named; those of one motor never are."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest

from pipeline.crosscheck.agreement import disagreements, failing, findings, parties, suspects
from pipeline.crosscheck.registry import check_all
from pipeline.records.agreement import Disagreement, Reading
from pipeline.records.capture import Campaign
from pipeline.records.constants import Constants
from pipeline.records.uncertainty import type_a, type_b

SPIN, MAP = ("open_circuit",), ("torque_map",)


def reading(
    path: str,
    value: float,
    way: tuple[str, ...] = SPIN,
    quantity: str = "p·psi",
    u_rel: float = 1e-4,
    gain_rel: float = 0.01,
    station: str = "north",
    model: float = 0.005,
) -> Reading:
    """A reading with scatter of its own and a gain that its station's captures share."""
    scatter = type_a(f"scatter:x#{path}", u_rel * value)
    budget = scatter + type_b(f"voltage@{station}", gain_rel * value)
    return Reading(quantity, way, path, value, "V·s/rad", budget, model)


def only(readings: Sequence[Reading]) -> Disagreement:
    (found,) = disagreements(readings)
    return found


def test_two_motors_in_one_folder_were_told_as_a_six_step_convention() -> None:
    """Published: Kt over Ke 1.037 +- 0.006, told as 1.0472; the spins are of two motors.

    A gain of 1 % that all share does not hide 3.7 %.
    """
    own = [reading("a/spin_0", 0.1000), reading("a/spin_1", 0.1003), reading("a/spin_2", 0.0998)]
    found = only([*own, reading("b/spin_0", 0.1037), reading("b/spin_1", 0.1039)])
    assert found.odd_paths == ("b/spin_0", "b/spin_1")
    assert found.usual.paths == ("a/spin_0", "a/spin_1", "a/spin_2")
    (told,) = findings([found])
    assert told.file == "b/spin_0"
    assert "b/spin_0, b/spin_1 (2 files) agree with each other and not with the other 3" in (
        told.message
    )
    checks = {c.name: c for c in check_all(Constants(), Campaign("m", ()), {}, [found])}
    check = checks["kt_vs_ke"]
    assert check.status == "fail"
    assert check.value == pytest.approx(1.0381, abs=1e-3)
    assert "another motor" in (check.suspect or "")
    assert "1.0472" not in (check.suspect or "")
    assert checks["resistance_balance"].status == "not_evaluated"


def test_a_gain_that_two_stations_do_not_share_is_allowed_for() -> None:
    """3.7 % between benches of 1 % each is 2.5 standard uncertainties; within a bench it is not."""
    north = [reading(f"n{k}", 0.1) for k in range(3)]
    south = [reading(f"s{k}", 0.1037, station="south") for k in range(3)]
    assert disagreements([*north, *south]) == ()
    assert disagreements([*north, *(reading(r.path, r.value) for r in south)]) != ()


@pytest.mark.parametrize(("deviates", "parted"), [(3.85, False), (3.93, True)])
def test_two_readings_have_one_degree_of_freedom(deviates: float, parted: bool) -> None:
    """One in ten thousand of a normal deviate is beyond 3.891 of it, either sign."""
    half = 0.5 * deviates * math.sqrt(2.0) * 0.1 * math.hypot(1e-4, 0.005)
    found = disagreements([reading("one", 0.1 - half), reading("two", 0.1 + half)])
    assert bool(found) is parted


@pytest.mark.parametrize("seed", range(200))
def test_one_motor_is_never_two(seed: int) -> None:
    """Readings that scatter as their budgets and methods say, over stations and quantities."""
    noise = np.random.default_rng(seed)
    gains = {name: noise.normal(0.0, 0.01) for name in ("north", "south")}
    drawn = []
    for k in range(12):
        station = ("north", "south")[k % 2]
        rel = noise.normal(0.0, 0.005) + noise.normal(0.0, 1e-3) + gains[station]
        one = reading(f"c{k}", 0.1 * (1.0 + rel), u_rel=1e-3, station=station)
        drawn.append(one)
    assert disagreements(drawn) == ()


def test_a_drift_is_no_second_motor() -> None:
    """A magnet that warms from capture to capture spreads its readings evenly over 8 %."""
    assert disagreements([reading(f"c{k}", 0.1 * (1.0 - 0.01 * k)) for k in range(9)]) == ()


def test_a_convention_between_two_ways_is_left_to_the_checks() -> None:
    """Torque maps and spins that differ by 2/sqrt(3): no capture of one way is odd."""
    spins = [reading(f"s{k}", 0.1) for k in range(3)]
    maps = [reading(f"m{k}", 0.11547, MAP) for k in range(3)]
    assert disagreements([*spins, *maps]) == ()


def test_captures_of_other_ways_join_the_motor_they_lie_near() -> None:
    spins = [reading("a/spin", 0.1), reading("b/spin", 0.12)]
    maps = [reading("a/map_0", 0.1005, MAP), reading("a/map_1", 0.0996, MAP)]
    found = only([*spins, *maps])
    assert found.usual.paths == ("a/map_0", "a/map_1", "a/spin")
    assert found.odd_paths == ("b/spin",)
    assert not found.tied


def test_three_motors_are_three_groups() -> None:
    values = {"a0": 0.1, "a1": 0.1, "b0": 0.13, "b1": 0.13, "c0": 0.2}
    found = only([reading(path, value) for path, value in values.items()])
    assert [group.paths for group in found.odd] == [("b0", "b1"), ("c0",)]


def test_one_against_one_accuses_neither_until_another_quantity_decides() -> None:
    tied = only([reading("a/spin", 0.1), reading("b/spin", 0.12)])
    assert tied.tied
    assert suspects([tied]) == "a/spin against b/spin: of two motors?"
    ohms = [reading(p, 1.0, ("r",), "r_phase_ohm") for p in ("b/r_0", "b/spin", "b/r_1")]
    decided = disagreements([reading("a/r", 1.2, ("r",), "r_phase_ohm"), *ohms])
    assert parties([tied, *decided]) == (["b/r_0", "b/r_1", "b/spin"], ["a/r", "a/spin"])


def test_the_value_of_a_failing_check_is_the_groups_ratio() -> None:
    found = only([reading("a", 0.1), reading("b", 0.1), reading("c", 0.05)])
    check = failing("kt_vs_ke", [found])
    assert check.value == pytest.approx(0.5)
    assert check.limit is not None
    assert 0.0 < check.limit < abs(math.log(0.5))
