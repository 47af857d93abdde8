"""A warm motor: the thermometer that tells how warm, and what is assumed of its magnets."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import jv

from pipeline.estimation.estimators.inertia import ESTIMATOR as INERTIA
from pipeline.estimation.estimators.open_circuit import ESTIMATOR as OPEN_CIRCUIT
from pipeline.estimation.estimators.torque_map import ESTIMATOR, Regression
from pipeline.estimation.policy import DEFAULT
from pipeline.estimation.thermal.magnet_coefficient import SOURCE
from pipeline.records.capture import Campaign, Capture
from pipeline.records.constants import Constants
from pipeline.records.estimate import Estimate
from pipeline.records.uncertainty import type_b
from pipeline.simulator.bench import CAMPAIGN, campaign
from pipeline.simulator.design import EXACT, Bench
from tests.simulated import campaign_of, design
from tests.unit.estimation.signals import capture, estimates

EXACT_BENCH = Bench(instruments=EXACT)
U_COEFFICIENT = DEFAULT.magnet.u_coefficient_1_k


def hot_map(*others: str) -> Campaign:
    """A torque map, and other tests, with the magnet at 60 degC, by exact instruments.

    A drive is of a free shaft.
    """
    motor = replace(design("gimbal-5208"), effects={})
    free = {"drive": {"load": 0.0}}
    plan = tuple(
        (name, name, {"temp_magnet_degc": 60.0, **free.get(name, {})})
        for name in ("torque_map", *others)
    )
    return campaign_of(campaign(motor, EXACT_BENCH, 1, plan))


def torque_constant(captures: Campaign, known: Constants | None = None) -> Estimate:
    found = ESTIMATOR.fit(captures, known or Constants(), ESTIMATOR.options).estimates[0]
    assert found.name == "kt_peak_nm_a"
    return found


def test_torque_constant_at_25_degrees() -> None:
    """At 60 degC the magnet has lost 3.85 %; the constant of 25 degC is what is published."""
    motor = replace(design("gimbal-5208"), effects={})
    warm = {"temp_magnet_degc": 60.0}
    plan = (("hot", "torque_map", warm), ("back", "torque_map", {**warm, "speed": -0.3}))
    captures = campaign_of(campaign(motor, EXACT_BENCH, 1, plan))
    coefficient = Estimate(
        "temp_coeff_magnet_1_k", -0.0011, "1/K", "measured", "given", type_b("x", 1e-5)
    )
    known = Constants((coefficient,))
    kt = torque_constant(captures, known)
    truth = 1.5 * motor.pole_pairs * motor.psi_pm_wb
    assert kt.number == pytest.approx(truth, rel=5e-4)
    assert next(p.u for p in kt.budget if p.source == "x") != 0.0
    assumed = torque_constant(captures)
    share = next(p.u for p in assumed.budget if p.source == SOURCE)
    assert abs(share) / truth == pytest.approx(35.0 * U_COEFFICIENT / (1 - 0.0385), rel=0.05)


def test_one_thermometer_is_one_source_of_the_torque_constant() -> None:
    """It may read the map's magnet high and was in the coefficient too: the two add up."""
    captures = hot_map()
    meta = captures.captures[0].meta
    source = f"temperature@{meta.station}"
    budget = (*type_b(source, 2e-6), *type_b("other", 1e-5))
    known = Estimate("temp_coeff_magnet_1_k", -0.0011, "1/K", "measured", "given", budget)
    kt = torque_constant(captures, Constants((known,)))
    parts = {part.source: part.u for part in kt.budget}
    assert len(parts) == len(kt.budget)
    # K25 is high by alpha times the thermometer's error, and low by 35 K times alpha's.
    expected = 0.0011 * (meta.u_temp_degc or 0.0) - 35.0 * 2e-6
    assert parts[source] == pytest.approx(kt.number * expected / (1 - 0.0385), rel=0.02)


def with_slow_magnet_temperature(capture: Capture, every: int) -> Capture:
    """The capture with the magnet's temperature on a slower clock, whose last row comes early."""
    fast = capture.tables[0]
    slow = fast.select("t_s", "temp_magnet_degc")[::every]
    return replace(capture, tables=(fast.drop("temp_magnet_degc"), slow))


