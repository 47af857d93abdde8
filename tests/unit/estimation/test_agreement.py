"""Methods of one constant that contradict each other: wide, withheld, or left alone."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from pipeline.crosscheck.judge import ratio_of
from pipeline.estimation.protocol import Fit
from pipeline.estimation.registry import _preferred, fit_all
from pipeline.estimation.uncertainty.agreement import judges, outranked, reconciled
from pipeline.records.constants import Constants
from pipeline.records.estimate import Estimate
from pipeline.records.uncertainty import METHODS, propagate, type_a, type_b
from pipeline.simulator.catalogue import with_effects
from tests.recovery.simulated import BENCH, MOTOR, recorded

GAIN = type_b("current@rig", 0.02)


def of(method: str, value: float, u: float, name: str = "r_phase_ohm", **at: float) -> Estimate:
    """An estimate of 1 Ω or so with scatter of its own and the rig's gain of 2 %."""
    budget = propagate([(1.0, type_a(f"scatter:{method}", u, 50.0)), (value, GAIN)])
    return Estimate(name, value, "ohm", "measured", method, budget, at)


def part(estimate: Estimate) -> float:
    """What the methods' disagreement adds to u."""
    return math.hypot(*(p.u for p in estimate.budget if p.source.startswith(METHODS)))


def test_methods_that_disagree_widen_each_other_and_are_named() -> None:
    """1.00 and 1.05, ± 0.005 each beside a common gain of 2 %: 0.05 is clear, the gain cancels."""
    best, other = of("bridge", 1.0, 0.005), of("drive", 1.05, 0.005)
    found = reconciled(Constants((best, other))).best("r_phase_ohm")
    assert found is not None
    assert part(found) == pytest.approx(0.05 / math.sqrt(2.0), rel=0.05)
    assert "bridge 1 ±" in found.note
    assert "drive 1.05 ±" in found.note
    low, high = found.interval()
    assert low < 1.05 < high


def test_methods_that_share_what_parts_them_agree() -> None:
    """0.05 apart with gains of two rigs, each ± 2 %: by chance; of one rig: not."""
    best, other = of("bridge", 1.0, 0.005), of("drive", 1.05, 0.005)
    elsewhere = tuple(
        replace(p, source="current@far") if p.source == "current@rig" else p for p in other.budget
    )
    found = reconciled(Constants((best, replace(other, budget=elsewhere)))).best("r_phase_ohm")
    assert found == best


def test_a_rough_method_says_nothing_of_a_precise_one() -> None:
    rough = Estimate("r_phase_ohm", 2.0, "ohm", "measured", "drive", type_a("d", 0.25, 50.0))
    best = of("bridge", 1.0, 0.005)
    assert judges(Constants((best, rough)), best) == []
    assert judges(Constants((best, rough)), rough) == [best]
    kept = reconciled(Constants((best, rough))).estimates
    assert kept[0] == best
    assert part(kept[1]) > 0.0


def test_a_rough_method_that_excludes_a_precise_value_is_heard() -> None:
    """Coulomb friction came out as 1.76 ± 0.05 mN·m where the torque map had 12.9 ± 1.7.

    The narrow one has few degrees of freedom, which say nothing of how sure the wide one is.
    """
    name = "torque_coulomb_nm"
    narrow = Estimate(name, 1.76e-3, "N·m", "measured", "inertia", type_a("i", 5e-5, 1.5))
    rough = Estimate(name, 12.9e-3, "N·m", "measured", "torque_map", type_a("t", 1.7e-3, 20.0))
    assert judges(Constants((narrow, rough)), narrow) == [rough]
    found = reconciled(Constants((narrow, rough))).estimates[0]
    assert found.u > 0.5 * (rough.number - narrow.number)
    assert "torque_map 0.0129" in found.note


def test_drag_at_creep_speed_is_not_held_against_drag_at_full_speed() -> None:
    name = "torque_coulomb_nm"
    fast = of("inertia", 1.0, 0.005, name, omega_mech_rad_s=300.0)
    creep = of("cogging", 1.5, 0.005, name, omega_mech_rad_s=0.5)
    nearer = of("torque_map", 1.5, 0.005, name, omega_mech_rad_s=100.0)
    both = reconciled(Constants((fast, creep)))
    assert both.best(name) == fast
    assert part(both.estimates[1]) == pytest.approx(0.5)
    assert "from the drag at speed (inertia)" in both.estimates[1].note
    assert reconciled(Constants((fast, nearer))).best(name) != fast


