"""Windows of motion: columns, coasts and voltages of logs whose course is known exactly."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pipeline.estimation.electrical import voltage_rows as window_means
from pipeline.estimation.electrical.terminals import PAIRS
from pipeline.estimation.electrical.voltage_rows import VoltageRows
from pipeline.estimation.estimators import drive_voltage, feedforward, lcr, spin_down
from pipeline.estimation.estimators.drive_voltage import q_voltage
from pipeline.estimation.mechanical.drag_forms import (
    DRAG_FORMS,
)
from pipeline.estimation.mechanical.shaft_rows import shaft_rows
from pipeline.physics.copper import COPPER_COEFFICIENT_25_1_K
from pipeline.records.capture import Campaign
from pipeline.records.constants import Constants
from tests.unit.estimation.signals import capture, estimates

# Rows of motion


def driven(rows=4000, rate=2000.0, angle=True, **more):
    """Speed 100 + 30 sin 8t, i_q and i_d of other frequencies, a warm magnet, a load."""
    t = np.arange(rows) / rate
    speed = 100.0 + 30.0 * np.sin(8.0 * t)
    theta = 100.0 * t + 30.0 / 8.0 * (1.0 - np.cos(8.0 * t))
    columns = {
        "t_s": t, "iq_a": 5.0 * np.cos(5.0 * t), "id_a": 2.0 * np.sin(3.0 * t),
        "torque_shaft_nm": 0.1 * np.cos(2.0 * t), "temp_magnet_degc": np.full(rows, 45.0),
    }  # fmt: skip
    columns |= {"theta_mech_rad": theta} if angle else {"omega_mech_rad_s": speed}
    return capture("drive", "drive", **{**columns, **more})


def mean_of(rows, function):
    """A slow function of time at the windows' centres."""
    return function(rows.time_s)


@pytest.mark.parametrize("angle", [True, False])
def test_columns_of_the_equation_of_motion(angle: bool) -> None:
    """Window means of what was logged, the rates of what turns; within the windows' own width."""
    rows = shaft_rows([driven(angle=angle)], {"windage": DRAG_FORMS["windage"]}, (2,), (3,))
    assert rows is not None
    t = rows.time_s

    def speed(x):
        return 100.0 + 30.0 * np.sin(8.0 * x)

    def near(found, expected, abs_):
        assert found == pytest.approx(expected, abs=abs_)

    near(rows.speed_rad_s, speed(t), 0.2)
    near(rows.acceleration_rad_s2, 240.0 * np.cos(8.0 * t), 2.0)
    near(rows.q_current_a, 5.0 * np.cos(5.0 * t), 0.01)
    near(rows.warm_current_k_a, 100.0 * np.cos(5.0 * t), 0.2)
    near(rows.product_a2, 10.0 * np.cos(5.0 * t) * np.sin(3.0 * t), 0.02)
    near(rows.load_nm, 0.1 * np.cos(2.0 * t), 1e-3)
    near(rows.sense, 1.0, 1e-9)
    c = rows.columns
    near(c["windage"], (speed(t) / rows.fastest_rad_s) ** 2, 2e-3)
    near(c["offset"], 1.0, 1e-12)
    near(c["load friction"], np.abs(5.0 * np.cos(5.0 * t)), 0.1)
    near(c["d current"], 2.0 * np.sin(3.0 * t), 5e-3)
    near(c["q current cubed"], (5.0 * np.cos(5.0 * t)) ** 3, 0.5)
    near(c["d squared q current"], 4.0 * np.sin(3.0 * t) ** 2 * 5.0 * np.cos(5.0 * t), 0.1)
    near(c["d q current cubed"], 2.0 * np.sin(3.0 * t) * (5.0 * np.cos(5.0 * t)) ** 3, 1.0)
    near(c["load lag"], -0.2 * np.sin(2.0 * t), 2e-3)
    near(c["current lag"], -25.0 * np.sin(5.0 * t), 0.1)
    assert rows.fastest_rad_s == pytest.approx(130.0, rel=2e-3)
    assert rows.cluster == pytest.approx(np.floor((t - t[0] + 1e-12) / 0.25), abs=1.0)
    assert (rows.count, rows.dropped) == (t.size, 0)
    # waves of the angle, all turned alike by the same window
    turn = c["unbalance cos"] + 1j * c["unbalance sin"]
    assert np.abs(turn).max() <= 1.0 + 1e-9
    assert {"order 2 cos", "order 2 sin", "order 3 q current cos", "order 3 q current sin"} <= set(
        c
    )


