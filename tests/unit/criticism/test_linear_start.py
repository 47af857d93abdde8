"""A soft coupling found from its own start, on a dynamometer that gives way."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from pipeline.criticism.diagnosis import diagnose
from pipeline.criticism.library.registry import effects
from pipeline.criticism.machine.model import Model
from pipeline.criticism.machine.two_masses import (
    far_drag,
    inertia_scale,
    linear_far_drag,
    passed_on,
    spring_of,
    spring_twist,
)
from pipeline.criticism.regression.fit import Fit
from pipeline.criticism.selection import starts
from pipeline.criticism.selection.candidates import Candidate
from pipeline.criticism.selection.score_test import Score
from pipeline.criticism.selection.starts import _by_choices
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants
from pipeline.simulator.bench import CAMPAIGN, campaign
from pipeline.simulator.design import Bench
from tests.simulated import campaign_of, design
from tests.unit.criticism.machines import BASE, machine, operating

TESTS = ("resistance_ab", "torque_map_slow", "torque_map_backward", "drive_0", "spin_down_forward")
MOTORS = [("gimbal-5208", 65.0, 0.8, 14.0), ("servo-ipm", 120.0, 0.7, 9.0)]
MOTORS = [*MOTORS, ("joint-11p", 85.0, 0.6, 18.0)]
"""Motor, resonance [Hz], share of the inertia beyond it [1], bandwidth of the dynamometer [Hz]."""


def ladder(name, dyno_hz, seed, **effects):
    """What is diagnosed from a few captures on a bench that shows the reaction torque."""
    plan = tuple(step for step in CAMPAIGN if step[0] in TESTS)
    motor = replace(design(name), effects={}).having(**effects)
    found = campaign_of(campaign(motor, Bench(dyno_hz=dyno_hz), seed, plan))
    return diagnose(found, ModelSpec(), Constants())


def softness(name, resonance_hz, share):
    """Of a spring [rad/(N·m)] on which both parts ring at a frequency."""
    reduced = design(name).j_rotor_kgm2 * share * (1.0 - share)
    return 1.0 / (reduced * (2.0 * math.pi * resonance_hz) ** 2)


@pytest.mark.parametrize(
    ("name", "resonance_hz", "share", "dyno_hz"),
    [pytest.param(*one, marks=pytest.mark.slow) for one in MOTORS],
)
def test_most_inertia_behind_a_soft_shaft_is_found_with_its_size(
    name, resonance_hz, share, dyno_hz
):
    soft = softness(name, resonance_hz, share)
    found = ladder(name, dyno_hz, 3, compliance={"size": soft, "load_fraction": share})
    assert found.missing == ("compliance",)
    assert found.ladder[-1].parameters["compliance.share"][0] == pytest.approx(share, rel=0.08)
    assert found.ladder[-1].held_out < 0.1 * found.ladder[0].held_out


@pytest.mark.parametrize(
    "motor", [MOTORS[0], *(pytest.param(one, marks=pytest.mark.slow) for one in MOTORS[1:])]
)
def test_a_stiff_shaft_on_the_same_bench_is_quiet(motor):
    name, _, _, dyno_hz = motor
    assert ladder(name, dyno_hz, 4).missing == ()


@pytest.mark.slow
@pytest.mark.parametrize(("name", "resonance_hz"), [("gimbal-5208", 60.0), ("joint-11p", 55.0)])
def test_a_far_end_that_a_stiff_dynamometer_holds_is_found_from_the_same_start(name, resonance_hz):
    """The linear form is that of a dynamometer that gives way; the transducer stands elsewhere.

    The second coupling rings so long in a torque map that a spring without damping misses it.
    """
    soft = softness(name, resonance_hz, 0.38)
    found = ladder(name, 0.0, 3, compliance={"size": soft, "load_fraction": 0.38})
    assert found.missing == ("compliance",)
    assert found.ladder[-1].parameters["compliance.share"][0] == pytest.approx(0.38, rel=0.02)
    assert found.ladder[-1].held_out < 0.7 * found.ladder[0].held_out


def test_a_start_is_tried_with_the_transducer_wherever_it_may_stand():
    model = Model(machine(), (effects()["compliance"],))
    spring = {"share": 0.4, "twist_rad": 0.02, "damping_s": 0.0, "between": -1.0}
    spring |= {"far_friction": 0.0}
    values = {**BASE, **{f"compliance.{name}": value for name, value in spring.items()}}
    starts = _by_choices(Fit((), model, values, (), values))
    assert [one.values["compliance.between"] for one in starts] == [0.0, 1.0, -1.0]
    assert all(one.values["compliance.share"] == 0.4 for one in starts)


def ringing():
    """A motor's side that shakes at 40 and 90 Hz under a torque of both."""
    t = 5e-5 * np.arange(3000)
    angle = 0.02 * np.sin(2 * math.pi * 40 * t) + 0.004 * np.cos(2 * math.pi * 90 * t)
    torque = 0.8 * np.sin(2 * math.pi * 40 * t + 0.4) + 0.3 * np.sin(2 * math.pi * 90 * t)
    return replace(operating(t.size), theta_rad=angle, torque_em_nm=torque)


