"""Every test of the contract on motors of any size; seeds; truth; closed forms of whole tests."""

import math
from dataclasses import replace

import numpy as np
import pytest

from pipeline.physics.glossary import COLUMNS, METADATA, TESTS
from pipeline.simulator.bench import CAMPAIGN, campaign, record, truth
from pipeline.simulator.design import EXACT, Bench
from pipeline.simulator.effects import FORMS, parameters
from pipeline.simulator.plant import plant_of
from tests.simulated import QUIET, campaign_of, design

DESIGNS = ("gimbal-5208", "servo-ipm", "drone-2306", "servo-15kw", "joint-11p")
CAMPAIGNS = [
    pytest.param(name, marks=pytest.mark.slow if name in ("drone-2306", "servo-15kw") else ())
    for name in DESIGNS
]
"""That of a fast motor alone takes as long as those of the others together."""
HOLDS = {
    "resistance": {"temp_winding_degc"},
    "current_step": set(),
    "lcr": {"theta_elec_deg", "lab_h"},
    "open_circuit": {"vab_v", "vbc_v", "theta_mech_rad"},
    "hand_turn": {"vab_v", "theta_mech_rad"},
    "cogging": {"theta_mech_rad", "torque_shaft_nm"},
    "torque_map": {
        "vd_v", "vq_v", "id_a", "iq_a", "omega_mech_rad_s", "torque_shaft_nm",
    },
    "spin_down": {"omega_mech_rad_s"},
    "heat_run": {"vd_v", "id_a", "temp_winding_degc", "temp_magnet_degc"},
    "holding_current": {"theta_mech_rad", "iq_a"},
    "flux_map": {"id_a", "iq_a", "psi_d_wb", "psi_q_wb"},
    "drive": {"vd_v", "vq_v", "id_a", "iq_a", "theta_mech_rad", "omega_mech_rad_s"},
}  # fmt: skip


@pytest.mark.parametrize("name", CAMPAIGNS)
def test_a_campaign_keeps_the_contract_on_every_size_of_motor(name):
    """All tests of a campaign, columns and metadata by the glossary, finite, clocks increasing."""
    recordings = campaign(design(name), Bench(), 4)
    assert {r.meta["test"] for r in recordings} == set(TESTS) - {"torque_table"}
    for recording in recordings:
        held = {key for table in recording.tables for key in table}
        needed = set(HOLDS[recording.meta["test"]])
        if pair := recording.meta.get("pair"):
            needed |= {f"v{pair}_v", f"i{pair[0]}_a"}
        assert needed <= held <= set(COLUMNS)
        assert set(recording.meta) <= set(METADATA) | {"u_rel_lcr"}
        for table in recording.tables:
            assert len({column.size for column in table.values()}) == 1
            for key, column in table.items():
                assert np.all(np.isfinite(column)), (recording.stem, key)
                low, high = COLUMNS[key].low, COLUMNS[key].high
                assert low <= np.min(column) <= np.max(column) <= high
            if "t_s" in table:
                assert np.all(np.diff(table["t_s"]) > 0)
    assert len(campaign_of(recordings).captures) == len(CAMPAIGN)


@pytest.mark.parametrize("name", CAMPAIGNS)
def test_a_campaign_visits_what_its_tests_are_for(name):
    """Both senses of rotation, rated current in the map, reversals, a warm winding."""
    motor = design(name)
    by_stem = {r.stem: r.tables[0] for r in campaign(motor, QUIET, 5)}
    drive = by_stem["drive_0"]["omega_mech_rad_s"]
    assert (
        np.min(drive) < -0.1 * np.max(np.abs(drive)) < 0.1 * np.max(np.abs(drive)) < np.max(drive)
    )
    slow = by_stem["torque_map_slow"]
    rated = motor.current_rated_a
    assert np.max(slow["iq_a"]) == pytest.approx(rated, rel=0.05)
    assert np.min(slow["iq_a"]) == pytest.approx(-rated, rel=0.05)
    settled = np.abs(slow["iq_a"] - rated) < 0.01 * rated
    assert np.mean(settled) > 0.05
    limit = motor.vdc_v / math.sqrt(3)
    assert np.max(np.hypot(slow["vd_v"], slow["vq_v"])) <= 1.001 * limit
    assert np.ptp(by_stem["heat_run"]["temp_winding_degc"]) > 15.0
    assert np.ptp(by_stem["hand_turn"]["theta_mech_rad"]) == pytest.approx(2 * math.pi, rel=1e-9)


