"""Tests at standstill: resistance, current step, LCR meter, heat run, flux map, holding current."""

from __future__ import annotations

import math

import numpy as np

from pipeline.simulator import protocols
from pipeline.simulator.design import Recording
from pipeline.simulator.sensors import Array, Session, grid, to_grid

ROOT3 = math.sqrt(3.0)
# tanh(8) is 1 to 2e-7
_CRAWL = 8.0
# Direction of a pair's current in alpha and beta, per ampere; then its two phases.
PAIRS = {
    "ab": (1.0, -1.0 / ROOT3, 0, 1),
    "bc": (0.0, 2.0 / ROOT3, 1, 2),
    "ca": (-1.0, -1.0 / ROOT3, 2, 0),
}


def nice_rate(wanted_hz: float) -> float:
    """The next rate of the series 1, 2, 5, 10 at or above what is wanted [Hz].

    Parameters
    ----------
    wanted_hz
        Least rate [Hz].

    """
    decade = 10.0 ** math.floor(math.log10(wanted_hz))
    for step in (1.0, 2.0, 5.0, 10.0):
        if step * decade >= wanted_hz * (1.0 - 1e-9):
            return step * decade
    return 10.0 * decade


def pair_ohm(session: Session, pair: str) -> float:
    """Resistance of a terminal pair at 25 degC [ohm].

    Parameters
    ----------
    session
        Motor, bench and the state of both in this capture.
    pair
        Terminal pair, `ab`, `bc` or `ca`.

    """
    p = session.plant
    phases = (p.r_a_ohm, p.r_b_ohm, p.r_c_ohm)
    return float(phases[PAIRS[pair][2]] + phases[PAIRS[pair][3]])


def _start_degc(session: Session, given: float | None) -> float:
    return session.motor.ambient_degc if given is None else given


def resistance(session: Session, how: protocols.Resistance) -> Recording:
    """DC plateaus: v = R(T) i + L di/dt, the winding warming as it must.

    Parameters
    ----------
    session
        Motor, bench and the state of both in this capture.
    how
        The levels and their times.

    """
    from pipeline.simulator.field import inductances
    from pipeline.simulator.heat import warmed

    motor = session.motor
    each = max(2, round(how.dwell_s * how.rate_hz))
    n = each * len(how.levels)
    t_s, stamps = session.clock(n, how.rate_hz)
    start = _start_degc(session, how.temp_degc)
    i_a, slope = np.zeros(n), np.zeros(n)
    before = 0.0
    for k, level in enumerate(how.levels):
        rows = slice(k * each, (k + 1) * each)
        want = level * motor.current_rated_a
        decay = np.exp(-(t_s[rows] - t_s[k * each]) / how.rise_s)
        i_a[rows] = want + (before - want) * decay
        slope[rows] = -(before - want) * decay / how.rise_s
        before = want
    ohm = pair_ohm(session, how.pair)
    oven = start if how.temp_degc is not None else motor.ambient_degc
    heat = warmed(ohm * i_a**2, (start, start), oven, 1.0 / how.rate_hz, session.plant)
    warm = 1.0 + session.plant.alpha_copper * (heat[:, 0] - 25.0)
    henry = float(inductances(np.zeros(1), start, session.plant)[0, :2].sum())
    v = ohm * warm * i_a + henry * slope
    first = PAIRS[how.pair][2]
    table = {
        "t_s": stamps,
        f"v{how.pair}_v": session.voltage(v, t_s),
        f"i{'abc'[first]}_a": session.line_current(i_a, first, t_s),
        "temp_winding_degc": session.winding(heat[:, 0], heat[:, 1]),
    }
    meta = session.meta("resistance", pair=how.pair)
    return Recording(f"resistance_{how.pair}", meta, (table,))


def _supply(volt: float, before: int, on: int, n: int, ramp: int) -> Array:
    """Open voltage of the supply [n + 1]: off, on, off; edges ramp over so many samples."""
    source = np.zeros(n + 1)
    source[before : before + on] = volt
    if ramp > 1:
        rise = np.arange(ramp) / ramp
        source[before : before + ramp] = volt * rise
        source[before + on : before + on + ramp] = volt * (1.0 - rise)
    return source


