"""A coast that carries the dynamometer, beside drives whose transducer stands in front of it."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pipeline.estimation.estimators.inertia import ESTIMATOR as INERTIA
from pipeline.estimation.estimators.inertia import GIVES, METHOD
from pipeline.estimation.estimators.torque_map import ESTIMATOR as TORQUE_MAP
from pipeline.estimation.mechanical.setups import another_setup
from pipeline.records.estimate import Estimate
from pipeline.simulator.bench import CAMPAIGN, campaign
from pipeline.simulator.design import EXACT, Bench
from pipeline.simulator.truth import truth
from tests.simulated import campaign_of, design
from tests.unit.estimation.mechanical import chain

MOTOR = replace(design("servo-ipm"), effects={})
TRUE = truth(MOTOR)["constants"]
TESTS = ("torque_map_slow", "torque_map_backward", "drive_0", "spin_down_forward")


def constants(far: float) -> dict[str, Estimate]:
    """J, T_c and B where a share of what coasts is behind the transducer."""
    motor = MOTOR.having(compliance={"load_fraction": far, "damping_ratio": 0.05}) if far else MOTOR
    bench = Bench(torque_in_coupling=True, instruments=EXACT)
    plan = tuple(step for step in CAMPAIGN if step[0] in TESTS)
    known = chain(campaign_of(campaign(motor, bench, 3, plan)), TORQUE_MAP, INERTIA)
    return {name: one for name in GIVES for one in known.all_of(name) if one.method == "inertia"}


@pytest.mark.parametrize("far", [pytest.param(0.6, marks=pytest.mark.slow), 0.85])
def test_friction_is_that_of_the_drives_where_a_coast_carries_more(far: float) -> None:
    """By the coast's deceleration and the rotor's inertia it would be a part of it only."""
    found = constants(far)
    inertia, dry, viscous = (found[name] for name in GIVES)
    assert inertia.number == pytest.approx((1.0 - far) * TRUE["j_rotor_kgm2"], rel=0.03)
    assert dry.number == pytest.approx(TRUE["torque_coulomb_nm"], abs=3.0 * dry.u)
    assert dry.u < 0.2 * dry.number
    assert viscous.number == pytest.approx(TRUE["b_visc_nm_s_rad"], abs=3.0 * viscous.u)
    assert "they turn something else" in dry.note
    assert not any("spin_down" in path for path in dry.captures)


def drags(dry: float, u: float, slope: float, u_slope: float) -> list[Estimate]:
    """J of 1, T_c and B with their standard uncertainties, of drives or coasts up to 100 rad/s."""
    values = (1.0, 0.0), (dry, u), (slope, u_slope)
    at = {"omega_mech_rad_s": 100.0}
    rows = zip(GIVES, values, strict=True)
    parts = ((name, value, [METHOD.scatter(name, u, 50.0)]) for name, (value, u) in rows)
    return [METHOD.measured(name, value, part, ("a",), at) for name, value, part in parts]


@pytest.mark.parametrize(("dry_nm", "u_dry", "other"), [(0.5, 0.1, True), (0.9, 0.1, False),
                                                       (0.5, 0.2, False)])  # fmt: skip
def test_a_drive_that_knows_no_viscous_drag_knows_the_dry_one(
    dry_nm: float, u_dry: float, other: bool
) -> None:
    """Half of the drag by the coasts; by the drives 1 N·m, and nothing is known of its slope."""
    words = another_setup(drags(dry_nm, 0.01, 0.01 * dry_nm, 1e-4), drags(1.0, u_dry, 0.01, 0.02))
    assert bool(words) is other
    assert not other or "0.5 times" in words


def test_another_inertia_would_scale_the_drag_at_every_speed() -> None:
    """Dry friction of half and a slope of twice are 1.5 N·m at half speed, as by the drives."""
    assert another_setup(drags(0.5, 0.01, 0.01, 1e-4), drags(1.0, 0.01, 0.02, 1e-4))
    assert not another_setup(drags(0.5, 0.01, 0.02, 1e-4), drags(1.0, 0.01, 0.01, 1e-4))


def test_a_coast_of_the_same_shaft_is_used() -> None:
    dry = constants(0.0)["torque_coulomb_nm"]
    assert dry.number == pytest.approx(TRUE["torque_coulomb_nm"], abs=3.0 * dry.u)
    assert any("spin_down" in path for path in dry.captures)
