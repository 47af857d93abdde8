"""Small machines and operating points for the tests of criticism."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from pipeline.criticism.data.segment import Instrument, Segment, Sensors, row_index
from pipeline.criticism.effect import Effect
from pipeline.criticism.library.registry import effects
from pipeline.criticism.machine.model import BASE, STATE, Model, zero
from pipeline.criticism.operating import Operating
from pipeline.criticism.parameter import Machine
from pipeline.criticism.regression.columns import effect_columns
from pipeline.criticism.regression.fit import Fit, floors
from pipeline.criticism.regression.gauss_newton import gauss_newton
from pipeline.criticism.regression.linearise import linearise
from pipeline.criticism.regression.noise_floors import Floor
from pipeline.numerics.projection import projection

BASE = {
    "r_ohm": 0.31,
    "ld_h": 2.1e-4,
    "lq_h": 2.9e-4,
    "psi_wb": 9.4e-3,
    "j_kgm2": 4.4e-5,
    "b_nm_s_rad": 2.2e-5,
    "ripple_slope": 0.0,
    "ripple_mean": 0.0,
    "ripple_edge": 0.0,
    "ripple_shift": 0.0,
    "frame_lag_s": 0.0,
    "bend_angle_s2": 0.0,
    "command_lead": 0.0,
    "ripple_torque": 0.0,
    "ripple_held": 0.0,
    "ripple_sampled": 0.0,
    "bench_angle_rad": 0.0,
    "lead_ohm": 0.0,
    **dict.fromkeys((*STATE, *(one.name for one in BASE if one.hook in ("gain", "log"))), 0.0),
}


def machine(pole_pairs: int = 7, slots: int | None = 12) -> Machine:
    scales = {
        "current_a": 16.0,
        "voltage_v": 20.0,
        "speed_rad_s": 250.0,
        "freq_hz": 280.0,
        "torque_nm": 1.6,
        "period_s": 5e-5,
        "flux_wb": 9.4e-3,
    }
    return Machine(pole_pairs, slots, scales, (12, 14, 84))


def operating(n: int = 60, seed: int = 1) -> Operating:
    """Random currents, angles and speeds of both signs [n]."""
    rng = np.random.default_rng(seed)
    theta = rng.uniform(-10, 10, n)
    return Operating(
        machine=machine(),
        base=BASE,
        id_a=rng.uniform(-8, 8, n),
        iq_a=rng.uniform(-16, 16, n),
        eps_rad=7 * theta,
        theta_rad=theta,
        omega_rad_s=rng.uniform(-250, 250, n),
        winding_k=rng.uniform(0, 60, n),
        magnet_k=rng.uniform(0, 30, n),
        travel_rad=rng.uniform(0, 0.01, n),
        inverter=True,
        freq_hz=rng.uniform(0, 280, n),
        ts_s=5e-5,
    )


def log(n: int = 8000, seed: int = 5, noise: float = 0.0) -> Segment:
    """A drive log that obeys the base equations in closed form: slow sines of current, steady
    acceleration through zero speed, voltages instantaneous.
    """
    p, ts = 7, 5e-5
    t = np.arange(n) * ts
    theta = -60.0 * t + 0.5 * 400.0 * t**2
    omega = -60.0 + 400.0 * t
    current = 3 * np.sin(40 * t) - 2.0 + 1j * (6 * np.cos(25 * t) + 1.0)
    slope = 120 * np.cos(40 * t) - 1j * 150 * np.sin(25 * t)
    psi = BASE["ld_h"] * current.real + BASE["psi_wb"] + 1j * BASE["lq_h"] * current.imag
    voltage = (
        BASE["r_ohm"] * current
        + BASE["ld_h"] * slope.real
        + 1j * BASE["lq_h"] * slope.imag
        + 1j * p * omega * psi
    )
    em = 1.5 * p * (psi.real * current.imag - psi.imag * current.real)
    shaft = em - BASE["b_nm_s_rad"] * omega - BASE["j_kgm2"] * 400.0
    sigma = {
        "id_a": 0.01,
        "iq_a": 0.01,
        "vd_v": 0.01,
        "vq_v": 0.01,
        "theta_mech_rad": 2e-6,
        "torque_shaft_nm": 1e-3,
        "temp_winding_degc": 0.0,
        "temp_magnet_degc": 0.0,
    }
    signals = {
        "id_a": current.real,
        "iq_a": current.imag,
        "vd_v": voltage.real,
        "vq_v": voltage.imag,
        "theta_mech_rad": theta,
        "torque_shaft_nm": shaft,
        "temp_winding_degc": 25.0 + 200.0 * t,
        "temp_magnet_degc": 25.0 + 90.0 * t,
    }
    rng = np.random.default_rng(seed)
    noisy = {k: v + noise * rng.normal(0, sigma[k], n) for k, v in signals.items()}
    noisy["travel_rad"] = np.abs(theta - theta[np.argmin(np.abs(omega))])
    starts = np.arange(40, n - 440, 200)
    weak = projection(theta, starts, 400, (1, 7, 14, 42))
    return Segment(
        capture="log",
        test="drive",
        kind="dq",
        ts_s=ts,
        recorded=noisy,
        channels=("vd_v", "vq_v", "torque_shaft_nm"),
        weak=weak,
        instrument=Instrument("drive", "instant"),
        sensors=Sensors(sigma),
        fixed={"ambient_k": 0.0},
    )


def in_frame_of(theta_rad: np.ndarray, recorded: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Columns of a log of seven pole pairs whose encoder showed another angle than recorded."""
    back = np.exp(-7j * (theta_rad - recorded["theta_mech_rad"]))
    turned = {"theta_mech_rad": theta_rad}
    for d, q in (("id_a", "iq_a"), ("vd_v", "vq_v")):
        vector = (recorded[d] + 1j * recorded[q]) * back
        turned |= {d: vector.real, q: vector.imag}
    return {**recorded, **turned}


