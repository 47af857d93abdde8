"""The parts of a heat balance on arrays whose answer is known in closed form."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from pipeline.estimation.estimators import thermal
from pipeline.estimation.estimators.thermal import (
    _balance,
    _losses_w,
    _start,
    _two_nodes,
    _winding_fit,
    heat_balance,
    network,
)
from pipeline.estimation.thermal.heat_record import (
    HeatRecord,
    _phase_shares,
    _unbroken,
    ambient_degc,
    read_heat,
    reference_resistance,
)
from pipeline.numerics.least_squares import autocorrelation_time, linear_fit
from pipeline.records.constants import Constants
from tests.unit.estimation.signals import capture, estimates, known_value

NETWORK = np.array([0.05, 0.004, 0.02, 0.005, 0.002])


def record(t, winding, second=None, *, power=40.0, ambient=25.0, r=0.4, measured=None):
    """A record of a constant copper loss [W]."""
    square = np.full(t.size, power / (1.5 * r))
    shown = None if measured is None else np.full(t.size, measured)
    columns = {"t_s": t, "temp_winding_degc": winding}
    made = capture("heat_run", "run", ambient_degc=ambient, **columns)
    return HeatRecord(
        made, t, np.full(t.size, r), np.sqrt(square), square, winding, second, shown, False, None
    )


def one_node(t, *, rth=1.5, tau=60.0, power=40.0, start=25.0, ambient=25.0):
    """T = T_a + P R + (T_0 - T_a - P R) exp(-t/tau)."""
    end = ambient + power * rth
    return end + (start - end) * np.exp(-t / tau)


def test_a_body_that_nobody_measured_shows_in_the_winding() -> None:
    """Two time constants in one thermometer: all four constants, and R as sure as the slow one is.

    One time constant read R 25 % low with z of 12.
    """
    t = np.arange(0.0, 4000.0, 2.0)
    losses = 40.0 * np.ones(t.size)
    k, a, b, c, d = NETWORK
    rise = network(t, losses, np.array([[*NETWORK, 0.0, 0.0]]))[0, 0]
    noise = 0.01 * np.random.default_rng(1).standard_normal(t.size)
    found = _balance(record(t, 25.0 + rise + noise), losses, 25.0)
    assert found is not None
    assert "not measured" in found.words
    expected = [k / (a + b * d / (c + d)), 1.0 / k, 1.0 / (a + b), 1.0 / (c + d)]
    u = np.sqrt(np.diag(found.scatter @ found.scatter.T))
    assert np.all(np.abs(found.values - expected) < 4.0 * u)
    assert np.all(u[1:] < 0.05 * np.array(expected[1:]))
    slow = 0.5 * (a + b + c + d) - math.sqrt(0.25 * (a + b - c - d) ** 2 + b * c)
    assert found.covered == pytest.approx(3998.0 * slow, rel=0.02)
    assert found.u_rth_k_w == pytest.approx(expected[0] * math.exp(-3998.0 * slow), rel=0.1)
    assert found.fitted_degc - 25.0 == pytest.approx(rise, abs=0.05)
    half = _balance(record(t, 25.0 + rise + noise), 2.0 * losses, 25.0)
    assert half is not None
    assert half.values == pytest.approx(found.values * np.array([0.5, 2.0, 1.0, 1.0]), rel=1e-6)
    # below three of the thermometer's noise one time constant does
    loud = 25.0 + rise + 3.0 * np.random.default_rng(2).standard_normal(t.size)
    plain = _balance(record(t, loud), losses, 25.0)
    assert plain is not None
    assert "one time constant" in plain.words
    # what only warms is no balance
    assert _balance(record(t, 25.0 + 0.01 * t + 1e-6 * t**2), losses, 25.0) is None


def steady(k, a, b, c, d):
    """R of the winding by Kirchhoff: 1/C over a, beside b in series with d of the body."""
    # heat that b carries to the body leaves it at share d/(c + d)
    return k / (a + b * d / (c + d))


@pytest.mark.parametrize("rates", [NETWORK, [0.02, 0.0, 0.03, 0.01, 0.004]])
def test_the_network_is_the_exponential_of_its_matrix(rates) -> None:
    """Against scipy's general exponential, with a constant loss, from its own start."""
    k, a, b, c, d = rates
    t = np.array([0.0, 1.0, 3.0, 10.0, 60.0, 400.0])
    rise = network(t, np.full(t.size, 40.0), np.array([[*rates, 3.0, 1.5]]))
    assert rise.shape == (2, 1, t.size)
    matrix = np.array([[-(a + b), b, 40.0 * k], [c, -(c + d), 0.0], [0.0, 0.0, 0.0]])
    for row, time in enumerate(t):
        expected = expm(matrix * time) @ np.array([3.0, 1.5, 1.0])
        assert rise[:, 0, row] == pytest.approx(expected[:2], rel=1e-9)
    late = network(np.array([0.0, 1e6]), np.full(2, 40.0), np.array([[*rates, 0.0, 0.0]]))
    assert late[0, 0, -1] == pytest.approx(40.0 * steady(*rates), rel=1e-9)
    assert late[1, 0, -1] == pytest.approx(late[0, 0, -1] * c / (c + d), rel=1e-9)