def test_slow_waves_of_the_angle() -> None:
    """2 rad/s: windows are short beside a turn, so waves come out as they are."""
    t = np.arange(8000) / 2000.0
    rng = np.random.default_rng(0)
    theta = 2.0 * t + 1e-9 * rng.standard_normal(t.size)
    made = capture("drive", t_s=t, theta_mech_rad=theta, iq_a=np.full(t.size, 3.0),
                   id_a=np.full(t.size, 2.0))  # fmt: skip
    rows = shaft_rows([made], {}, (2,), (3,))
    assert rows is not None
    a, c = 2.0 * rows.time_s, rows.columns
    for name, expected in {
        "unbalance cos": np.cos(a),
        "unbalance sin": np.sin(a),
        "d current cos": 2.0 * np.cos(a),
        "d current sin": 2.0 * np.sin(a),
        "order 2 cos": np.cos(2.0 * a),
        "order 2 sin": np.sin(2.0 * a),
        "order 3 q current cos": 3.0 * np.cos(3.0 * a),
        "order 3 q current sin": 3.0 * np.sin(3.0 * a),
        "eccentric cos": -4.0 * np.cos(a),
        "eccentric sin": -4.0 * np.sin(a),
    }.items():
        assert c[name] == pytest.approx(expected, abs=0.02 * max(np.abs(expected).max(), 1.0)), name
    assert rows.warm_current_k_a == pytest.approx(0.0)  # no thermometer, no ambient: 25 degC


@pytest.mark.parametrize(("slowest", "kept"), [(0.0095, False), (0.0105, True)])
def test_windows_below_a_hundredth_of_the_fastest_are_left_out(slowest: float, kept: bool) -> None:
    t = np.arange(6000) / 2000.0
    speed = np.where(t < 1.5, 200.0, 200.0 * slowest)
    theta = np.cumsum(speed) / 2000.0
    made = capture("drive", t_s=t, theta_mech_rad=theta, iq_a=np.ones(t.size))
    rows = shaft_rows([made], {})
    assert rows is not None
    assert bool(np.any(rows.time_s > 1.7)) is kept
    assert (rows.dropped > 10) is not kept


def test_logs_that_make_no_rows() -> None:
    assert shaft_rows([driven(rows=9)], {}) is None
    assert shaft_rows([], {}) is None
    blind = driven()
    table = blind.tables[0].drop("iq_a")
    assert shaft_rows([replace(blind, tables=(table,))], {}) is None


# Coasts


def coasting(sense=1.0, of_angle=True, a=40.0, b=0.5, w0=200.0, rate=1000.0, noise=1e-5, path="c"):
    """dw/dt = -a - b w in closed form, down to a tenth of the speed."""
    end = math.log((w0 + a / b) / (0.1 * w0 + a / b)) / b
    t = np.arange(0.0, end, 1.0 / rate)
    speed = (w0 + a / b) * np.exp(-b * t) - a / b
    theta = (w0 + a / b) / b * -np.expm1(-b * t) - a / b * t
    rng = np.random.default_rng(0)
    y = sense * (theta if of_angle else speed) + noise * rng.standard_normal(t.size)
    return capture("spin_down", path, t_s=t + 5.0,
                   **{"theta_mech_rad" if of_angle else "omega_mech_rad_s": y})  # fmt: skip


@pytest.mark.parametrize(("of_angle", "noise"), [(True, 1e-5), (False, 1e-3)])
def test_both_senses_of_a_coast_give_dry_and_viscous_friction(of_angle: bool, noise: float) -> None:
    runs = [coasting(s, of_angle, noise=noise, path=f"{s}") for s in (1.0, -1.0)]
    found = estimates(spin_down.ESTIMATOR, *runs)
    assert found["coast_coulomb_rad_s2"].number == pytest.approx(40.0, rel=2e-3)
    assert found["coast_viscous_1_s"].number == pytest.approx(0.5, rel=2e-3)
    assert abs(found["coast_coulomb_rad_s2"].number - 40.0) < 4.0 * found["coast_coulomb_rad_s2"].u
    assert found["coast_coulomb_rad_s2"].at["omega_mech_rad_s"] == pytest.approx(200.0, rel=0.02)


