"""The effects: found, complete, and each equal to its closed form."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipeline.criticism.data.machine_scale import machine_of
from pipeline.criticism.data.segment import slow_orders
from pipeline.criticism.effects import cogging
from pipeline.criticism.library.registry import chosen, effects
from pipeline.criticism.machine.coenergy import base_flux, effect_flux
from pipeline.criticism.machine.model import Model, evaluate, values_of
from pipeline.criticism.operating import Recorded, ShaftState
from pipeline.physics.glossary import COLUMNS, TESTS
from pipeline.records.capture import Campaign
from pipeline.records.constants import Constants
from pipeline.records.errors import UsageError
from tests.unit.criticism.machines import BASE, machine, operating
from tests.unit.estimation.signals import capture

LIBRARY = effects()


def ready(x):
    """Flux and torque filled in, as the drop and torque hooks find them."""
    evaluate(Model(machine(), ()), x, BASE)
    return x


@pytest.mark.parametrize("name", LIBRARY)
def test_an_effect_says_what_the_contract_asks_of_it(name):
    effect = LIBRARY[name]
    assert effect.words and effect.signature and effect.experiment and effect.reference
    assert set(effect.tests) <= set(TESTS)
    assert set(effect.signals) <= set(COLUMNS)
    known = {*LIBRARY, "backlash"}
    assert set(effect.alternatives) <= known
    assert effect.parameters_of(machine())
    for p in effect.parameters_of(machine()):
        assert p.unit and p.typical > 0 and p.low < p.high
        assert p.negligible < p.typical
        assert p.scale == "1" or p.scale in machine().scales


@pytest.mark.parametrize("name", [n for n, e in LIBRARY.items() if e.coenergy])
def test_flux_is_reciprocal_and_torque_is_the_angles_share(name):
    """Complex steps against central differences of the co-energy itself."""
    effect, x = LIBRARY[name], operating()
    q = {p.name: p.typical * machine().scale(p) for p in effect.parameters_of(machine())}
    flux, slope = effect_flux(effect, x, q)
    from dataclasses import replace

    def energy(**moved):
        return np.real(effect.coenergy(replace(x, **moved), q)) * np.ones(60)

    h = 1e-4
    by_d = (energy(id_a=x.id_a + h) - energy(id_a=x.id_a - h)) / (2 * h)
    by_q = (energy(iq_a=x.iq_a + h) - energy(iq_a=x.iq_a - h)) / (2 * h)
    by_e = (energy(eps_rad=x.eps_rad + h) - energy(eps_rad=x.eps_rad - h)) / (2 * h)
    size = np.abs(flux).max()
    assert flux.real == pytest.approx(by_d, abs=1e-6 * size)
    assert flux.imag == pytest.approx(by_q, abs=1e-6 * size)
    assert slope == pytest.approx(by_e, abs=1e-6 * max(np.abs(slope).max(), size))
    up, _ = effect_flux(effect, replace(x, iq_a=x.iq_a + h), q)
    down, _ = effect_flux(effect, replace(x, iq_a=x.iq_a - h), q)
    right, _ = effect_flux(effect, replace(x, id_a=x.id_a + h), q)
    left, _ = effect_flux(effect, replace(x, id_a=x.id_a - h), q)
    assert (up - down).real == pytest.approx((right - left).imag, abs=1e-9 * size)


def test_dead_time_is_a_sign_for_each_phase_in_the_abc_frame():
    x = operating()
    x.ts_s = 1.0
    drop = LIBRARY["dead_time"].drop(
        x,
        {"loss_v": 0.2, "width_a": 1e-6, "lag_s": 0.0, "on_v": 0.0, "ripple": 0.0, "given_v": 0.0},
    )
    stationary = (x.id_a + 1j * x.iq_a) * np.exp(1j * x.eps_rad)
    phases = [np.real(stationary * np.exp(-2j * np.pi * k / 3)) for k in range(3)]
    lost = [0.2 * np.sign(i) for i in phases]
    alpha = 2 / 3 * (lost[0] - 0.5 * lost[1] - 0.5 * lost[2])
    beta = (lost[1] - lost[2]) / math.sqrt(3)
    assert drop == pytest.approx((alpha + 1j * beta) * np.exp(-1j * x.eps_rad), abs=1e-12)


def test_a_switch_that_is_on_drops_with_the_current():
    x = operating()
    of = {"loss_v": 0.0, "width_a": 1.0, "lag_s": 0.0, "on_v": 0.3, "ripple": 0.0, "given_v": 0.0}
    drop = LIBRARY["dead_time"].drop(x, of)
    assert drop == pytest.approx(0.3 * x.i_a / x.machine.scales["current_a"])
    assert not np.any(LIBRARY["dead_time"].drop(replace(x, inverter=False), of))


def test_a_compensation_gives_back_by_an_earlier_current_what_dead_time_takes():
    """In full at large currents; of those that turned since its sample, in the wrong sense."""
    x = operating()
    of = {"loss_v": 0.2, "width_a": 1e-6, "lag_s": 0.0, "on_v": 0.0, "ripple": 0.0, "given_v": 0.0}
    gives = of | {"loss_v": 0.0, "given_v": 0.2, "ramp_a": 1e-6, "given_lag_s": 0.0}
    drop = LIBRARY["dead_time"].drop
    whole, late_s = drop(x, of), 2e-4
    assert np.abs(drop(x, gives)).max() < 1e-12
    assert drop(x, gives | {"loss_v": 0.05}) == pytest.approx(0.25 * whole)
    assert drop(x, gives | {"ramp_a": 1e9}) == pytest.approx(whole)
    still = replace(x, id_a=np.full(x.id_a.size, 2.0), iq_a=np.full(x.id_a.size, 3.0), cache={})
    before = replace(still, eps_rad=x.eps_rad - x.machine.pole_pairs * x.omega_rad_s * late_s)
    turned = np.exp(1j * (before.eps_rad - x.eps_rad))
    late = drop(still, of) - drop(before, of) * turned
    assert drop(still, gives | {"given_lag_s": late_s}) == pytest.approx(late)


@pytest.mark.parametrize(("pole_pairs", "slots", "order"), [(7, 12, 84), (20, 63, None)])
def test_slots_and_poles_that_share_no_factor_do_not_cog(pole_pairs, slots, order):
    """63 slots and 40 poles make 2520 waves a turn of nothing: in a log they beat with anything."""
    one = machine(pole_pairs, slots)
    assert one.cogging_order == order
    assert max(cogging.orders(one)) == (order or 6 * pole_pairs)
    assert max(slow_orders(one)) == (2 * order if order else 12 * pole_pairs)
    assert 2520 in cogging.orders(replace(one, torque_orders=(2520,))) or order


def test_phase_imbalance_is_three_resistances_in_the_abc_frame():
    x, gamma = operating(), 0.02 - 0.03j
    drop = LIBRARY["phase_imbalance"].drop(x, {"cosine": gamma.real, "sine": gamma.imag})
    more = [2 * np.real(gamma * np.exp(-4j * np.pi * k / 3)) * BASE["r_ohm"] for k in range(3)]
    stationary = (x.id_a + 1j * x.iq_a) * np.exp(1j * x.eps_rad)
    lost = [r * np.real(stationary * np.exp(-2j * np.pi * k / 3)) for k, r in enumerate(more)]
    total = 2 / 3 * sum(v * np.exp(2j * np.pi * k / 3) for k, v in enumerate(lost))
    assert drop == pytest.approx(total * np.exp(-1j * x.eps_rad), abs=1e-12)


@pytest.mark.parametrize("bend", [0.0, 1e-5, 1e-3, 4.6])
def test_saturation_bends_the_flux_by_its_rational_curve(bend):
    """Down to no bend at all, where it is a cubic and the closed form a quotient of zeros."""
    x, size = operating(), 16.0
    q = {"q_fall": 0.1, "q_bend": bend, "d_odd": 0.05, "d_fall": 0.07, "d_bend": bend}
    flux, _ = effect_flux(LIBRARY["saturation"], x, q)
    s, d = x.iq_a / size, x.id_a / size
    lost_q, lost_d = (0.1 * s**2 / (1 + bend * s**2), 0.07 * d**2 / (1 + bend * d**2))
    assert flux.imag == pytest.approx(-BASE["lq_h"] * x.iq_a * lost_q, rel=1e-6)
    assert flux.real == pytest.approx(-BASE["ld_h"] * size * d * (0.05 * d + lost_d), rel=1e-6)


@pytest.mark.parametrize(("bend", "d_bend"), [(0.0, 0.0), (1.5, 0.0), (0.0, 2.0), (1.5, 2.0)])
def test_cross_saturation_bends_on_both_axes(bend, d_bend):
    """ψ_q = −√(L_d L_q) i_max (odd s_d + even s_d²)/(1 + b_d s_d²) · 2 s_q/(1 + b s_q²)², and
    ψ_d = −√(L_d L_q) i_max (odd + 2 even s_d − odd b_d s_d²)/(1 + b_d s_d²)² · s_q²/(1 + b s_q²).
    """
    x = operating()
    q = {"odd": 0.2, "even": -0.1, "bend": bend, "d_bend": d_bend}
    size = machine().scales["current_a"]
    d, s = x.id_a / size, x.iq_a / size
    beside = (0.2 * d - 0.1 * d**2) / (1.0 + d_bend * d**2)
    closed = -math.sqrt(BASE["ld_h"] * BASE["lq_h"]) * size * beside * 2 * s
    flux, _ = effect_flux(LIBRARY["cross_saturation"], x, q)
    assert flux.imag == pytest.approx(closed / (1.0 + bend * s**2) ** 2, rel=1e-10)
    slope = (0.2 - 0.2 * d - 0.2 * d_bend * d**2) / (1.0 + d_bend * d**2) ** 2
    closed = -math.sqrt(BASE["ld_h"] * BASE["lq_h"]) * size * slope * s**2 / (1.0 + bend * s**2)
    assert flux.real == pytest.approx(closed, rel=1e-9, abs=1e-15)


def test_torque_comes_from_the_co_energy_of_the_linear_machine():
    x = ready(operating())
    ld, lq, psi = BASE["ld_h"], BASE["lq_h"], BASE["psi_wb"]
    expected = 1.5 * 7 * (psi * x.iq_a + (ld - lq) * x.id_a * x.iq_a)
    assert x.torque_nm == pytest.approx(expected)
    assert base_flux(x, BASE).real == pytest.approx(ld * x.id_a + psi)


@pytest.mark.parametrize(
    ("name", "values", "closed"),
    [
        ("coulomb_friction", {"torque_nm": 0.01}, lambda x: 0.01 * np.sign(x.omega_rad_s)),
        (
            "windage",
            {"drag_nm": 0.02},
            lambda x: 0.02 * x.omega_rad_s * abs(x.omega_rad_s) / 250.0**2,
        ),
        (
            "stribeck",
            {"excess_nm": 0.01, "speed_rad_s": 7.0, "exponent": 2.0, "tail": 0.0},
            lambda x: 0.01 * np.exp(-((x.omega_rad_s / 7.0) ** 2)) * np.sign(x.omega_rad_s),
        ),
        (
            "stribeck",
            {"excess_nm": 0.01, "speed_rad_s": 7.0, "exponent": 2.0, "tail": 1.0},
            lambda x: 0.01 / (1.0 + (x.omega_rad_s / 7.0) ** 2) * np.sign(x.omega_rad_s),
        ),
        (
            "stribeck",
            {"excess_nm": 0.01, "speed_rad_s": 7.0, "exponent": 1.0, "tail": 0.5},
            lambda x: 0.01 / (1.0 + abs(x.omega_rad_s) / 14.0) ** 2 * np.sign(x.omega_rad_s),
        ),
        (
            "unbalance",
            {"sin_nm": 0.01, "cos_nm": -0.02},
            lambda x: 0.01 * np.sin(x.theta_rad) - 0.02 * np.cos(x.theta_rad),
        ),
        (
            "cogging",
            {"sin_84_nm": 0.01, "cos_84_nm": 0.02},
            lambda x: 0.01 * np.sin(84 * x.theta_rad) + 0.02 * np.cos(84 * x.theta_rad),
        ),
        (
            "iron_eddy",
            {"drag_nm": 0.02, "excess_nm": 0.0},
            lambda x: 0.02 * x.omega_rad_s / 250.0 * abs(x.flux_wb / BASE["psi_wb"]) ** 2,
        ),
        (
            "iron_eddy",
            {"drag_nm": 0.0, "excess_nm": 0.01},
            lambda x: (
                0.01
                * np.sign(x.omega_rad_s)
                * (abs(x.omega_rad_s) / 250.0) ** 0.5
                * abs(x.flux_wb / BASE["psi_wb"]) ** 1.5
            ),
        ),
        (
            "iron_hysteresis",
            {"drag_nm": 0.01, "steeper": 0.6},
            lambda x: 0.01 * np.sign(x.omega_rad_s) * abs(x.flux_wb / BASE["psi_wb"]) ** 1.6,
        ),
        (
            "load_dependent_friction",
            {"share": 0.02},
            lambda x: 0.02 * abs(x.torque_nm) * np.sign(x.omega_rad_s),
        ),
        (
            "presliding",
            {"torque_nm": 0.01, "damping_nm": 0.5, "travel_rad": 0.002},
            lambda x: (
                2.0
                * np.exp(-x.travel_rad / 0.002)
                * (0.5 * x.omega_rad_s / 250.0 - 0.01 * np.sign(x.omega_rad_s))
            ),
        ),
    ],
)
def test_a_drag_of_a_held_shaft_is_its_formula(name, values, closed):
    x = ready(replace(operating(), shaft=ShaftState(held=True)))
    assert LIBRARY[name].torque(x, values) == pytest.approx(closed(x), abs=1e-14)


@pytest.mark.parametrize("step_rad", [0.2, 1.5, 2.6])
def test_a_free_shaft_s_second_difference_tells_the_mean_of_its_cogging(step_rad):
    """θ'' = sin kθ at a steady pace, integrated twice: its second difference over T² is the drag
    that the model has at the sample.
    """
    order, n = 528, 60
    theta = step_rad / order * np.arange(n)
    bend = -np.sin(order * theta) / step_rad**2  # ∬ sin over (samples)²
    told = np.diff(bend, 2)
    x = replace(operating(n), theta_rad=theta)
    drag = LIBRARY["cogging"].torque(x, {f"sin_{order}_nm": 0.3})
    assert drag[1:-1] == pytest.approx(0.3 * told, abs=1e-12)


def test_a_late_current_is_turned_back_and_not_lengthened():
    """A phase current that is logged τ late stands ω τ behind in the rotor frame, as long as ever;
    of a ramp besides, what it rose since.
    """
    n, ts, tau = 50, 1e-4, 3e-5
    omega = np.full(n, 2500.0)
    true = (3.0 + 40.0 * np.arange(n) * ts) * np.exp(0.4j)
    late = (3.0 + 40.0 * (np.arange(n) * ts - tau)) * np.exp(0.4j) * np.exp(-1j * omega * tau)
    zero = np.zeros(n)
    seen = Recorded(late, zero, zero, omega, ts, True, "drive")
    found = LIBRARY["current_delay"].current(seen, {"delay_s": tau, "of_phases": 1.0})
    # beyond the ends nothing is known
    assert found[1:-2] == pytest.approx(true[1:-2], rel=1e-12)


def test_an_encoder_errs_once_and_twice_a_turn_and_a_resolver_an_electrical_one():
    x = operating()
    q = {"sine_rad": 2e-3, "cosine_rad": -1e-3, "sine2_rad": 5e-4, "cosine2_rad": 3e-4}
    of_resolver = {"sine_elec_turn_rad": 4e-4, "cosine_elec_turn_rad": 1e-4}
    of_resolver |= {"sine2_elec_turn_rad": -6e-4, "cosine2_elec_turn_rad": 2e-4}
    sines, cosines = [*{**q, **of_resolver}.values()][::2], [*{**q, **of_resolver}.values()][1::2]
    angles = np.outer([1, 2, 7, 14], x.theta_rad)
    waves = sines @ np.sin(angles) + cosines @ np.cos(angles)
    eccentric = LIBRARY["angle_eccentricity"]
    assert {p.name for p in eccentric.parameters_of(x.machine)} == {*q, *of_resolver}
    assert eccentric.angle(x, q | of_resolver) == pytest.approx(7 * waves, abs=1e-15)
    two_poles = replace(x.machine, pole_pairs=1)
    assert {p.name for p in eccentric.parameters_of(two_poles)} == {*q}


def test_a_torque_behind_two_lags_is_brought_forward_by_both():
    """Y + (τ + l) y' + τ l y'' of two lags in a row, for a torque that is slow beside them."""
    ts, tau, lag, rate = 1e-4, 8e-4, 3e-4, 60.0
    t = ts * np.arange(2000)
    late = math.atan(rate * tau) + math.atan(rate * lag)
    seen = np.sin(rate * t - late) / math.hypot(1.0, rate * tau) / math.hypot(1.0, rate * lag)
    zero = np.zeros(t.size)
    recorded = Recorded(zero.astype(complex), seen, zero, zero, ts, True, "drive")
    q = {"lag_s": tau + lag, "late": tau * lag / (tau + lag) / ts, "stamped": 0.0}
    true = LIBRARY["torque_lag"].load(recorded, q)
    assert true[5:-5] == pytest.approx(np.sin(rate * t)[5:-5], abs=2e-4)


