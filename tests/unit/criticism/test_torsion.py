"""The law of a coupling's twist from whole logs, against two masses in steps of a µs."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numba import njit

from pipeline.criticism.effect import Discrimination, FullLog
from pipeline.criticism.library.registry import effects
from pipeline.criticism.machine.model import Model
from pipeline.criticism.machine.torsion import Law, Shaft, law_of_twist
from pipeline.criticism.machine.two_masses import _excluded, discriminator, side_of
from pipeline.criticism.policy.policy import DEFAULT
from pipeline.criticism.regression.columns import effect_columns
from pipeline.criticism.selection.discrimination import settled
from tests.unit.criticism.machines import BASE, machine, operating

TS = 5e-5
SHARE = 0.35
J = BASE["j_kgm2"]
NEAR, FAR = (1.0 - SHARE) * J, SHARE * J
ENCODER_RAD = 2 * math.pi / 2**17
U_TORQUE_NM = 1e-3
SECONDS = 1.6
STEPS_S = (0.0, 0.23, 0.41, 0.68, 0.87, 1.12, 1.33, SECONDS)
LOADS_NM = (0.06, -0.15, 0.1, 0.18, -0.09, 0.13, -0.18)


def driving(t):
    """Air-gap torque that turns its sign some sixty times [N·m]."""
    return 0.33 * np.sin(61.0 * t) + 0.21 * np.sign(np.sin(17.0 * t)) + 0.06


def load(t):
    return np.array(LOADS_NM)[np.searchsorted(STEPS_S[1:-1], t, side="right")]


@njit
def two_masses(driven, pull, gap, stiffness, rub):
    """Motor's angle and torque in the coupling [n, 2] under torque and load [n, fine].

    Half-implicit Euler at steps of a microsecond; a spring with a damper that pushes and
    never pulls, behind half a gap to each side.
    """
    half = 0.5 * gap
    step = TS / driven.shape[1]
    kept = np.zeros((driven.shape[0], 2))
    near, far, speed, far_speed = half, 0.0, 0.0, 0.0
    for n in range(driven.shape[0]):
        for k in range(driven.shape[1]):
            twist = near - far
            side = 1.0 if twist > 0 else -1.0
            through = 0.0
            if abs(twist) > half:
                through = stiffness * (twist - side * half) + rub * (speed - far_speed)
                if through * side < 0 and gap > 0:
                    through = 0.0
            if k == 0:
                kept[n] = near, through
            speed += step * (driven[n, k] - through) / NEAR
            far_speed += step * (through - pull[n, k]) / FAR
            near += step * speed
            far += step * far_speed
    return kept


@cache
def shaft(gap: float, softness: float):
    """Motor's angle and torque in the coupling [n]; what closes a gap damps more than a spring."""
    damping = 0.3 if gap else 0.05
    rub = 2.0 * damping * math.sqrt(NEAR * FAR / J / softness)
    fine = 40
    t = (TS / fine * np.arange(round(SECONDS / TS) * fine)).reshape(-1, fine)
    kept = two_masses(driving(t), load(t), gap, 1.0 / softness, rub)
    return kept[:, 0], kept[:, 1]


def told(gap: float, softness: float, between: bool, seed: int = 1) -> Law | None:
    """The law from a log with an encoder's rounding and a noisy torque."""
    one = whole(gap, softness, between, seed)
    driven = one.x.torque_em_nm
    assert driven is not None
    return law_of_twist(
        [
            Shaft(
                TS,
                one.x.theta_rad,
                one.shaft_nm if between else driven,
                one.shaft_nm if between else driven - one.shaft_nm,
                0.0 if between else NEAR,
                (FAR if between else J) * 1.01,
                one.u_theta_rad,
                U_TORQUE_NM if between else 0.0,
                U_TORQUE_NM,
                one.good,
            )
        ],
        DEFAULT.torsion,
    )


