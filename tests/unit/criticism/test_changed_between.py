"""Friction or a magnet that is another in one kind of test than in the others."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest

from pipeline.criticism.data.machine_scale import machine_of
from pipeline.criticism.diagnosis import diagnose
from pipeline.criticism.machine.model import COAST_SHARES, OPEN_FLUX
from pipeline.criticism.residuals.segments import segments
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants
from pipeline.simulator.bench import CAMPAIGN, campaign
from pipeline.simulator.design import Bench
from tests.simulated import campaign_of, design

TESTS = (
    *("resistance_ab", "open_circuit_forward", "open_circuit_backward_warm"),
    *("torque_map_slow", "drive_0"),
)


def recorded(test, plan=TESTS, **factors):
    """A campaign in which some fields of the motor are others in one kind of test."""
    motor = replace(design("gimbal-5208"), effects={})
    changed = {"changed": {name: f * getattr(motor, name) for name, f in factors.items()}}
    chosen = tuple(
        (stem, kind, {**how, **(changed if kind == test else {})})
        for stem, kind, how in CAMPAIGN
        if stem in plan or kind == "spin_down"
    )
    return campaign_of(campaign(motor, Bench(), 6, chosen))


def sizes(note):
    """Signed shares [%] in a note, in its order."""
    found = re.findall(r"is ([\d.]+) ± [\d.e+-]+ % (higher|lower)", note)
    return [float(size) * (1.0 if sense == "higher" else -1.0) for size, sense in found]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("dry", "viscous"), [(1.02, 1.02), pytest.param(0.98, 0.985, marks=pytest.mark.slow)]
)
def test_friction_that_repeats_to_some_percent_is_no_change(dry, viscous):
    """With shares of no size it is `unknown`, as if something had changed between the tests."""
    found = recorded("spin_down", torque_coulomb_nm=dry, b_visc_nm_s_rad=viscous)
    result = diagnose(found, ModelSpec(), Constants())
    assert (result.verdict, result.missing) == ("adequate", ())


def test_a_bearing_that_was_cold_in_the_coasts_is_told_with_its_size():
    """Its viscous drag, 40 % more, is less than what half a microsecond between a current's sample
    and its mean is in proportion to speed.
    """
    found = recorded("spin_down", torque_coulomb_nm=1.2, b_visc_nm_s_rad=1.4)
    result = diagnose(found, ModelSpec(), Constants())
    assert (result.verdict, result.missing) == ("unknown", ())
    assert sizes(next(note for note in result.notes if "dry friction" in note)) == [
        pytest.approx(20.0, abs=1.5)
    ]


@pytest.mark.slow
def test_a_magnet_that_lost_flux_after_the_open_circuit_tests_is_no_clock():
    """It was told as a clock of the open-circuit tests that runs 5 % fast."""
    found = recorded("open_circuit", psi_pm_wb=1.05)
    result = diagnose(found, ModelSpec(), Constants())
    assert (result.verdict, result.missing) == ("unknown", ())
    note = next(note for note in result.notes if note.startswith("psi_wb is"))
    assert sizes(note) == [pytest.approx(5.0, abs=0.3)]
    assert "open_circuit_backward_warm.mcap, open_circuit_forward.mcap" in note


@pytest.mark.parametrize(
    ("plan", "coasts", "spins"),
    [((), False, False), (("open_circuit_forward",), False, False), (TESTS, True, True)],
)
def test_a_test_that_nothing_stands_beside_has_no_share(plan, coasts, spins):
    """Of coasts alone, friction over inertia is known as well as the coasts show it."""
    found = recorded("", plan)
    made = segments(found, machine_of(found, Constants()))
    of = {segment.test: segment.fixed for segment in made}
    assert all((name in of["spin_down"]) == coasts for name in COAST_SHARES)
    assert (OPEN_FLUX in of.get("open_circuit", {})) == spins