def test_cogging_orders_are_multiples_of_poles_or_slots():
    """Order 13 stands out of this slow turn as well, but no magnet on a slot can make it."""
    assert cogging.orders(replace(machine(), torque_orders=(12, 13, 14, 84))) == (12, 14, 84)


def test_a_users_file_counts_and_may_not_take_a_name(tmp_path: Path):
    text = Path(cogging.__file__).with_name("windage.py").read_text(encoding="utf-8")
    (tmp_path / "brake.py").write_text(text.replace('name="windage"', 'name="brake"'))
    assert "brake" in effects(str(tmp_path))
    assert chosen(("brake",), str(tmp_path))["brake"].hook == "torque"
    (tmp_path / "again.py").write_text(text)
    with pytest.raises(UsageError, match="windage exists already"):
        effects(str(tmp_path))
    with pytest.raises(UsageError, match="unknown effect friction"):
        chosen(("friction",))


def test_values_are_handed_over_by_their_short_names():
    values = {"windage.drag_nm": 0.5, "stribeck.excess_nm": 0.1}
    assert values_of(LIBRARY["windage"], machine(), values) == {"drag_nm": 0.5}


@pytest.mark.parametrize(("name", "of"), [("iron_eddy", "excess_nm"), ("iron_hysteresis", "")])
def test_power_that_the_iron_takes_from_the_winding_is_what_its_drag_takes_from_the_shaft(name, of):
    effect, x = LIBRARY[name], ready(operating())
    q = {"drag_nm": 0.02, "excess_nm": 0.0, "steeper": 0.3, "parallel": 1.0}
    if of:
        q[of] = 0.01
    induced = 1j * 7 * x.omega_rad_s * x.flux_wb
    taken = 1.5 * np.real(induced * np.conj(effect.parallel(x, q)))
    assert taken == pytest.approx(effect.torque(x, q) * x.omega_rad_s, rel=1e-12)
    assert not effect.parallel(x, {**q, "parallel": 0.0}).any()
    open_winding = replace(x, inverter=False)
    assert not effect.parallel(open_winding, q).any()
    eddies = effect.parallel(open_winding, {**q, "parallel": 2.0})
    assert eddies == pytest.approx(effect.parallel(x, q))