def test_the_network_takes_the_mean_loss_of_a_steps_ends() -> None:
    """0 and 80 W at the ends of one step warm as 40 W throughout; two variants are two rows."""
    t = np.array([0.0, 5.0])
    rows = np.array([[*NETWORK, 0.0, 0.0], [*(2.0 * NETWORK), 1.0, 1.0]])
    ramp, flat = (network(t, np.array(w), rows) for w in ([0.0, 80.0], [40.0, 40.0]))
    assert ramp == pytest.approx(flat)
    alone = network(t, np.array([40.0, 40.0]), rows[1:])
    assert flat[:, 1] == pytest.approx(alone[:, 0])


def test_the_columns_of_the_balance() -> None:
    t = np.array([0.0, 1.0, 3.0])
    found = heat_balance(t, np.array([2.0, 4.0, 4.0]), np.array([0.0, 1.0, 2.0]))
    assert found[:, 0].tolist() == [1.0, 1.0, 1.0]
    assert np.diff(found[:, 1]) == pytest.approx([3.0, 8.0])
    assert np.diff(found[:, 2]) == pytest.approx([-0.5, -3.0])


@pytest.mark.parametrize("end_s", [120.0, 300.0])
def test_one_node_is_as_sure_as_what_the_record_covers(end_s: float) -> None:
    """Noise-free: u is R exp(-covered), and nothing else."""
    t = np.arange(0.0, end_s, 0.5)
    found = _balance(record(t, one_node(t)), np.full(t.size, 40.0), 25.0)
    assert found is not None
    assert found.rth_k_w == pytest.approx(1.5, rel=1e-4)
    covered = (end_s - 0.5) / 60.0
    assert found.covered == pytest.approx(covered, rel=1e-3)
    assert found.u_rth_k_w == pytest.approx(1.5 * math.exp(-covered), rel=2e-3)
    assert found.fitted_degc == pytest.approx(one_node(t), abs=1e-3)
    assert f"one time constant of {60:.3g} s, {covered:.1f} of them" in found.words


def test_one_nodes_scatter_is_that_of_a_ratio() -> None:
    """u^2/R^2 = v_k/k^2 + v_r/r^2 - 2 c/(k r), times how many samples count as one."""
    t = np.arange(0.0, 1200.0, 0.5)
    noise = 0.05 * np.random.default_rng(3).standard_normal(t.size)
    winding = one_node(t) + noise
    power = np.full(t.size, 40.0)
    found = _balance(record(t, winding), power, 25.0)
    assert found is not None
    fit = linear_fit(heat_balance(t, power, winding - 25.0), winding)
    k, r = fit.coefficients[1:]
    v = fit.covariance
    tau = autocorrelation_time(fit.residuals)
    relative = v[1, 1] / k**2 + v[2, 2] / r**2 - 2.0 * v[1, 2] / (k * r)
    assert found.u_rth_k_w == pytest.approx(k / r * math.sqrt(relative * tau), rel=1e-4)
    assert found.dof == pytest.approx(fit.dof / tau)


