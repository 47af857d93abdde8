"""Each effect: zero is nothing at all, a size does what `contract/effects.md` says gives it away.

Expected sizes are worked out here by hand from the effect's definition, on a bench without noise.
"""

import math
from dataclasses import replace

import numpy as np
import pytest

from pipeline.simulator.bench import record
from pipeline.simulator.catalogue import with_effects
from pipeline.simulator.effects import ALWAYS, FORMS, parameters
from pipeline.simulator.outside import OUTSIDE, with_unknown
from pipeline.simulator.sensors import first_order_lag
from tests.simulated import QUIET, design

BASE = design("gimbal-5208").having(cogging=0.0, copper_temperature=0.0, magnet_temperature=0.0)
P, R, PSI, LD, LQ = 7, 0.42, 7.1e-3, 1.9e-4, 2.35e-4
TC, B, J = 5.5e-3, 1.6e-5, 3.6e-5
KT = 1.5 * P * PSI
RATED_A, RATED_W, VDC = 9.0, 330.0, 36.0

SHORT = {
    "resistance": {"dwell_s": 0.05},
    "current_step": {},
    "lcr": {},
    "open_circuit": {"levels": (0.3,), "dwell_s": 0.1},
    "cogging": {"turns": 1.0},
    "torque_map": {"speed": 0.4, "id_levels": (-0.3,), "iq_levels": (0.5,), "dwell_s": 0.1},
    "spin_down": {},
    "heat_run": {"samples": 200},
    "holding_current": {},
    "flux_map": {},
    "drive": {"segments": 4},
}


def table(test, motor, seed=3, **protocol):
    return record(test, motor, QUIET, np.random.default_rng(seed), **{**SHORT[test], **protocol})


def columns(test, name=None, size=None, seed=3, **protocol):
    motor = BASE if name is None else BASE.having(**{name: size})
    return table(test, motor, seed, **protocol).tables[0]


