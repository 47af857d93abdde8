"""What no model of a bench gets right to: reading errors, offsets, form, beside sensors' noise."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.criticism.data.segment import Segment, projected, row_index
from pipeline.criticism.effect import Effect
from pipeline.criticism.library.equations import equation_of
from pipeline.criticism.machine.model import Model, evaluate, zero
from pipeline.criticism.operating import Array, Complex, Flags, Indices, Operating, Values
from pipeline.criticism.parameter import Machine
from pipeline.criticism.policy.regression import NoiseFloors
from pipeline.criticism.regression.standstill import at_rest, at_reversals
from pipeline.criticism.residuals.channels import (
    channel_of,
    channel_scale,
    largest_reading,
    reported_unit,
)
from pipeline.criticism.residuals.residual import operate, residual
from pipeline.criticism.signals.shaft import averaged
from pipeline.criticism.signals.true_current import unseen_slopes, unseen_waves
from pipeline.criticism.signals.voltage import central, unresolved

VOLTS = ("vd_v", "vq_v")
SPEED = "omega_mech_rad_s"
_WINDING = {"vd_v": ("id_a", "ld_h"), "vq_v": ("iq_a", "lq_h")}
"""Current and inductance of each axis."""


@dataclass(frozen=True, slots=True)
class Floor:
    """What the rows of a segment are divided by.

    Attributes
    ----------
    sigma
        Noise of each weak sample [R].
    near
        Values at which reading errors are computed.
    tolerance
        What the forms of effects may be wrong by [groups]; None for nothing.

    """

    sigma: Array
    near: Values
    tolerance: Array | None = None

    def noise_and_scale(self, group: Indices, reading: Array) -> tuple[Array, Array]:
        """Noise floor of the weak samples, without and with the tolerance of form.

        Parameters
        ----------
        group
            Number of each sample's group [R].
        reading
            Reading error of each sample [R].

        Returns
        -------
        tuple of array [R]
            Both as weak samples of the residual.

        """
        noise: Array = np.hypot(self.sigma, reading)
        if self.tolerance is None:
            return noise, noise
        return noise, np.hypot(noise, self.tolerance[group])


def rough_floor(segment: Segment, model: Model, values: Values) -> Array:
    """A twentieth of the machine's own scale, as weak samples, whatever the noise.

    Parameters
    ----------
    segment
        The segment.
    model
        Its policy.
    values
        Parameters by full name.

    Returns
    -------
    array [R]
        As weak samples.

    """
    group, _, valid, groups = row_index(segment)
    scales = [channel_scale(segment, channel, model.machine, values) for channel, _ in groups]
    part = model.policy.noise_floors.rough * window_gain(segment) / reported_unit(segment, values)
    return part * np.array(scales)[group[valid]]


def form_tolerance(
    segment: Segment,
    model: Model,
    values: Values,
    added: Sequence[Effect],
    share: float | None = None,
) -> Array:
    """What the forms of the effects that were added may be wrong by.

    Parameters
    ----------
    segment
        Where they act.
    model, values
        With these effects.
    added
        The effects.
    share
        Of what an effect does [1]; the policy's where not given.

    Returns
    -------
    array [groups]
        As weak samples. Where a found effect acts, an error below that is one of its form, and
        names no further effect.

    """
    group, _, valid, groups = row_index(segment)
    total = np.zeros(len(groups))
    inexact = [effect for effect in added if not effect.exact]
    before = residual(segment, model, values) if inexact else np.zeros(0)
    for effect in inexact:
        without = residual(segment, model, {**values, **zero(effect, model)})
        power = projected(segment, without - before)[valid] ** 2
        count = np.bincount(group[valid], minlength=len(groups))
        total += np.bincount(group[valid], power, minlength=len(groups)) / np.maximum(count, 1)
    wrong = model.policy.noise_floors.form if share is None else share
    return wrong * np.sqrt(total)


def reading_error(segment: Segment, model: Model, values: Values) -> Array:
    """The error that any model of a bench is allowed.

    Parameters
    ----------
    segment
        Whose channels they are.
    model, values
        For scales and friction; an effect without a value is not there.

    Returns
    -------
    array [C, W, M]
        As weak samples.

    Notes
    -----
    5e-5 of the reading in a window, since no sensor is more linear, and for what happens between
    samples a part of the machine's own scale: 1e-4 under a drive, 2e-5 on a bench. Then what a
    drive's log may have as well: jumps of the voltage, a speed of a period ago, lines of the
    encoder, friction at standstill. An effect below this is negligible, and smaller structure names
    nothing.

    """
    weak, policy = segment.weak, model.policy.noise_floors
    if weak is None:
        return np.zeros((len(segment.channels), segment.size, 1))
    for effect in model.effects:
        values = {**zero(effect, model), **values}
    sensing = equation_of(segment).sensing
    sizes = [
        np.abs(segment.recorded.get(channel, np.zeros(segment.size)))
        if sensing.reading is None
        else sensing.reading(segment, channel, model, values)
        for channel in segment.channels
    ]
    reading = np.zeros((len(sizes), weak.starts.size, weak.orders.size))
    reading[:, :, 0] = policy.reading * np.abs(weak.project(np.stack(sizes)))[:, :, 0]
    part = policy.model_drive if segment.instrument.name == "drive" else policy.model_bench
    scales = [
        channel_scale(segment, channel, model.machine, values) for channel in segment.channels
    ]
    of_scale = (
        part
        * window_gain(segment)
        / reported_unit(segment, values)
        * np.array(scales)[:, None, None]
    )
    combined: Array = np.hypot(reading, of_scale)
    if "late_speed" in sensing.errors and SPEED in segment.channels:
        place, slope = segment.channels.index(SPEED), np.gradient(segment.recorded[SPEED])
        late = np.abs(weak.project(policy.speed_periods * slope[None])[0])
        combined[place] = np.hypot(combined[place], late)
    if "torque_shaft_nm" in segment.channels:
        place = segment.channels.index("torque_shaft_nm")
        combined[place] = np.hypot(combined[place], _of_torque(segment, model, values))
    places = [n for n, channel in enumerate(segment.channels) if channel in VOLTS]
    if places and "voltage_jumps" in sensing.errors:
        combined[places] = np.hypot(combined[places], _of_voltages(segment, model, values))
    return combined


def _of_voltages(segment: Segment, model: Model, values: Values) -> Array:
    """What a drive's log may be off by in its voltages [V, W, M], as weak samples of each."""
    errors = equation_of(segment).sensing.errors
    total = _jumps(segment, VOLTS, model.policy.noise_floors)[None, :, None]
    if "unsampled" in errors:
        total = np.hypot(total, np.abs(projected(segment, _unsampled(segment, values, 0.0))))
    if "instants" in errors and segment.instrument.timing == "instant":
        unsampled = _unsampled(segment, values, model.policy.noise_floors.jump)
        total = np.hypot(total, np.abs(projected(segment, unsampled)))
        total = np.hypot(total, _spikes(segment, VOLTS, model.policy.noise_floors)[:, :, None])
        total = np.hypot(total, _of_unseen_waves(segment, model, values))
    if any(effect.drop is not None for effect in model.effects):
        steep = steep_drops(model, values, operate(segment, segment.recorded, model, values))
        steep = steep[:: steep.size // segment.size]
        by_axis = {"vd_v": steep.real, "vq_v": steep.imag}
        axes = np.stack([by_axis[channel] for channel in segment.channels if channel in VOLTS])
        total = np.hypot(total, np.abs(projected(segment, axes)))
    return total


def _unsampled(segment: Segment, values: Values, jump: float) -> Array:
    """Voltage [V, n] of each axis by which currents change between the samples of a log, where they
    bend by more than so many times their noise: of that, an instant may show nothing or all.
    """
    axes = [channel for channel in segment.channels if channel in VOLTS]
    total = np.zeros((len(axes), segment.size))
    for place, channel in enumerate(axes):
        column, inductance = _WINDING[channel]
        current, noise = segment.recorded[column], segment.sensors.noise[column]
        share = unresolved(current, math.sqrt(2.0) * jump * noise)
        total[place] = values[inductance] * share * central(current, segment.ts_s)
    return total


def _of_unseen_waves(segment: Segment, model: Model, values: Values) -> Array | float:
    """Voltage [V, W, M] of each axis by which waves change the current that rows do not show, as
    weak samples: the rms over their phase.

    Where six electrical turns are nearly a whole number of rows, each row has the same phase of a
    wave. An instant of the voltage shows one value of what the wave takes, and the rows no change.
    """
    slopes = unseen_slopes(segment, model.machine.pole_pairs)
    if slopes is None or not slopes.any():
        return 0.0
    inductances = [values[_WINDING[name][1]] for name in segment.channels if name in VOLTS]
    power = sum(
        projected(segment, np.multiply.outer(inductances, part)) ** 2
        for one in slopes
        for part in (one.real, one.imag)
    )
    missed: Array = np.sqrt(power / 2.0)
    return missed


def _of_torque(segment: Segment, model: Model, values: Values) -> Array | float:
    """What a drive's log may be off by in its torque [W, M], as weak samples of its channel."""
    weak, policy = segment.windows, model.policy.noise_floors
    errors = equation_of(segment).sensing.errors
    if not errors:
        return 0.0
    total = np.zeros((weak.starts.size, weak.orders.size))
    if "encoder_lines" in errors:
        total = _encoder_lines(segment, values, policy)
    if "standstill" in errors:
        x = operate(segment, segment.recorded, model, values)
        total[:, 0] = np.hypot(total[:, 0], at_rest(segment, model, values, x))
        total[:, 0] = np.hypot(total[:, 0], at_reversals(segment, model, values, x))
    kt = 1.5 * model.machine.pole_pairs * values["psi_wb"]
    if "pulses" in errors:
        total[:, 0] = np.hypot(total[:, 0], _of_pulses(segment, model, values, x))
        total[:, 0] = np.hypot(total[:, 0], kt * _of_waves(segment, x.theta_rad.size))
    if "current_jumps" in errors:
        jumps = kt * _jumps(segment, ("id_a", "iq_a"), policy)
        total = np.hypot(total, jumps[:, None])
    if "torque_jumps" in errors:
        jumps = _jumps(segment, ("torque_shaft_nm",), policy)
        total = np.hypot(total, jumps[:, None])
    return total / reported_unit(segment, values)


def _of_pulses(segment: Segment, model: Model, values: Values, x: Operating) -> Array:
    """Torque [W] of what the mean of a pulsed current may be above its samples, as weak samples.

    Pulses make the current ripple about the zero vectors, where a drive samples it. Without
    resistance the mean of the ripple there is none. Its drop makes one, of up to R T² v/(96 L²):
    a tenth of the friction current where a period is a quarter of L/R. A log may hold means.
    """
    weak, l_q, pwm_s = segment.windows, values["lq_h"], x.supply.pwm_s or x.supply.hold_s
    if not l_q or not pwm_s:
        return np.zeros(weak.starts.size)
    pairs, finer = model.machine.pole_pairs, x.theta_rad.size // segment.size
    emf_v = pairs * values["psi_wb"] * x.omega_rad_s[::finer]
    share = model.policy.noise_floors.pulses * (pwm_s / l_q) ** 2 * values["r_ohm"]
    torque = 1.5 * pairs * values["psi_wb"] * share * emf_v
    return np.abs(weak.project(torque[None])[0, :, 0])


def _of_waves(segment: Segment, size: int) -> Array:
    """Current [W, A] of waves that rows do not show, as weak samples: the rms over their phase.

    Where six electrical turns are nearly a whole number of rows, each row has the same phase of a
    wave, and the mean of the rows is not that of the current.
    """
    weak, unseen = segment.windows, unseen_waves(segment, size)
    if unseen is None:
        return np.zeros(weak.starts.size)
    finer = size // segment.size
    rows = [averaged(part, finer) for one in unseen for part in (one.real, one.imag)]
    missed: Array = np.sqrt((weak.project(np.array(rows))[:, :, 0] ** 2).sum(0) / 2.0)
    return missed


def steep_drops(model: Model, values: Values, x: Operating) -> Complex:
    """How far the drops of effects are off where the currents at which they change are off.

    Parameters
    ----------
    model
        The model.
    values
        Parameters by full name.
    x
        True state [n].

    Returns
    -------
    array [n], complex
        d + jq [V].

    Notes
    -----
    A drop that jumps with the current, as that of an inverter whose ripple just exceeds it, is off
    by all of that jump where the current at which it jumps is off by little. What is in proportion
    to the current is a resistance, which a fit determines.

    """
    evaluate(model, x, values, frozenset({"flux"}))
    factor = 1.0 + model.policy.selection.form_error
    moved = replace(x, id_a=x.id_a * factor, iq_a=x.iq_a * factor, cache={})
    change = np.zeros(x.omega_rad_s.shape, dtype=complex)
    for drop, q in model.hooks("drop", values):
        before = drop(x, q)
        step = drop(moved, q) - before
        steeper = np.abs(step) - (factor - 1.0) * np.abs(before)
        change = change + np.maximum(steeper, 0.0) * np.exp(1j * np.angle(step))
    return change


def _jumps(segment: Segment, names: Sequence[str], policy: NoiseFloors) -> Array:
    """Error [W] that a jump of signals may make, as weak samples: a quarter of it for a sample.

    A log says what a voltage, current or torque was at its samples, not when within a period it
    changed. A sample of a column that is slower than the rows is in as many of them.
    """
    there = [name for name in names if name in segment.recorded]
    noise = math.hypot(*(segment.sensors.noise[name] for name in there))
    counts = [segment.sensors.every.get(name, 1) for name in there]
    each = zip(there, counts, strict=True)
    bends = [math.sqrt(count) * _bends(segment.recorded[name], count) for name, count in each]
    # a jump bends the line twice, there and back
    bend = np.sqrt(sum(one**2 for one in bends)) / math.sqrt(2.0)
    bend[bend < policy.jump * noise] = 0.0
    weak = segment.windows
    rows = weak.starts[:, None] + np.arange(weak.length)[None, :]
    return policy.jump_periods * np.sqrt((bend[rows] ** 2) @ (weak.functions[0, 0] ** 2))


def _bends(signal: Array, every: int) -> Array:
    """Second differences [n] of a signal over so many rows, 0 at both ends."""
    bends = np.zeros(signal.size)
    bends[every:-every] = signal[2 * every :] - 2.0 * signal[every:-every] + signal[: -2 * every]
    return bends


def _spikes(segment: Segment, names: Sequence[str], policy: NoiseFloors) -> Array:
    """Error [V, W] of signals that stand out in one row alone, as weak samples of each.

    Between two instants a log does not say how long a pulse lasted, from no time to two periods. So
    its mean is open by as much as it is.
    """
    weak, there = segment.windows, [name for name in names if name in segment.channels]
    height = np.zeros((len(there), segment.size))
    for place, name in enumerate(there):
        before, after = np.diff(segment.recorded[name])[:-1], np.diff(segment.recorded[name])[1:]
        least = np.minimum(np.abs(before), np.abs(after))
        stands_out = (before * after < 0.0) & (least > policy.jump * segment.sensors.noise[name])
        height[place, 1:-1] = np.where(stands_out, least, 0.0)
    rows = weak.starts[:, None] + np.arange(weak.length)[None, :]
    spread: Array = np.sqrt((height[:, rows] ** 2) @ (weak.functions[0, 0] ** 2))
    return spread


def _encoder_lines(segment: Segment, values: Values, policy: NoiseFloors) -> Array:
    """Torque [W, M] that a line of the encoder's own error makes on an order k, as weak samples.

    Rounding at steady speed is periodic in the angle, and some of its harmonics beat with the
    sampling on to any order k. The 10th has 0.03 steps [Widrow & Kollar (2008), ch. 20], and makes
    a torque of J (k ω)² times that.
    """
    weak = segment.windows
    theta = segment.recorded["theta_mech_rad"]
    span = (weak.length - 1) * segment.ts_s
    omega = (theta[weak.starts + weak.length - 1] - theta[weak.starts]) / span
    step = math.sqrt(12.0) * segment.sensors.noise["theta_mech_rad"]
    wave = window_gain(segment) / math.sqrt(2.0) * policy.encoder_line * step * values["j_kgm2"]
    return wave * (omega[:, None] * weak.orders[None, :]) ** 2


def offsets(segment: Segment, valid: Flags, row_weight: Array, machine: Machine) -> list[Array]:
    """Whitened weak samples of the disturbances that a segment may hold.

    Parameters
    ----------
    segment
        The segment.
    valid
        Weak samples that are used [C, W, M].
    row_weight
        Weights of the rows [R].
    machine
        Its scales, and in its policy prior sizes of offsets.

    Returns
    -------
    list of array [R]
        An offset of each channel's sensor, mains lines and drift, each of its prior size.

    """
    shapes, lines = segment.disturbances.offsets, segment.disturbances.lines
    constants = [] if lines is None else [line[valid] * row_weight for line in lines]
    if shapes is not None:
        of_shapes = [projected(segment, one[None])[valid] * row_weight for one in shapes]
        return of_shapes + constants
    if segment.weak is None:
        return []
    policy, of_one = machine.policy.noise_floors, segment.weak.functions.sum(axis=2)
    for place, channel in enumerate(segment.channels):
        observed = channel_of(segment, channel)
        offset, prior = observed.offset, policy.offset * segment.sensors.noise.get(channel, 0.0)
        if offset == "voltmeter":
            prior = math.hypot(prior, policy.terminal_offset * largest_reading(segment, (channel,)))
        if offset == "transducer":
            prior = math.hypot(prior, policy.transducer_offset * machine.scales[observed.scale])
        if offset == "none" or prior == 0.0:
            continue
        constant = np.zeros((len(segment.channels), *of_one.shape))
        constant[place] = prior * of_one
        constants.append(constant[valid] * row_weight)
    return constants


def window_gain(segment: Segment) -> float:
    """Weak sample that a constant of one makes in the plain window.

    Parameters
    ----------
    segment
        Whose windows they are.

    Returns
    -------
    float
        [1]; 1 of a table.

    """
    weak = segment.weak
    return 1.0 if weak is None or weak.starts.size == 0 else float(weak.functions[0, 0].sum())
