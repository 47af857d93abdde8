"""Open terminals of a driven shaft: the back-EMF in the rotor frame, or in that of the voltage."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import polars as pl

from pipeline.criticism.data.rounding import coarse_step
from pipeline.criticism.data.segment import (
    PAIR_RAD,
    Segment,
    Sensors,
    segment_of,
)
from pipeline.criticism.data.sensors import prepared, sensor_noise
from pipeline.criticism.data.shaft_angle import ANGLES, shaft_angle, with_angle
from pipeline.criticism.data.traces import (
    LINES_V,
    even_clock,
    pad_of,
    smoothed,
    thinned,
    window_between_gaps,
)
from pipeline.criticism.equation import Channel, Equation, Observes, Sensing, Use
from pipeline.criticism.machine.model import OPEN_FLUX, Model, Pieces
from pipeline.criticism.operating import Array, Complex, Flags, Operating, Signals, Values
from pipeline.criticism.parameter import Machine
from pipeline.criticism.policy.captures import Cutting
from pipeline.criticism.signals.true_state import at_true_angle, motion_of, operating
from pipeline.criticism.signals.voltage import central, fine_slope, recorded_voltage
from pipeline.numerics.projection import Projection, projection
from pipeline.physics.frames import vector_of_lines
from pipeline.records.capture import Capture

_VOLTAGE_FRAME = "own_frame"
"""Number of a segment whose angle is that of its voltage, for want of an encoder."""
_PHASES_V = ("va_v", "vb_v", "vc_v")
_LINE_RAD = {f"v{pair}_v": angle for pair, angle in PAIR_RAD.items()}
"""Where each line voltage stands [rad, electrical]."""


def cut(capture: Capture, machine: Machine) -> Segment | None:
    """Line voltages and angle of an open-circuit spin, in the windows of steady speed.

    Parameters
    ----------
    capture
        An open-circuit spin.
    machine
        Orders and policy.

    Returns
    -------
    Segment or None
        None with fewer than two line voltages. Without an encoder the angle is that of the voltage
        itself.

    """
    capture = _with_lines(capture)
    lines = [n for n in LINES_V if capture.has(n)]
    if len(lines) < 2:
        return None
    extra = ["temp_magnet_degc"] if capture.has("temp_magnet_degc") else []
    names = with_angle(capture, [*lines, *extra])
    encoder = not ANGLES.isdisjoint(names)
    policy = machine.policy.cutting
    signals = tuple(names if encoder else [*lines, *extra])
    period, columns, keep = even_clock(capture, signals, policy)
    window = window_between_gaps(period, keep, policy)
    if encoder:
        shaft_angle(columns, period, machine)
    else:
        keep &= _by_voltage(columns, machine, window, period)
    columns |= _without_zeros(columns, machine, window)
    sensors = _beside_waves(prepared(columns, period, machine.policy), columns, machine, window)
    if not encoder:
        # of the phase alone, which the noise of the voltages makes anew
        noise = {**sensors.noise, "theta_mech_rad": 0.0}
        samples = _phase_samples(window, period, policy)
        sensors = replace(sensors, noise=noise, phase_samples=samples)
    columns["t_s"] = period * np.arange(keep.size, dtype=np.float64)
    columns, starts = thinned(columns, keep, window, policy.windows, pad_of(period, policy))
    orders, margin = machine.electrical_orders, policy.wave_samples
    weak = projection(columns["theta_mech_rad"], starts, window, orders, margin=margin)
    weak = weak.only(_steady(weak, columns["theta_mech_rad"], policy))
    return segment_of(
        capture,
        "open",
        "bench",
        period,
        columns,
        sensors,
        channels=("vd_v", "vq_v"),
        weak=weak,
        fixed={} if encoder else {_VOLTAGE_FRAME: 1.0},
    )


def _with_lines(capture: Capture) -> Capture:
    """The capture with line voltages, where it holds those of all three phases to the star point.

    What all phases have in common, such as their third harmonic, is in no line.
    """
    if any(capture.has(name) for name in LINES_V) or not capture.has(*_PHASES_V):
        return capture
    lines = [
        (pl.col(one) - pl.col(other)).alias(line)
        for line, one, other in zip(LINES_V, _PHASES_V, (*_PHASES_V[1:], _PHASES_V[0]), strict=True)
    ]
    tables = (t.with_columns(lines) if {*_PHASES_V} <= {*t.columns} else t for t in capture.tables)
    return replace(capture, tables=tuple(tables))


def _beside_waves(
    sensors: Sensors, columns: Mapping[str, Array], machine: Machine, window: int
) -> Sensors:
    """The sensors with the noise of voltages beside the waves of their angle, where that is less.

    Of few samples a turn the seventh wave of a back-EMF bends between them as noise does.
    """
    waves = _waves(columns["theta_mech_rad"], machine, window)
    basis = np.column_stack([waves.real, waves.imag[:, 1:]])
    inverse = np.linalg.pinv(basis.T @ basis, hermitian=True)
    noise, steps = dict(sensors.noise), dict(sensors.steps)
    for name in LINES_V:
        if name in columns:
            remainder = columns[name] - basis @ (inverse @ (basis.T @ columns[name]))
            noise[name] = min(noise[name], sensor_noise(remainder, machine.policy.sensor_noise))
            step = coarse_step(columns[name], noise[name], machine.policy.sensor_noise)
            steps |= {name: step} if step else {}
    return replace(sensors, noise=noise, steps=steps)


def _without_zeros(columns: Mapping[str, Array], machine: Machine, window: int) -> dict[str, Array]:
    """The line voltages [n, V] without the zeros of their probes, as no winding has a mean voltage.
    None within two electrical turns, where a constant is a part of a wave.
    """
    inside = slice(window, -window)
    theta = columns["theta_mech_rad"][inside]
    if theta.size < 2 or float(np.ptp(theta)) * machine.pole_pairs < 4.0 * math.pi:
        return {}
    waves = _waves(columns["theta_mech_rad"], machine, window)[inside, 1:]
    basis = np.column_stack([np.ones(theta.size), waves.real, waves.imag])
    basis /= np.linalg.norm(basis, axis=0)
    lines = [name for name in LINES_V if name in columns]
    recorded = np.column_stack([columns[name][inside] for name in lines])
    zeros = np.linalg.lstsq(basis, recorded, rcond=None)[0][0] / math.sqrt(theta.size)
    return {name: columns[name] - zero for name, zero in zip(lines, zeros, strict=True)}


def _waves(theta_rad: Array, machine: Machine, window: int) -> Complex:
    """Waves [n, orders] of the electrical angle, of a size that goes with the speed."""
    theta = smoothed(theta_rad, 2 * (window // 2) + 1)
    orders = machine.pole_pairs * np.arange(machine.policy.cutting.voltage_orders + 2)
    waves: Complex = np.gradient(theta)[:, None] * np.exp(1j * orders * theta[:, None])
    return waves


def _by_voltage(columns: dict[str, Array], machine: Machine, window: int, period: float) -> Flags:
    """Adds the angle [n, rad] at which the voltage stands; the samples where it is known.

    The magnet's angle at the start differs between spins, and a speed does not show it. The voltage
    does, but for the sense of rotation, which its own turning shows. What its phase has at whole
    orders of its own angle is harmonics and errors of the meter; all else is motion of the shaft.
    """
    voltage = vector_of_lines({name: columns[name] for name in LINES_V if name in columns})
    noise = max(
        sensor_noise(columns[name], machine.policy.sensor_noise)
        for name in LINES_V
        if name in columns
    )
    phase = np.unwrap(np.angle(voltage))
    width = 2 * (window // 2) + 1
    sense = np.sign(smoothed(np.gradient(phase), width))
    known = (np.abs(voltage) > machine.policy.cutting.audible_u * noise) & (
        np.diff(sense, prepend=sense[0]) == 0.0
    )
    inside: Flags = np.convolve(known.astype(float), np.ones(width), mode="same") > width - 0.5
    upright = phase - 0.5 * math.pi * sense
    angle = smoothed(upright, width)
    short = _phase_samples(window, period, machine.policy.cutting)
    if short < width and inside.any():
        orders = np.arange(1, machine.policy.cutting.voltage_orders + 1)
        waves = np.exp(1j * orders * angle[:, None])
        basis, deviation = np.column_stack([waves.real, waves.imag]), upright - angle
        coefficients = np.linalg.lstsq(basis[inside], deviation[inside], rcond=None)[0]
        angle += smoothed(deviation - basis @ coefficients, short)
    columns["theta_mech_rad"] = angle / machine.pole_pairs
    return inside


def _phase_samples(window: int, period: float, policy: Cutting) -> int:
    """Samples that the phase of voltages is smoothed over."""
    return min(2 * (round(policy.speed_s / period) // 2), 2 * (window // 2)) + 1


def _steady(weak: Projection, theta: Array, policy: Cutting) -> Flags:
    """The windows [W] of constant speed, which an open-circuit test is made of; all if too few.

    An instantaneous voltage sample at a kink of the speed belongs to neither side of it.
    """
    half = weak.length // 2
    first = theta[weak.starts + half] - theta[weak.starts]
    second = theta[weak.starts + 2 * half - 1] - theta[weak.starts + half - 1]
    steady = np.abs(second - first) < policy.steady_share * np.abs(first + second)
    return steady if steady.sum() >= policy.steady_windows else np.ones(steady.size, dtype=bool)


def state(segment: Segment, signals: Signals, model: Model, values: Values) -> Operating:
    """True angle and speed [n] without current; the bench's encoder has a zero of its own."""
    motion = motion_of(segment, signals, model.machine)
    none = np.zeros(motion.theta_rad.size, dtype=complex)
    x = operating(segment, signals, model, values, none, motion)
    if _VOLTAGE_FRAME in segment.fixed:
        return x
    x = replace(x, eps_rad=x.eps_rad - values["bench_angle_rad"])
    return at_true_angle(segment, x, model, values)


