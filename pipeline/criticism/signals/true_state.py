"""True currents, angle and speed of a segment: what the sensors recorded, less their effects."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from pipeline.criticism.data.segment import Instrument, Segment, clock, joins, slow_orders
from pipeline.criticism.data.traces import lagged, smoothed
from pipeline.criticism.machine.model import (
    EARLY_S,
    LATENESS,
    UNLOGGED_AT_REST,
    Model,
    clock_gain,
)
from pipeline.criticism.operating import (
    Array,
    Complex,
    Indices,
    Operating,
    ShaftState,
    Signals,
    Supply,
    Values,
)
from pipeline.criticism.parameter import BENDING, UNLOGGED, WARMING, Machine
from pipeline.criticism.policy.captures import Cutting
from pipeline.criticism.signals.angle_sensor import angle_error, frame_angle, frame_turn, zero_angle

Number = TypeVar("Number", np.float64, np.int64)


@dataclass(frozen=True, slots=True)
class Motion:
    """Motion of the shaft.

    Attributes
    ----------
    theta_rad
        Angle [n].
    omega_rad_s
        Speed [n].
    freq_hz
        Electrical frequency [n].

    """

    theta_rad: Array
    omega_rad_s: Array
    freq_hz: Array


def on_true_clock(segment: Segment, recorder: str | None, model: Model, values: Values) -> Segment:
    """The segment with its true sample period in place of the recorded one. The last one is kept:
    state, reading and prediction of a point are all asked for it.

    Parameters
    ----------
    segment
        Any segment.
    recorder
        Whose clock it goes by; None for a table.
    model
        Effects of clocks.
    values
        Parameters by full name.

    """
    gain = clock_gain(recorder, model, values)
    if not gain:
        return segment
    known = segment.cache.get("true clock")
    if known is None or known[0] is not segment or known[1] != gain:
        paced = replace(segment, ts_s=segment.ts_s / (1.0 + gain))
        known = segment.cache["true clock"] = segment, gain, paced
    paced_before: Segment = known[2]
    return paced_before


def at_rest(size: int) -> Motion:
    """The motion of a shaft that stands still.

    Parameters
    ----------
    size
        Samples.

    """
    zero = np.zeros(size)
    return Motion(zero, zero, zero)


def motion_of(segment: Segment, signals: Signals, machine: Machine, finer: int = 1) -> Motion:
    """The motion of a shaft from its recorded angle.

    Parameters
    ----------
    segment
        Sample period.
    signals
        `theta_mech_rad` [n].
    machine
        Pole pairs and policy.
    finer
        Points m a sample, where the shaft turns so far in one that the samples alone would miss an
        order of the torque.

    Returns
    -------
    Motion
        [n m], between samples on straight lines; the speed is smoothed.

    """
    recorded = signals["theta_mech_rad"]
    policy, pairs = machine.policy.cutting, machine.pole_pairs

    def motion() -> Motion:
        theta = recorded
        if finer > 1:
            at = np.arange(theta.size * finer) / finer
            theta = np.interp(at, np.arange(theta.size), theta)
        omega = _speed(theta, segment.ts_s, finer, policy)
        return Motion(theta, omega, np.abs(omega) * pairs / (2 * math.pi))

    return segment.once(recorded, "motion", (segment.ts_s, finer, pairs, policy), motion)


def finer_of(segment: Segment, machine: Machine, finest: int) -> int:
    """How many points a sample the torque of a free shaft is averaged over.

    Parameters
    ----------
    segment
        A capture with an angle.
    machine
        Orders of its torque.
    finest
        Most points.

    Returns
    -------
    int
        1 where the highest order hardly turns within a sample.

    """
    highest, policy = max(*slow_orders(machine), 1), machine.policy.cutting
    turn = highest * float(np.abs(np.diff(segment.recorded["theta_mech_rad"])).max())
    if turn < policy.instant_rad:
        return 1
    return min(max(int(np.ceil(turn / policy.part_rad)), policy.least_parts), finest)


def averaging(segment: Segment, machine: Machine) -> Instrument:
    """The recorder of a log, with how many points of a sample its voltages are the mean of.

    Parameters
    ----------
    segment
        A drive's log with an angle.
    machine
        Orders of its torque, and policy.

    Returns
    -------
    Instrument
        With 1 point of a log as fast as its PWM, of snapshots, and where no order turns far in a
        sample; else an even number.

    """
    motion, policy = motion_of(segment, segment.recorded, machine), machine.policy.cutting
    points = finer_of(segment, machine, policy.mean_points)
    held = hold_s(segment, motion.omega_rad_s, machine)
    if points == 1 or held == segment.ts_s:
        return segment.instrument
    if segment.instrument.timing == "instant":
        return replace(segment.instrument, snapshots=held > 0.0)
    return replace(segment.instrument, points=2 * ((points + 1) // 2))


def operating(
    segment: Segment,
    signals: Signals,
    model: Model,
    values: Values,
    current: Complex,
    motion: Motion,
) -> Operating:
    """The state of a machine whose true current and motion are known.

    Parameters
    ----------
    segment
        What is known of supply, temperatures and shaft.
    signals
        Recorded columns [n].
    model
        The machine.
    values
        Parameters by full name.
    current
        True complex current [n m, A].
    motion
        True motion [n m].

    Returns
    -------
    Operating
        As of a bench; `Operating.fed` makes it that of a drive.

    """
    theta = motion.theta_rad
    return Operating(
        machine=model.machine,
        base=values,
        id_a=current.real,
        iq_a=current.imag,
        eps_rad=model.machine.pole_pairs * theta,
        theta_rad=theta,
        omega_rad_s=motion.omega_rad_s,
        winding_k=_warmth(segment, signals, "temp_winding_degc", theta.size, values),
        magnet_k=_warmth(segment, signals, "temp_magnet_degc", theta.size, values),
        travel_rad=_travel(signals, theta.size),
        inverter=False,
        ts_s=segment.ts_s,
        freq_hz=motion.freq_hz,
        supply=Supply(
            segment.fixed.get("pwm_s", 0.0),
            segment.fixed.get("vdc_v", 0.0),
            hold_s=hold_s(segment, motion.omega_rad_s, model.machine),
            measured=bool(segment.fixed.get("measured")),
        ),
        shaft=ShaftState(
            held=segment.test == "torque_map",
            stator=segment.instrument.stator,
            alone="torque_shaft_nm" not in signals,
            finer=theta.size // segment.size,
            run=_run(signals, theta.size),
            runs_rad=segment.sensors.runs_rad,
            behind_nm=_torque_behind(signals, theta.size),
            age_s=_age(segment, theta.size, model.machine),
        ),
    )


def hold_s(segment: Segment, omega_rad_s: Array, machine: Machine) -> float:
    """Time for which a voltage vector is constant.

    Parameters
    ----------
    segment
        Its PWM period, where stated.
    omega_rad_s
        Speed of the shaft [n].
    machine
        Its pole pairs, and the policy of logs that are slower than the PWM.

    Returns
    -------
    float
        The PWM period, or the sample period of a log as fast [s]. Where no PWM is stated, a log is
        slower than that if no inverter is as slow, or if the rotor turns further in a sample than
        under one vector of any: then the period that the policy takes for one.

    """
    policy, pwm_s = machine.policy.cutting, segment.fixed.get("pwm_s")
    if pwm_s is not None:
        return pwm_s if pwm_s < policy.slower_share * segment.ts_s else segment.ts_s
    turn = machine.pole_pairs * segment.ts_s * float(np.max(np.abs(omega_rad_s), initial=0.0))
    fast = segment.ts_s <= policy.slowest_pwm_s and turn < policy.held_turn_rad
    return segment.ts_s if fast else policy.unstated_pwm_s


def at_true_angle(segment: Segment, x: Operating, model: Model, values: Values) -> Operating:
    """The state with the errors of the angle sensor taken out of angle, speed and frame.

    Parameters
    ----------
    segment
        Lateness and zero of the sensor.
    x
        State by the recorded angle [n].
    model
        Effects of the angle.
    values
        Parameters by full name.

    Returns
    -------
    Operating
        The error is evaluated at the true angle by a few rounds of iteration.

    """
    late, bend, lag = (segment.fixed.get(name, 0.0) * values[name] for name in LATENESS)
    if behind := segment.instrument.behind * segment.ts_s:
        late, bend = late - behind, bend + 0.5 * behind**2
    if late or bend:
        x = _in_time(segment, x, late, bend, lag)
    none = np.zeros(x.omega_rad_s.shape)
    zero, frame = zero_angle(segment, x, values), frame_angle(segment, x, values)
    if not any(effect.angle is not None for effect in model.effects):
        turn = frame_turn(segment, x, model, values)
        if frame is None or turn is None:
            return x
        return _turned_back(x, none if zero is None else zero, frame, turn)
    policy = model.policy.cutting
    error = zero = none if zero is None else zero
    for _ in range(policy.angle_rounds):
        nearer = replace(x, theta_rad=x.theta_rad - error / model.machine.pole_pairs)
        error = zero + angle_error(nearer, model, values)
    turned, finer = error / model.machine.pole_pairs, x.theta_rad.size // segment.size
    slower = x.omega_rad_s - _speed(turned, segment.ts_s, finer, policy)
    whole = error if frame is None else error + (frame - zero)
    return replace(_turned_back(x, error, whole, np.exp(1j * whole)), omega_rad_s=slower)


def _turned_back(x: Operating, error: Array, frame: Array, ahead: Complex) -> Operating:
    """The state less an error [n, rad] of its electrical angle, and that of its frame, which is
    `ahead` as a unit vector [n]; the speed stays.
    """
    current, volts = x.i_a * ahead, x.supply.volts_v
    return replace(
        x,
        id_a=current.real,
        iq_a=current.imag,
        supply=x.supply if volts is None else replace(x.supply, volts_v=volts * ahead),
        eps_rad=x.eps_rad - frame,
        theta_rad=x.theta_rad - error / x.machine.pole_pairs,
    )


def _in_time(
    segment: Segment, x: Operating, late_s: float, bend_s2: float, lag_s: float
) -> Operating:
    """The state with a motion that was recorded late taken ahead.

    A filter of first order is late by `late_s`, an observer of second order and a delay are by
    `late_s` and `bend_s2`; a tracking loop is by `bend_s2` with a lag, 2 ζ over its bandwidth:

        θ − θ_recorded = (late s + bend s² / (1 + lag s)) θ_recorded

    The angle goes ahead by its own differences: smoothed ones would bend it where the speed does.
    """
    points, policy = x.theta_rad.size // segment.size, x.machine.policy.cutting
    speed = np.gradient(x.theta_rad[::points], segment.ts_s)
    bent = bend_s2 * np.gradient(speed, segment.ts_s)
    if bend_s2:
        step = segment.ts_s / lag_s if lag_s > 0.0 else math.inf
        parts = np.split(bent, joins(segment))
        bent = np.concatenate([_lagged(part, step) for part in parts])
    ahead = late_s * speed + bent
    omega = late_s * np.gradient(x.omega_rad_s, segment.ts_s / points)
    if bend_s2:
        faster = _speed(bent, segment.ts_s, 1, policy)
        omega += faster if points == 1 else np.repeat(faster, points)
    if points > 1:
        ahead = np.interp(np.arange(x.theta_rad.size) / points, np.arange(segment.size), ahead)
    return replace(
        x,
        eps_rad=x.eps_rad + x.machine.pole_pairs * ahead,
        theta_rad=x.theta_rad + ahead,
        omega_rad_s=x.omega_rad_s + omega,
    )


def _lagged(part: Array, step: float) -> Array:
    """Second differences [n] of what follows without a gap, behind a lag, none of an infinite step;
    those of the two samples at either end reach across gaps, and are those of their neighbours
    instead.
    """
    inner = part[2:-2]
    if inner.size == 0:
        return part
    known = np.pad(inner, 2, mode="edge")
    return known if math.isinf(step) else lagged(known, step)


def _speed(theta: Array, period: float, finer: int, policy: Cutting) -> Array:
    width = max(2 * round(policy.speed_s / period / 2) + 1, 5) * finer
    return smoothed(np.gradient(theta, period / finer), width)


def _warmth(segment: Segment, signals: Signals, name: str, size: int, values: Values) -> Array:
    if name not in signals:
        known = [UNLOGGED[name], *([UNLOGGED_AT_REST] if name == "temp_winding_degc" else [])]
        warmed = sum(values[one] for one in segment.fixed if one.startswith(tuple(known)))
        rise, bend = (
            sum(
                values[one]
                for one in segment.fixed
                if name in course and one.startswith(course[name])
            )
            for course in (WARMING, BENDING)
        )
        at = np.linspace(-0.5, 0.5, size)
        return segment.fixed["ambient_k"] + warmed + rise * at + bend * (1.0 - 12.0 * at**2)
    warm = signals[name] - 25.0 - values[segment.instrument.thermometer]
    return _held(warm, size)


def _travel(signals: Signals, size: int) -> Array:
    since = signals.get("travel_rad")
    if since is None:
        return np.full(size, np.inf)
    known = np.isfinite(since)
    if since.size == size:
        return np.where(known, since, np.inf)
    at = np.arange(size) * since.size / size
    turned = np.interp(at, np.arange(since.size), np.where(known, since, 0.0))
    return np.where(known[at.astype(np.int64)], turned, np.inf)


def _held(column: NDArray[Number], size: int) -> NDArray[Number]:
    """A column [n] at every point [n m] of its samples; the column itself where m is 1."""
    points = size // column.size
    return column if points == 1 else np.repeat(column, points)


def _run(signals: Signals, size: int) -> Indices:
    run = signals.get("run")
    if run is None:
        return np.zeros(size, dtype=np.int64)
    return _held(run.astype(np.int64), size)


def _age(segment: Segment, size: int, machine: Machine) -> Array | None:
    """Time since the capture began [n m, s], where friction may change with it."""
    if EARLY_S not in machine.stated_u or EARLY_S not in segment.fixed:
        return None
    return _held(clock(segment), size)


def _torque_behind(signals: Signals, size: int) -> Array | None:
    behind = signals.get("behind_nm")
    return None if behind is None else _held(behind, size)
