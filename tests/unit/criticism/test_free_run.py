"""Free runs against machines integrated independently, by an adaptive Runge-Kutta method."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pipeline.criticism.data.segment import Instrument, Segment, Sensors
from pipeline.criticism.library.registry import effects
from pipeline.criticism.machine.model import Model
from pipeline.criticism.operating import Array
from pipeline.criticism.validation.held_out import Run, free_run
from pipeline.numerics.projection import projection
from tests.unit.criticism.machines import BASE, machine

P, TS, N, WINDOW = 7, 5e-5, 4000, 400
PLAIN = Model(machine(), ())
SIGMA = {
    "id_a": 0.01,
    "iq_a": 0.01,
    "vd_v": 0.02,
    "vq_v": 0.02,
    "theta_mech_rad": 2e-6,
    "torque_shaft_nm": 1e-3,
}


def voltage(t: float | Array) -> tuple[float | Array, float | Array]:
    return 0.8 * np.sin(70 * t) - 0.5, 3.0 + 2.5 * np.sin(45 * t)


def load(t: float | Array) -> float | Array:
    return 0.6 * np.sin(30 * t) + 0.1


def coulomb(omega: float | Array) -> float | Array:
    return 0.01 * np.tanh(omega / 0.5)


def drive(noise: float = 0.0, seed: int = 1, drag: Callable = lambda omega: 0.0 * omega) -> Segment:
    """A motor under known dq voltages and load, its currents and speed left to themselves."""

    def slopes(t: float, state: Array) -> list[float]:
        i_d, i_q, omega, _ = state
        v_d, v_q = voltage(t)
        psi_d = BASE["ld_h"] * i_d + BASE["psi_wb"]
        psi_q = BASE["lq_h"] * i_q
        torque = 1.5 * P * (psi_d * i_q - psi_q * i_d)
        return [
            (v_d - BASE["r_ohm"] * i_d + P * omega * psi_q) / BASE["ld_h"],
            (v_q - BASE["r_ohm"] * i_q - P * omega * psi_d) / BASE["lq_h"],
            (torque - BASE["b_nm_s_rad"] * omega - drag(omega) - load(t)) / BASE["j_kgm2"],
            omega,
        ]

    t = np.arange(N) * TS
    start = [0.0, 0.0, 30.0, 0.2]
    found = solve_ivp(slopes, (0, t[-1]), start, t_eval=t, rtol=1e-10, atol=1e-12)
    i_d, i_q, _, theta = found.y
    v_d, v_q = voltage(t)
    clean = {
        "vd_v": np.asarray(v_d),
        "vq_v": np.asarray(v_q),
        "id_a": i_d,
        "iq_a": i_q,
        "theta_mech_rad": theta,
        "torque_shaft_nm": np.asarray(load(t)),
    }
    rng = np.random.default_rng(seed)
    recorded = {k: v + noise * rng.normal(0, SIGMA[k], N) for k, v in clean.items()}
    recorded |= {"travel_rad": np.full(N, np.inf), "t_s": t}
    starts = np.arange(0, N - WINDOW + 1, WINDOW // 2)
    return Segment(
        capture="drive",
        test="drive",
        kind="dq",
        ts_s=TS,
        recorded=recorded,
        channels=("vd_v", "vq_v", "torque_shaft_nm"),
        weak=projection(theta, starts, WINDOW, ()),
        instrument=Instrument("drive", "instant"),
        sensors=Sensors({k: noise * s for k, s in SIGMA.items()}),
        fixed={"ambient_k": 0.0},
    )


def run_of(segment: Segment, **moved: float) -> Run:
    found = free_run(segment, PLAIN, {**BASE, **moved})
    assert found is not None
    return found


def rms(run: Run, signal: str) -> float:
    return float(np.sqrt((run.errors(signal) ** 2).mean()))


def test_the_true_model_reproduces_an_independently_integrated_motor():
    """Noise-free: currents within 1e-4 of 15 A and speed within 1e-4 of 100 rad/s all along."""
    run = run_of(drive())
    assert run.signals == ("id_a", "iq_a", "omega_mech_rad_s")
    assert np.ptp(run.recorded["iq_a"]) > 5.0
    assert np.ptp(run.recorded["omega_mech_rad_s"]) > 50.0
    for signal, size in (("id_a", 15.0), ("iq_a", 15.0), ("omega_mech_rad_s", 100.0)):
        left = run.recorded[signal] - run.simulated[signal]
        assert np.abs(left).max() < 1e-3 * size
        assert rms(run, signal) < 1e-4 * size


@pytest.mark.parametrize(
    ("moved", "signal"),
    [
        pytest.param({"r_ohm": 1.05 * BASE["r_ohm"]}, "omega_mech_rad_s", marks=pytest.mark.slow),
        ({"psi_wb": 1.01 * BASE["psi_wb"]}, "omega_mech_rad_s"),
        ({"b_nm_s_rad": 20 * BASE["b_nm_s_rad"]}, "iq_a"),
        pytest.param({"lq_h": 1.1 * BASE["lq_h"]}, "id_a", marks=pytest.mark.slow),
    ],
)
def test_a_wrong_constant_makes_a_larger_error(moved: dict[str, float], signal: str):
    segment = drive(noise=1.0)
    right, wrong = run_of(segment), run_of(segment, **moved)
    assert rms(wrong, signal) > 3 * rms(right, signal)
    assert rms(wrong, signal) > 3 * wrong.floor[signal]


def test_a_wrong_resistance_leaves_the_current_that_ohms_law_says():
    """Without a load sensor the speed is given: i_q is off by the settled δR i / |Z| of theory."""
    segment = drive()
    segment = replace(segment, channels=("vd_v", "vq_v"))
    run = run_of(segment, r_ohm=1.1 * BASE["r_ohm"])
    assert run.signals == ("id_a", "iq_a")
    omega_e = P * np.gradient(segment.recorded["theta_mech_rad"], TS)
    wrong = {**BASE, "r_ohm": 1.1 * BASE["r_ohm"]}
    # quasi-static: (R' + j ω L) δ = −δR i, in rows of d and q
    det = wrong["r_ohm"] ** 2 + omega_e**2 * BASE["ld_h"] * BASE["lq_h"]
    i_d, i_q = segment.recorded["id_a"], segment.recorded["iq_a"]
    fall = 0.1 * BASE["r_ohm"]
    expected = -fall * (wrong["r_ohm"] * i_q - omega_e * BASE["ld_h"] * i_d) / det
    late = run.t_s[:, -40:]
    left = (run.simulated["iq_a"] - run.recorded["iq_a"])[:, -40:]
    theory = np.interp(late, segment.recorded["t_s"], expected)
    assert np.abs(theory).max() > 0.2
    assert np.abs(left - theory).max() < 0.1 * np.abs(theory).max()


def test_a_run_begins_at_the_measured_speed_and_goes_on_at_the_models_rate():
    """A shaft braked by a constant torque, and a model with three times that torque: ω₀ − 3 T/J t
    from the first sample on, to a hundredth of what a sample period brakes.
    """
    friction, drag = effects()["coulomb_friction"], 0.01
    rate = drag / BASE["j_kgm2"]
    t = TS * np.arange(N)
    theta = 200.0 * t - 0.5 * rate * t**2
    segment = Segment(
        capture="coast",
        test="spin_down",
        kind="shaft",
        ts_s=TS,
        recorded={"theta_mech_rad": theta, "t_s": t},
        channels=("omega_mech_rad_s",),
        weak=projection(theta, np.arange(0, N - WINDOW + 1, WINDOW // 2), WINDOW, ()),
        instrument=Instrument("bench", "instant"),
        sensors=Sensors({"theta_mech_rad": 1e-9}),
        fixed={"ambient_k": 0.0},
    )
    values = {**BASE, "b_nm_s_rad": 0.0, "coulomb_friction.torque_nm": 3.0 * drag}
    run = free_run(segment, Model(machine(), (friction,)), values)
    assert run is not None
    speed = run.simulated["omega_mech_rad_s"]
    since = run.t_s - run.t_s[:, :1]
    told = (200.0 - rate * run.t_s[:, :1]) - 3.0 * rate * since
    assert np.abs(speed - told)[:, 1:].max() < 0.01 * rate * TS


def test_the_noise_floor_is_the_scatter_of_a_true_model():
    """Errors over the floor have a mean square near 1 over four recordings, at a noise that drowns
    the allowance for linearity; offsets that the priors absorb take a little of it away.
    """
    total: dict[str, list[float]] = {}
    for seed in range(4):
        run = run_of(drive(noise=8.0, seed=seed))
        for signal in run.signals:
            total.setdefault(signal, []).extend((run.errors(signal) / run.floor[signal]) ** 2)
    for signal, squares in total.items():
        spread = np.sqrt(2.0 / len(squares))
        assert 0.75 - 4 * spread < np.mean(squares) < 1.0 + 4 * spread, signal


def test_an_offset_of_half_the_noise_is_no_error_and_a_tenfold_one_is():
    """The priors of the sensors' offsets hold here as in the equations."""
    segment = drive(noise=1.0)

    def shifted(offset: float) -> float:
        recorded = {**segment.recorded, "vq_v": segment.recorded["vq_v"] + offset}
        run = run_of(replace(segment, recorded=recorded))
        return rms(run, "omega_mech_rad_s") / run.floor["omega_mech_rad_s"]

    assert shifted(0.5 * SIGMA["vq_v"]) < 2.0
    assert shifted(10 * SIGMA["vq_v"]) > 2.0


