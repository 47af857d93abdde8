"""What a recording says beyond the base model, in units of its sensors' noise.

Each recording is compared with the plain motor's answer to the *recorded* inputs: currents that
follow from recorded voltages, torque from those currents, motion from that torque. A closed loop
so hides nothing and adds nothing. The noise of what is compared is white after `whiten`.

References: [1] Ljung, System Identification, 2nd ed. (1999), ch. 13 (closed loop, conditioning on
the input); [2] Widrow & Kollár, Quantization Noise (2008), ch. 3 (q²/12).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pipeline.simulator.design import Bench, Motor, Recording

Array = NDArray[np.float64]
Table = Mapping[str, Array]
SLOW = 0.01
"""Share of rated speed below which the sense of rotation is taken as unknown."""
SMOOTH = 11
WINDOW_S = 0.05
"""Time over which the motion of a coasting shaft is held to be undisturbed [s]."""


@dataclass(frozen=True, slots=True)
class Base:
    """The plain motor, and the gains and offsets of the station as departures from perfect."""

    r_ohm: float
    ld_h: float
    lq_h: float
    psi_wb: float
    j_kgm2: float
    b_nm_s_rad: float
    coulomb_nm: float
    copper_1_k: float
    magnet_1_k: float
    current: float = 0.0
    voltage: float = 0.0
    voltage_commanded: float = 0.0
    torque: float = 0.0
    lcr: float = 0.0
    temperature_k: float = 0.0


def base_of(motor: Motor) -> Base:
    """The base of a simulated motor, by its truths."""
    return Base(
        motor.r_phase_ohm,
        motor.ld_h,
        motor.lq_h,
        motor.psi_pm_wb,
        motor.j_rotor_kgm2,
        motor.b_visc_nm_s_rad,
        motor.torque_coulomb_nm,
        motor.temp_coeff_copper_1_k,
        motor.temp_coeff_magnet_1_k,
    )


def priors(bench: Bench) -> dict[str, float]:
    """Standard uncertainty of what is known beforehand: the station's gains and its thermometer."""
    return {
        "current": bench.u_rel_current,
        "voltage": bench.u_rel_voltage,
        "voltage_commanded": bench.u_rel_voltage,
        "torque": bench.u_rel_torque,
        "lcr": bench.u_rel_lcr,
        "temperature_k": bench.u_temp_degc,
    }


@dataclass(frozen=True, slots=True)
class Sensors:
    """Standard deviation of each sensor, noise and resolution together (q²/12 of every step)."""

    current_a: float
    dq_a: float
    voltage_v: float
    logged_v: float
    torque_nm: float
    theta_rad: float
    degc: float


def sensors_of(motor: Motor, bench: Bench) -> Sensors:
    """The sensors of a station on one motor."""
    from pipeline.simulator.sensors import TEMPERATURE_STEP_DEGC, grid

    def both(sigma: float, *steps: float) -> float:
        return math.sqrt(sigma**2 + sum(step**2 for step in steps) / 12.0)

    i_step = grid(5.0 * motor.current_rated_a, bench.adc_bits)
    v_step = grid(4.0 * motor.vdc_v, bench.adc_bits)
    t_step = grid(8.0 * motor.torque_rated_nm, bench.adc_bits)
    current = both(bench.current_noise_rel * motor.current_rated_a, i_step)
    return Sensors(
        current_a=current,
        dq_a=both(math.sqrt(2.0 / 3.0) * current, i_step / 2.0),
        voltage_v=both(bench.voltage_noise_rel * motor.vdc_v, v_step),
        logged_v=both(0.0, v_step),
        torque_nm=both(bench.torque_noise_rel * motor.torque_rated_nm, t_step),
        theta_rad=both(bench.encoder_noise_rad, 2.0 * math.pi / 2.0**bench.encoder_bits),
        degc=both(bench.temperature_noise_degc, TEMPERATURE_STEP_DEGC),
    )