def test_the_plots_of_coasts_show_speed_in_its_sense_and_the_fit_on_it() -> None:
    runs = [coasting(s, path=f"{s}") for s in (1.0, -1.0)]
    fit = spin_down.ESTIMATOR.fit(
        Campaign("m", tuple(runs)), Constants(), spin_down.ESTIMATOR.options
    )
    titles = [plot.title for plot in fit.evidence]
    assert titles == ["Coast-down forward", "Angle travelled forward", "Coast-down backward",
                      "Angle travelled backward"]  # fmt: skip
    for plot, sense in zip(fit.evidence[::2], (1.0, -1.0), strict=True):
        (series,) = plot.series
        assert series.x[0] == pytest.approx(5.0, abs=0.05)
        assert np.all(sense * series.fitted > 0.0)
        assert series.fitted == pytest.approx(series.measured, abs=2.0)
    for plot in fit.evidence[1::2]:
        assert plot.series[0].fitted == pytest.approx(plot.series[0].measured, abs=1e-3)


def test_deceleration_and_its_ripples() -> None:
    speed = np.array([100.0, 50.0])
    found = spin_down.deceleration(speed, np.array([3.0, 0.1, 8.0]), ("windage",), 200.0)
    assert found == pytest.approx([3.0 + 10.0 + 2.0, 3.0 + 5.0 + 0.5])
    theta = np.array([0.3])
    for name, value in (("cos", math.cos(0.3)), ("sin", math.sin(0.3)),
                        ("cos 2", math.cos(0.6)), ("sin 2", math.sin(0.6))):  # fmt: skip
        assert spin_down._ripple(name, theta) == pytest.approx([value])
    motion = spin_down.Motion(("windage",), ("cos", "sin"), 200.0)
    shared, own = motion.of_coast(1, np.arange(11.0))
    assert (shared.tolist(), own.tolist()) == ([0, 1, 2], [7, 8, 9, 10])
    wider = spin_down._transferred(
        spin_down.Motion((), (), 200.0), motion, np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]), 2
    )
    assert wider.tolist() == [1, 2, 0, 3, 4, 0, 0, 5, 6, 0, 0]


# Voltages of a drive


def log(*, p=4, timing="instant", rows=8000, rate=4000.0, **more):
    """A motor of psi 5 mWb, R 0.3 ohm, L 1 mH whose speed and current go their own ways."""
    t = np.arange(rows) / rate
    w = 120.0 + 80.0 * np.sin(3.0 * t)
    theta = 120.0 * t + 80.0 / 3.0 * (1.0 - np.cos(3.0 * t))
    i = 4.0 * np.cos(7.0 * t) + 1.0
    d = more.pop("d", np.zeros(rows))
    v = p * 5e-3 * w + 0.3 * i + 1e-3 * -28.0 * np.sin(7.0 * t) + p * w * 1e-3 * d
    rng = np.random.default_rng(0)
    columns = {"t_s": t, "theta_mech_rad": theta, "iq_a": i, "id_a": d,
               "vq_v": v + 1e-4 * rng.standard_normal(rows)}  # fmt: skip
    return capture("drive", "drive", pole_pairs=p, voltage_timing=timing, **{**columns, **more})


def test_ke_and_r_of_a_drive() -> None:
    found = estimates(drive_voltage.ESTIMATOR, log(d=2.0 * np.sin(5.0 * np.arange(8000) / 4000.0)))
    assert found["ke_phase_peak_v_s_rad"].number == pytest.approx(0.02, rel=1e-3)
    assert found["r_phase_ohm"].number == pytest.approx(0.3, rel=3e-3)
    assert found["r_phase_ohm"].at["omega_mech_rad_s"] == pytest.approx(200.0, rel=1e-2)


def voltage_rows(**more):
    made = {
        "captures": (capture("drive", t_s=np.arange(2.0)),), "capture": np.zeros(3, dtype=np.int64),
        "cluster": np.zeros(3, dtype=np.int64), "time_s": np.arange(3.0),
        "voltage_v": np.arange(3.0), "current_a": np.array([1.0, 2.0, -3.0]),
        "speed_rad_s": np.array([10.0, 20.0, 30.0]), "warm_current_k_a": np.array([5.0, 0.0, 1.0]),
        "warm_speed_k_rad_s": np.array([50.0, 0.0, 9.0]),
        "columns": {"inductive": np.array([0.1, 0.2, 0.4]), "drop": np.array([1.0, 1.0, -1.0]),
                    "zero": np.ones(3)},
        "period_s": 1e-3, "hold_doubt": 0.0,
    }  # fmt: skip
    return VoltageRows(**{**made, **more})