def measured(segment: Segment, signals: Signals, model: Model, values: Values) -> Array:
    """Line voltages [2, n, V], turned into the rotor's frame by the recorded angle."""
    lines = vector_of_lines({name: signals[name] for name in LINES_V if name in signals})
    voltage = lines * np.exp(-1j * _recorded_eps(segment, signals, model, values))
    return np.stack([voltage.real, voltage.imag])


def predicted(
    segment: Segment, x: Operating, pieces: Pieces, model: Model, values: Values
) -> Array:
    """Voltages v_d, v_q [2, n, V] of a winding without current.

    Parameters
    ----------
    segment
        The spin, on its true clock.
    x
        True state [n].
    pieces
        Flux of the model there.
    model
        Effects of its sensors.
    values
        Parameters by full name.

    Returns
    -------
    array [2, n]
        In V, in the frame of the recorded angle.

    Notes
    -----
    v = (1 + s) (dψ/dt + j ω_e ψ), with the share s by which the magnet is not that of other
    tests, over what the recorded voltage samples stand for.

    References
    ----------
    IEEE Std 1812-2014 (tests of permanent magnet machines: open circuit).

    """
    period = segment.ts_s
    omega = x.once(x.theta_rad, "pace", lambda: central(x.machine.pole_pairs * x.theta_rad, period))
    voltage = pieces.drop_v + fine_slope(pieces.psi_wb, period) + 1j * omega * pieces.psi_wb
    voltage *= 1.0 + segment.fixed.get(OPEN_FLUX, 0.0) * values[OPEN_FLUX]
    by_encoder = _VOLTAGE_FRAME not in segment.fixed
    voltage = recorded_voltage(voltage, segment, x, model, values, in_frame=by_encoder)
    return np.stack([voltage.real, voltage.imag])