@njit(cache=True)
def _answer(v: Array, theta: Array, r: Array, psi: Array, first: Array, k: Array) -> Array:
    """Currents and fluxes [n, 4: id, iq, psi_d, psi_q] that follow from logged voltages.

    `v` [n, 2] is the vector in alpha, beta held for half a period around each sample; `k` holds
    ld_h, lq_h, pole pairs, period. Heun steps in the stator frame, four a half period.
    """
    n, steps = v.shape[0], 4
    out = np.empty((n, 4))
    ld, lq, p, period = k[0], k[1], k[2], k[3]
    h = 0.5 * period / steps
    eps = p * theta[0]
    d, q = psi[0] + ld * first[0], lq * first[1]
    a, b = math.cos(eps) * d - math.sin(eps) * q, math.sin(eps) * d + math.cos(eps) * q
    for row in range(n):
        if row > 0:
            turn = p * (theta[row] - theta[row - 1])
            for step in range(2 * steps):
                here = row - 1 if step < steps else row
                e0 = p * theta[row - 1] + turn * step / (2 * steps)
                e1 = e0 + turn / (2 * steps)
                c, s = math.cos(e0), math.sin(e0)
                i_d, i_q = (c * a + s * b - psi[row]) / ld, (c * b - s * a) / lq
                da = v[here, 0] - r[row] * (c * i_d - s * i_q)
                db = v[here, 1] - r[row] * (s * i_d + c * i_q)
                a1, b1 = a + h * da, b + h * db
                c, s = math.cos(e1), math.sin(e1)
                i_d, i_q = (c * a1 + s * b1 - psi[row]) / ld, (c * b1 - s * a1) / lq
                a += 0.5 * h * (da + v[here, 0] - r[row] * (c * i_d - s * i_q))
                b += 0.5 * h * (db + v[here, 1] - r[row] * (s * i_d + c * i_q))
        eps = p * theta[row]
        c, s = math.cos(eps), math.sin(eps)
        d, q = c * a + s * b, c * b - s * a
        out[row] = ((d - psi[row]) / ld, q / lq, d, q)
    return out


@dataclass(frozen=True, slots=True)
class View:
    """One recording with the motor, base and sensors it is looked at with."""

    table: Table
    meta: Mapping[str, str]
    motor: Motor
    base: Base
    sensors: Sensors

    @property
    def period_s(self) -> float:
        """Sample period [s]."""
        t_s = self.table["t_s"]
        return float((t_s[-1] - t_s[0]) / (t_s.size - 1))

    def rise(self) -> Array:
        """Factor [n] on the resistance by the recorded winding temperature."""
        degc = self.table["temp_winding_degc"] - self.base.temperature_k
        factor: Array = 1.0 + self.base.copper_1_k * (degc - 25.0)
        return factor

    def magnet(self) -> Array:
        """Magnet flux [n, Wb] by the recorded magnet temperature."""
        degc = self.table["temp_magnet_degc"] - self.base.temperature_k
        flux: Array = self.base.psi_wb * (1.0 + self.base.magnet_1_k * (degc - 25.0))
        return flux

    def drag(self, omega: Array) -> Array:
        """Viscous and Coulomb friction [n, N·m]."""
        total: Array = self.base.b_nm_s_rad * omega + self.base.coulomb_nm * np.sign(omega)
        return total


def _running(view: View) -> list[Array]:
    """Torque map and drive: currents, then torque or motion."""
    table, base, motor, sensors = view.table, view.base, view.motor, view.sensors
    p, dt, theta = motor.pole_pairs, view.period_s, table["theta_mech_rad"]
    volt = (table["vd_v"] + 1j * table["vq_v"]) / (1.0 + base.voltage_commanded)
    volt = volt * np.exp(1j * p * theta)
    seen = (table["id_a"] + 1j * table["iq_a"]) / (1.0 + base.current)
    answer = _answer(
        np.stack([volt.real, volt.imag], axis=1),
        np.ascontiguousarray(theta),
        np.broadcast_to(base.r_ohm * view.rise(), theta.shape).copy(),
        view.magnet(),
        np.array([seen[0].real, seen[0].imag]),
        np.array([base.ld_h, base.lq_h, float(p), dt]),
    )
    bent = motor.psi_pm_wb * p * sensors.theta_rad / motor.lq_h
    settled = np.arange(theta.size) * dt > 5.0 * motor.tau_elec_s
    omega = np.gradient(theta, dt)
    parts = []
    for left, henry, own in (
        (seen.real - answer[:, 0], motor.ld_h, sensors.dq_a),
        (seen.imag - answer[:, 1], motor.lq_h, math.hypot(sensors.dq_a, bent)),
    ):
        through = _through(left.size, dt, p * float(np.mean(np.abs(omega))), henry, motor)
        parts.append(_flattened(settled * left, np.hypot(own, sensors.logged_v * through)))
    torque = 1.5 * p * (answer[:, 2] * answer[:, 1] - answer[:, 3] * answer[:, 0])
    load = table["torque_shaft_nm"] / (1.0 + base.torque)
    sigma = math.hypot(sensors.torque_nm, 1.5 * p * motor.psi_pm_wb * bent)
    if view.meta["test"] == "torque_map":
        left = load - torque + view.drag(_level(omega))
        return [*parts, settled * left / sigma]
    omega = np.convolve(omega, np.full(SMOOTH, 1.0 / SMOOTH), "same")
    second = np.zeros(theta.size)
    second[1:-1] = np.diff(theta, 2) / dt**2
    left = load - torque + view.drag(omega) + base.j_kgm2 * second
    fast = np.abs(omega) > SLOW * motor.speed_rated_rad_s
    turn = 2.0 * math.pi * np.fft.rfftfreq(theta.size)
    angle = motor.j_rotor_kgm2 * sensors.theta_rad * (2.0 - 2.0 * np.cos(turn)) / dt**2
    return [*parts, _flattened(settled * fast * left, np.hypot(sigma, angle))]


