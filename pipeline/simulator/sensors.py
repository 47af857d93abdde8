"""What the instruments make of the truth: gains, faults, noise, resolution, drift, hum."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.simulator.design import Bench, Instruments, Motor, Scope
from pipeline.simulator.effects import active
from pipeline.simulator.plant import Plant

Array = NDArray[np.float64]
TEMPERATURE_STEP_DEGC = 2.0**-6


def grid(span: float, bits: int) -> float:
    """Resolution of a converter over a span: a power of two, so that values are exact.

    Parameters
    ----------
    span
        Span of the converter [unit].
    bits
        Number of bits.

    """
    return float(2.0 ** math.floor(math.log2(span / 2.0**bits)))


def to_grid(values: Array, step: float) -> Array:
    """Values rounded to a resolution.

    Parameters
    ----------
    values
        The values [n].
    step
        Resolution [unit of the values].

    """
    return np.round(values / step) * step


def first_order_lag(signal: Array, step: float) -> Array:
    """A signal behind a first-order lag that starts settled.

    Parameters
    ----------
    signal
        [n, any unit]
    step
        Sampling period over the time constant [1], above zero.

    Returns
    -------
    array [n]
        Unit of the signal.

    Notes
    -----
    T dy/dt = x − y, exact for a signal that runs straight between its samples: one held between
    them would come half a period early.

    """
    from scipy.signal import lfilter

    kept = math.exp(-step)
    mean = -math.expm1(-step) / step
    return lfilter([1.0 - mean, mean - kept], [1.0, -kept], signal - signal[0]) + signal[0]


def scope_range(largest: float) -> float:
    """Half the range of a scope, of the series 1, 2, 5.

    Parameters
    ----------
    largest
        Largest size of the signal [V or A], above zero.

    Returns
    -------
    float
        The least that holds the signal and a tenth more.

    Examples
    --------
    >>> scope_range(1.9), scope_range(4.4)
    (5.0, 5.0)

    """
    wanted = 1.1 * largest
    decade = 10.0 ** math.floor(math.log10(wanted))
    return next(x * decade for x in (1.0, 2.0, 5.0, 10.0) if x * decade >= wanted)


def late(signal: Array, t_s: Array, delay_s: float) -> Array:
    """A signal [n] as it was `delay_s` before each instant [n, s], its first value before that.

    Parameters
    ----------
    signal
        The signal [n].
    t_s
        Time of each sample [n, s].
    delay_s
        Delay [s].

    """
    if delay_s == 0.0:
        return signal
    return np.interp(t_s - delay_s, t_s, signal)


@dataclass(frozen=True, slots=True)
class Session:
    """One motor on one station with its instruments as they really are, and its randomness.

    `later`: the plant that it is from the share `since` of a capture on. `course`: share of its
    friction [1] at times [s] of the capture.
    """

    motor: Motor
    plant: Plant
    bench: Bench
    instruments: Instruments
    rng: np.random.Generator
    later: Plant | None = None
    since: float = 0.0
    course: tuple[tuple[float, float], ...] = ()

    def then(self, n: int) -> tuple[Plant, int]:
        """The plant that the motor is later in a capture of `n` periods, and the period of that.

        Parameters
        ----------
        n
            Number of periods of the capture.

        """
        return (self.plant, 0) if self.later is None else (self.later, round(self.since * n))

    def friction(self, t_s: Array) -> Array:
        """Share of its stated friction that the motor has over a capture [n, 1].

        Parameters
        ----------
        t_s
            Time from the first sample [n, s].

        """
        if not self.course:
            return np.ones(t_s.size)
        at, share = np.array(self.course, dtype=np.float64).T
        return np.interp(t_s, at, share)

    def fault(self, name: str, key: str = "size") -> float:
        """Parameter of a sensor effect, 0 where the effect is absent.

        Parameters
        ----------
        name
            Name of the effect.
        key
            Name of its parameter.

        """
        return active(self.motor).get(name, {}).get(key, 0.0)

    def noise(self, n: int, sigma: float, t_s: Array | None = None) -> Array:
        """Noise of one channel: white, with the station's drift and mains pick-up on top.

        Parameters
        ----------
        n
            Samples.
        sigma
            Standard deviation of the white part [unit of the channel].
        t_s
            Instants [n, s]; no mains pick-up without.

        Returns
        -------
        array [n]
            Unit of the channel.

        """
        bench = self.bench
        sigma = sigma * bench.noise_scale
        errors = sigma * self.rng.standard_normal(n)
        if bench.drift_rel > 0.0 and n > 1:
            walk = np.cumsum(self.rng.standard_normal(n)) / math.sqrt(n)
            errors += bench.drift_rel * sigma * walk
        if bench.hum_rel > 0.0 and t_s is not None:
            phase = self.rng.uniform(0.0, 2.0 * math.pi)
            errors += bench.hum_rel * sigma * np.sin(2.0 * math.pi * bench.hum_hz * t_s + phase)
        return errors

    @property
    def current_step_a(self) -> float:
        """Resolution of a current channel, over plus and minus 2.5 rated currents [A]."""
        return grid(5.0 * self.motor.current_rated_a, self.bench.adc_bits)

    @property
    def voltage_step_v(self) -> float:
        """Resolution of a voltage channel, over plus and minus twice the link [V]."""
        return grid(4.0 * self.motor.vdc_v, self.bench.adc_bits)

    @property
    def current_sigma_a(self) -> float:
        """Noise of a current channel [A]."""
        return self.bench.current_noise_rel * self.motor.current_rated_a

    def phase_gain(self, phase: int) -> float:
        """Gain of one phase's current sensor: station, common fault, its own fault.

        Parameters
        ----------
        phase
            Number of the phase, 0 to 2.

        """
        gain = self.instruments.current * (1.0 + self.fault("current_scale"))
        if int(self.fault("current_gain", "phase")) == phase:
            gain *= 1.0 + self.fault("current_gain")
        return gain

    def phase_offset_a(self, phase: int) -> float:
        """Offset of one phase's current sensor [A].

        Parameters
        ----------
        phase
            Number of the phase, 0 to 2.

        """
        if int(self.fault("current_offset", "phase")) == phase:
            return self.fault("current_offset")
        return 0.0

    def clock(self, n: int, rate_hz: float) -> tuple[Array, Array]:
        """Sampling instants, and the stamps that the recorder writes for them.

        Parameters
        ----------
        n
            Samples.
        rate_hz
            Sampling rate [Hz].

        Returns
        -------
        true, stamped
            [n each, s]. The stamps are off by the gain of the time base; jitter never exchanges
            two.

        """
        t_s = np.arange(n) / rate_hz
        clock_s = t_s * (self.instruments.clock * (1.0 + self.bench.clock_rel))
        if self.bench.jitter_s <= 0.0:
            return t_s, clock_s
        limit = 0.45 / rate_hz
        scatter = self.bench.jitter_s * self.rng.standard_normal(n)
        return t_s, clock_s + np.clip(scatter, -limit, limit)

    def line_current(self, i_a: Array, phase: int, t_s: Array) -> Array:
        """A line current [n] as measured.

        Parameters
        ----------
        i_a
            True current [n, A].
        phase
            Number of the phase, 0 to 2.
        t_s
            Time of each sample [n, s].

        """
        delay = self.fault("current_delay")
        late = np.interp(t_s - delay, t_s, i_a) if delay > 0.0 else i_a
        seen = self.phase_gain(phase) * late + self.phase_offset_a(phase)
        return to_grid(seen + self.noise(i_a.size, self.current_sigma_a, t_s), self.current_step_a)

    def voltage(self, v: Array, t_s: Array) -> Array:
        """A measured voltage [n].

        Parameters
        ----------
        v
            True voltage [n, V].
        t_s
            Time of each sample [n, s].

        """
        gain = self.instruments.voltage * (1.0 + self.fault("voltage_scale"))
        sigma = self.bench.voltage_noise_rel * self.motor.vdc_v
        return to_grid(gain * v + self.noise(v.size, sigma, t_s), self.voltage_step_v)

    def probe(self, v: Array, scope: Scope) -> Array:
        """A voltage [n] as the scope's probe shows it.

        Parameters
        ----------
        v
            True voltage [n, V].
        scope
            The oscilloscope.

        """
        return self._scoped(self.instruments.probe * v, self.instruments.probe_offset, scope)

    def clamp(self, i_a: Array, scope: Scope) -> Array:
        """A current [n] as the scope's clamp shows it.

        Parameters
        ----------
        i_a
            True current [n, A].
        scope
            The oscilloscope.

        """
        return self._scoped(self.instruments.clamp * i_a, self.instruments.clamp_offset, scope)

    def _scoped(self, seen: Array, offset: float, scope: Scope) -> Array:
        """One channel of a scope in the least range that holds it; `offset` is a share of that."""
        half = scope_range(float(np.max(np.abs(seen))))
        step = 2.0 * half / 2.0**scope.bits
        noise = scope.noise_steps * step * self.rng.standard_normal(seen.size)
        return to_grid(seen + offset * half + noise, step)

    def angle(self, theta: Array) -> Array:
        """Mechanical angle [n] by the encoder, with its faults.

        Parameters
        ----------
        theta
            Mechanical angle [n, rad].

        """
        from pipeline.simulator.followers import played

        bench = self.bench
        if bench.encoder_play_rad > 0.0:
            theta = played(np.ascontiguousarray(theta), 0.5 * bench.encoder_play_rad)
        seen = theta + self.fault("angle_offset") / self.motor.pole_pairs
        wobble = self.fault("angle_eccentricity")
        if wobble != 0.0:
            order = self.fault("angle_eccentricity", "order")
            phase = order * theta + self.fault("angle_eccentricity", "phase_rad")
            seen = seen + wobble * np.sin(phase)
        if bench.encoder_noise_rad > 0.0:
            seen = seen + self.noise(theta.size, bench.encoder_noise_rad)
        return to_grid(seen, 2.0 * math.pi / 2.0**bench.encoder_bits)

    def speed(self, omega: Array, rate_hz: float) -> Array:
        """The bench's own speed estimate [n]: it lags and is noisy.

        Parameters
        ----------
        omega
            Mechanical speed [n, rad/s].
        rate_hz
            Rate of the samples [Hz].

        """
        from pipeline.simulator.followers import lagged

        rated = self.motor.speed_rated_rad_s
        lag = self.bench.speed_lag_s
        blend = 1.0 - math.exp(-1.0 / (rate_hz * lag)) if lag > 0.0 else 1.0
        seen = lagged(np.ascontiguousarray(omega), blend)
        seen = seen + self.noise(omega.size, self.bench.speed_noise_rel * rated)
        return to_grid(seen, grid(rated, 17))

    def torque(self, torque: Array, t_s: Array) -> Array:
        """Shaft torque [n] by the transducer, with lag, gain, offset.

        Parameters
        ----------
        torque
            Torque [n, N·m].
        t_s
            Time of each sample [n, s].

        """
        torque = self._strained(torque)
        lag = self.fault("torque_lag")
        if lag > 0.0 and torque.size > 1:
            torque = first_order_lag(torque, (t_s[1] - t_s[0]) / lag)
        torque = late(torque, t_s, self.bench.late_torque_s)
        gain = self.instruments.torque * (1.0 + self.fault("torque_scale"))
        sigma = self.bench.torque_noise_rel * self.motor.torque_rated_nm
        seen = gain * torque + self.fault("torque_offset") + self.noise(torque.size, sigma, t_s)
        return to_grid(seen, grid(8.0 * self.motor.torque_rated_nm, self.bench.adc_bits))

    def _strained(self, torque: Array) -> Array:
        """What a transducer's body makes of a torque [n, N·m]: it bends, and lags behind its past.

        The hysteresis is that of one play operator of a quarter of rated torque to either side.
        """
        from pipeline.simulator.followers import played

        bench, rated = self.bench, self.motor.torque_rated_nm
        bent = torque + bench.torque_bend_rel * torque**3 / rated**2
        if bench.torque_hysteresis_rel == 0.0:
            return bent
        half = 0.25 * rated
        behind = torque - played(np.ascontiguousarray(torque), half)
        return bent - 0.5 * bench.torque_hysteresis_rel * rated * behind / half

    def temperature(self, degc: Array) -> Array:
        """A thermometer [n] with its offset.

        Parameters
        ----------
        degc
            True temperature [n, degC].

        """
        seen = degc + self.instruments.temperature_degc
        seen = seen + self.noise(degc.size, self.bench.temperature_noise_degc)
        return to_grid(seen, TEMPERATURE_STEP_DEGC)

    def winding(self, winding_degc: Array, magnet_degc: Array) -> Array:
        """The winding's thermometer [n], which may sit between winding and iron.

        Parameters
        ----------
        winding_degc
            True temperature of the winding [n, degC].
        magnet_degc
            True temperature of the magnets [n, degC].

        """
        share = self.motor.thermometer_share
        return self.temperature(share * winding_degc + (1.0 - share) * magnet_degc)

    def meta(self, test: str, **further: str) -> dict[str, str]:
        """Metadata of one capture, in the contract's words.

        Parameters
        ----------
        test
            Name of the test.
        **further
            Further metadata, by key.

        """
        motor, bench = self.motor, self.bench
        words = {
            "contract": "1",
            "motor_id": motor.motor_id,
            "motor_type": motor.motor_type,
            "lot": motor.lot,
            "station": bench.station,
            "operator": bench.operator,
            "started_at": bench.started_at,
            "test": test,
            "winding": motor.winding,
            "pole_pairs": str(motor.pole_pairs),
            "slots": str(motor.slots),
            "ambient_degc": repr(motor.ambient_degc),
            "voltage_kind": "measured",
            "voltage_timing": "instant",
            "pwm_hz": f"{bench.pwm_hz:g}",
            "vdc_v": f"{motor.vdc_v:g}",
            "u_rel_current": f"{bench.u_rel_current:g}",
            "u_rel_voltage": f"{bench.u_rel_voltage:g}",
            "u_rel_torque": f"{bench.u_rel_torque:g}",
            "u_temp_degc": f"{bench.u_temp_degc:g}",
        }
        if bench.u_rel_clock > 0.0:
            words["u_rel_clock"] = f"{bench.u_rel_clock:g}"
        return {**words, **further, **motor.nameplate}