def test_a_resistance_beside_the_magnetising_branch_is_the_iron_s_loss_in_both_equations():
    """The exact solution of v = R i + e, e = jω ψ(i − e/R_fe): drag and flux are of one resistance.

    With the drag alone the voltage was L_q/R_fe late, and a delay was named for it.
    """
    r_fe, p = 90.0, 7
    x = operating()
    size = p * 1.5 * p * x.machine.scales["speed_rad_s"] * BASE["psi_wb"] ** 2 / r_fe
    model = Model(machine(), (LIBRARY["iron_eddy"],))
    values = {**BASE, **dict.fromkeys(model.parameters(), 0.0)}
    values |= {"iron_eddy.drag_nm": size, "iron_eddy.parallel": 1.0, "b_nm_s_rad": 0.0}
    omega = p * x.omega_rad_s
    inside = x.i_a
    for _ in range(60):
        psi = BASE["ld_h"] * inside.real + BASE["psi_wb"] + 1j * BASE["lq_h"] * inside.imag
        inside = x.i_a - 1j * omega * psi / r_fe
    torque = 1.5 * p * np.imag(np.conj(psi) * inside)
    pieces = evaluate(model, x, values)
    given = x.torque_nm - pieces.drag_nm
    plain = Model(machine(), ())
    bare = evaluate(plain, operating(), BASE)
    lost = np.abs(psi - bare.psi_wb).max()
    assert np.abs(pieces.psi_wb - psi).max() < 0.03 * lost
    without = 1.5 * p * np.imag(np.conj(bare.psi_wb) * x.i_a)
    assert np.abs(given - torque).max() < 0.03 * np.abs(without - torque).max()