def current_step(session: Session, how: protocols.CurrentStep) -> Recording:
    """Voltage step on one pair with the rotor locked, the third terminal open.

    Parameters
    ----------
    session
        Motor, bench and the state of both in this capture.
    how
        The step and its sampling.

    """
    from pipeline.simulator.locked import pair_step

    motor, plant = session.motor, session.plant
    tau = motor.tau_elec_s
    rate = how.rate_hz or nice_rate(how.samples_tau / tau)
    before, on, off = (
        max(2, round(share * tau * rate)) for share in (how.before_tau, how.on_tau, how.off_tau)
    )
    n = before + on + off
    t_s, stamps = session.clock(n, rate)
    ohm = pair_ohm(session, how.pair)
    degc = _start_degc(session, how.temp_degc)
    warm = 1.0 + plant.alpha_copper * (degc - 25.0)
    volt = how.level * motor.current_rated_a * ohm * (warm + how.source_share)
    source = _supply(volt, before, on, n, round(how.rise_s * rate))
    alpha, beta, first, _ = PAIRS[how.pair]
    steps = max(1, math.ceil(1.0 / (rate * tau * 0.02)))
    early = session.rng.uniform(size=n + 1) if how.random_edges else np.zeros(n + 1)
    true = pair_step(
        np.column_stack([source, early]),
        (1.0 / rate, steps),
        (alpha, beta, ohm, how.source_share * ohm),
        math.radians(how.theta_elec_deg + how.theta_off_deg),
        (degc, degc),
        plant,
    )
    volts, amps, stated = _measured(session, true, first, t_s)
    table = {"t_s": stamps, f"v{how.pair}_v": volts, f"i{'abc'[first]}_a": amps}
    place = f"{how.theta_elec_deg % 360.0:.2f}"
    meta = session.meta("current_step", pair=how.pair, theta_elec_deg=place, **stated)
    return Recording(f"current_step_{how.pair}", meta, (table,))


def _measured(
    session: Session, true: Array, phase: int, t_s: Array
) -> tuple[Array, Array, dict[str, str]]:
    """Voltage and current [n, 2] of a pair by the bench or its scope, and what the scope states."""
    scope = session.bench.scope
    if scope is None:
        volts = session.voltage(true[:, 0], t_s)
        return volts, session.line_current(true[:, 1], phase, t_s), {}
    stated = {
        "u_rel_voltage": f"{scope.u_rel_probe:g}",
        "u_rel_current": f"{scope.u_rel_clamp:g}",
    }
    return session.probe(true[:, 0], scope), session.clamp(true[:, 1], scope), stated


def pair_inductance(session: Session, pair: str, eps: Array, degc: float) -> Array:
    """Incremental inductance [n, H] between two terminals at zero current, third open.

    Parameters
    ----------
    session
        Motor, bench and the state of both in this capture.
    pair
        Terminal pair, `ab`, `bc` or `ca`.
    eps
        Electrical angle [n, rad].
    degc
        Temperature of the magnets [degC].

    """
    from pipeline.simulator.field import inductances

    alpha, beta, _, _ = PAIRS[pair]
    c, s = np.cos(eps), np.sin(eps)
    w_d, w_q = c * alpha + s * beta, c * beta - s * alpha
    l = inductances(np.ascontiguousarray(eps), degc, session.plant)
    return 1.5 * (l[:, 0] * w_d**2 + l[:, 1] * w_q**2 + 2.0 * l[:, 2] * w_d * w_q)


def lcr(session: Session, how: protocols.Lcr) -> Recording:
    """LCR meter: incremental inductance of each pair, and the resistance of ab.

    Parameters
    ----------
    session
        Motor, bench and the state of both in this capture.
    how
        The frequencies and angles.

    """
    degc = _start_degc(session, how.temp_degc)
    angle_deg = np.arange(how.angles) * 360.0 / how.angles
    sigma = session.bench.lcr_noise_rel * session.bench.noise_scale
    eps = np.radians(angle_deg)
    table = {"theta_elec_deg": angle_deg}
    for pair in how.pairs:
        true = pair_inductance(session, pair, eps, degc)
        scatter = 1.0 + sigma * session.rng.standard_normal(true.size)
        table[f"l{pair}_h"] = session.instruments.lcr * true * scatter
    plant = session.plant
    u = 2.0 * math.pi * how.freq_hz / plant.omega_elec_rated
    ohm = pair_ohm(session, "ab") * (1.0 + plant.alpha_copper * (degc - 25.0))
    ohm *= 1.0 + plant.skin * u**2 / (1.0 + (u / plant.skin_knee) ** 2)
    scatter = 1.0 + sigma * session.rng.standard_normal(angle_deg.size)
    table["rab_ohm"] = session.instruments.lcr * ohm * scatter
    table["freq_hz"] = np.full(angle_deg.size, how.freq_hz)
    meta = session.meta("lcr", u_rel_lcr=f"{session.bench.u_rel_lcr:g}")
    return Recording("lcr", meta, (table,))


def heat_level_a(session: Session, how: protocols.HeatRun) -> float:
    """Current of a heat run [A]: what warms the winding by `rise_k`, rated at most.

    Parameters
    ----------
    session
        Motor, bench and the state of both in this capture.
    how
        The level and its length.

    """
    from pipeline.simulator.truth import rth_winding

    motor = session.motor
    if how.level is not None:
        return how.level * motor.current_rated_a
    hot = motor.ambient_degc + how.rise_k
    ohm = motor.r_phase_ohm * (1.0 + session.plant.alpha_copper * (hot - 25.0))
    wanted = math.sqrt(how.rise_k / (1.5 * ohm * rth_winding(session.plant)))
    return min(wanted, motor.current_rated_a)


