"""What was not logged is in the uncertainty: the magnets' temperature, the d current, the angle."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace

import numpy as np
import pytest

from pipeline.estimation.estimators.drive_voltage import ESTIMATOR
from pipeline.estimation.policy import DEFAULT
from pipeline.estimation.registry import fit_all
from pipeline.numerics.integrals import trapezoid
from pipeline.records.capture import Campaign
from pipeline.records.estimate import Estimate
from pipeline.simulator.bench import campaign
from pipeline.simulator.design import EXACT, Bench
from pipeline.simulator.truth import truth
from tests.simulated import campaign_of, design
from tests.unit.estimation.signals import capture, estimates

MOTOR = replace(design("gimbal-5208"), effects={})
TRUE = truth(MOTOR)["constants"]
WARM = {"temp_magnet_degc": 58.0}
LOST = DEFAULT.magnet.coefficient_1_k * DEFAULT.magnet.unlogged_k


def recorded(*plan: tuple[str, Mapping[str, object]], without: Collection[str] = ()) -> Campaign:
    steps = tuple((f"{test}_{n}", test, how) for n, (test, how) in enumerate(plan))
    whole = campaign_of(campaign(MOTOR, Bench(instruments=EXACT), 1, steps))
    cut = (
        replace(one, tables=tuple(t.drop(without, strict=False) for t in one.tables))
        for one in whole.captures
    )
    return replace(whole, captures=tuple(cut))


def found(captures: Campaign, name: str) -> Estimate:
    best = fit_all(captures, {})[0].best(name)
    assert best is not None, name
    return best


def holds(one: Estimate) -> bool:
    low, high = one.interval()
    return bool(low <= TRUE[one.name] <= high)


@pytest.mark.parametrize(
    ("test", "how", "name"),
    [
        ("open_circuit", WARM, "psi_pm_wb"),
        ("torque_map", WARM, "kt_peak_nm_a"),
        ("torque_table", {}, "kt_peak_nm_a"),
    ],
)
def test_a_warm_magnet_without_a_thermometer(
    test: str, how: Mapping[str, object], name: str
) -> None:
    """Taken at ambient it read 3.7 % low, with an uncertainty of a tenth of a percent."""
    one = found(recorded((test, how), without={"temp_magnet_degc"}), name)
    assert holds(one)
    (part,) = (p for p in one.budget if p.source.startswith("assumed:temp_magnet_degc"))
    assert abs(part.u / one.number) == pytest.approx(abs(LOST), rel=0.02)
    assert f"ambient temperature ± {DEFAULT.magnet.unlogged_k:g} K" in one.note


def test_a_thermometer_goes_before_an_assumption() -> None:
    """The flux of two spins, of which the warm one has no thermometer, is that of the other."""
    whole = recorded(("open_circuit", {}), ("open_circuit", WARM))
    cold, warm = whole.captures
    bare = replace(warm, tables=tuple(t.drop("temp_magnet_degc") for t in warm.tables))
    psi = found(replace(whole, captures=(cold, bare)), "psi_pm_wb")
    alone = found(replace(whole, captures=(cold,)), "psi_pm_wb")
    assert (psi.number, psi.captures) == (alone.number, (cold.path,))
    assert holds(psi)
    assert (
        fit_all(replace(whole, captures=(cold, bare)), {})[0].best("temp_coeff_magnet_1_k") is None
    )


def test_no_coefficient_from_assumed_temperatures() -> None:
    """Two spins whose captures state another ambient each, and hold no temperature."""
    bare = recorded(("open_circuit", {}), ("open_circuit", WARM), without={"temp_magnet_degc"})
    rooms = zip(bare.captures, (25.0, 58.0), strict=True)
    stated = tuple(replace(c, meta=replace(c.meta, ambient_degc=t)) for c, t in rooms)
    constants = fit_all(replace(bare, captures=stated), {})[0]
    assert constants.best("temp_coeff_magnet_1_k") is None


def test_a_torque_map_without_its_d_current() -> None:
    """Reluctance torque of a d current that nobody logged made Kt 1.7 % high."""
    one = found(recorded(("torque_map", {}), without={"id_a"}), "kt_peak_nm_a")
    assert holds(one)
    (part,) = (p for p in one.budget if p.source == "assumed:id_a")
    assert part.u / one.number == pytest.approx(DEFAULT.torque_map.unlogged_d_share)
    assert "id_a not logged" in one.note
    logged = found(recorded(("torque_map", {})), "kt_peak_nm_a")
    assert not any(p.source == "assumed:id_a" for p in logged.budget)


def test_an_inertia_by_a_speed_alone() -> None:
    plan = (("torque_map", {}), ("drive", {"load": 0.0}))
    by_speed = found(recorded(*plan, without={"theta_mech_rad"}), "j_rotor_kgm2")
    assert holds(by_speed)
    assert "bench's own speed" in by_speed.note
    parts = {p.source: p.u for p in by_speed.budget}
    assert parts["assumed:speed_estimate"] == DEFAULT.drag.speed_share * by_speed.number
    by_angle = found(recorded(*plan), "j_rotor_kgm2")
    assert not any(p.source == "assumed:speed_estimate" for p in by_angle.budget)
    assert holds(by_angle)


def test_a_map_without_motion_breaks_nothing() -> None:
    """`inductance_rated` broke on it: SVD did not converge."""
    captures = recorded(("torque_map", {}), without={"theta_mech_rad", "omega_mech_rad_s"})
    captures = replace(
        captures,
        captures=tuple(
            replace(c, meta=replace(c.meta, pole_pairs=MOTOR.pole_pairs)) for c in captures.captures
        ),
    )
    assert fit_all(captures, {})[2] == ()


@pytest.mark.parametrize(
    "seed", [0, pytest.param(3, marks=pytest.mark.slow), pytest.param(4, marks=pytest.mark.slow)]
)
def test_a_drive_without_its_d_current(seed: int) -> None:
    """Its flux read as 2 % of Ke, 2 to 7 u, and its torque as 3 % of J."""
    steps = (("drive", "drive", {}),)
    whole = campaign_of(campaign(MOTOR, Bench(instruments=EXACT), seed, steps))
    (one,) = whole.captures
    bare = replace(one, tables=tuple(t.drop("id_a", "vd_v") for t in one.tables))
    captures = replace(whole, captures=(bare,))
    ke, inertia = (found(captures, n) for n in ("ke_phase_peak_v_s_rad", "j_rotor_kgm2"))
    assert abs(ke.number - MOTOR.pole_pairs * MOTOR.psi_pm_wb) < 2.0 * ke.u
    assert ke.u < 0.05 * ke.number
    assert abs(inertia.number - MOTOR.j_rotor_kgm2) < 2.0 * inertia.u
    assert "id_a not logged" in ke.note
    assert "id_a not logged" in inertia.note
    assert not any("id_a" in p.source for p in found(whole, "ke_phase_peak_v_s_rad").budget)


def test_the_lateness_of_an_observer_is_no_resistance() -> None:
    """It goes with the current where that accelerates; noise must not hide it from the fit."""
    rng, t = np.random.default_rng(1), np.arange(0.0, 8.0, 1e-3)
    iq = 2.0 * np.sign(np.sin(2.0 * np.pi * t / 0.8)) + 0.4 * np.sin(2.0 * np.pi * t / 3.0)
    rate = 300.0 * 2.0 * np.sign(np.sin(2.0 * np.pi * t / 0.8)) + 30.0 * np.cos(9.0 * t)
    true = trapezoid(t, rate)
    late = true - 2e-3 * rate
    vq = 0.2 * true + 0.5 * iq + 0.5 * rng.standard_normal(t.size)
    log = capture("drive", t_s=t, omega_mech_rad_s=late, vq_v=vq, iq_a=iq, id_a=0.0 * t)
    resistance = estimates(ESTIMATOR, log)["r_phase_ohm"]
    assert "acceleration" in resistance.note
    assert not resistance.known or abs(resistance.number - 0.5) < 2.0 * resistance.u


def test_a_hot_winding_without_a_thermometer() -> None:
    """Taken at ambient it read 15 % high, with an uncertainty of half a percent."""
    hot = {"temp_degc": 60.0}
    bare = recorded(("resistance", hot), without={"temp_winding_degc"})
    resistance = found(bare, "r_phase_ohm")
    assert abs(resistance.number - MOTOR.r_phase_ohm) < 2.0 * resistance.u
    (part,) = (p for p in resistance.budget if p.source == "assumed:temp_winding_degc")
    assert abs(part.u / resistance.number) == pytest.approx(0.0039 * DEFAULT.magnet.unlogged_k, 0.1)
    assert f"ambient ± {DEFAULT.magnet.unlogged_k:g} K" in resistance.note
    logged = found(recorded(("resistance", hot)), "r_phase_ohm")
    assert not any(p.source == "assumed:temp_winding_degc" for p in logged.budget)
    assert logged.u < 0.01 * logged.number