def test_eddy_currents_beside_an_open_winding_turn_its_voltage_to_the_d_axis():
    """V = jω ψ(−v/R_fe) of open terminals: v_d is ω² L_q ψ / R_fe whichever way the shaft turns."""
    r_fe, p = 40.0, 7
    x = replace(operating(), inverter=False, iq_a=np.zeros(60), id_a=np.zeros(60))
    size = p * 1.5 * p * x.machine.scales["speed_rad_s"] * BASE["psi_wb"] ** 2 / r_fe
    model = Model(machine(), (LIBRARY["iron_eddy"],))
    values = {**BASE, **dict.fromkeys(model.parameters(), 0.0)}
    values |= {"iron_eddy.drag_nm": size, "iron_eddy.parallel": 2.0}
    omega = p * x.omega_rad_s
    volts = 1j * omega * evaluate(model, x, values).psi_wb
    reluctance = omega * BASE["lq_h"] / r_fe
    expected = omega * BASE["psi_wb"] * reluctance
    assert np.abs(reluctance).max() > 0.01
    assert volts.real == pytest.approx(expected, rel=0.05, abs=1e-3 * np.abs(expected).max())


def test_a_constant_load_is_a_drag_only_where_no_transducer_records_it():
    """One that acts before the transducer is a drag everywhere."""
    effect, x = LIBRARY["constant_load"], operating()
    alone = replace(x, shaft=ShaftState(alone=True))
    beyond, inside = ({"torque_nm": 0.03, "inside": n} for n in (0.0, 1.0))
    assert not effect.torque(x, beyond).any()
    for state, q in ((alone, beyond), (x, inside), (alone, inside)):
        assert effect.torque(state, q) == pytest.approx(np.full(60, 0.03))