def begins(segment: Segment, machine: Machine) -> Values:
    """Zero of the bench's encoder, where the back-EMF puts the magnet.

    Parameters
    ----------
    segment
        The spin.
    machine
        Its pole pairs.

    Returns
    -------
    dict of float
        Empty where the voltage itself is the angle. From half a turn off a fit would put the magnet
        to nothing before it had turned it.

    """
    if _VOLTAGE_FRAME in segment.fixed:
        return {}
    theta = segment.recorded["theta_mech_rad"]
    lines = vector_of_lines(
        {name: segment.recorded[name] for name in LINES_V if name in segment.recorded}
    )
    turned = lines * np.gradient(theta) * np.exp(-1j * machine.pole_pairs * theta)
    back_emf = complex(np.nanmean(turned)) / 1j
    return {"bench_angle_rad": -float(np.angle(back_emf))} if back_emf else {}


def _recorded_eps(segment: Segment, signals: Signals, model: Model, values: Values) -> Array:
    eps: Array = model.machine.pole_pairs * signals["theta_mech_rad"]
    return eps if _VOLTAGE_FRAME in segment.fixed else eps - values["bench_angle_rad"]


def _reading(segment: Segment, _: str, __: Model, ___: Values) -> Array:
    """Length [n, V] of two line voltages."""
    present = [segment.recorded[n] for n in ("vab_v", "vbc_v") if n in segment.recorded]
    return np.sqrt(sum(column**2 for column in present))


def _sensed(segment: Segment, residual: Array, model: Model, values: Values) -> Signals:
    """A residual [2, n] in the rotor's frame, turned back to each line's voltage [n]."""
    eps = _recorded_eps(segment, segment.recorded, model, values)
    winding = math.sqrt(3.0) * (residual[0] + 1j * residual[1]) * np.exp(1j * (eps + math.pi / 6.0))
    lines = [name for name in LINES_V if name in segment.recorded]
    return {name: (winding * np.exp(-1j * _LINE_RAD[name])).real for name in lines}


EQUATION = Equation(
    name="open",
    words="v = dψ/dt + j ω_e ψ at no current",
    tests=("open_circuit",),
    columns=("t_s",),
    channels=(
        Channel("vd_v", "voltage_v", offset="none"),
        Channel("vq_v", "voltage_v", offset="none"),
    ),
    cut=cut,
    state=state,
    measured=measured,
    predicted=predicted,
    observes=Observes(
        ("psi_wb", "bench_angle_rad"),
        hooks=frozenset({"flux"}),
        sensors=frozenset({"angle", "voltage", "clock"}),
    ),
    begins=begins,
    recorder="open",
    sensing=Sensing(_reading, sensors=LINES_V, sensed=_sensed),
    use=Use(turns=True, warms=frozenset({"flux"}), angle_maps=True),
)