def whole(gap: float, softness: float, between: bool, seed: int = 1) -> FullLog:
    rng = np.random.default_rng(seed)
    angle, through = shaft(gap, softness)
    t = TS * np.arange(angle.size)
    theta = np.round(angle / ENCODER_RAD) * ENCODER_RAD
    told = (through if between else load(t)) + U_TORQUE_NM * rng.standard_normal(t.size)
    x = replace(operating(t.size), theta_rad=theta, torque_em_nm=driving(t))
    good = np.ones(t.size, dtype=bool)
    u_theta = ENCODER_RAD / math.sqrt(12)
    return FullLog(x, np.zeros(t.size), told, good, u_theta, U_TORQUE_NM, 0.0)


@pytest.mark.parametrize("between", [False, True])
@pytest.mark.parametrize("gap", [0.0005, 0.003])
def test_a_gap_is_measured_wherever_the_transducer_stands(gap: float, between: bool):
    law = told(gap, 0.002, between)
    assert law is not None and law.windows >= 10
    part = 1.0 if between else SHARE
    assert law.gap_rad / part == pytest.approx(gap, rel=0.1)
    assert law.gap_rad > 10.0 * law.u_gap_rad


@pytest.mark.parametrize("between", [False, True])
@pytest.mark.parametrize("softness", [0.002, 0.01])
def test_a_spring_alone_shows_its_softness_and_no_gap(softness: float, between: bool):
    law = told(0.0, softness, between)
    assert law is not None
    part = 1.0 if between else SHARE
    assert law.softness / part == pytest.approx(softness, rel=0.15)
    assert abs(law.gap_rad) / part < 0.1 * law.torque_nm * softness


def test_bad_samples_are_not_looked_at():
    """A stretch of log that was bridged: a straight line of the angle, no torque."""
    one = whole(0.003, 0.002, True)
    theta, through = one.x.theta_rad.copy(), one.shaft_nm.copy()
    theta[9000:13000] = np.linspace(theta[9000], theta[12999], 4000)
    through[9000:13000] = 0.2
    good = np.ones(theta.size, dtype=bool)
    good[9000:13000] = False
    args = (TS, theta, through, through, 0.0, FAR, one.u_theta_rad, U_TORQUE_NM, U_TORQUE_NM, good)
    law = law_of_twist([Shaft(*args)], DEFAULT.torsion)
    assert law is not None
    assert law.gap_rad == pytest.approx(0.003, rel=0.1)


@pytest.mark.parametrize("between", [0.0, 1.0])
@pytest.mark.parametrize(("gap", "name"), [(0.003, "backlash"), (0.0, "compliance")])
def test_the_closer_look_names_the_form(gap: float, name: str, between: float):
    one = whole(gap, 0.004, between > 0)
    found = discriminator([one, one], {"share": SHARE, "between": between})
    assert found is not None and found.name == name
    if gap:
        assert found.values["gap_rad"][0] == pytest.approx(gap, rel=0.15)
    elif between:
        assert found.values["share"][0] == pytest.approx(SHARE, rel=0.01)
        torque = one.x.machine.scales["torque_nm"]
        assert found.values["twist_rad"][0] == pytest.approx(0.004 * torque, rel=0.05)
    else:
        assert not found.values, "the fit knows the spring better: its damping is in it"


def test_a_rigid_shaft_excludes_a_twist():
    """The angle of one mass under the same torques: a fit may have taken another error for soft."""
    one = whole(0.0, 0.004, False)
    t = TS * np.arange(one.good.size)
    angle = np.cumsum(np.cumsum(driving(t) - load(t))) * TS**2 / J
    rigid = replace(one, x=replace(one.x, theta_rad=np.round(angle / ENCODER_RAD) * ENCODER_RAD))
    torque = one.x.machine.scales["torque_nm"]
    fitted = {"share": SHARE, "between": 0.0, "twist_rad": 0.004 * torque}
    assert discriminator([rigid, rigid], fitted) == Discrimination(None, {})
    gap = {"share": SHARE, "between": 0.0, "gap_rad": 0.003}
    assert discriminator([rigid, rigid], gap) == Discrimination(None, {})
    found = discriminator([one, one], fitted)
    assert found is not None and found.name == "compliance"