def test_friction_of_its_own_in_each_sense_adds_to_one_and_takes_from_the_other():
    effect, x = LIBRARY["direction_friction"], operating()
    x.omega_rad_s[:3] = 100.0, -100.0, 0.0
    drag = effect.torque(x, {"coulomb_nm": 0.01, "viscous_nm": 0.05})
    assert drag[:3] == pytest.approx([0.03, 0.03, 0.0])
    both = np.sign(x.omega_rad_s) * 0.04 + drag
    assert both[:2] == pytest.approx([0.07, -0.01])


def test_an_order_is_offered_where_some_capture_goes_through_one_of_its_waves():
    """0.04 of a turn: cogging of order 12 was named for a curve of load over the stroke."""
    short = replace(machine(), travel_turns=0.04)
    assert cogging.orders(short) == (84,)
    assert LIBRARY["cogging"].gone_through(short)
    shorter = replace(machine(), travel_turns=0.001)
    for name in ("cogging", "unbalance", "angle_eccentricity"):
        assert not LIBRARY[name].gone_through(shorter)
        assert LIBRARY[name].gone_through(machine())
    assert LIBRARY["coulomb_friction"].gone_through(shorter)
    arm = replace(machine(), travel_turns=0.2)
    assert LIBRARY["unbalance"].gone_through(arm)


