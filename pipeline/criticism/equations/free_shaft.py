"""A shaft without current: its coast, or the torque of a slow turn."""

from __future__ import annotations

import math

import numpy as np

from pipeline.criticism.data.hysteresis import with_travel
from pipeline.criticism.data.segment import Segment, Sensors, segment_of, slow_orders
from pipeline.criticism.data.sensors import noise_and_steps, prepared, sensor_noise
from pipeline.criticism.data.shaft_angle import shaft_angle, with_angle
from pipeline.criticism.data.traces import (
    decimated,
    even_clock,
    pad_of,
    smoothed,
    thinned,
    window_between_gaps,
)
from pipeline.criticism.equation import Channel, Equation, Observes, Use
from pipeline.criticism.machine.model import COAST_SHARES, Model, Pieces, clock_gain
from pipeline.criticism.operating import Array, Flags, Operating, Signals, Values
from pipeline.criticism.parameter import Machine
from pipeline.criticism.policy.policy import Policy
from pipeline.criticism.signals.shaft import (
    net_torque,
    sensed_torque,
    true_load,
    unexplained_acceleration,
)
from pipeline.criticism.signals.true_state import at_true_angle, finer_of, motion_of, operating
from pipeline.numerics.coasting import coasting_rows
from pipeline.numerics.projection import projection, window_starts
from pipeline.records.capture import Capture

SPEED, TORQUE, RECORDER = "omega_mech_rad_s", "torque_shaft_nm", "shaft"


def cut(capture: Capture, machine: Machine) -> Segment | None:
    """The angle of a coast; of a slow turn the torque, averaged to some samples a wave.

    Parameters
    ----------
    capture
        A spin-down or a cogging turn.
    machine
        Orders and policy.

    Returns
    -------
    Segment or None
        None without an angle or speed, of a slow turn without a torque, and of one that does not
        turn.

    """
    names = with_angle(capture, [])
    if not names:
        return None
    if capture.meta.test == "cogging":
        if not capture.has("torque_shaft_nm"):
            return None
        names = [*names, "torque_shaft_nm"]
    policy = machine.policy.cutting
    period, columns, keep = even_clock(capture, tuple(names), policy)
    speed = shaft_angle(columns, period, machine)
    channel = TORQUE if TORQUE in columns else SPEED
    if capture.meta.test == "cogging":
        return _slow_turn(capture, machine, period, columns, keep, channel)
    window = window_between_gaps(period, keep, policy)
    keep = keep & _coasts(columns["theta_mech_rad"], window, machine.policy)
    sensors = prepared(columns, period, machine.policy, speed)
    columns["t_s"] = period * np.arange(keep.size, dtype=np.float64)
    columns, starts = thinned(columns, keep, window, policy.windows, pad_of(period, policy))
    weak = projection(
        columns["theta_mech_rad"], starts, window, slow_orders(machine), cycles=2.0, margin=4.0
    )
    return segment_of(
        capture, "shaft", "bench", period, columns, sensors, channels=(channel,), weak=weak
    )


def _coasts(theta: Array, window: int, policy: Policy) -> Flags:
    """Samples [n] in which a shaft coasts.

    A shaft at rest does not: friction holds it, and what is left of its recorded speed is of the
    sensor, or of the rows before that it is smoothed over. What is before a coast counts, unless
    the shaft was driven or held there for more than a share of some coast. A shaft that never turns
    has no coast, and all of it counts.
    """
    half, driven_share = window // 2, policy.cutting.driven_share
    least = policy.cutting.rest_sigmas * sensor_noise(theta, policy.sensor_noise, steady=True)
    speed = smoothed(np.gradient(theta), 2 * half + 1)
    runs = sorted(((rows.start, rows.stop) for rows, _ in coasting_rows(speed)))
    if not runs:
        return np.ones(theta.size, dtype=bool)
    ends = [0, *(stop for _, stop in runs)]
    driven = any(
        start - end > driven_share * (stop - start)
        for (start, stop), end in zip(runs, ends, strict=False)
    )
    free = np.zeros(theta.size, dtype=bool)
    free[: runs[0][0]] = not driven
    for start, stop in runs:
        # where it is once the last row that the speed is smoothed over has passed
        ahead = np.abs(theta[min(stop + half, theta.size - 1)] - theta[start:stop])
        last = int(np.flatnonzero(ahead > least).max(initial=0))
        free[start : start + last + 1] = True
    return free