def test_the_same_seed_is_the_same_campaign_and_another_is_not():
    motor = design("gimbal-5208")
    one, two, other = (campaign(motor, Bench(), seed, CAMPAIGN[:9]) for seed in (7, 7, 8))
    for a, b, c in zip(one, two, other, strict=True):
        assert a.meta == b.meta
        for key, column in a.tables[0].items():
            assert np.array_equal(column, b.tables[0][key])
            assert key == "t_s" or not np.array_equal(column, c.tables[0][key])


def test_captures_do_not_hang_on_each_other():
    """Changing one capture's protocol leaves every other capture's bytes alone."""
    motor = design("gimbal-5208")
    plan = CAMPAIGN[:4]
    changed = ((plan[0][0], plan[0][1], {**plan[0][2], "dwell_s": 0.1}), *plan[1:])
    before, after = campaign(motor, Bench(), 1, plan), campaign(motor, Bench(), 1, changed)
    assert after[0].tables[0]["t_s"].size < before[0].tables[0]["t_s"].size
    for a, b in zip(before[1:], after[1:], strict=True):
        assert all(np.array_equal(a.tables[0][key], b.tables[0][key]) for key in a.tables[0])


def test_gains_are_drawn_from_the_stated_uncertainty_and_common_to_a_campaign():
    bench = Bench(u_rel_current=2e-3, u_rel_voltage=1e-3, u_temp_degc=0.5)
    drawn = [bench.drawn(np.random.default_rng(seed)) for seed in range(2000)]
    for name, u in (("current", 2e-3), ("voltage", 1e-3), ("torque", 2e-3)):
        values = np.array([getattr(d, name) for d in drawn])
        assert np.std(values) == pytest.approx(u, rel=0.08)
        assert abs(np.mean(values) - 1.0) < 4 * u / math.sqrt(2000)
    assert replace(bench, instruments=EXACT).drawn(np.random.default_rng(0)) == EXACT
    loud = Bench(u_rel_voltage=0.2, noise_scale=0.0, adc_bits=40)
    ratios = []
    for recording in campaign(design("gimbal-5208"), loud, 3, CAMPAIGN[:3]):
        pair = recording.meta["pair"]
        volts = recording.tables[0][f"v{pair}_v"]
        amps = recording.tables[0][f"i{pair[0]}_a"]
        ratios.append(np.max(volts) / np.max(amps))
    first = np.random.SeedSequence(3).spawn(4)[0]
    station = loud.drawn(np.random.default_rng(first))
    assert abs(station.voltage - 1.0) > 1e-3
    assert ratios == pytest.approx([0.84 * station.voltage / station.current] * 3, rel=2e-3)


def test_a_recorders_clock_is_in_its_stamps_alone():
    """Recorded time over true time, drawn where stated; the bench's own speed knows better."""
    motor, plan = design("gimbal-5208"), tuple(s for s in CAMPAIGN if s[0] == "spin_down_forward")
    fast = replace(QUIET, clock_rel=-0.02)
    right, wrong = (campaign(motor, bench, 1, plan)[0].tables[0] for bench in (QUIET, fast))
    assert wrong["t_s"] == pytest.approx(0.98 * right["t_s"], rel=1e-12)
    for name in ("theta_mech_rad", "omega_mech_rad_s"):
        assert np.array_equal(wrong[name], right[name])
    bench = Bench(u_rel_clock=1e-3)
    drawn = [bench.drawn(np.random.default_rng(seed)) for seed in range(2000)]
    assert np.std([d.clock for d in drawn]) == pytest.approx(1e-3, rel=0.08)
    plain = Bench().drawn(np.random.default_rng(3))
    assert replace(drawn[3], clock=1.0) == plain
    assert (
        record("spin_down", motor, bench, np.random.default_rng(1)).meta["u_rel_clock"] == "0.001"
    )