def test_a_check_still_sees_what_widened_its_constants() -> None:
    """Kt 2 % above 1.5 p psi: Kt is widened, the ratio is judged as it was."""
    kt = Estimate("kt_peak_nm_a", 0.102, "N·m/A", "measured", "torque_map", type_b("t", 2e-4))
    ke = Estimate("kt_from_ke_nm_a", 0.1, "N·m/A", "derived", "derived", type_b("v", 1e-4))
    found = reconciled(Constants((kt, ke)))
    wide = found.best("kt_peak_nm_a")
    assert wide is not None
    assert wide.interval()[0] < 0.1
    assert found.best("kt_from_ke_nm_a") == ke
    assert ratio_of(wide, ke) == pytest.approx(ratio_of(kt, ke))


def test_torque_constant_off_with_a_transducer_off_is_never_stated_narrow() -> None:
    """A transducer 2 % off beyond its stated 0.2 %: before, Kt ± 0.3 % and 2 % from the truth."""
    motor = with_effects(MOTOR, "[torque_scale=0.02]")
    plan = (
        ("torque_map_0", "torque_map", {"speed": 0.3}),
        ("torque_map_1", "torque_map", {"speed": -0.3}),
        ("open_circuit", "open_circuit", {}),
    )
    slow_turns = [(f"cogging_{k}", "cogging", {"direction": k}) for k in (1, -1)]
    campaign, _ = recorded((*plan, *slow_turns), 3, motor, BENCH)
    constants = fit_all(campaign, {})[0]
    found, drag = (constants.best(name) for name in ("kt_peak_nm_a", "torque_coulomb_nm"))
    true = 1.5 * MOTOR.pole_pairs * MOTOR.psi_pm_wb
    assert found is not None and drag is not None
    assert drag.method == "cogging"
    assert abs(drag.number - MOTOR.torque_coulomb_nm) < 2.0 * drag.u
    assert "the transducer is in doubt" in drag.note
    assert found.number / true - 1.0 > 0.012
    low, high = found.interval()
    assert low < true < high
    assert "methods disagree" in found.note


def test_stribecks_excess_at_creep_speed_is_in_u_of_coulomb_friction() -> None:
    """Creep drag 80 % above the drag at speed: it was published with the transducer's 0.2 %."""
    motor = with_effects(MOTOR, f"[stribeck={0.8 * MOTOR.torque_coulomb_nm}]")
    slow_turns = [(f"cogging_{k}", "cogging", {"direction": k}) for k in (1, -1)]
    driven = (("drive_0", "drive", {}), ("spin_down_0", "spin_down", {}))
    campaign, _ = recorded((*slow_turns, ("open_circuit", "open_circuit", {}), *driven), 3, motor)
    constants = fit_all(campaign, {})[0]
    creep = next(e for e in constants.all_of("torque_coulomb_nm") if e.method == "cogging")
    assert not creep.known or abs(creep.number - MOTOR.torque_coulomb_nm) < 2.0 * creep.u
    best = constants.best("torque_coulomb_nm")
    assert best is None or best.method != "cogging"


def test_the_odd_one_of_three_is_in_doubt_by_what_parts_it_from_the_nearest() -> None:
    """Two that agree to a thousandth made the third, a third off, sure to 7 %: and it was the one
    that was published.
    """
    odd = of("torque_map", 0.0026439, 1.8e-5)
    others = of("inertia", 0.0039997, 8e-6), of("cogging", 0.0039967, 8.6e-6)
    found = {e.method: e for e in reconciled(Constants((odd, *others))).estimates}
    assert part(found["torque_map"]) == pytest.approx(0.00135 / math.sqrt(2.0), rel=0.05)
    assert part(found["inertia"]) < part(found["torque_map"])


def test_a_method_that_knows_a_constant_ten_times_better_comes_first() -> None:
    """Of a spin of one cycle psi was 0.084 ± 0.037 Wb, though a table said 0.1321 ± 0.0004."""
    rough, best = of("spin", 1.0, 0.9), of("table", 1.5, 0.002)
    fits = [(0, 0, Fit((rough,))), (6, 1, Fit((best,)))]
    assert [e.method for e in _preferred(fits)] == ["table", "spin"]
    fair = of("spin", 1.4, 0.1)
    assert [e.method for e in _preferred([(0, 0, Fit((fair,))), (6, 1, Fit((best,)))])] == [
        "spin",
        "table",
    ]


def test_a_drag_at_creep_speed_does_not_come_before_one_at_speed() -> None:
    """They are two quantities where friction bends, however well the one is known."""
    fast = of("coast", 1.0, 0.9, "torque_coulomb_nm", omega_mech_rad_s=100.0)
    slow = of("creep", 1.5, 0.002, "torque_coulomb_nm", omega_mech_rad_s=0.5)
    assert not outranked(fast, (fast, slow))
