"""Inductances at rated current on simulated benches whose truth is known."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from pipeline.estimation.estimators.inductance_rated import ESTIMATOR as INDUCTANCE_RATED
from pipeline.simulator.bench import campaign
from pipeline.simulator.bench import truth as simulated_truth
from pipeline.simulator.catalogue import with_effects
from tests.simulated import campaign_of, design
from tests.unit.estimation.mechanical import EXACT_BENCH, chain, fitted, number, recorded


def test_rated_inductances() -> None:
    motor = design("gimbal-5208")
    known = chain(recorded(), INDUCTANCE_RATED)
    assert number(known, "inductance_rated", "ld_rated_h") == pytest.approx(motor.ld_h, rel=3e-3)
    lq = known.best("lq_rated_h")
    assert lq is not None
    assert lq.number == pytest.approx(motor.lq_h, rel=3e-3)
    assert lq.at["iq_a"] == pytest.approx(motor.current_rated_a, rel=0.02)


@pytest.mark.parametrize("size", [0.03, -0.05])
def test_an_angle_offset_is_no_inductance(size: float) -> None:
    """Turned by e, the drop of R on the other axis reads as R tan(e) / w: 11 % on this motor."""
    motor = design("joint-11p")
    captures = recorded(f"angle_offset={size}", "joint-11p", ("torque_map",))
    known = chain(captures, INDUCTANCE_RATED)
    for name, truth in (("ld_rated_h", motor.ld_h), ("lq_rated_h", motor.lq_h)):
        found = known.best(name)
        assert found is not None
        assert found.number == pytest.approx(truth, rel=8e-4)
        (turned,) = re.findall(r"frame turned by (\S+) rad", found.note)
        assert float(turned) == pytest.approx(size, abs=5e-4)


def test_currents_sampled_late_are_no_inductance() -> None:
    """Late by d, the current stands w d beside the voltages' frame: R d adds to both axes, 2.5 %.

    No voltage shows it; the torque of d current does, K i_d sin(w d).
    """
    motor = design("joint-11p")
    delay = 0.03 / (motor.pole_pairs * motor.speed_rated_rad_s)
    captures = recorded("current_delay", "joint-11p", ("torque_map",))
    known = chain(captures, INDUCTANCE_RATED)
    for name, truth in (("ld_rated_h", motor.ld_h), ("lq_rated_h", motor.lq_h)):
        found = known.best(name)
        assert found is not None
        assert found.number == pytest.approx(truth, rel=2e-3)
        late = float(found.note.split("currents ")[1].split(" µs")[0])
        assert late == pytest.approx(1e6 * delay, rel=0.15)


def test_rated_d_inductance_of_a_saturated_axis_is_what_the_truth_means() -> None:
    """Root-form d saturation and cross-saturation: flux over the map's largest d current."""
    motor = with_effects(replace(design("servo-ipm"), effects={}), "saturation,cross_saturation")
    captures = recorded("saturation,cross_saturation", "servo-ipm", ("torque_map",))
    ld = chain(captures, INDUCTANCE_RATED).best("ld_rated_h")
    assert ld is not None
    true = simulated_truth(motor)
    assert true["at"]["ld_rated_h"]["id_a"] == pytest.approx(ld.at["id_a"], rel=0.01)
    assert abs(ld.number - true["constants"]["ld_rated_h"]) < 2.0 * ld.u
    assert true["constants"]["ld_rated_h"] > 1.03 * motor.ld_h


def test_rated_inductance_of_a_saturated_axis_is_apparent_flux_over_current() -> None:
    """Against the flux map of the same motor at the same current, an independent recording."""
    tests = ("torque_map", "flux_map")
    captures = recorded("saturation", "gimbal-5208", tests)
    lq = chain(captures, INDUCTANCE_RATED).best("lq_rated_h")
    assert lq is not None
    table = captures.of("flux_map")[0].arrays("id_a", "iq_a", "psi_q_wb")
    rated = float(table["iq_a"].max())
    here = (np.abs(table["id_a"]) < 0.05 * rated) & (table["iq_a"] > 0.97 * rated)
    apparent = float(np.mean(table["psi_q_wb"][here] / table["iq_a"][here]))
    assert lq.number == pytest.approx(apparent, rel=0.01)
    assert apparent < 0.97 * design("gimbal-5208").lq_h


@pytest.mark.parametrize(("timing", "allowed"), [("held", 3e-3), ("centred", 6e-3)])
def test_rated_inductance_respects_voltage_timing(timing: str, allowed: float) -> None:
    """A held voltage is turned by half a period against the sample, a centred one damped.

    At 0.09 rad of half period a polygon and a circle differ by 0.4 %: that doubt is in the budget.
    """
    motor = replace(design("gimbal-5208"), effects={})
    plan = (
        ("fast", "torque_map", {"speed": 0.8, "voltage_timing": timing}),
        ("back", "torque_map", {"speed": -0.8, "voltage_timing": timing}),
    )
    captures = campaign_of(campaign(motor, EXACT_BENCH, 5, plan))
    known = chain(captures, INDUCTANCE_RATED)
    for name, truth in (("lq_rated_h", motor.lq_h), ("ld_rated_h", motor.ld_h)):
        found = known.best(name)
        assert found is not None
        low, high = found.interval()
        assert low <= truth <= high
        assert found.number == pytest.approx(truth, rel=allowed)


def test_both_sides_of_d_current_are_stated_and_the_negative_published() -> None:
    """Saturated along the magnet: 20 % apart on the two sides, never averaged into one."""
    design_motor = with_effects(replace(design("gimbal-5208"), effects={}), "saturation.size_d=0.2")
    levels = {"id_levels": (-0.6, 0.0, 0.6)}
    plan = tuple(
        (f"map_{k}", "torque_map", {**levels, "speed": w}) for k, w in ((0, 0.3), (1, -0.5))
    )
    captures = campaign_of(campaign(design_motor, EXACT_BENCH, 4, plan))
    found = chain(captures, INDUCTANCE_RATED).best("ld_rated_h")
    assert found is not None
    assert found.at["id_a"] == pytest.approx(-0.6 * design_motor.current_rated_a, rel=0.01)
    assert found.number > 1.02 * design_motor.ld_h
    other = 1e-6 * float(found.note.rsplit("; ", 1)[1].split(" µH at ")[0])
    assert other < 0.98 * design_motor.ld_h


def test_flux_plots_hold_the_published_inductance() -> None:
    found = fitted(INDUCTANCE_RATED, recorded("", tests=("torque_map",)))
    values = {e.name: e.number for e in found.estimates}
    for one, name in zip(found.evidence, ("lq_rated_h", "ld_rated_h"), strict=True):
        curves = [s for s in one.series if s.fitted.size and np.ptp(s.x) > 1.0]
        assert curves
        for series in curves:
            slope = float(np.polyfit(series.x, series.fitted, 1)[0])
            assert slope == pytest.approx(values[name], rel=1e-6)
            assert np.std(series.measured - series.fitted) < 0.02 * np.ptp(series.measured)