def test_a_slow_thermometer_serves_the_last_step_as_well() -> None:
    """At 60 degC, read every 50 rows: the last step's last rows have no reading after them."""
    captures = hot_map()
    slow = replace(
        captures,
        captures=tuple(with_slow_magnet_temperature(c, 50) for c in captures.captures),
    )
    kt, usual = (torque_constant(c).number for c in (slow, captures))
    assert kt == pytest.approx(usual, rel=2e-4)


def test_what_is_assumed_of_the_magnets_is_one_error_of_kt_and_ke() -> None:
    """Both at 60 degC and brought to 25 by the same guess: their ratio does not depend on it."""
    captures = hot_map("open_circuit")
    kt = torque_constant(captures)
    psi = OPEN_CIRCUIT.fit(captures, Constants(), OPEN_CIRCUIT.options).estimates[0]
    shares = [
        next(part.u for part in one.budget if part.source == SOURCE) / one.number
        for one in (kt, psi)
    ]
    assert abs(shares[0]) > 30.0 * U_COEFFICIENT
    assert shares[0] == pytest.approx(shares[1], rel=0.02)


def test_inertia_from_a_hot_drive_carries_what_is_assumed_of_the_magnets() -> None:
    """Kt is known at 25 degC; at 60 the torque is 35 K of the coefficient off, and so is J.

    No load torque is logged, which would give J another scale.
    """
    captures = hot_map("drive", "spin_down")
    drive = captures.of("drive")[0]
    unloaded = replace(drive, tables=(drive.tables[0].drop("torque_shaft_nm"),))
    campaign_of_two = Campaign("m", (unloaded, *captures.of("spin_down")))
    kt = Estimate("kt_peak_nm_a", 0.0746, "N·m/A", "measured", "given", type_b("kt", 1e-5))
    found = INERTIA.fit(campaign_of_two, Constants((kt,)), INERTIA.options).estimates[0]
    share = next(part.u for part in found.budget if part.source == SOURCE) / found.number
    assert share == pytest.approx(35.0 * U_COEFFICIENT / (1 - 0.0385), rel=0.05)


@pytest.mark.parametrize("wobble_rad", [0.05, 0.3])
def test_the_torque_constant_of_an_eccentric_encoder(wobble_rad: float) -> None:
    """An angle off by e = A sin(theta + phi) shows K cos(e) i_q + K sin(e) i_d: K J_0(A) over a
    turn, 2 K J_1(A) once a turn. The correction is right to terms of A^4.
    """
    kt, phase = 0.0746, 0.7
    once = 2.0 * kt * float(jv(1, wobble_rad))
    seen = np.array([kt * jv(0, wobble_rad), once * np.sin(phase), once * np.cos(phase)])
    names = ("iq", "id cos", "id sin")
    model = Regression(names, seen, np.zeros((3, 3)), np.zeros(9), 6)
    assert model.kt_nm_a == pytest.approx(kt, rel=wobble_rad**4 / 16.0)


def map_of_speeds(missed_nm: float) -> Campaign:
    """Six speeds, both senses, steps of q current; the third and the fifth miss drag's line."""
    rng = np.random.default_rng(4)
    steps, rows = (-2.0, -1.0, 1.0, 2.0), 400
    captures = []
    for number, speed in enumerate((-30.0, -20.0, -10.0, 10.0, 20.0, 30.0)):
        iq = np.repeat(steps, rows) + 1e-4 * rng.standard_normal(len(steps) * rows)
        miss = missed_nm * {2: 1.0, 4: -1.0}.get(number, 0.0)
        torque = 0.0746 * iq - 5e-3 * np.sign(speed) - 2e-5 * speed + miss
        t = np.arange(iq.size) * 1e-3
        table = {
            "t_s": t,
            "id_a": 1e-4 * rng.standard_normal(t.size),
            "iq_a": iq,
            "theta_mech_rad": speed * t,
            "omega_mech_rad_s": np.full(t.size, speed),
            "torque_shaft_nm": torque + 1e-5 * rng.standard_normal(t.size),
            "temp_magnet_degc": np.full(t.size, 25.0),
        }
        captures.append(capture("torque_map", f"map_{number}", pole_pairs=7, **table))
    return Campaign("m", tuple(captures))