def held(before_middle: float, plain: Segment) -> Segment:
    """A log of vectors that are held from sample to sample, in the rotor frame of an instant
    `before_middle` of their hold [holds]; `plain` has those of instants.
    """
    recorded = dict(plain.recorded)
    instant = recorded["vd_v"] + 1j * recorded["vq_v"]
    middle = np.append(0.5 * (instant[:-1] + instant[1:]), instant[-1])
    turn = np.append(np.diff(7 * recorded["theta_mech_rad"]), 0.0)
    vector = middle * np.exp(1j * before_middle * turn)
    recorded |= {"vd_v": vector.real, "vq_v": vector.imag}
    return replace(plain, recorded=recorded, instrument=replace(plain.instrument, timing="held"))


def unit_floor(segment: Segment) -> np.ndarray:
    """A noise floor of one for each of a segment's weak samples."""
    return np.ones(int(row_index(segment)[2].sum()))


def columns_and_changes(
    segment: Segment, effect: Effect, sigma: np.ndarray
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Each column of an effect, and what its step changes in a residual that is computed anew."""
    plain = Model(machine(), ())
    columns, model, floor = (
        effect_columns(effect, plain),
        plain.with_effects(effect),
        Floor(sigma, BASE),
    )
    start = {**BASE, **zero(effect, model)}
    before = linearise(segment, plain, BASE, columns, floor)
    for n, column in enumerate(columns):
        moved = {**start, column.name: start[column.name] + column.step}
        after = linearise(segment, model, moved, [], floor)
        yield before.columns[:, n], (after.residual - before.residual) / column.step


def coasting(n: int = 3000, seed: int = 5) -> Segment:
    """A shaft that coasts from 200 rad/s against its viscous friction alone."""
    ts = 1e-3
    rate = BASE["b_nm_s_rad"] / BASE["j_kgm2"]
    sigma = 2e-6
    random = np.random.default_rng(seed)
    theta = 200.0 / rate * -np.expm1(-rate * ts * np.arange(n)) + random.normal(0.0, sigma, n)
    signals = {"theta_mech_rad": theta}
    weak = projection(theta, np.arange(40, n - 140, 50), 100, ())
    noise = {"theta_mech_rad": sigma}
    channels = ("omega_mech_rad_s",)
    return Segment(
        capture="coast",
        test="spin_down",
        kind="shaft",
        ts_s=ts,
        recorded=signals,
        channels=channels,
        weak=weak,
        instrument=Instrument("bench", "instant"),
        sensors=Sensors(noise),
        fixed={"ambient_k": 0.0},
    )


LIBRARY = {
    name: effects()[name]
    for name in ("coulomb_friction", "windage", "stribeck", "dead_time", "saturation", "unbalance")
}


def fitted(segments, **start):
    """The fit from the true constants, or from others that are given."""
    model = Model(machine(), ())
    begun = Fit(tuple(segments), model, {**BASE, **start}, floors(segments, model, BASE), BASE)
    return gauss_newton(begun).fit


def cautious(segments, times):
    """A fit whose noise floors are some times what the sensors' noise makes."""
    model = Model(machine(), ())
    sigma = tuple(times * one for one in floors(segments, model, BASE))
    return gauss_newton(Fit(tuple(segments), model, dict(BASE), sigma, BASE)).fit


def with_drag(drag, seed=5):
    """The log with a further drag of speed and angle [N·m] at its shaft."""
    segment = log(noise=1.0, seed=seed)
    theta = segment.recorded["theta_mech_rad"]
    omega = np.gradient(log().recorded["theta_mech_rad"], 5e-5)
    torque = segment.recorded["torque_shaft_nm"] - drag(omega, theta)
    return replace(segment, recorded={**segment.recorded, "torque_shaft_nm": torque})


def curved(size_nm):
    """A drag as windage has it [N·m], of this size at 250 rad/s."""
    return lambda omega, _: size_nm * omega * np.abs(omega) / 250.0**2


def asking_for(negligible):
    """The library with windage that nobody minds below a part of the machine's torque."""
    windage = effects()["windage"]
    parameters = tuple(replace(p, negligible=negligible) for p in windage.parameters)
    return {**LIBRARY, "windage": replace(windage, parameters=parameters)}


def coast_under_load(sense: float, load_nm: float = 3e-5, seed: int = 5) -> Segment:
    """A coast from 200 rad/s in a sense, against dry and viscous friction and a load that pulls one
    way.
    """
    ts, n, b, inertia = 1e-3, 3000, BASE["b_nm_s_rad"], BASE["j_kgm2"]
    rate, steady = b / inertia, sense * (4e-4 + sense * load_nm) / b
    t = ts * np.arange(n)
    theta = (200.0 * sense + steady) / rate * -np.expm1(-rate * t) - steady * t
    plain = coasting(n)
    sigma = plain.sensors.noise["theta_mech_rad"]
    theta += np.random.default_rng(seed).normal(0.0, sigma, n)
    weak = projection(theta, np.arange(40, n - 140, 50), 100, ())
    return replace(plain, recorded={"theta_mech_rad": theta}, weak=weak)