def test_an_effect_of_the_machine_is_an_effect_of_the_run():
    """A motor with Coulomb drag: the plain model misses its current, the model with it does not."""
    segment = drive(noise=1.0, drag=coulomb)
    effect = effects()["coulomb_friction"]
    values = {**BASE, "coulomb_friction.torque_nm": 0.01}
    with_it = free_run(segment, Model(machine(), (effect,)), values)
    assert with_it is not None
    plain = run_of(segment)
    assert rms(plain, "iq_a") > 5 * rms(with_it, "iq_a")
    assert rms(with_it, "iq_a") < 1.5 * with_it.floor["iq_a"]


def test_held_voltages_are_held():
    """A motor fed by constant voltage from sample to sample: `held` fits it, `instant` does not."""
    step = 400

    def slopes(t: float, i: Array, v: Array) -> list[float]:
        return [
            (v[0] - BASE["r_ohm"] * i[0]) / BASE["ld_h"],
            (v[1] - BASE["r_ohm"] * i[1]) / BASE["lq_h"],
        ]

    n = np.arange(N)
    v_d, v_q = 0.5 * np.sign(np.sin(n / 9.0)), 0.8 * np.sign(np.sin(n / 7.0))
    # standstill: both axes are first-order lags, exact from sample to sample
    i_d, i_q = np.zeros(N), np.zeros(N)
    for k in range(N - 1):
        for i, v, name in ((i_d, v_d, "ld_h"), (i_q, v_q, "lq_h")):
            decay = np.exp(-TS * BASE["r_ohm"] / BASE[name])
            i[k + 1] = decay * i[k] + (1 - decay) * v[k] / BASE["r_ohm"]
    zero = np.zeros(N)
    signals = {"vd_v": v_d, "vq_v": v_q, "id_a": i_d, "iq_a": i_q, "theta_mech_rad": zero}
    segment = drive()
    segment = replace(
        segment,
        recorded={**signals, "travel_rad": np.full(N, np.inf), "t_s": n * TS},
        channels=("vd_v", "vq_v"),
        weak=projection(zero, np.arange(0, N - WINDOW, step), WINDOW, ()),
    )
    held = run_of(replace(segment, instrument=Instrument("drive", "held")))
    instant = run_of(segment)

    def worst(run: Run) -> float:
        return float(np.abs(run.recorded["iq_a"] - run.simulated["iq_a"]).max())

    assert worst(held) < 1e-3
    assert worst(instant) > 50 * worst(held)


def test_other_tests_and_slow_logs_are_not_simulated():
    segment = drive()
    assert free_run(replace(segment, test="heat_run"), PLAIN, BASE) is None
    assert free_run(replace(segment, ts_s=0.01), PLAIN, BASE) is None
    assert free_run(replace(segment, weak=None), PLAIN, BASE) is None