def test_twice_the_heat_for_one_rise_is_half_the_resistance_and_half_its_u() -> None:
    t = np.arange(0.0, 100.0, 0.5)
    winding = one_node(t) + 0.5 * np.random.default_rng(3).standard_normal(t.size)
    one, two = (_balance(record(t, winding), np.full(t.size, p), 25.0) for p in (40.0, 80.0))
    assert one is not None and two is not None
    assert two.rth_k_w == pytest.approx(one.rth_k_w / 2.0, rel=1e-9)
    assert two.u_rth_k_w == pytest.approx(one.u_rth_k_w / 2.0, rel=1e-9)


@pytest.mark.parametrize("power", [-40.0, 0.0])
def test_heat_that_cools_is_no_balance(power: float) -> None:
    t = np.arange(0.0, 200.0, 0.5)
    assert _balance(record(t, one_node(t, power=40.0)), np.full(t.size, power), 25.0) is None


def two_nodes(t, noise=0.0, seed=0, rates=NETWORK):
    rise = network(t, np.full(t.size, 40.0), np.array([[*rates, 2.0, 1.0]]))[:, 0]
    rng = np.random.default_rng(seed)
    return rise + 25.0 + noise * rng.standard_normal(rise.shape)


@pytest.mark.parametrize("rates", [NETWORK, np.array([0.05, 0.0, 0.02, 0.005, 0.002])])
def test_two_nodes_find_the_steady_resistance(rates) -> None:
    t = np.arange(0.0, 1500.0, 5.0)
    winding, body = two_nodes(t, 0.01, rates=rates)
    found = _balance(record(t, winding, body), np.full(t.size, 40.0), 25.0)
    assert found is not None
    assert "two nodes" in found.words
    assert found.rth_k_w == pytest.approx(steady(*rates), rel=5e-3)
    _, a, b, c, d = rates
    fast, slow = (
        float(w.split()[0]) for w in found.words.replace("body ", "winding ").split("winding ")[1:]
    )
    assert fast == pytest.approx(1.0 / (a + b), rel=0.05)
    assert slow == pytest.approx(1.0 / (c + d), rel=0.05)
    assert found.covered == pytest.approx(t[-1] * (a + b), rel=0.05)


def test_two_nodes_scatter_as_they_say() -> None:
    """Over 24 drawings of the noise the spread of R is its u, within what 24 can tell."""
    t = np.arange(0.0, 1500.0, 10.0)
    start = NETWORK
    found = [
        _two_nodes(record(t, *two_nodes(t, 0.05, seed)), np.full(t.size, 40.0), 25.0, start, True)
        for seed in range(24)
    ]
    values = np.array([one.rth_k_w for one in found if one])
    u = float(np.mean([one.u_rth_k_w for one in found if one]))
    assert values.size == 24
    assert 0.7 < values.std(ddof=1) / u < 1.4
    assert abs(values.mean() - steady(*NETWORK)) < 4.0 * u / math.sqrt(24)
    assert all(one.dof == pytest.approx(2 * t.size - 7, rel=0.7) for one in found if one)
    assert _two_nodes(record(t, one_node(t)), np.full(t.size, 40.0), 25.0, start, True) is None


def fits(sigma_b: float, sigma_c: float, k: float = 2.0):
    """Diagonal fits with b = 3, c = 3 and their standard errors."""

    def diagonal(values, sigmas):
        return linear_fit(np.eye(len(values)), np.array(values), np.array(sigmas))

    double = diagonal([20.0, k, 3.0, 0.5], [1.0, 0.1, sigma_b, 0.1])
    body = diagonal([20.0, 3.0, 0.25], [1.0, sigma_c, 0.1])
    return double, body