def test_a_late_log_is_the_log_of_before():
    """Torque and dq currents by whole samples; nothing else moves."""
    motor, plan = design("gimbal-5208"), tuple(s for s in CAMPAIGN if s[0] == "torque_map_fast")
    faulty = replace(QUIET, late_torque_s=2e-3, late_current_s=5e-4)
    right, wrong = (campaign(motor, bench, 1, plan)[0].tables[0] for bench in (QUIET, faulty))
    for name, samples in (("torque_shaft_nm", 20), ("id_a", 5), ("iq_a", 5)):
        assert wrong[name][samples:] == pytest.approx(right[name][:-samples], abs=1e-6)
        assert np.ptp(right[name]) > 0.0
    for name in ("vd_v", "vq_v", "theta_mech_rad", "t_s"):
        assert np.array_equal(wrong[name], right[name])


def test_noise_is_what_the_bench_says():
    motor = design("gimbal-5208")
    quiet = replace(QUIET, noise_scale=1.0)
    for channel, sigma in (("vab_v", 2e-4 * 36.0), ("ia_a", 4e-4 * 9.0)):
        noisy = record("current_step", motor, quiet, np.random.default_rng(1)).tables[0][channel]
        still = record("current_step", motor, QUIET, np.random.default_rng(1)).tables[0][channel]
        assert np.std(noisy - still) == pytest.approx(sigma, rel=0.05)
    hum = replace(quiet, hum_rel=20.0, drift_rel=0.0)
    run = record("cogging", motor, hum, np.random.default_rng(1), speed_rad_s=2.0).tables[0]
    still = record("cogging", motor, QUIET, np.random.default_rng(1), speed_rad_s=2.0).tables[0]
    pick_up = run["torque_shaft_nm"] - still["torque_shaft_nm"]
    at = np.mean(pick_up * np.exp(-2j * math.pi * 50.0 * run["t_s"])) * 2
    assert abs(at) == pytest.approx(20 * 6e-4 * motor.torque_rated_nm, rel=0.1)
    drift = replace(quiet, drift_rel=30.0)
    ends = [
        record("cogging", motor, drift, np.random.default_rng(s)).tables[0]["torque_shaft_nm"][-1]
        for s in range(60)
    ]
    calm = record("cogging", motor, QUIET, np.random.default_rng(1)).tables[0]["torque_shaft_nm"]
    scatter = np.std(np.array(ends) - calm[-1]) / (6e-4 * motor.torque_rated_nm)
    assert 20.0 < scatter < 42.0


def test_resolution_and_jitter():
    motor = design("gimbal-5208")
    coarse = replace(QUIET, adc_bits=10, encoder_bits=12)
    run = record("torque_map", motor, coarse, np.random.default_rng(0)).tables[0]
    steps = np.unique(np.round(np.diff(run["theta_mech_rad"]) / (2 * math.pi / 4096), 6))
    assert np.all(np.abs(steps - np.round(steps)) < 1e-5)
    volts = run["vq_v"] / 2.0 ** math.floor(math.log2(4 * 36.0 / 1024))
    assert np.all(volts == np.round(volts))
    jitter = record("cogging", motor, replace(QUIET, jitter_s=1e-4), np.random.default_rng(0))
    stamps = jitter.tables[0]["t_s"]
    assert np.all(np.diff(stamps) > 0)
    assert np.std(np.diff(stamps)) > 5e-5


def test_thermometers_on_their_own_clock():
    slow = replace(QUIET, temperature_hz=100.0)
    fast, warm = record("drive", design("gimbal-5208"), slow, np.random.default_rng(0)).tables
    assert not any(key.startswith("temp_") for key in fast)
    assert set(warm) == {"t_s", "temp_winding_degc", "temp_magnet_degc"}
    assert np.median(np.diff(warm["t_s"])) == pytest.approx(0.01)
    assert warm["t_s"][[0, -1]] == pytest.approx(fast["t_s"][[0, -1]])


def test_open_circuit_is_psi_omega_and_nothing_else():
    """Line voltage amplitude sqrt(3) p psi omega; centred is shorter by the sinc of half a step."""
    motor = design("gimbal-5208").having(dead_time=0.5, phase_imbalance=0.1, saturation=0.2)
    how = {"levels": (0.5,), "rate_hz": 20_000.0, "dwell_s": 0.2}
    run = record("open_circuit", motor, QUIET, np.random.default_rng(0), **how).tables[0]
    omega = 7 * 0.5 * 330.0
    eps = 7 * run["theta_mech_rad"]
    line = -math.sqrt(3) * 7.1e-3 * omega * np.sin(eps + math.pi / 6)
    assert run["vab_v"] == pytest.approx(line, abs=1e-6)
    assert run["vab_v"] + run["vbc_v"] + run["vca_v"] == pytest.approx(0.0, abs=1e-6)
    held = record(
        "open_circuit", motor, QUIET, np.random.default_rng(0), voltage_timing="centred", **how
    )
    half = omega * 0.5 / 20_000.0
    shorter = math.sin(half) / half
    assert held.tables[0]["vab_v"] == pytest.approx(shorter * line, abs=1e-6)