def settled(columns_of, **protocol):
    """Means of a torque-map plateau over whole mechanical turns at its end, rows kept."""
    return {key: values[values.size // 3 :] for key, values in columns_of.items()}


def order(signal, angle, k, *beside):
    """Complex amplitude of order k of an angle, fitted with a line and the orders beside it."""
    parts = [np.ones_like(angle), angle]
    for n in (k, *beside):
        parts += [np.cos(n * angle), np.sin(n * angle)]
    fitted = np.linalg.lstsq(np.stack(parts, axis=1), signal, rcond=None)[0]
    return complex(fitted[2], -fitted[3])


@pytest.mark.parametrize("name", sorted(set(FORMS) - set(ALWAYS)))
def test_zero_is_exactly_nothing(name):
    """Bit for bit, in every test the effect could enter, with its shape parameters set."""
    shaped = {**parameters(name, BASE), "size": 0.0}
    if name == "saturation":
        shaped["size_d"] = 0.0
    for test in ("torque_map", "drive", "spin_down", "cogging", "current_step", "open_circuit"):
        with_zero = table(test, BASE.having(**{name: shaped})).tables[0]
        for key, values in columns(test).items():
            assert np.array_equal(values, with_zero[key]), (test, key)


@pytest.mark.parametrize(
    ("name", "field"),
    [
        ("copper_temperature", "temp_coeff_copper_1_k"),
        ("magnet_temperature", "temp_coeff_magnet_1_k"),
        ("coulomb_friction", "torque_coulomb_nm"),
    ],
)
def test_effects_of_every_motor_override_its_field(name, field):
    motor = design("gimbal-5208")
    by_effect = table("torque_map", motor.having(**{name: 0.0})).tables[0]
    by_field = table("torque_map", replace(motor, **{field: 0.0})).tables[0]
    plain = table("torque_map", motor).tables[0]
    assert all(np.array_equal(by_effect[key], by_field[key]) for key in plain)
    assert any(not np.array_equal(by_effect[key], plain[key]) for key in plain)


def test_copper_temperature_grows_the_voltage_with_the_winding():
    heat = columns("heat_run", "copper_temperature", 0.004)
    ohm = heat["vd_v"] / heat["id_a"]
    assert np.ptp(heat["temp_winding_degc"]) > 30.0
    assert ohm == pytest.approx(R * (1 + 0.004 * (heat["temp_winding_degc"] - 25.0)), rel=2e-4)


def test_magnet_temperature_scales_the_open_voltage():
    cold = columns("open_circuit", "magnet_temperature", -0.0012)
    warm = columns("open_circuit", "magnet_temperature", -0.0012, temp_magnet_degc=65.0)
    assert warm["vab_v"] == pytest.approx(cold["vab_v"] * (1 - 0.0012 * 40.0), abs=1e-6)


def test_skin_effect_adds_resistance_at_speed():
    plain, skin = (settled(columns("torque_map", *e)) for e in ((), ("skin_effect", 0.2)))
    u = np.mean(plain["omega_mech_rad_s"]) / RATED_W
    more = 0.2 * u**2 / (1 + (u / 3.0) ** 2) * R * np.mean(plain["iq_a"])
    assert np.mean(skin["vq_v"]) - np.mean(plain["vq_v"]) == pytest.approx(more, rel=0.01)
    still = columns("resistance", "skin_effect", 0.2)
    assert np.array_equal(still["vab_v"], columns("resistance")["vab_v"])


def test_phase_imbalance_shows_as_second_order_in_the_rotor_frame():
    """R_x = R(1 + s cos(120 x - a)) gives |v| = s R i / 2 at order 2 eps."""
    lean = settled(columns("torque_map", "phase_imbalance", 0.06, speed=0.05, dwell_s=1.0))
    i = complex(np.mean(lean["id_a"]), np.mean(lean["iq_a"]))
    v2 = order(lean["vd_v"], P * lean["theta_mech_rad"], 2)
    assert abs(v2) == pytest.approx(0.06 * R * abs(i) / 2, rel=0.05)
    ohm = [R * (1 + 0.06 * math.cos(2 * math.pi * k / 3 - math.radians(20))) for k in range(3)]
    for pair, both in (("ab", ohm[0] + ohm[1]), ("bc", ohm[1] + ohm[2]), ("ca", ohm[2] + ohm[0])):
        out = table("resistance", BASE.having(phase_imbalance=0.06), pair=pair).tables[0]
        line = out[f"i{pair[0]}_a"]
        top = line > 0.999 * np.max(line)
        assert np.median(out[f"v{pair}_v"][top] / line[top]) == pytest.approx(both, rel=1e-4)


def test_dead_time_is_an_offset_that_does_not_grow_with_current():
    """At a locked rotor with d on phase a: drop(i) + drop(i/2) over the three phases."""
    volt = {"size": 0.3, "knee_a": 1e-3}
    low, high = (
        settled(table("heat_run", BASE.having(dead_time=volt), level=k).tables[0])
        for k in (0.1, 0.4)
    )
    for run in (low, high):
        excess = run["vd_v"][0] - R * run["id_a"][0]
        assert excess == pytest.approx(0.3 * 4.0 / 3.0, rel=1e-3)
    moving = settled(columns("torque_map", "dead_time", 0.3, speed=0.05, dwell_s=1.0))
    sixth = order(moving["vq_v"], P * moving["theta_mech_rad"], 6)
    assert abs(sixth) > 0.02
    assert np.array_equal(
        columns("resistance", "dead_time", 0.3)["vab_v"], columns("resistance")["vab_v"]
    )


def test_voltage_scale_is_one_factor_on_every_voltage():
    for test, key in (("open_circuit", "vbc_v"), ("resistance", "vab_v"), ("torque_map", "vq_v")):
        scaled, plain = columns(test, "voltage_scale", 0.03)[key], columns(test)[key]
        assert scaled == pytest.approx(1.03 * plain, abs=1e-9)


def test_sample_delay_turns_the_voltage_by_angle_travelled():
    late, plain = columns("torque_map", "sample_delay", 40e-6), columns("torque_map")
    v = late["vd_v"] + 1j * late["vq_v"]
    v0 = plain["vd_v"] + 1j * plain["vq_v"]
    turn = P * plain["omega_mech_rad_s"][-1] * 40e-6
    assert np.mean(np.angle(v / v0)[500:]) == pytest.approx(turn, rel=1e-3)
    assert np.abs(v) == pytest.approx(np.abs(v0), rel=1e-9)


def test_current_delay_turns_the_current_backwards():
    """The loop drives the late reading to its reference: the true current leads by omega tau.

    Switching at 40 kHz, so that the bow of the current inside a period is small.
    """
    late, plain = (
        settled(columns("torque_map", *e, pwm_hz=40e3)) for e in (("current_delay", 40e-6), ())
    )
    assert np.mean(late["iq_a"]) == pytest.approx(np.mean(plain["iq_a"]), rel=1e-3)
    turn = P * np.mean(plain["omega_mech_rad_s"]) * 40e-6
    i = complex(np.mean(plain["id_a"]), np.mean(plain["iq_a"]))
    true_q = (i * np.exp(1j * turn)).imag
    true_d = (i * np.exp(1j * turn)).real
    expected = 1.5 * P * (PSI * true_q + (LD - LQ) * true_d * true_q)
    drag = TC + B * np.mean(plain["omega_mech_rad_s"])
    assert np.mean(late["torque_shaft_nm"]) == pytest.approx(expected - drag, rel=1e-3)
    step, still = columns("current_step", "current_delay", 40e-6), columns("current_step")
    assert step["ia_a"] == pytest.approx(
        np.interp(still["t_s"] - 40e-6, still["t_s"], still["ia_a"]), abs=1e-9
    )


def test_torque_lag_rises_with_its_time_constant():
    protocol = {"iq_levels": (-0.5, 0.5), "dwell_s": 0.1}
    slow = columns("torque_map", "torque_lag", 5e-3, **protocol)["torque_shaft_nm"]
    fast = columns("torque_map", **protocol)["torque_shaft_nm"]
    start = fast.size // 2
    area = np.sum(fast[start:] - slow[start:]) / 10_000.0
    assert area == pytest.approx(5e-3 * np.ptp(fast[start // 2 :]), rel=0.01)


def test_a_ramp_comes_out_of_the_lag_late_by_its_time_constant():
    t_s, lag = np.arange(400) * 1e-4, 2e-3
    ramp = first_order_lag(5.0 + 3.0 * t_s, 1e-4 / lag)
    assert ramp == pytest.approx(5.0 + 3.0 * (t_s + lag * np.expm1(-t_s / lag)), abs=1e-13)


def test_current_scale_gain_and_offset():
    run, plain = columns("heat_run", "current_scale", 0.04), columns("heat_run")
    assert run["vd_v"][0] / run["id_a"][0] == pytest.approx(R / 1.04, rel=1e-6)
    assert columns("resistance", "current_scale", 0.04)["ia_a"] == pytest.approx(
        1.04 * columns("resistance")["ia_a"], abs=1e-9
    )
    for pair, factor in (("ab", 1.06), ("bc", 1.0)):
        one = columns("resistance", "current_gain", {"size": 0.06, "phase": 0.0}, pair=pair)
        line = f"i{pair[0]}_a"
        assert one[line] == pytest.approx(factor * columns("resistance", pair=pair)[line], abs=1e-9)
    moved = columns("resistance", "current_offset", {"size": 0.5, "phase": 0.0})["ia_a"]
    assert moved == pytest.approx(columns("resistance")["ia_a"] + 0.5, abs=1e-9)
    slow = {"speed": 0.05, "dwell_s": 1.0}
    gain = settled(columns("torque_map", "current_gain", 0.06, **slow))
    torque = gain["torque_shaft_nm"]
    assert abs(order(torque, P * gain["theta_mech_rad"], 2)) == pytest.approx(
        0.06 / 3 * KT * math.hypot(4.5, 2.7), rel=0.1
    )
    offset = settled(columns("torque_map", "current_offset", 0.5, **slow))
    assert abs(order(offset["torque_shaft_nm"], P * offset["theta_mech_rad"], 1)) == pytest.approx(
        2 / 3 * 0.5 * KT, rel=0.05
    )
    assert plain["id_a"][0] == pytest.approx(plain["vd_v"][0] / R, rel=1e-6)


def test_angle_offset_is_odd_in_speed_and_eccentricity_once_a_turn():
    for speed in (0.4, -0.4):
        off = settled(columns("torque_map", "angle_offset", 0.05, speed=speed))
        plain = settled(columns("torque_map", speed=speed))
        i = complex(np.mean(off["id_a"]), np.mean(off["iq_a"])) * np.exp(0.05j)
        expected = 1.5 * P * (PSI * i.imag + (LD - LQ) * i.real * i.imag)
        sign = math.copysign(1.0, speed)
        drag = sign * (TC + B * abs(np.mean(plain["omega_mech_rad_s"])))
        assert np.mean(off["torque_shaft_nm"]) == pytest.approx(expected - drag, rel=2e-3)
    turn = columns("cogging", "angle_eccentricity", {"size": 0.01, "phase_rad": 0.6})
    true = columns("cogging")["theta_mech_rad"]
    wobble = turn["theta_mech_rad"] - true
    assert wobble == pytest.approx(0.01 * np.sin(true + 0.6), abs=1e-9)


def test_saturation_bends_the_flux_map_and_the_big_step():
    """Apparent Lq at rated q current falls by the size; a small step still reads Lq."""
    bent = columns("flux_map", "saturation", {"size": 0.2, "size_d": 0.0})
    at = (np.abs(bent["id_a"]) < 1e-6) & (np.abs(bent["iq_a"] - RATED_A) < 1e-6)
    assert bent["psi_q_wb"][at][0] / RATED_A == pytest.approx(0.8 * LQ, rel=1e-5)
    rise = {}
    for level in (0.02, 1.0):
        step = columns(
            "current_step", "saturation", {"size": 0.2}, theta_elec_deg=60.0, level=level
        )
        plain = columns("current_step", theta_elec_deg=60.0, level=level)
        rise[level] = np.sum(plain["ia_a"] - step["ia_a"]) / np.max(plain["ia_a"])
    assert abs(rise[0.02]) < 1e-3 * abs(rise[1.0])


def test_cross_saturation_makes_q_flux_depend_on_d_current():
    bent = columns("flux_map", "cross_saturation", 0.1)
    i_d, i_q, psi_q = bent["id_a"], bent["iq_a"], bent["psi_q_wb"]
    small = np.abs(i_q - 0.25 * RATED_A) < 1e-6
    by_d = dict(zip(np.round(i_d[small] / RATED_A, 2), psi_q[small], strict=True))
    assert by_d[0.5] < by_d[0.0] < by_d[-1.0]
    assert by_d[0.0] == pytest.approx(LQ * 0.25 * RATED_A, rel=0.01)


def test_bemf_harmonics_grow_with_speed_and_ripple_the_torque():
    run = columns("open_circuit", "bemf_harmonics", {"size": 0.03, "seventh": 0.0})
    line = order(run["vab_v"], P * run["theta_mech_rad"], 5, 1, 7, 11, 13)
    omega = P * 0.3 * RATED_W
    assert abs(line) == pytest.approx(math.sqrt(3) * 5 * 0.03 * PSI * omega, rel=0.01)
    slow = settled(
        columns("torque_map", "bemf_harmonics", 0.03, speed=0.05, id_levels=(0.0,), dwell_s=1.0)
    )
    assert abs(order(slow["torque_shaft_nm"], P * slow["theta_mech_rad"], 6)) > 0.01 * KT * 4.5


def test_inductance_harmonics_ripple_at_six_under_current_only():
    args = {"speed": 0.05, "dwell_s": 1.0, "id_levels": (0.0,)}
    on = settled(columns("torque_map", "inductance_harmonics", 0.1, iq_levels=(0.8,), **args))
    off = settled(columns("torque_map", "inductance_harmonics", 0.1, iq_levels=(0.0,), **args))
    lines = [abs(order(x["vd_v"], P * x["theta_mech_rad"], 6)) for x in (on, off)]
    assert lines[0] > 20 * lines[1]
    meter = columns("lcr", "inductance_harmonics", {"size": 0.1, "ratio_d": 0.0})
    assert np.max(np.abs(meter["lab_h"] / columns("lcr")["lab_h"] - 1)) > 0.03


DRAGS = {
    "iron_eddy": (1e-4, lambda w: 1e-4 * w / (1 + (w / (5 * RATED_W)) ** 2)),
    "iron_hysteresis": (4e-3, lambda _: 4e-3),
    "stribeck": (4e-3, lambda w: 4e-3 / (1 + (w / (0.03 * RATED_W)) ** 2)),
    "windage": (4e-7, lambda w: 4e-7 * w * w),
}


@pytest.mark.parametrize("name", sorted(DRAGS))
def test_drags_take_their_torque_from_an_idle_motor(name):
    """Deceleration of a coast at several speeds, against the drag written out."""
    size, drag = DRAGS[name]
    coast = columns("spin_down", name, size, samples=4000)
    theta, t = coast["theta_mech_rad"], coast["t_s"]
    h = t[1] - t[0]
    k = np.linspace(20, theta.size - 60, 9).astype(int)
    omega = (theta[k + 5] - theta[k - 5]) / (10 * h)
    slowing = -(theta[k + 5] - 2 * theta[k] + theta[k - 5]) / (5 * h) ** 2
    expected = (TC + B * omega + np.array([drag(w) for w in omega])) / J
    assert slowing == pytest.approx(expected, rel=5e-3)


def test_load_dependent_friction_grows_with_torque_in_both_senses():
    for speed in (0.3, -0.3):
        on = settled(columns("torque_map", "load_dependent_friction", 0.05, speed=speed))
        off = settled(columns("torque_map", speed=speed))
        lost = np.mean(off["torque_shaft_nm"]) - np.mean(on["torque_shaft_nm"])
        torque = 1.5 * P * (PSI * 4.5 + (LD - LQ) * -2.7 * 4.5)
        assert lost == pytest.approx(math.copysign(0.05 * torque, speed), rel=2e-3)


def test_presliding_builds_friction_over_its_travel():
    size = 0.02
    slow = columns("cogging", "presliding", size)
    travel = slow["theta_mech_rad"] - slow["theta_mech_rad"][0]
    speed = slow["omega_mech_rad_s"][-1]
    expected = -TC * (1 - 2 * np.exp(-travel / size)) - B * speed
    assert slow["torque_shaft_nm"] == pytest.approx(expected, abs=2e-3 * TC)


def test_cogging_and_unbalance_against_the_angle():
    slow = columns("cogging", "cogging", {"size": 0.01, "second": 0.0, "phase_rad": 0.7})
    theta = slow["theta_mech_rad"]
    line = order(slow["torque_shaft_nm"], theta, 84)
    assert abs(line) == pytest.approx(0.01, rel=1e-3)
    heavy = columns("cogging", "unbalance", {"size": 0.02, "phase_rad": 1.1})
    assert order(heavy["torque_shaft_nm"], theta, 1) == pytest.approx(
        0.02 * np.exp(1j * (1.1 - math.pi / 2)), rel=1e-3
    )


def test_holding_current_carries_cogging_and_friction():
    held = columns("holding_current", "cogging", {"size": 0.01, "second": 0.0})
    half = held["iq_a"].size // 2
    forward, back = held["iq_a"][:half], held["iq_a"][half:]
    assert np.mean(forward) - np.mean(back) == pytest.approx(2 * TC / KT, rel=1e-3)
    line = order(forward, held["theta_mech_rad"][:half], 84)
    assert abs(line) == pytest.approx(0.01 / KT, rel=1e-2)


def test_compliance_rings_at_the_resonance_of_the_two_masses():
    """Free-free resonance sqrt(k (1/J1 + 1/J2)) = 80 Hz after a torque step."""
    ring = record(
        "drive",
        BASE.having(compliance=parameters("compliance", BASE)),
        QUIET,
        np.random.default_rng(5),
        segments=2,
        load=1.0,
        speed=0.5,
        segment_s=0.3,
    ).tables[0]
    theta = ring["theta_mech_rad"][4500:]
    wave = np.diff(theta, 2) * np.hanning(theta.size - 2)
    spectrum = np.abs(np.fft.rfft(wave, 1 << 16))
    freq = np.fft.rfftfreq(1 << 16, 1e-4)
    window = (freq > 40) & (freq < 200)
    assert freq[window][np.argmax(spectrum[window])] == pytest.approx(80.0, rel=0.15)


def test_backlash_lets_the_rotor_move_without_the_load():
    """Dynamometer at crawl, current reversed: the gap, and the twist of the 400 Hz coupling."""
    args = {"speed": 0.02, "id_levels": (0.0,), "iq_levels": (-0.5, 0.5), "dwell_s": 0.2}
    gap = columns("torque_map", "backlash", 0.02, **args)
    rigid = columns("torque_map", **args)
    behind = gap["theta_mech_rad"] - rigid["theta_mech_rad"]
    half = behind.size // 2
    moved = np.mean(behind[-500:]) - np.mean(behind[half - 500 : half])
    stiffness = 0.25 * J * (2 * math.pi * 400.0) ** 2
    assert moved == pytest.approx(0.02 + 2 * 4.5 * KT / stiffness, rel=0.01)


def test_transducer_scale_and_offset():
    plain = columns("torque_map")["torque_shaft_nm"]
    assert columns("torque_map", "torque_scale", 0.03)["torque_shaft_nm"] == pytest.approx(
        1.03 * plain, abs=1e-9
    )
    assert columns("torque_map", "torque_offset", 0.01)["torque_shaft_nm"] == pytest.approx(
        plain + 0.01, abs=1e-9
    )


@pytest.mark.parametrize("name", sorted(OUTSIDE))
def test_effects_outside_the_library_change_something_and_vanish_at_zero(name):
    protocol = {"speed": 0.4, "temp_winding_degc": 60.0}
    plain = table("torque_map", BASE, **protocol).tables[0]
    for size, same in ((0.0, True), (1.0, False)):
        other = table("torque_map", with_unknown(BASE, name, size), **protocol).tables[0]
        unchanged = all(np.allclose(plain[k], other[k], rtol=0, atol=1e-9) for k in plain)
        assert unchanged == same


@pytest.mark.parametrize("timing", ["instant", "centred"])
def test_a_back_emf_outside_the_library_is_seen_whatever_the_timing(timing):
    plain, other = (
        table("open_circuit", motor, voltage_timing=timing).tables[0]
        for motor in (BASE, with_unknown(BASE, "trapezoid"))
    )
    assert np.std(other["vab_v"] - plain["vab_v"]) > 0.01 * np.std(plain["vab_v"])


def test_a_delay_has_no_sign():
    with pytest.raises(ValueError, match="has no sign"):
        with_effects(BASE, "current_delay=-1e-5")


def test_unknown_names_and_parameters_are_refused():
    with pytest.raises(ValueError, match="no effect"):
        parameters("ghost", BASE)
    with pytest.raises(ValueError, match="has no parameter"):
        parameters("cogging", BASE, {"sizes": 1.0})
    with pytest.raises(ValueError, match="outside"):
        with_unknown(BASE, "ghost")