def test_a_body_takes_heat_where_both_ways_stand_out_by_three_u() -> None:
    start, direct = _start(*fits(0.99, 0.99))
    assert direct
    assert start == pytest.approx([2.0, 0.5, 3.0, 3.0, 0.25])
    for b, c in ((1.01, 0.5), (0.5, 1.01)):
        assert _start(*fits(b, c))[0] is None
    assert _start(*fits(0.5, 0.5, k=-1.0))[0] is None
    double, body = fits(0.5, 0.5)
    without = linear_fit(np.eye(3), np.array([20.0, 2.0, 3.0]), np.array([1.0, 0.1, 0.5]))
    start, direct = _start(without, body)
    assert not direct
    assert start is not None
    assert start[1] == 0.0
    assert double.coefficients.size == 4


def test_heat_straight_to_ambient_counts_from_three_u() -> None:
    rng = np.random.default_rng(0)
    design = rng.standard_normal((400, 4))
    noise = rng.standard_normal(400)
    noise -= design @ np.linalg.lstsq(design, noise, rcond=None)[0]
    u = linear_fit(design, noise).u(3)
    for times, size in ((2.9, 3), (3.1, 4)):
        y = design @ np.array([1.0, 1.0, 1.0, times * u]) + noise
        assert _winding_fit(design, y).coefficients.size == size


def test_copper_loss() -> None:
    """1.5 R(T) i^2: R as measured, else R25 (1 + alpha (T - 25))."""
    t = np.arange(3.0)
    run = record(t, np.array([25.0, 35.0, 45.0]), power=30.0)
    assert _losses_w(run, Constants()) == pytest.approx(30.0)
    resistance = known_value("r_phase_ohm", 0.5, 0.001, "ohm")
    square = 30.0 / (1.5 * 0.4)
    warm = np.array([1.0, 1.03, 1.06])
    known = Constants((resistance, known_value("temp_coeff_copper_1_k", 0.003)))
    assert _losses_w(run, known) == pytest.approx(1.5 * 0.5 * warm * square)
    copper = _losses_w(run, Constants((resistance,)))
    assert copper[2] / copper[0] == pytest.approx(1.0 + 20.0 / (234.5 + 25.0), rel=3e-3)


def test_what_an_instrument_makes_of_the_resistance() -> None:
    """Loss by R and i^2, or by v and i; a thermometer by the rise, where ambient is stated."""
    t = np.arange(0.0, 600.0, 0.5)
    winding = one_node(t)
    run = record(t, winding, measured=25.0)
    gains = {"u_rel_voltage": 0.001, "u_rel_current": 0.002, "u_temp_degc": 0.5}
    balance = _balance(run, np.full(t.size, 40.0), 25.0)
    assert balance is not None

    def budget(made, known):
        found = thermal._estimates(balance, made, np.array([25.0]), known)[0]
        return {p.source: p.u / balance.rth_k_w for p in found.budget}, found

    parts, found = budget(run, Constants())
    assert parts["voltage@s"] == pytest.approx(-gains["u_rel_voltage"])
    assert parts["current@s"] == pytest.approx(-gains["u_rel_current"])
    assert "temperature@s" not in parts
    # 1.5 K/W and 60 s make 40 J/K
    assert balance.values == pytest.approx([1.5, 40.0, 60.0], rel=1e-3)
    assert found.at["temp_high_degc"] == pytest.approx(winding.max(), abs=0.01)
    assert found.at["current_a"] == pytest.approx(math.sqrt(40.0 / 0.6), abs=1e-4)
    flat = known_value("temp_coeff_copper_1_k", 0.0)
    known = Constants((known_value("r_phase_ohm", 0.4, 0.004, "ohm"), flat))
    parts, _ = budget(replace(run, temp_ambient_degc=None), known)
    assert parts["current@s"] == pytest.approx(-2.0 * gains["u_rel_current"])
    assert parts["test:r_phase_ohm"] == pytest.approx(-0.01)
    assert parts["temperature@s"] == pytest.approx(0.5 / 60.0, rel=1e-3)
    assert "voltage@s" not in parts