def test_no_wave_of_the_inductances_is_offered_of_two_locked_angles():
    """Two fit any wave and its mean: what saturation left of such steps was named one."""
    harmonics, rows = LIBRARY["inductance_harmonics"], np.linspace(0.0, 1.0, 300)

    def size(*angles, **columns):
        columns = {"t_s": rows, "vab_v": rows, "ia_a": rows, **columns}
        steps = [
            capture("current_step", f"{n}", pole_pairs=4, theta_elec_deg=angle, **columns)
            for n, angle in enumerate(angles)
        ]
        return machine_of(Campaign("m", tuple(steps)), Constants())

    two_of_a_wave = size(330.0, 60.0, 330.0, 120.0)
    assert not harmonics.gone_through(two_of_a_wave)
    assert LIBRARY["saturation"].gone_through(two_of_a_wave)
    assert harmonics.gone_through(size(330.0, 60.0, 15.0))
    assert not harmonics.gone_through(size(330.4, 60.0, 331.6))
    assert harmonics.gone_through(size(330.0, theta_mech_rad=rows))
    assert not harmonics.gone_through(size(330.0, 60.0, theta_mech_rad=0.1 + 1e-4 * rows))


def test_the_flux_of_a_crawl_beside_a_spin():
    """The crawl's voltage over the spin's speed was a hundredth of it: no step led back."""
    t, flux_wb, pairs = np.linspace(0.0, 1.0, 4000), 0.0028, 7
    line_v = math.sqrt(3.0) * pairs * 350.0 * flux_wb * np.sin(pairs * 350.0 * t)
    spin = capture(
        "open_circuit",
        "spin",
        pole_pairs=pairs,
        t_s=t,
        vab_v=line_v,
        omega_mech_rad_s=350.0 + 0 * t,
    )
    speed = 1.6 * np.sin(9.0 * t)
    crawl = capture(
        "drive",
        "crawl",
        pole_pairs=pairs,
        t_s=t,
        omega_mech_rad_s=speed,
        iq_a=0.4 * np.cos(9.0 * t),
        vq_v=0.04 * np.cos(9.0 * t) + pairs * flux_wb * speed,
    )
    scales = machine_of(Campaign("m", (spin, crawl)), Constants()).scales
    assert scales["flux_wb"] == pytest.approx(flux_wb, rel=0.1)
    assert scales["torque_nm"] == pytest.approx(1.5 * pairs * flux_wb * 0.4, rel=0.1)