@pytest.mark.parametrize("sense", [1, -1])
def test_spin_down_is_the_closed_form(sense):
    """J dw/dt = -Tc - B w: w = (w0 + Tc/B) exp(-B t/J) - Tc/B, angle its integral."""
    motor = design("gimbal-5208").having(cogging=0.0)
    run = record("spin_down", motor, QUIET, np.random.default_rng(0), direction=sense).tables[0]
    t, ratio, rate = run["t_s"], 5.5e-3 / 1.6e-5, 1.6e-5 / 3.6e-5
    start = 0.95 * 330.0 + ratio
    angle = start / rate * (1 - np.exp(-rate * t)) - ratio * t
    assert sense * (run["theta_mech_rad"] - run["theta_mech_rad"][0]) == pytest.approx(
        angle, abs=2e-6
    )
    assert t[-1] == pytest.approx(math.log(start / (ratio + 0.01 * 0.95 * 330.0)) / rate, rel=2e-3)


def test_lcr_is_the_pair_formula_of_each_pair():
    """L = (Ld + Lq) + (Ld - Lq) cos(2 theta + 60), -180, -60 degrees for ab, bc, ca."""
    motor = design("servo-ipm").having(saturation=0.0, cross_saturation=0.0)
    run = record("lcr", motor, QUIET, np.random.default_rng(0), pairs=("ab", "bc", "ca")).tables[0]
    twice = np.radians(2 * run["theta_elec_deg"])
    for pair, turn in (("ab", 60.0), ("bc", -180.0), ("ca", -60.0)):
        expected = 9.3e-3 - 3.1e-3 * np.cos(twice + math.radians(turn))
        assert run[f"l{pair}_h"] == pytest.approx(expected, rel=1e-12)
    assert run["rab_ohm"] == pytest.approx(1.16, rel=1e-12)


def test_heat_run_ends_at_rth_times_power():
    """A long run: winding and magnet where the network of three resistances puts them."""
    motor = design("gimbal-5208")
    run = record("heat_run", motor, QUIET, np.random.default_rng(0), duration_tau=30.0).tables[0]
    watt = 1.5 * run["vd_v"][-1] * run["id_a"][-1]
    rise = run["temp_winding_degc"][-1] - 25.0
    rth = 1 / (1 / 2.6 + 1 / (3.4 + 3.0))
    assert rise == pytest.approx(rth * watt, rel=2e-3)
    assert truth(motor)["constants"]["rth_winding_k_w"] == pytest.approx(rth, rel=1e-12)
    magnet = run["temp_magnet_degc"][-1] - 25.0
    assert magnet == pytest.approx(rise * 3.0 / 6.4, rel=5e-3)
    loss = run["vd_v"] / run["id_a"] / 0.42 - 1
    assert loss == pytest.approx(0.003854 * (run["temp_winding_degc"] - 25.0), abs=2e-4)


def test_truth_of_a_linear_motor_is_its_design():
    t = truth(design("joint-11p").having(cogging=0.0))
    c = t["constants"]
    assert (c["r_phase_ohm"], c["r_ll_ohm"]) == pytest.approx((0.19, 0.38), rel=1e-12)
    assert (c["ld_h"], c["lq_h"]) == pytest.approx((1.6e-4, 1.8e-4), rel=1e-9)
    assert (c["ld_rated_h"], c["lq_rated_h"]) == pytest.approx((1.6e-4, 1.8e-4), rel=1e-9)
    k = 11 * 0.0132
    assert c["ke_ll_peak_v_krpm"] == pytest.approx(math.sqrt(3) * k * 104.7197551, rel=1e-8)
    assert c["kv_ll_peak_rpm_v"] == pytest.approx(9.549296586 / (math.sqrt(3) * k), rel=1e-8)
    assert c["kt_peak_nm_a"] == pytest.approx(1.5 * k, rel=1e-9)
    assert c["motor_constant_nm_sqrt_w"] == pytest.approx(1.5 * k / math.sqrt(1.5 * 0.19), rel=1e-9)
    assert c["tau_mech_s"] == pytest.approx(4.2e-4 * 0.19 / (1.5 * k * k), rel=1e-9)
    assert c["cogging_order"] is None
    assert t["hidden"] == ["cogging"]


