"""A torque map of a rotor that is held still: Kt, and what its angle leaves open."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import cache

import numpy as np
import polars as pl
import pytest

from pipeline.estimation.electrical.operating_points import operating_points
from pipeline.estimation.estimators.inductance_rated import ESTIMATOR as INDUCTANCE_RATED
from pipeline.estimation.estimators.torque_map import ESTIMATOR as TORQUE_MAP
from pipeline.estimation.mechanical.locked_rotor import HARMONICS, SOURCE, angle_doubt
from pipeline.records.capture import Campaign
from pipeline.records.constants import Constants
from pipeline.records.estimate import Estimate
from pipeline.simulator.bench import campaign
from pipeline.simulator.catalogue import with_effects
from pipeline.simulator.design import EXACT, Bench
from tests.simulated import campaign_of, design
from tests.unit.estimation.signals import known_value

MOTOR = replace(design("gimbal-5208"), effects={})
KT = 1.5 * MOTOR.pole_pairs * MOTOR.psi_pm_wb
LOCKED: Mapping[str, object] = {"speed": 0.0}
TURNING = (
    ("slow", "torque_map", {"speed": 0.2}),
    ("fast", "torque_map", {"speed": 0.6}),
    ("back", "torque_map", {"speed": -0.3}),
)


@cache
def held(*captures: tuple[object, ...], effects: str = "", seed: int = 11) -> Campaign:
    """Maps of a rotor held where it stopped, each with the q levels given; exact instruments."""
    machine = with_effects(MOTOR, effects) if effects else MOTOR
    plan = tuple(
        (f"held_{k}", "torque_map", LOCKED | ({"iq_levels": levels} if levels else {}))
        for k, levels in enumerate(captures)
    )
    return campaign_of(campaign(machine, Bench(instruments=EXACT), seed, plan))


def fitted(captures: Campaign, known: Constants | None = None) -> dict[str, Estimate]:
    found = TORQUE_MAP.fit(captures, known or Constants(), TORQUE_MAP.options)
    return {e.name: e for e in found.estimates}


def test_a_locked_rotor_gives_the_torque_constant_and_no_drag() -> None:
    found = fitted(held(()))
    assert found["kt_peak_nm_a"].number == pytest.approx(KT, rel=1e-4)
    assert "standstill" in found["kt_peak_nm_a"].note
    saliency = 1.5 * MOTOR.pole_pairs * (MOTOR.ld_h - MOTOR.lq_h)
    assert found["kt_reluctance_nm_a2"].number == pytest.approx(saliency, rel=0.01)
    twice = fitted(held((), ()))
    for name in ("torque_coulomb_nm", "b_visc_nm_s_rad"):
        assert found[name].status == twice[name].status == "not_identifiable"


def test_cogging_at_rest_is_one_constant_an_angle() -> None:
    """Positive currents at one angle, negative at another: their difference is no torque of i_q."""
    captures = held((0.2, 0.5, 0.8, 1.0), (-0.2, -0.5, -0.8, -1.0), effects="cogging")
    points = operating_points(captures.captures, MOTOR.pole_pairs).points
    rest = [(p.group, p.torque_nm - KT * p.iq_a) for p in points]
    by_angle = [np.mean([torque for group, torque in rest if group == g]) for g in (0, 1)]
    assert abs(by_angle[1] - by_angle[0]) > 0.01 * KT * MOTOR.current_rated_a
    assert fitted(captures)["kt_peak_nm_a"].number == pytest.approx(KT, rel=2e-4)


def test_a_point_a_file_at_one_angle_is_one_group() -> None:
    """The angle tells that these files belong together; without it they are each on their own.

    The shaft twists by a tenth of a degree between them.
    """
    whole = held(())
    (one,) = whole.captures
    levels = [one.tables[0][k * 300 : (k + 1) * 300] for k in range(24)]
    twisted = [
        t.with_columns(pl.col("theta_mech_rad") + math.radians(0.1) * math.sin(k))
        for k, t in enumerate(levels)
    ]
    files = tuple(replace(one, path=f"{k:02}", tables=(t,)) for k, t in enumerate(twisted))
    pieces = Campaign("m", files)
    assert fitted(pieces)["kt_peak_nm_a"].number == pytest.approx(KT, rel=2e-4)
    blind = [replace(c, tables=(c.tables[0].drop("theta_mech_rad"),)) for c in files]
    missing = fitted(Campaign("m", tuple(blind)))["kt_peak_nm_a"]
    assert missing.status == "not_identifiable"
    together = replace(one, tables=(one.tables[0].drop("theta_mech_rad"),))
    assert fitted(Campaign("m", (together,)))["kt_peak_nm_a"].number == pytest.approx(KT, rel=2e-4)


def harmonics(*sizes: float) -> Constants:
    return Constants(tuple(known_value(n, s) for n, s in zip(HARMONICS, sizes, strict=True)))


@pytest.mark.parametrize("seed", range(6))
def test_torque_ripple_of_the_angle_is_in_the_uncertainty(seed: int) -> None:
    """Harmonics of 6, 5, 3 and 2 % of the back-EMF make Kt of one angle wrong by up to 15 %.

    Two cosines of unknown phase never pass twice their joint standard uncertainty.
    """
    captures = held((), effects="bemf_harmonics", seed=seed)
    known = harmonics(0.06, 0.0504, 0.0264, 0.0187)
    kt = fitted(captures, known)["kt_peak_nm_a"]
    assert abs(kt.number - KT) < 2.0 * kt.u
    share = next(p.u for p in kt.budget if p.source == SOURCE) / kt.number
    assert share == pytest.approx(math.hypot(0.1104, 0.0451) / math.sqrt(2.0), rel=1e-3)


def test_angles_half_a_ripple_apart_cancel() -> None:
    points = operating_points(held(()).captures, MOTOR.pole_pairs).points
    first = points[0]
    turn = math.pi / (6.0 * MOTOR.pole_pairs)

    def at(angle: float) -> list[object]:
        turned = first.angle_rad + angle
        return [replace(first, cos_turn=math.cos(turned), sin_turn=math.sin(turned))]

    known = harmonics(0.03, 0.01, 0.0, 0.0)

    def doubt(*angles: float, pairs: int | None = MOTOR.pole_pairs) -> float:
        points = [p for angle in angles for p in at(angle)]
        return angle_doubt(points, 2.0, pairs, known)[0].u

    single = 2.0 * 0.04 / math.sqrt(2.0)
    assert doubt(0.0) == pytest.approx(single)
    assert doubt(0.0, turn) == pytest.approx(0.0, abs=1e-12)
    assert doubt(0.0, turn / 2.0) == pytest.approx(single / math.sqrt(2.0))
    assert doubt(0.0, turn, pairs=None) == pytest.approx(single)
    both = angle_doubt([*at(0.0), *at(turn)], 2.0, 7, harmonics(0.03, 0.01, 0.002, 0.001))
    assert both[0].u == pytest.approx(2.0 * 0.003 / math.sqrt(2.0))
    moving = replace(first, omega_mech_rad_s=10.0)
    assert angle_doubt([moving], 2.0, 7, known) == ()
    assert angle_doubt([first, moving], 2.0, 7, known)[0].u == pytest.approx(single / 2.0)


def test_a_locked_map_beside_turning_ones_changes_nothing() -> None:
    """Friction and Kt of three speeds are those of the three speeds."""
    bench = Bench(instruments=EXACT)
    three = campaign_of(campaign(MOTOR, bench, 11, TURNING))
    four = Campaign("m", (*three.captures, *held(()).captures))
    alone, beside = fitted(three), fitted(four)
    for name, estimate in alone.items():
        assert beside[name].value == estimate.value
        assert beside[name].u == estimate.u
    assert "24 points at standstill left out" in beside["kt_peak_nm_a"].note


def test_a_standing_shaft_is_no_third_speed_of_drag() -> None:
    """One point forward, one backward and a locked rotor: its offset is no transducer's zero."""
    one_level = {"id_levels": (0.0,), "iq_levels": (0.5,)}
    plan = tuple((f"at_{s}", "torque_map", one_level | {"speed": s}) for s in (0.3, -0.2))
    few = campaign_of(campaign(MOTOR, Bench(instruments=EXACT), 11, plan))
    found = fitted(Campaign("m", (*few.captures, *held(()).captures)))
    assert found["kt_peak_nm_a"].number == pytest.approx(KT, rel=1e-4)
    assert found["torque_coulomb_nm"].status == "not_identifiable"


def test_a_speed_of_zero_gives_no_flux_and_breaks_nothing() -> None:
    (one,) = held(()).captures
    still = one.tables[0].with_columns(theta_mech_rad=pl.lit(0.3), omega_mech_rad_s=pl.lit(0.0))
    captures = Campaign("m", (replace(one, tables=(still,)),))
    known = Constants((known_value("pole_pairs", 7), known_value("r_phase_ohm", 0.4)))
    found = INDUCTANCE_RATED.fit(captures, known, INDUCTANCE_RATED.options).estimates
    assert {e.status for e in found} == {"not_identifiable"}
    assert all("at speed" in e.note for e in found)