def heated(**more):
    t = np.arange(0.0, 400.0, 0.1)
    winding = one_node(t)
    columns = {
        "t_s": t, "id_a": np.full(t.size, 6.0), "iq_a": np.full(t.size, 8.0),
        "vd_v": np.full(t.size, 2.4), "vq_v": np.full(t.size, 3.2), "temp_winding_degc": winding,
    }  # fmt: skip
    return capture("heat_run", "run", ambient_degc=25.0, **{**columns, **more})


def test_a_record_of_a_locked_rotor() -> None:
    """V along I: (2.4 * 6 + 3.2 * 8) / 100 = 0.4 ohm; 300 blocks of 13 rows."""
    found = read_heat(heated(), Constants())
    assert found is not None
    assert found.r_phase_ohm == pytest.approx(0.4)
    assert found.current_a == pytest.approx(10.0)
    assert found.square_a2 == pytest.approx(100.0)
    assert found.t_s.size == 4000 // (4000 // 300)
    assert not found.turning
    assert found.shares is None
    assert ambient_degc(found) == 25.0


def test_the_electrical_power_of_a_turning_rotor_is_taken_off() -> None:
    """w_e ((psi + Ld id) iq - Lq iq id) = 5 * 2 * (0.01 * 8 + (3e-3 - 5e-3) * 48) = -0.16 W."""
    turning = heated(omega_mech_rad_s=np.full(4000, 2.0))
    with pytest.raises(KeyError, match="back-EMF"):
        read_heat(turning, Constants())
    values = {"psi_pm_wb": 0.01, "pole_pairs": 5.0, "ld_h": 3e-3, "lq_h": 5e-3}
    known = Constants(tuple(known_value(n, v) for n, v in values.items()))
    found = read_heat(turning, known)
    assert found is not None
    assert found.turning
    assert found.r_phase_ohm == pytest.approx((40.0 + 0.16) / 100.0)
    # warm magnets: psi falls by 0.2 % a kelvin over 40 K
    warm = heated(omega_mech_rad_s=np.full(4000, 2.0), temp_magnet_degc=np.full(4000, 65.0))
    known = known.adding((known_value("temp_coeff_magnet_1_k", -0.002),))
    found = read_heat(warm, known)
    assert found is not None
    assert found.r_phase_ohm == pytest.approx((40.0 + 0.16 + 10.0 * 8e-4 * 8.0) / 100.0)


@pytest.mark.parametrize(("speed", "matters"), [(0.9e-4, False), (1.1e-4, True)])
def test_a_power_of_a_ten_thousandth_is_left_out(speed: float, matters: bool) -> None:
    """40 W of copper: 4 mW is the limit; with psi 1 Wb, p 5 and i_q 8 A, 40 W a rad/s."""
    values = {"psi_pm_wb": 1.0, "pole_pairs": 5.0, "ld_h": 0.0, "lq_h": 0.0}
    known = Constants(tuple(known_value(n, v) for n, v in values.items()))
    found = read_heat(heated(omega_mech_rad_s=np.full(4000, speed)), known)
    assert found is not None
    assert found.turning is matters


@pytest.mark.parametrize(("speed", "refused"), [(0.019, False), (-0.019, False), (0.021, True)])
def test_a_rotor_that_all_but_stands_needs_no_flux(speed: float, refused: bool) -> None:
    run = heated(omega_mech_rad_s=np.full(4000, speed))
    if refused:
        with pytest.raises(KeyError, match="turns"):
            read_heat(run, Constants())
    else:
        assert read_heat(run, Constants()) is not None