def heat_run(session: Session, how: protocols.HeatRun) -> Recording:
    """Current along d on a locked rotor; the drive logs what it commands, its own drop included.

    Parameters
    ----------
    session
        Motor, bench and the state of both in this capture.
    how
        The level and its length.

    """
    from pipeline.simulator.heat import warmed

    motor, plant = session.motor, session.plant
    tau = motor.cth_winding_j_k / (1.0 / motor.rth_wa_k_w + 1.0 / motor.rth_wm_k_w)
    rate = nice_rate(how.samples / (how.duration_tau * tau))
    n = round(how.duration_tau * tau * rate)
    t_s, stamps = session.clock(n, rate)
    i_d = heat_level_a(session, how)
    eps = math.radians(how.theta_elec_deg)
    phase = i_d * np.cos(eps - 2.0 * math.pi * np.arange(3) / 3.0)
    ohm = np.array([plant.r_a_ohm, plant.r_b_ohm, plant.r_c_ohm])
    gain = np.array([session.phase_gain(k) for k in range(3)])
    offset = np.array([session.phase_offset_a(k) for k in range(3)])
    true = (phase - offset) / gain
    true -= true.mean()
    watt = np.full(n, float(np.sum(ohm * true**2)))
    start = (motor.ambient_degc, motor.ambient_degc)
    heat = warmed(watt, start, motor.ambient_degc, 1.0 / rate, plant)
    warm = 1.0 + plant.alpha_copper * (heat[:, 0] - 25.0)
    drop = plant.dead_v * true / np.sqrt(true**2 + plant.dead_knee_a**2)
    v_phase = warm[:, None] * (ohm * true)[None, :] + drop[None, :]
    table = {"t_s": stamps, **_dq_log(session, phase, v_phase, eps, heat, t_s)}
    table["theta_mech_rad"] = session.angle(np.full(n, eps / motor.pole_pairs))
    table["temp_winding_degc"] = session.winding(heat[:, 0], heat[:, 1])
    table["temp_magnet_degc"] = session.temperature(heat[:, 1])
    table["temp_ambient_degc"] = session.temperature(np.full(n, motor.ambient_degc))
    meta = session.meta("heat_run", voltage_kind="commanded", voltage_timing="centred")
    return Recording("heat_run", meta, (table,))


def _dq_log(
    session: Session, i_phase: Array, v_phase: Array, eps: float, heat: Array, t_s: Array
) -> dict[str, Array]:
    """Rotor-frame log of a locked motor from phase currents [3] and voltages [n, 3]."""
    from pipeline.simulator.motion import extra_volts

    turn = np.exp(-1j * eps) * 2.0 / 3.0 * np.exp(2j * math.pi * np.arange(3) / 3.0)
    n = t_s.size
    i_dq, v_dq = complex(i_phase @ turn), v_phase @ turn
    if session.plant.extras > 0:
        theta, still = np.full(n, eps / session.motor.pole_pairs), np.zeros(n)
        amps = (np.full(n, i_dq.real), np.full(n, i_dq.imag))
        warm = (np.ascontiguousarray(heat[:, 0]), np.ascontiguousarray(heat[:, 1]))
        more = extra_volts((theta, still), amps, warm, session.plant)
        v_dq = v_dq + more[:, 0] + 1j * more[:, 1]
    v_dq = session.instruments.voltage_commanded * (1.0 + session.fault("voltage_scale")) * v_dq
    sigma = session.current_sigma_a * math.sqrt(2.0 / 3.0)
    step_a, step_v = session.current_step_a, session.voltage_step_v
    return {
        "id_a": to_grid(i_dq.real + session.noise(n, sigma, t_s), step_a),
        "iq_a": to_grid(i_dq.imag + session.noise(n, sigma, t_s), step_a),
        "vd_v": to_grid(v_dq.real, step_v),
        "vq_v": to_grid(v_dq.imag, step_v),
    }