def _slow_turn(
    capture: Capture,
    machine: Machine,
    period: float,
    columns: dict[str, Array],
    keep: Flags,
    channel: str,
) -> Segment | None:
    orders, policy = slow_orders(machine), machine.policy.cutting
    theta = columns["theta_mech_rad"]
    turns = float(np.ptp(theta)) / (2 * math.pi)
    if turns <= 0.0:
        return None
    factor = max(int(theta.size / turns / (policy.slow_samples * max(orders))), 1)
    if theta.size // factor < policy.least_window + 2:
        return None
    noise, steps = noise_and_steps(columns, machine.policy.sensor_noise)
    noise = {n: sigma / math.sqrt(factor) for n, sigma in noise.items()}
    columns = {name: decimated(column, factor) for name, column in columns.items()}
    sensors = Sensors(noise, steps, with_travel(columns, noise, policy))
    keep = decimated(keep.astype(float), factor) > 0.999
    keep[:1] = keep[-1:] = False
    size = keep.size
    window = max(int(size / round(turns)), policy.least_window) if turns > 1.2 else size - 2
    window = min(window, size - 2)
    # the first and the last sample have no neighbours
    starts = 1 + window_starts(keep[1:-1], window)
    weak = projection(columns["theta_mech_rad"], starts, window, orders, cycles=0.9, margin=12.0)
    return segment_of(
        capture, "shaft", "bench", period * factor, columns, sensors, channels=(channel,), weak=weak
    )


def state(segment: Segment, signals: Signals, model: Model, values: Values) -> Operating:
    """True angle and speed of a shaft without current.

    Parameters
    ----------
    segment
        The capture, on its true clock.
    signals
        Recorded columns [n].
    model
        Effects of its sensors.
    values
        Parameters by full name.

    Returns
    -------
    Operating
        The state [n m], with m points a sample of a coast.

    """
    slow = segment.test == "cogging"
    finer = 1 if slow else finer_of(segment, model.machine, model.policy.cutting.coast_parts)
    motion = motion_of(segment, signals, model.machine, finer)
    none = np.zeros(motion.theta_rad.size, dtype=complex)
    x = operating(segment, signals, model, values, none, motion)
    return at_true_angle(segment, x, model, values)


def measured(segment: Segment, signals: Signals, model: Model, values: Values) -> Array:
    """Zero for a coast, whose angle is in the prediction; the torque of a slow turn.

    Parameters
    ----------
    segment
        The capture.
    signals
        Recorded columns [n].
    model
        Effects of its sensors.
    values
        Parameters by full name.

    Returns
    -------
    array [1, n]
        In rad/s² or N·m.

    """
    if SPEED in segment.channels:
        return np.zeros((1, segment.size))
    return true_load(segment, signals, model, values)[None]


def predicted(
    segment: Segment, x: Operating, pieces: Pieces, model: Model, values: Values
) -> Array:
    """Acceleration that the drags leave unexplained [rad/s²], or the shaft's torque [N·m]: [1, n].

    Parameters
    ----------
    segment
        The capture, on its true clock.
    x
        True state [n m].
    pieces
        Drags of the model there.
    model
        Effects of its sensors.
    values
        Parameters by full name.

    Returns
    -------
    array [1, n]
        In rad/s² of a coast, in N·m of a slow turn.

    Notes
    -----
    −drags/J − d²θ/dt² of a coast, each drag with the share by which it is not
    that of other tests; −drags − J d²θ/dt² where a transducer drives the shaft.

    """
    torque = net_torque(x, pieces, values)
    if SPEED in segment.channels:
        torque += _further_drag(segment, x, torque, values)
        stretch = 1.0 + clock_gain(RECORDER, model, values)
        return unexplained_acceleration(segment, x, torque, values, stretch)[None]
    return sensed_torque(segment, x, torque, model, values)[None]


def _further_drag(segment: Segment, x: Operating, torque_nm: Array, values: Values) -> Array:
    """What turns a coasting shaft [n, N·m] beyond the drags −`torque_nm` of other tests."""
    if COAST_SHARES[0] not in segment.fixed:
        return np.zeros_like(torque_nm)
    dry, viscous = (values[name] for name in COAST_SHARES)
    of_speed = values["b_nm_s_rad"] * x.omega_rad_s
    return dry * (torque_nm + of_speed) - viscous * of_speed


EQUATION = Equation(
    name="shaft",
    words="J dω/dt = −drags",
    tests=("spin_down", "cogging"),
    columns=("t_s",),
    channels=(
        Channel(SPEED, "torque_nm", reported="alpha_mech_rad_s2", acceleration=True),
        Channel(TORQUE, "torque_nm", offset="transducer"),
    ),
    cut=cut,
    state=state,
    measured=measured,
    predicted=predicted,
    observes=Observes(
        ("j_kgm2", "b_nm_s_rad"),
        hooks=frozenset({"torque"}),
        sensors=frozenset({"angle", "load", "clock"}),
        form="affine",
    ),
    recorder=RECORDER,
    use=Use(turns=True, free_runs=("spin_down",), angle_maps=True),
)