def _through(n: int, dt: float, omega_e: float, henry: float, motor: Motor) -> Array:
    """Current a volt gives [n // 2 + 1, A/V] in a frame that turns, per frequency of the FFT."""
    turn = 2.0 * math.pi * np.fft.rfftfreq(n, dt)
    r2 = motor.r_phase_ohm**2
    sides = [1.0 / (r2 + ((turn + sign * omega_e) * henry) ** 2) for sign in (1.0, -1.0)]
    gain: Array = np.sqrt(0.5 * (sides[0] + sides[1]))
    return gain


def _flattened(left: Array, sigma: Array) -> Array:
    """A residual [n] over the noise of each frequency [n // 2 + 1], its ends faded out."""
    n = left.size
    edge = np.minimum(1.0, np.minimum(np.arange(n), np.arange(n)[::-1]) / (0.01 * n))
    flat: Array = np.fft.irfft(np.fft.rfft(left * edge) / sigma, n)
    return flat


def _level(omega: Array) -> Array:
    """The one speed of a test at constant speed [n]."""
    return np.full(omega.size, float(np.mean(omega)))


def _heat_run(view: View) -> list[Array]:
    table, base, s = view.table, view.base, view.sensors
    gain = (1.0 + base.voltage_commanded) / (1.0 + base.current)
    rise, r = view.rise(), base.r_ohm
    level = float(np.max(np.hypot(table["id_a"], table["iq_a"])))
    sigma = math.hypot(s.logged_v, r * s.dq_a)
    parts = []
    for axis in "dq":
        left = table[f"v{axis}_v"] / gain - r * rise * table[f"i{axis}_a"]
        warm = r * base.copper_1_k * s.degc * (level if axis == "d" else 0.0)
        parts.append(left / math.hypot(sigma, warm))
    return parts


def _resistance(view: View) -> list[Array]:
    table, base, s = view.table, view.base, view.sensors
    (volt,) = (name for name in table if name.startswith("v"))
    (amp,) = (name for name in table if name.startswith("i"))
    i = table[amp] / (1.0 + base.current)
    left = table[volt] / (1.0 + base.voltage) - 2.0 * base.r_ohm * view.rise() * i
    warm = 2.0 * base.r_ohm * base.copper_1_k * s.degc * np.abs(i)
    fixed = math.hypot(s.voltage_v, 2.0 * base.r_ohm * s.current_a)
    return [left / np.hypot(fixed, warm)]


def _current_step(view: View) -> list[Array]:
    """Pair current from the recorded voltage, held from sample to sample."""
    from pipeline.simulator.standing import PAIRS

    table, base, s = view.table, view.base, view.sensors
    pair = view.meta["pair"]
    alpha, beta, _, _ = PAIRS[pair]
    eps = math.radians(float(view.meta["theta_elec_deg"]))
    along, across = (
        math.cos(eps) * alpha + math.sin(eps) * beta,
        math.cos(eps) * beta - math.sin(eps) * alpha,
    )
    henry = 1.5 * (base.ld_h * along**2 + base.lq_h * across**2)
    ohm = 2.0 * base.r_ohm * (1.0 + base.copper_1_k * (view.motor.ambient_degc - 25.0))
    (amp,) = (name for name in table if name.startswith("i"))
    from scipy.signal import lfilter

    keep = math.exp(-ohm / henry * view.period_s)
    volt = table[f"v{pair}_v"] / (1.0 + base.voltage)
    driven = np.concatenate([[0.0], volt[:-1]]) * (1.0 - keep) / ohm
    i = np.asarray(lfilter([1.0], [1.0, -keep], driven), dtype=np.float64)
    turn = 2.0 * math.pi * np.fft.rfftfreq(i.size)
    gain = (1.0 - keep) / ohm / np.abs(1.0 - keep * np.exp(-1j * turn))
    left = table[amp] / (1.0 + base.current) - i
    return [_flattened(left, np.hypot(s.current_a, s.voltage_v * gain))]


