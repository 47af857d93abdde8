"""A coupling that the transducer stands in, found from what whole logs show of it."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pipeline.criticism.diagnosis import diagnose
from pipeline.criticism.machine.two_masses import shown
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants
from pipeline.simulator.bench import CAMPAIGN, campaign
from pipeline.simulator.design import Bench
from tests.simulated import campaign_of, design
from tests.unit.criticism.test_torsion import SHARE, J, whole

TESTS = ("resistance_ab", "torque_map_slow", "torque_map_backward", "drive_0", "spin_down_forward")
BENCH = Bench(torque_in_coupling=True, encoder_bits=14)


def diagnosed(name, seed, **effects):
    """What is diagnosed from a few captures with the transducer between motor and dynamometer."""
    plan = tuple(step for step in CAMPAIGN if step[0] in TESTS)
    motor = replace(design(name), effects={}).having(**effects)
    found = campaign_of(campaign(motor, BENCH, seed, plan))
    return diagnose(found, ModelSpec(), Constants())


SPRING = {"compliance": {"load_fraction": 0.7, "damping_ratio": 0.05}}
PLAY = {"backlash": 0.006}


@pytest.mark.parametrize(
    ("name", "hidden", "share"),
    [
        pytest.param("servo-ipm", SPRING, 0.7, marks=pytest.mark.slow),
        pytest.param("gimbal-5208", SPRING, 0.7, marks=pytest.mark.slow),
        pytest.param("gimbal-5208", PLAY, 0.5, marks=pytest.mark.slow),
        pytest.param("servo-ipm", PLAY, 0.5, marks=pytest.mark.slow),
    ],
)
def test_a_transducer_in_the_coupling_shows_what_is_behind_it(name, hidden, share):
    found = diagnosed(name, 5, **hidden)
    (effect,) = hidden
    assert found.missing == (effect,)
    assert found.ladder[-1].parameters[f"{effect}.share"][0] == pytest.approx(share, abs=0.02)
    if hidden is PLAY:
        gap = found.ladder[-1].parameters["backlash.gap_rad"][0]
        assert gap == pytest.approx(0.006, rel=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["gimbal-5208", pytest.param("servo-ipm", marks=pytest.mark.slow)])
def test_a_rigid_shaft_on_the_same_bench_is_quiet(name):
    assert diagnosed(name, 6).missing == ()


@pytest.mark.parametrize(("gap", "name"), [(0.003, "backlash"), (0.0, "compliance")])
def test_whole_logs_give_the_far_inertia_without_a_fit(gap, name):
    """Whatever inertia the fit has of the motor's side: the share follows from it."""
    log = whole(gap, 0.004, True)
    for near in (1.0 - SHARE, 0.5 * (1.0 - SHARE)):
        base = {**log.x.base, "j_kgm2": near * J}
        seen = shown([replace(log, x=replace(log.x, base=base))] * 2)
        assert seen is not None and seen.discrimination.name == name
        assert seen.base["j_kgm2"] == pytest.approx((near + SHARE) * J, rel=0.02)
        assert seen.discrimination.values["share"][0] == pytest.approx(
            SHARE / (near + SHARE), rel=0.02
        )


def test_a_load_shows_no_far_part():
    assert shown([whole(0.003, 0.004, False)] * 2) is None
    assert shown([]) is None
