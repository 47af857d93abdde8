"""A spring between two masses, from the angle and the current of a free shaft alone."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import pipeline
from pipeline.criticism.data.drive_log import drive_log
from pipeline.criticism.data.unlogged_load import unexplained_share
from pipeline.criticism.diagnosis import base_fit
from pipeline.criticism.library.registry import effects
from pipeline.criticism.machine.model import zero
from pipeline.criticism.machine.two_masses import far_drag, linear_far_drag, passed_on, reach
from pipeline.criticism.operating import ShaftState
from pipeline.criticism.regression.goodness import significant_groups
from pipeline.criticism.regression.linear_system import LinearSystem, linear_system
from pipeline.criticism.selection.candidates import candidates, widened
from pipeline.criticism.selection.discrimination import discriminate
from pipeline.criticism.selection.refit import begin_from
from pipeline.criticism.selection.score_test import Score
from pipeline.criticism.selection.starts import with_linear_start
from pipeline.execution.tasks.start import start_constants
from pipeline.records.comparison import ModelSpec
from pipeline.simulator.bench import campaign
from pipeline.simulator.design import Bench
from pipeline.simulator.effects import parameters
from tests.simulated import campaign_of, design
from tests.unit.criticism.machines import operating

MOTOR = replace(design("servo-15kw"), effects={})
SOFT = {"load_fraction": 0.35, "damping_ratio": 0.02}
PLAN = (
    ("open_circuit", "open_circuit", {}),
    ("drive_0", "drive", {"load": 0.0}),
    ("drive_1", "drive", {"load": 0.0}),
)


VERY_SOFT = {**SOFT, "size": 1.0 / (MOTOR.j_rotor_kgm2 * 0.35 * 0.65 * (2.0 * np.pi * 15.0) ** 2)}
"""Both parts ring at 15 Hz."""
STICKY = replace(MOTOR, torque_coulomb_nm=0.1 * MOTOR.torque_rated_nm)


def free_campaign(motor):
    """A spin and two logs of a shaft without a transducer."""
    whole = campaign_of(campaign(motor, Bench(encoder_bits=15), 8, PLAN))
    captures = [
        replace(one, tables=tuple(t.drop("torque_shaft_nm", strict=False) for t in one.tables))
        for one in whole.captures
    ]
    return replace(whole, captures=tuple(captures))


@cache
def base(coupled: bool, very: bool = False) -> LinearSystem:
    """The fit of a rigid shaft to logs of current, voltage and angle, of two masses or of one."""
    soft = STICKY.having(compliance=VERY_SOFT) if very else MOTOR.having(compliance=SOFT)
    motor = soft if coupled else MOTOR
    free = free_campaign(motor)
    fitted = base_fit(free, ModelSpec("standard"), start_constants(free))
    assert not isinstance(fitted, str)
    return fitted.system


def coupling(system: LinearSystem) -> Score | None:
    """The score of compliance, begun from its linear form."""
    only = {"compliance": effects()["compliance"]}
    offered = candidates(only, system.fit.model)
    wide = widened(system.fit, offered)
    return next(iter(with_linear_start(wide, offered, (), significant_groups(wide))), None)


@pytest.mark.slow
def test_the_motion_of_a_free_shaft_shows_share_and_stiffness():
    score = coupling(base(coupled=True))
    assert score is not None
    assert score.passes
    full = parameters("compliance", MOTOR, SOFT)
    torque = base(coupled=True).fit.machine.scales["torque_nm"]
    assert score.step["compliance.share"] == pytest.approx(0.35, abs=0.02)
    twist = score.candidate.values["compliance.twist_rad"]
    assert twist == pytest.approx(full["size"] * torque, rel=0.05)


@pytest.mark.slow
def test_a_very_soft_coupling_passes_on_what_friction_leaves_of_the_torque():
    """A step of friction at a reversal is not in the coupling. With it, half the twist was found,
    and the deviance rose by 96.
    """
    system = base(coupled=True, very=True)
    score = coupling(system)
    assert score is not None
    assert score.passes
    assert score.step["compliance.share"] == pytest.approx(0.35, abs=0.02)
    twist = score.candidate.values["compliance.twist_rad"]
    torque = system.fit.machine.scales["torque_nm"]
    assert twist == pytest.approx(VERY_SOFT["size"] * torque, rel=0.1)
    assert score.candidate.values["compliance.far_friction"] < 0.3
    begun = begin_from(system.fit, score)
    assert begun.values["j_kgm2"] == pytest.approx(STICKY.j_rotor_kgm2, rel=0.05)


def test_friction_moves_what_a_coupling_passes_on() -> None:
    """The column of friction is the slope of the residual, that through the coupling included."""
    fit, effect = base(coupled=True, very=True).fit, effects()["compliance"]
    torque = fit.machine.scales["torque_nm"]
    soft = {"compliance.share": 0.35, "compliance.twist_rad": VERY_SOFT["size"] * torque}
    model = fit.model.with_effects(effect)
    coupled = replace(fit, model=model).at({**zero(effect, model), **soft})
    system = linear_system(coupled)
    for name, step in (("coulomb_friction.torque_nm", 1e-4), ("b_nm_s_rad", 1e-7)):
        moved = linear_system(coupled.at({name: coupled.values[name] + step}))
        (place,) = (n for n, c in enumerate(system.columns) if c.name == name)
        slope = (moved.residual - system.residual) / step
        assert system.matrix[:, place] == pytest.approx(slope, abs=0.01 * np.abs(slope).max())


def test_a_soft_coupling_with_friction_is_no_load_that_nothing_recorded() -> None:
    """A coupling of 12 Hz was never tried: its motion was taken for that of a load."""
    machine = base(coupled=True, very=True).fit.machine
    drives = free_campaign(STICKY.having(compliance=VERY_SOFT)).of("drive")
    logs = [drive_log(one, machine) for one in drives]
    shares = [unexplained_share(one, machine) for one in logs if one is not None]
    assert max(shares) < 1e-3


@pytest.mark.slow
def test_a_rigid_shaft_has_none_and_is_at_its_floor():
    system = base(coupled=False)
    assert coupling(system) is None
    assert not significant_groups(system).any()
    assert system.fit.values["j_kgm2"] == pytest.approx(MOTOR.j_rotor_kgm2, rel=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("coupled", "name"), [(True, "compliance"), pytest.param(False, None, marks=pytest.mark.slow)]
)
def test_whole_logs_without_a_transducer_say_whether_the_shaft_twists(coupled, name):
    fit, effect = base(coupled).fit, effects()["compliance"]
    twist = parameters("compliance", MOTOR, SOFT)["size"] * fit.machine.scales["torque_nm"]
    soft = {"compliance.share": 0.35, "compliance.twist_rad": twist}
    model = fit.model.with_effects(effect)
    with_twist = replace(fit, model=model).at({**zero(effect, model), **soft})
    found = discriminate(with_twist, effect)
    assert found is not None and found.name == name


def finer(x, points):
    """A state of the same samples at some points each, on straight lines."""
    at = np.arange(x.theta_rad.size * points) / points
    places = np.arange(x.theta_rad.size)
    fine = {
        name: np.interp(at, places, getattr(x, name))
        for name in ("theta_rad", "omega_rad_s", "torque_em_nm")
    }
    return replace(x, shaft=ShaftState(alone=True, finer=points), cache={}, **fine)


def test_a_state_of_more_points_a_sample_has_the_same_coupling():
    t = 1e-4 * np.arange(300)
    x = replace(
        operating(t.size),
        theta_rad=20.0 * t + 1e-3 * np.sin(400.0 * t),
        torque_em_nm=np.cos(300.0 * t),
        ts_s=1e-4,
        shaft=ShaftState(alone=True),
    )
    fine = finer(x, 3)
    assert passed_on(fine, 0.4, 0.0) == pytest.approx(passed_on(x, 0.4, 0.0))
    q = {"torque_s2": 1e-5, "angle_s2": 2e-5, "torque_s3": 1e-9, "angle_s3": 2e-9}
    q |= {"far_friction": 0.0}
    assert linear_far_drag(fine, q)[::3] == pytest.approx(linear_far_drag(x, q))
    twist = 1e-4 * np.sin(350.0 * t)
    assert far_drag(fine, 0.4, 1.0, lambda: twist)[::3] == pytest.approx(
        far_drag(x, 0.4, 1.0, lambda: twist)
    )


@pytest.mark.parametrize("period_s", [5e-5, 1e-4, 1e-3])
def test_a_drag_of_two_masses_reaches_so_far_and_no_farther(period_s):
    t = period_s * np.arange(201)
    x = replace(
        operating(t.size),
        theta_rad=np.zeros(t.size),
        torque_em_nm=(np.arange(t.size) == 100) * 1.0,
        ts_s=period_s,
        shaft=ShaftState(alone=True),
    )
    by_torque = {"torque_s2": 1e-5, "angle_s2": 0.0, "torque_s3": 1e-9, "angle_s3": 0.0}
    by_torque |= {"far_friction": 0.0}
    moved = np.flatnonzero(linear_far_drag(x, by_torque))
    far = reach(period_s, x.machine.policy.torsion) - 1
    assert moved.min() == 100 - far
    assert moved.max() == 100 + far


def test_some_samples_of_it_are_a_state_of_their_own():
    x = finer(replace(operating(60), torque_em_nm=np.ones(60)), 4)
    some = x.at(np.arange(20))
    some.torque_em_nm = np.ones(20)
    assert passed_on(some, 0.4, 0.0).size == 20


def test_without_a_transducer_it_does_not_matter_where_one_would_stand():
    t = 1e-4 * np.arange(300)
    x = replace(operating(t.size), theta_rad=np.sin(90.0 * t), torque_em_nm=np.cos(300.0 * t))
    alone = replace(x, shaft=ShaftState(alone=True))
    q = {"share": 0.3, "twist_rad": 0.01, "damping_s": 0.0, "far_friction": 0.0}
    drags = [
        effects()["compliance"].torque(alone, q | {"between": one}) for one in (1.0, 0.0, -1.0)
    ]
    assert drags[0] == pytest.approx(drags[2])
    assert drags[1] == pytest.approx(drags[2])
    between = effects()["compliance"].torque(x, q | {"between": 1.0})
    assert np.abs(between - drags[2]).max() > 0.1 * np.abs(drags[2]).max()


SPRING = parameters("compliance", design("servo-ipm"), {})["size"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "spring"),
    [
        ("servo-ipm", {}),
        ("servo-ipm", {"size": 0.1 * SPRING, "load_fraction": 0.4}),
        ("gimbal-5208", None),
    ],
)
def test_telemetry_without_a_transducer_names_a_spring_and_nothing_else(name, spring):
    """A fast motor that hides nothing named iron_eddy: its torque lacked the vector's ripple.

    Of a stiff spring the captures show share and twist as a product only, so that the share ends at
    its bound. That it twists is sure all the same.
    """
    motor = replace(design(name), effects={})
    motor = motor if spring is None else motor.having(compliance=spring)
    plan = (("resistance_ab", "resistance", {"pair": "ab"}), *PLAN, ("drive_2", *PLAN[2][1:]))
    whole = campaign_of(campaign(motor, Bench(), 3, plan))
    captures = tuple(
        replace(one, tables=tuple(t.drop("torque_shaft_nm", strict=False) for t in one.tables))
        for one in whole.captures
    )
    free = pipeline.Recordings({whole.motor_id: replace(whole, captures=captures)})
    (found,) = pipeline.diagnose(free).motors.values()
    assert found.missing == (() if spring is None else ("compliance",))


@pytest.mark.slow
def test_a_coupling_that_is_asked_for_is_fitted_as_a_search_fits_it() -> None:
    """Its step in a search leaves 5 of 463 noise floors. Asked for, it stayed at 69; and of a motor
    of the second bench at 159, where a search comes to 0.7.
    """
    free = free_campaign(STICKY.having(compliance=VERY_SOFT))
    recordings = pipeline.Recordings({free.motor_id: free})
    (asked,) = pipeline.compare(recordings, effects=["compliance"]).motors.values()
    assert asked.held_out < 6.0
    assert asked.parameters["compliance.share"].value == pytest.approx(0.35, abs=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("floors", [2.0, 8.0])
def test_a_start_is_tried_wherever_the_torque_is_over_its_floor(floors):
    """A log of 1 kHz missed by 5 floors, and one of 4 kHz by 1.2: under a limit of 20 no start was
    tried, and a coupling of 80 Hz was `unknown`.
    """
    system = base(coupled=True)
    over = np.sqrt(system.reduced_chi2(system.residual).max()) / floors
    fit = replace(system.fit, sigma=tuple(over * sigma for sigma in system.fit.sigma))
    score = coupling(linear_system(fit))
    assert score is not None
    assert score.step["compliance.share"] == pytest.approx(0.35, abs=0.02)