def test_columns_of_the_q_voltage() -> None:
    """Ke (1 + a_m (T - 25)) w, R (1 + a_cu (T - 25)) i; a thermometer that is warmer by 4 K."""
    a = COPPER_COEFFICIENT_25_1_K
    rows = voltage_rows()
    plain = q_voltage(rows, -0.002, ["zero"], {})
    i, w = rows.current_a, rows.speed_rad_s
    assert plain[:, 0] == pytest.approx(w - 0.002 * rows.warm_speed_k_rad_s)
    assert plain[:, 1] == pytest.approx(i + a * rows.warm_current_k_a)
    assert plain[:, 2] == pytest.approx(rows.columns["inductive"])
    assert plain[:, 3].tolist() == [1.0, 1.0, -1.0]
    assert plain[:, 4].tolist() == [1.0, 1.0, 1.0]
    off = q_voltage(rows, -0.002, [], {"temperature@s": 4.0, "current@s": 0.1})
    assert off[:, 0] == pytest.approx(plain[:, 0] - 0.008 * w)
    assert off[:, 1] == pytest.approx(1.1 * (plain[:, 1] + 4.0 * a * i))
    assert off[:, 2] == pytest.approx(1.1 * plain[:, 2])


@pytest.mark.parametrize("timing", ["instant", "held", "centred"])
def test_voltages_of_a_drive_at_the_sampling_instant(timing: str) -> None:
    """Period means of a turning vector, by integration, come back to the instant."""
    made = log(timing=timing)
    period, speed = 2.5e-4, np.array([900.0, -400.0])
    omega = 4 * speed
    t = (np.arange(4000) + 0.5) / 4000.0 * period
    start = {"held": 0.0, "centred": -0.5 * period, "instant": 0.0}[timing]
    v = 2.0 + 3.0j
    mean = np.array([np.mean(np.exp(1j * o * (t + start))) for o in omega])
    seen = v * (np.ones(2) if timing == "instant" else mean)
    data = {"vd_v": seen.real, "vq_v": seen.imag}
    v_d, v_q = window_means._instant(made, data, speed, 4, period)
    assert v_d == pytest.approx([2.0, 2.0], rel=1e-6)
    assert v_q == pytest.approx([3.0, 3.0], rel=1e-6)
    v_d, v_q = window_means._instant(made, {"vq_v": seen.imag}, speed, 4, period)
    half = 0.5 * omega * period
    damped = seen.imag / (1.0 if timing == "instant" else np.sin(half) / half)
    assert v_d is None
    assert v_q == pytest.approx(damped)


def test_what_a_held_voltage_may_be_of_the_back_emf() -> None:
    made = log(timing="centred")
    made = replace(made, meta=replace(made.meta, pwm_hz=1000.0))
    speed = np.array([300.0, -400.0, 0.0])
    half = 0.5 * 4 * math.sqrt(250_000.0 / 3.0) * 1e-3
    expected = (1.0 / math.cos(half) - 1.0) / math.sqrt(3.0)
    assert window_means._hold_doubt(made, speed, 4, 1e-3) == pytest.approx(expected)
    assert window_means._hold_doubt(log(), speed, 4, 1e-3) == 0.0
    # without pole pairs one, the least that a motor has
    least = (1.0 / math.cos(half / 4.0) - 1.0) / math.sqrt(3.0)
    alone = window_means._hold_doubt(made, speed, None, 1e-3)
    assert alone == pytest.approx(least)
    most = (1.0 / math.cos(1.0) - 1.0) / math.sqrt(3.0)
    slow = replace(made, meta=replace(made.meta, pwm_hz=1.0))
    assert window_means._hold_doubt(slow, speed, 4, 1.0) == pytest.approx(most)


def fed(*, ks=0.5, kv=0.02, ka=2e-3, delay=0.0, rows=12000, rate=1000.0, noise=1e-4):
    """V = kS sign(w) + kV w + kA dw/dt of a speed written out, `delay` earlier in the log."""
    t = np.arange(rows) / rate
    late = t + delay

    def speed(x):
        return 150.0 * np.sin(2.0 * x) + 20.0 * np.sin(9.0 * x)

    def gain(x):
        return 300.0 * np.cos(2.0 * x) + 180.0 * np.cos(9.0 * x)

    theta = 75.0 * (1.0 - np.cos(2.0 * t)) + 20.0 / 9.0 * (1.0 - np.cos(9.0 * t))
    v = ks * np.sign(speed(late)) + kv * speed(late) + ka * gain(late)
    rng = np.random.default_rng(0)
    return capture("drive", "fed", t_s=t, theta_mech_rad=theta,
                   vq_v=v + noise * rng.standard_normal(rows))  # fmt: skip