@pytest.mark.parametrize(
    ("name", "order"),
    [("gimbal-5208", 84), ("servo-ipm", 72), ("servo-15kw", 60), ("joint-11p", 264)],
)
def test_leading_cogging_order_is_the_least_common_multiple_of_slots_and_poles(name, order):
    """12/14, 18/8, 60/10, 24/22 slots and poles."""
    assert truth(design(name))["constants"]["cogging_order"] == order


def test_truth_counts_effects_in():
    motor = design("gimbal-5208").having(
        cogging={"size": 0.01, "second": 0.4},
        bemf_harmonics=0.05,
        saturation={"size": 0.2, "size_d": 0.1},
        phase_imbalance={"size": 0.06, "angle_deg": 0.0},
    )
    c = truth(motor)["constants"]
    assert c["psi_pm_wb"] == pytest.approx(7.1e-3, rel=1e-9)
    assert (c["cogging_order"], c["cogging_amplitude_nm"]) == (84, pytest.approx(0.01, rel=1e-6))
    assert 0.01 < c["cogging_peak_nm"] < 0.014
    assert c["lq_rated_h"] == pytest.approx(0.8 * 2.35e-4, rel=5e-3)
    assert c["lq_h"] == pytest.approx(2.35e-4, rel=1e-9)
    assert c["ld_rated_h"] > c["ld_h"]
    assert c["resistance_imbalance"] == pytest.approx(0.09, rel=1e-9)
    assert truth(motor)["sizes"]["saturation"]["size_d"] == 0.1


def test_typical_sizes_are_possible_all_at_once():
    for name in DESIGNS:
        motor = design(name)
        everything = {effect: parameters(effect, motor) for effect in FORMS}
        plant_of(motor.having(**everything))


def test_mistakes_are_named():
    motor, rng = design("gimbal-5208"), np.random.default_rng(0)
    with pytest.raises(ValueError, match="no test"):
        record("spin_up", motor, QUIET, rng)
    with pytest.raises(TypeError, match="levels"):
        record("spin_down", motor, QUIET, rng, levels=(1.0,))
    with pytest.raises(ValueError, match="voltage_timing"):
        record("drive", motor, QUIET, rng, voltage_timing="sometimes")
    with pytest.raises(ValueError, match="r_phase_ohm must be positive"):
        replace(motor, r_phase_ohm=-1.0)


@pytest.mark.parametrize("name", ["gimbal-5208", "joint-11p", "servo-15kw"])
def test_a_dynamometer_that_gives_way_shows_its_reaction_torque(name):
    """Torque of the air gap less drags less J dω/dt, which is large after a step of current."""
    motor = design(name)
    motor = replace(motor, effects={})
    protocol = {"speed": 0.3, "id_levels": (0.0,), "iq_levels": (0.2, 0.6), "dwell_s": 0.1}

    def shown(bench):
        rng = np.random.default_rng(2)
        table = record("torque_map", motor, bench, rng, **protocol).tables[0]
        period = float(table["t_s"][1] - table["t_s"][0])
        pace = np.gradient(table["theta_mech_rad"], period)
        made = 1.5 * motor.pole_pairs * motor.psi_pm_wb * table["iq_a"]
        drag = motor.torque_coulomb_nm + motor.b_visc_nm_s_rad * pace
        push = motor.j_rotor_kgm2 * np.gradient(pace, period)
        return table["torque_shaft_nm"], made - drag, push

    inside = slice(200, -200)
    shaft, net, push = (column[inside] for column in shown(replace(QUIET, dyno_hz=12.0)))
    rated = motor.torque_rated_nm
    assert np.percentile(np.abs(shaft - net + push), 90) < 0.02 * rated
    assert np.abs(push).max() > 0.2 * rated
    shaft, net, push = (column[inside] for column in shown(QUIET))
    assert np.percentile(np.abs(shaft - net), 90) < 0.02 * rated
    assert np.abs(push).max() < 1e-3 * rated