def test_a_torque_of_one_sign_parts_nothing():
    """A gap stays closed: what the log shows is a spring, or a spring behind a gap."""
    one = whole(0.003, 0.004, True)
    pressed = replace(one, shaft_nm=np.abs(one.shaft_nm) + 0.01)
    assert discriminator([pressed], {"share": SHARE, "between": 1.0}) is None
    assert discriminator([], {"share": SHARE, "between": 1.0}) is None
    assert discriminator([one], {"share": 0.0, "between": 1.0}) is None


def test_a_gap_too_small_to_be_surely_there_or_not_is_left_open():
    """0.2 mrad is nobody's concern; of half that again two logs of noise leave it open."""
    one = whole(0.0003, 0.002, False)
    blurred = [
        replace(
            one,
            shaft_nm=one.shaft_nm + 0.05 * np.random.default_rng(n).standard_normal(32000),
            u_shaft_nm=0.05,
        )
        for n in (3, 4)
    ]
    assert discriminator(blurred, {"share": SHARE, "between": 0.0}) is None


def test_the_two_share_one_look():
    library = effects()
    assert library["backlash"].discriminator is library["compliance"].discriminator is discriminator
    assert sum(effect.discriminator is not None for effect in library.values()) == 2


def test_a_fit_leaves_the_shape_that_a_look_told_and_its_uncertainty():
    known = settled(effects()["backlash"], Discrimination("backlash", {"gap_rad": (0.003, 1e-4)}))
    gap = next(p for p in known.parameters if p.name == "gap_rad")
    assert gap.choice and gap.u == 1e-4
    columns = effect_columns(known, Model(machine(), (known,)))
    assert [c.name for c in columns] == [
        f"backlash.{name}" for name in ("share", "twist_rad", "damping_s", "far_friction")
    ]


def test_a_gap_is_crossed_slowly_at_first():
    """Closed, crossed over four samples, closed on the other side; then open without a crossing."""
    torque = np.array([1.0, 1.0, 0.0, 0.0, 0.0, -1.0, -1.0, 0.0, -1.0])
    wanted = [1.0, 1.0, 1 - 2 / 16, 1 - 8 / 16, 1 - 18 / 16, -1.0, -1.0, -1.0, -1.0]
    assert side_of(torque, 0.1) == pytest.approx(wanted)
    assert side_of(np.zeros(5), 0.1) == pytest.approx(0.0)


@pytest.mark.parametrize(
    ("gap", "seen", "excluded"), [(0.0, 0.004, True), (-4e-3, 0.004, False), (0.0, 1.5, False)]
)
def test_a_law_of_something_else_excludes_no_twist(gap: float, seen: float, excluded: bool) -> None:
    """One with a gap below zero is of another shaft, and one that leaves more than the fit in its
    windows is of the quiet ones of them: couplings of 12 and of 50 Hz were found, and then not
    believed.
    """
    x = replace(operating(4), base={**BASE})
    log = FullLog(x, np.zeros(4), np.zeros(4), np.ones(4, dtype=bool), 1e-4, 0.0, 1e-3)
    mobility = 1.0 / BASE["j_kgm2"]
    columns = np.random.default_rng(3).normal(size=(60, 3))
    angle = columns @ [mobility, seen, 0.5 * gap]
    whole = np.column_stack([columns, angle])
    law = Law(0.004, 0.002, gap, 1e-5, 0.2, 31, mobility, 1.0, whole.T @ whole)
    torque = x.machine.scales["torque_nm"]
    fit = {"share": 0.7, "twist_rad": 2.0 * torque, "damping_s": 0.0, "between": 0.0}
    assert _excluded(law, log, 0.7, fit) is excluded