@pytest.mark.parametrize("delay", [pytest.param(0.0, marks=pytest.mark.slow), 4e-3])
def test_feedforward_of_voltage_and_motion(delay: float) -> None:
    found = estimates(feedforward.ESTIMATOR, fed(delay=delay))
    assert found["ks_v"].number == pytest.approx(0.5, rel=0.02)
    assert found["kv_v_s_rad"].number == pytest.approx(0.02, rel=5e-3)
    assert found["ka_v_s2_rad"].number == pytest.approx(2e-3, rel=0.02)
    assert found["voltage_delay_s"].number == pytest.approx(delay, abs=3e-4)
    parts = {p.source: p.u for p in found["kv_v_s_rad"].budget}
    assert parts["voltage@s"] == pytest.approx(0.001 * found["kv_v_s_rad"].number)
    assert "voltage@s" not in {p.source for p in found["voltage_delay_s"].budget}
    assert found["ks_v"].at["omega_mech_rad_s"] == pytest.approx(170.0, rel=0.05)


def test_each_log_counts_by_what_it_leaves() -> None:
    rng = np.random.default_rng(0)
    x = rng.standard_normal(3000)
    noise = np.concatenate([0.3 * rng.standard_normal(1500), 0.01 * rng.standard_normal(1500)])
    rows = feedforward.Rows(x[:, None], 2.0 * x + noise, np.repeat([0, 1], 1500),
                            np.arange(3000), np.arange(3000.0))  # fmt: skip
    sigma = feedforward._noise_v(rows)
    assert sigma[:1500] == pytest.approx(0.3, rel=0.06)
    assert sigma[1500:] == pytest.approx(0.01, rel=0.06)


# Plots


def test_plots_lay_the_fit_on_what_was_read() -> None:
    """Of a meter's table every pair; of a feedforward log its windows."""
    angles = np.arange(0.0, 180.0, 15.0)
    columns = {}
    for pair, axis in zip(PAIRS, (-30.0, 90.0, 210.0), strict=True):
        columns[f"l{pair}_h"] = 4e-3 - 1e-3 * np.cos(2.0 * np.radians(angles - axis))
    made = capture("lcr", theta_elec_deg=angles, **columns)
    (plot,) = lcr.ESTIMATOR.fit(Campaign("m", (made,)), Constants(), lcr.ESTIMATOR.options).evidence
    assert [s.label for s in plot.series] == list(PAIRS)
    for series in plot.series:
        assert series.fitted == pytest.approx(series.measured, rel=1e-6)
        assert series.x == pytest.approx(np.sort(angles))
    fit = feedforward.ESTIMATOR.fit(
        Campaign("m", (fed(),)), Constants(), feedforward.ESTIMATOR.options
    )
    (series,) = fit.evidence[0].series
    assert series.fitted == pytest.approx(series.measured, abs=0.2)


# Numbers of judgement


@pytest.mark.parametrize(("rate", "share"), [(400.0, 0.05), (60.0, None)])
def test_windows_of_a_coast_are_a_twentieth_of_it(rate: float, share: float | None) -> None:
    """And half a second at most; each overlaps the next by half."""
    made = coasting() if share else coasting(a=4.0, b=0.05, rate=rate)
    rows = shaft_rows([made], {})
    assert rows is not None
    t = made.arrays("t_s")["t_s"]
    width = share * float(t[-1] - t[0]) if share else 0.5
    assert float(np.median(np.diff(rows.time_s))) == pytest.approx(0.5 * width, rel=0.02)


def test_a_coast_of_two_windows_has_a_row_for_each() -> None:
    """A window's neighbours are counted where it has two, one or none."""
    coast = coasting()
    for count in range(30, 90):
        short = replace(coast, tables=(coast.tables[0].head(count),))
        rows = shaft_rows([short], {})
        if rows is not None and rows.count == 2:
            return
    pytest.fail("no length of a coast gives two windows")