def _lcr(view: View) -> list[Array]:
    from pipeline.simulator.standing import PAIRS

    table, base, motor = view.table, view.base, view.motor
    eps = np.radians(table["theta_elec_deg"])
    alpha, beta, _, _ = PAIRS["ab"]
    along = np.cos(eps) * alpha + np.sin(eps) * beta
    across = np.cos(eps) * beta - np.sin(eps) * alpha
    henry = 1.5 * (base.ld_h * along**2 + base.lq_h * across**2)
    ohm = 2.0 * base.r_ohm * (1.0 + base.copper_1_k * (motor.ambient_degc - 25.0))
    gain, sigma = 1.0 + base.lcr, Bench().lcr_noise_rel
    return [
        (table["lab_h"] / (gain * henry) - 1.0) / sigma,
        (table["rab_ohm"] / ohm - gain) / sigma,
    ]


def _open_circuit(view: View) -> list[Array]:
    table, base, motor = view.table, view.base, view.motor
    theta = table["theta_mech_rad"]
    width = 21
    omega = np.convolve(np.gradient(theta, view.period_s), np.full(width, 1.0 / width), "same")
    inside = np.zeros(theta.size)
    inside[width:-width] = 1.0
    p, flux, parts = motor.pole_pairs, view.magnet(), []
    for pair, first in (("ab", 0), ("bc", 1), ("ca", 2)):
        ends = (2.0 * math.pi * first / 3.0, 2.0 * math.pi * ((first + 1) % 3) / 3.0)
        wave = np.sin(p * theta - ends[1]) - np.sin(p * theta - ends[0])
        left = table[f"v{pair}_v"] / (1.0 + base.voltage) - p * omega * flux * wave
        parts.append(inside * left / view.sensors.voltage_v)
    return parts


def _cogging(view: View) -> list[Array]:
    omega = _level(np.gradient(view.table["theta_mech_rad"], view.period_s))
    load = view.table["torque_shaft_nm"] / (1.0 + view.base.torque)
    return [(load + view.drag(omega)) / view.sensors.torque_nm]


def _spin_down(view: View) -> list[Array]:
    """Angle against twice integrated drag; each window starts where and as fast as it likes.

    Without free starts the test would hold a shaft to a path of many turns that no disturbance
    ever touches, and see a millionth of any friction.
    """
    theta, dt = view.table["theta_mech_rad"], view.period_s
    omega = np.gradient(theta, dt)
    pull = -view.drag(omega) / view.base.j_kgm2
    speed = np.concatenate([[0.0], np.cumsum(0.5 * (pull[1:] + pull[:-1]))]) * dt
    path = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]))]) * dt
    left = (theta - path) / view.sensors.theta_rad
    width = max(8, round(WINDOW_S / dt))
    return [_without_line(left[k : k + width]) for k in range(0, left.size - 3, width)]


def _without_line(left: Array) -> Array:
    u = np.linspace(-1.0, 1.0, left.size)
    level: Array = left - left.mean()
    return level - u * float(u @ level) / float(u @ u)


_TESTS: Mapping[str, Callable[[View], list[Array]]] = {
    "resistance": _resistance,
    "current_step": _current_step,
    "lcr": _lcr,
    "open_circuit": _open_circuit,
    "cogging": _cogging,
    "torque_map": _running,
    "spin_down": _spin_down,
    "heat_run": _heat_run,
    "drive": _running,
}


def innovations(
    recording: Recording, motor: Motor, bench: Bench, base: Base, rows: int | None = None
) -> Array:
    """What one recording says beyond the base model [m], white with unit variance.

    `rows` cuts the recording, so that two of one test compare. Raises KeyError for a test that
    has no base model here.
    """
    table = {name: column[:rows] for name, column in recording.tables[0].items()}
    view = View(table, recording.meta, motor, base, sensors_of(motor, bench))
    return np.concatenate(_TESTS[recording.meta["test"]](view))


def nuisances(
    recording: Recording, motor: Motor, bench: Bench, rows: int | None = None
) -> dict[str, Array]:
    """Innovation [m each] a unit of every nuisance gives: 1 % of a constant, a prior of a gain."""
    base = base_of(motor)
    known, columns = priors(bench), {}
    for field in fields(Base):
        name = field.name
        unit = known.get(name) or 0.01 * abs(getattr(base, name)) or 1e-9
        part = 1e-2 * unit
        up = replace(base, **{name: getattr(base, name) + part})
        down = replace(base, **{name: getattr(base, name) - part})
        more = innovations(recording, motor, bench, up, rows)
        less = innovations(recording, motor, bench, down, rows)
        columns[name] = (more - less) / (2.0 * part) * unit
    return columns