def test_drag_that_misses_its_line_is_as_uncertain_as_it_scatters() -> None:
    """Offsets off by 0.2 mN·m, noise a thousandth of that: u is that of a line through them."""
    speeds = np.array([-30.0, -20.0, -10.0, 10.0, 20.0, 30.0])
    line = np.column_stack([-np.sign(speeds), -speeds, np.ones(6)])
    miss = 2e-4 * np.array([0.0, 0.0, 1.0, 0.0, -1.0, 0.0])
    left = miss - line @ np.linalg.lstsq(line, miss, rcond=None)[0]
    expected = np.sqrt(np.diag(np.linalg.inv(line.T @ line)) * (left @ left) / 3.0)
    found = ESTIMATOR.fit(map_of_speeds(2e-4), Constants(), ESTIMATOR.options).estimates
    for name, u in zip(("torque_coulomb_nm", "b_visc_nm_s_rad"), expected[:2], strict=True):
        (one,) = (e for e in found if e.name == name)
        assert one.u_a == pytest.approx(u, rel=0.05), name


@pytest.mark.parametrize("name", ["joint-11p", "servo-15kw", "servo-ipm"])
def test_friction_of_currents_that_are_sampled_late(name: str) -> None:
    """Late currents turn the frame the more the faster; by one angle for all speeds, viscous
    friction came out 50 to 75 % high at 3 to 5 u, or Coulomb friction 17 % high.
    """
    motor = replace(design(name), effects={}).having(current_delay=None)
    maps = tuple(step for step in CAMPAIGN if step[1] == "torque_map")
    captures = campaign_of(campaign(motor, EXACT_BENCH, 1, maps))
    found = {e.name: e for e in ESTIMATOR.fit(captures, Constants(), ESTIMATOR.options).estimates}
    truth = {
        "torque_coulomb_nm": motor.torque_coulomb_nm,
        "b_visc_nm_s_rad": motor.b_visc_nm_s_rad,
    }
    for constant, true in truth.items():
        estimate = found[constant]
        assert estimate.number == pytest.approx(true, rel=0.05)
        assert abs(estimate.number - true) < 3.0 * estimate.u


@pytest.mark.parametrize(("other_a", "noise_a"), [(-6, 0.01), (-6, 0.0), (-5.4, 0.01), (-3, 0.01)])
def test_a_d_current_that_hardly_moves_makes_reluctance_torque_all_the_same(
    other_a: float, noise_a: float
) -> None:
    """It counted as torque of the magnet: Kt came out 5 % high at seven uncertainties."""
    kt_nm_a, reluctance_nm_a2, rng = 0.141, -0.0012, np.random.default_rng(3)
    i_q = np.repeat([-16.0, -10.0, -4.0, 4.0, 10.0, 16.0] * 2, 800)
    i_d = np.repeat([-6.0, other_a], i_q.size // 2)
    t = np.arange(i_q.size) / 1e4
    torque_nm = kt_nm_a * i_q + reluctance_nm_a2 * i_d * i_q
    held = capture(
        "torque_map",
        pole_pairs=10,
        u_rel_torque=0.002,
        t_s=t,
        temp_magnet_degc=np.full(t.size, 25.0),
        id_a=i_d + rng.normal(0.0, noise_a, t.size),
        iq_a=i_q + rng.normal(0.0, 0.01, t.size),
        theta_mech_rad=60.0 * t,
        omega_mech_rad_s=np.full(t.size, 60.0),
        torque_shaft_nm=torque_nm + rng.normal(0.0, 0.005, t.size),
    )
    kt = estimates(ESTIMATOR, held)["kt_peak_nm_a"]
    assert kt.known is bool(noise_a)
    if not kt.known:
        assert "one d current" in kt.note
        return
    assert abs(kt.number - kt_nm_a) < 2.5 * kt.u
    assert (kt.u > abs(reluctance_nm_a2 * i_d[0])) is (other_a == i_d[0])