def flux_map(session: Session, how: protocols.FluxMap) -> Recording:
    """Flux over a grid of currents, averaged over the electrical angle.

    Parameters
    ----------
    session
        Motor, bench and the state of both in this capture.
    how
        The grid of currents.

    """
    from pipeline.simulator.field import fluxes

    motor = session.motor
    i_d, i_q = (
        grid_a.ravel() * motor.current_rated_a
        for grid_a in np.meshgrid(how.id_levels, how.iq_levels, indexing="ij")
    )
    psi = np.zeros((i_d.size, 2))
    angles = np.arange(24) * 2.0 * math.pi / 24.0
    for eps in angles:
        psi += fluxes(i_d, i_q, np.full(i_d.size, eps), motor.ambient_degc, session.plant)
    psi /= angles.size
    scale = math.hypot(motor.psi_pm_wb, motor.lq_h * motor.current_rated_a)
    volts = session.instruments.voltage * (1.0 + session.fault("voltage_scale"))
    amps = session.instruments.current * (1.0 + session.fault("current_scale"))
    step = grid(4.0 * scale, 20)
    sigma = session.bench.flux_noise_rel * scale
    noise_a = session.current_sigma_a
    table = {
        "id_a": to_grid(amps * i_d + session.noise(i_d.size, noise_a), session.current_step_a),
        "iq_a": to_grid(amps * i_q + session.noise(i_d.size, noise_a), session.current_step_a),
        "psi_d_wb": to_grid(volts * psi[:, 0] + session.noise(i_d.size, sigma), step),
        "psi_q_wb": to_grid(volts * psi[:, 1] + session.noise(i_d.size, sigma), step),
    }
    return Recording("flux_map", session.meta("flux_map"), (table,))


def torque_table(session: Session, how: protocols.TorqueTable) -> Recording:
    """Torque of a clamped shaft against q current, row by row, without a clock.

    Parameters
    ----------
    session
        Motor, bench and the state of both in this capture.
    how
        The levels of current.

    """
    from pipeline.simulator.field import torques

    motor = session.motor
    once = np.array([*how.levels, *how.levels[::-1]]) * motor.current_rated_a
    sense = np.repeat([1.0, -1.0], len(how.levels))
    turn = 2.0 * math.pi / motor.pole_pairs
    at = np.repeat(turn * np.arange(how.angles) / how.angles, once.size)
    i_q, eps = np.tile(once, how.angles), motor.pole_pairs * at
    torque = torques(np.zeros(i_q.size), i_q, eps, motor.ambient_degc, session.plant)
    held = how.friction * motor.torque_coulomb_nm * np.tile(sense, how.angles)
    amps = session.instruments.current * (1.0 + session.fault("current_scale"))
    seen = amps * i_q + session.noise(i_q.size, session.current_sigma_a)
    table = {
        "iq_a": to_grid(seen, session.current_step_a),
        "torque_shaft_nm": session.torque(torque - held, np.arange(float(i_q.size))),
        "temp_magnet_degc": np.full(i_q.size, motor.ambient_degc),
    }
    if how.with_angle:
        table["theta_mech_rad"] = session.angle(at)
    return Recording("torque_table", session.meta("torque_table"), (table,))


def holding_current(session: Session, how: protocols.HoldingCurrent) -> Recording:
    """Current along q that holds the rotor at many angles, friction against the way it came.

    Parameters
    ----------
    session
        Motor, bench and the state of both in this capture.
    how
        The angles.

    """
    from pipeline.simulator.field import torques
    from pipeline.simulator.motion import passives

    motor, plant = session.motor, session.plant
    once = np.arange(how.angles) * 2.0 * math.pi / how.angles
    theta = np.concatenate([once, once[::-1]])
    sense = np.repeat([1.0, -1.0], how.angles)
    # fast enough for the whole of Coulomb's friction, too slow for any other drag
    crawl = sense * _CRAWL * plant.omega_eps
    kt = 1.5 * motor.pole_pairs * max(motor.psi_pm_wb, 1e-9)
    degc = motor.ambient_degc
    eps, i_q = motor.pole_pairs * theta, np.zeros(theta.size)
    for _ in range(12):
        torque = torques(np.zeros(theta.size), i_q, eps, degc, plant)
        rest = passives(theta, crawl, torque, i_q, degc, plant) + plant.b_visc * crawl
        i_q = i_q - (torque + rest) / kt
    each = how.samples
    n = theta.size * each
    t_s, stamps = session.clock(n, each / how.dwell_s)
    held, at = np.repeat(i_q, each), np.repeat(theta, each)
    phase = held[:, None] * -np.sin(
        motor.pole_pairs * at[:, None] - 2.0 * math.pi * np.arange(3)[None, :] / 3.0
    )
    seen = np.stack([session.line_current(phase[:, k], k, t_s) for k in range(3)], axis=1)
    angle = session.angle(at)
    turn = 2.0 / 3.0 * np.exp(2j * math.pi * np.arange(3) / 3.0)
    i_dq = (seen @ turn) * np.exp(-1j * motor.pole_pairs * angle)
    step = session.current_step_a / 4.0
    table = {
        "t_s": stamps,
        "theta_mech_rad": angle,
        "id_a": to_grid(i_dq.real, step),
        "iq_a": to_grid(i_dq.imag, step),
    }
    return Recording("holding_current", session.meta("holding_current"), (table,))