def test_a_pair_of_terminals_carries_two_resistances() -> None:
    """2 R I^2 is 1.5 R (4/3) I^2: V = 2 R I, each phase half of what is seen."""
    t = np.arange(0.0, 400.0, 0.1)
    run = capture(
        "heat_run", "pair", pair="bc", t_s=t, vbc_v=np.full(t.size, 8.0),
        ib_a=np.full(t.size, 10.0), temp_winding_degc=one_node(t),
    )  # fmt: skip
    found = read_heat(run, Constants())
    assert found is not None
    assert found.r_phase_ohm == pytest.approx(0.4)
    assert found.square_a2 == pytest.approx(400.0 / 3.0)
    assert found.shares == (0.0, 0.5, 0.5)


@pytest.mark.parametrize(
    ("degrees", "shares"),
    [(0.0, (2 / 3, 1 / 6, 1 / 6)), (120.0, (1 / 6, 2 / 3, 1 / 6)), (90.0, (0.0, 0.5, 0.5))],
)
def test_shares_of_the_phases_by_the_currents_angle(degrees, shares) -> None:
    """i_d 6 and i_q 8 lie at 53.13 degrees; the rotor at what is left."""
    angle = math.radians(degrees) - math.atan2(8.0, 6.0)
    run = heated(theta_elec_rad=np.full(4000, angle))
    assert _phase_shares(run, Constants()) == pytest.approx(shares, abs=1e-12)
    run = heated(theta_mech_rad=np.full(4000, (angle - 0.3) / 5.0))
    known = Constants((known_value("pole_pairs", 5), known_value("angle_offset_elec_rad", 0.3)))
    assert _phase_shares(run, known) == pytest.approx(shares, abs=1e-12)
    assert _phase_shares(run, Constants()) is None


def test_the_reference_is_of_the_phases_that_the_current_saw() -> None:
    run = replace(record(np.arange(3.0), np.full(3, 25.0)), shares=(0.5, 0.3, 0.2))
    phases = [known_value(f"r_{p}_ohm", r, u, "ohm") for p, r, u in
              (("a", 1.0, 0.01), ("b", 2.0, 0.02), ("c", 3.0, 0.03))]  # fmt: skip
    mean = known_value("r_phase_ohm", 2.0, 0.0, "ohm")
    found = reference_resistance(run, Constants((mean, *phases)))
    assert found is not None
    assert found.number == pytest.approx(0.5 + 0.6 + 0.6)
    assert found.u == pytest.approx(math.hypot(0.005, 0.006, 0.006))
    assert reference_resistance(run, Constants((mean, *phases[:2]))) == mean
    assert reference_resistance(replace(run, shares=None), Constants((mean, *phases))) == mean


def test_a_block_over_a_gap_is_left_out() -> None:
    t = np.arange(12.0)
    assert _unbroken(t, 3).tolist() == [True] * 4
    t[7:] += 2.0 * 0.51  # the third block takes 3.02 instead of 2
    assert _unbroken(t, 3).tolist() == [True, True, False, True]
    t = np.arange(12.0)
    t[7:] += 2.0 * 0.49
    assert _unbroken(t, 3).tolist() == [True] * 4


def test_of_two_runs_the_surer_one_counts_and_a_short_one_none() -> None:
    long, short = np.arange(0.0, 600.0, 0.5), np.arange(0.0, 240.0, 0.5)
    runs = []
    for name, t in (("short", short), ("long", long)):
        current = np.full(t.size, math.sqrt(40.0 / 0.6))
        runs.append(
            capture(
                "heat_run", name, ambient_degc=25.0, t_s=t, id_a=current, iq_a=np.zeros(t.size),
                vd_v=0.4 * current, vq_v=np.zeros(t.size), temp_winding_degc=one_node(t),
            )
        )  # fmt: skip
    for order in (runs, runs[::-1]):
        found = estimates(thermal.ESTIMATOR, *order)["rth_winding_k_w"]
        assert found.captures == ("long",)
        assert found.number == pytest.approx(1.5, rel=1e-3)
    # 4 time constants leave 1.8 %: under a limit of 2 % it counts, under 1.7 % it does not
    for limit, there in ((0.02, True), (0.017, False)):
        found = estimates(thermal.ESTIMATOR, runs[0], worst_u_rel=limit)["rth_winding_k_w"]
        assert found.known is there