@pytest.mark.parametrize("late_s", [0.0, 2e-4])
def test_the_linear_form_is_the_spring_and_its_damper_and_gives_them_back(late_s):
    x, share, stiffness = ringing(), 0.7, 6.0
    j, torque = BASE["j_kgm2"], x.machine.scales["torque_nm"]
    soft = share * j / stiffness
    linear = {
        "torque_s2": soft,
        "angle_s2": soft * (1.0 - share) * j / inertia_scale(x.machine),
    }
    linear |= {"torque_s3": late_s * linear["torque_s2"], "angle_s3": late_s * linear["angle_s2"]}
    linear |= {"far_friction": 0.0}
    spring = {"share": share, "twist_rad": torque / stiffness, "damping_s": late_s}
    twist = spring_twist(x, spring, passed_on(x, share, 0.0))
    both = far_drag(x, share, -1.0, lambda: twist), linear_far_drag(x, linear)
    inside = slice(60, -60)
    assert both[1][inside] == pytest.approx(both[0][inside], rel=1e-6, abs=1e-9)
    assert np.abs(both[0][inside]).max() > 0.01
    found = spring_of(linear, {"j_kgm2": j}, x.machine)
    assert found == pytest.approx({**spring, "far_friction": 0.0, "between": -1.0})


@pytest.mark.parametrize(("soft", "bent"), [(-1e-6, 1e-6), (1e-6, -1e-6), (1e-6, 1.0)])
def test_no_two_masses_have_such_parameters(soft, bent):
    x = operating(4)
    undamped = {"torque_s3": 0.0, "angle_s3": 0.0, "far_friction": 0.0}
    assert spring_of({"torque_s2": soft, "angle_s2": bent, **undamped}, BASE, x.machine) is None


def test_what_moves_is_counted_from_the_fit_that_there_is(monkeypatch):
    """By other noise floors the fit without the coupling has another inertia. From its own, a
    refit began at a thousandth of the inertia that was found.
    """
    there, anew, found = ({"j_kgm2": j} for j in (8e-4, 1.2e-3, 3.6e-4))
    fits = [
        SimpleNamespace(fit=Fit((), None, values, (), values)) for values in (there, anew, found)
    ]
    wide, refitted, end = fits
    made = Score(Candidate(effects()["compliance"], ()), 30.0, 10.0, {}, {}, 1.0, 2.0, policy=None)
    monkeypatch.setattr(starts, "_reweighted", lambda *_: refitted)
    monkeypatch.setattr(
        starts,
        "score_between",
        lambda base, end, _: replace(made, moves=starts._moves(base.fit, end.fit)),
    )
    score = starts._score_of(wide, made.candidate, end)
    assert score.moves["j_kgm2"] == pytest.approx(3.6e-4 - 8e-4)
