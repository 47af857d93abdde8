"""The motion of a shaft that runs free under the current of a log, with voltages or none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.criticism.data.drive_log import drive_log, in_time
from pipeline.criticism.data.segment import Segment, Unthinned, segment_of
from pipeline.criticism.data.traces import READ_BETWEEN, pad_of, thinned, window_between_gaps
from pipeline.criticism.data.unlogged_load import rests, runs_free
from pipeline.criticism.equation import Channel, Equation, Observes, Sensing, Use
from pipeline.criticism.machine.model import STATE, Model, Pieces, clock_gain
from pipeline.criticism.machine.two_masses import reach
from pipeline.criticism.operating import Array, Operating, Signals, Values
from pipeline.criticism.parameter import Machine
from pipeline.criticism.signals.shaft import (
    net_torque,
    torque_between,
    torque_reading,
    unexplained_acceleration,
)
from pipeline.criticism.signals.true_current import drive_current
from pipeline.criticism.signals.true_state import at_true_angle, finer_of, motion_of, operating
from pipeline.numerics.jumps import speed_jumps
from pipeline.numerics.projection import projection
from pipeline.records.capture import Capture

TORQUE, RECORDER = "torque_shaft_nm", "log"
_USED = (
    "theta_mech_rad",
    "iq_a",
    "id_a",
    "travel_rad",
    "run",
    "temp_magnet_degc",
    READ_BETWEEN,
)


def cut(capture: Capture, machine: Machine) -> Segment | None:
    """Angle and current of a free shaft, in a selection of the windows.

    Parameters
    ----------
    capture
        A drive log without a transducer.
    machine
        Orders and policy.

    Returns
    -------
    Segment or None
        None with a transducer, and where something else than the current drives the shaft. Windows
        are few because waves of the angle take long to compute at speed. None is of a shaft at
        rest: there friction holds what a load and the current leave over.

    Notes
    -----
    Without an angle the drive's own speed is integrated, and that is late by two nuisances. What
    its filter or observer makes smooth of its noise is in the floors (`sensor_noise.slow_noise`).

    """
    log = None if capture.has(TORQUE) else drive_log(capture, machine)
    if log is None or not runs_free(log, machine):
        return None
    shaft = {name: log.columns[name] for name in _USED if name in log.columns}
    shaft["t_s"] = log.period_s * np.arange(log.keep.size, dtype=np.float64)
    policy = machine.policy.cutting
    # what drove the shaft where its speed jumps, and settles, is in no row
    limits = policy.jump_share, policy.jump_times, policy.jump_rows
    steady = ~speed_jumps(shaft["theta_mech_rad"], *limits)
    each = 1 if steady.all() else 2
    window = window_between_gaps(log.period_s, log.keep & steady, policy, each)
    full = {**shaft, "good": log.keep.astype(float)} if capture.meta.test == "drive" else None
    pad = pad_of(log.period_s, policy, policy.motion_pad)
    pad = max(pad, reach(log.period_s, machine.policy.torsion))
    # a window needs the rows that show what its current does between them
    pad = max(pad, -(-(machine.policy.ripple.rows - window) // 2))
    moves = log.keep & steady & ~rests(shaft["theta_mech_rad"], window, policy)
    shaft, starts = thinned(shaft, moves, window, policy.windows_motion, pad)
    weak = projection(shaft["theta_mech_rad"], starts, window, ())
    middle = np.rint(shaft["t_s"][starts + window // 2] / log.period_s)
    segment = segment_of(
        capture,
        "motion",
        "drive",
        log.period_s,
        shaft,
        log.sensors,
        channels=(TORQUE,),
        weak=weak,
        blocks=in_time(middle, log.keep.size),
    )
    return replace(segment, unthinned=Unthinned(full))


def state(segment: Segment, signals: Signals, model: Model, values: Values) -> Operating:
    """True current, angle and speed [n·m], m points a sample where the shaft turns fast."""
    finer = finer_of(segment, model.machine, model.policy.cutting.log_parts)
    motion = motion_of(segment, signals, model.machine, finer)
    current = drive_current(segment, signals, model, values, motion.theta_rad.size)
    x = operating(segment, signals, model, values, current, motion)
    # a vector that turns while it is held ripples; the current of one axis does not
    hold_s = x.supply.hold_s if "id_a" in signals else 0.0
    return at_true_angle(segment, x.fed(hold_s=hold_s), model, values)


def measured(segment: Segment, _: Signals, __: Model, ___: Values) -> Array:
    """Nothing [1, n]: the angle is in the prediction."""
    return np.zeros((1, segment.size))


def predicted(
    segment: Segment, x: Operating, pieces: Pieces, model: Model, values: Values
) -> Array:
    """Acceleration that current and drags leave unexplained [1, n, rad/s²].

    Parameters
    ----------
    segment
        The log, on its true clock.
    x
        True state [n m].
    pieces
        Flux and drags of the model there.
    model
        Clock of the log.
    values
        Parameters by full name.

    Returns
    -------
    array [1, n]
        In rad/s².

    Notes
    -----
    (1.5 p [Im(ψ* i) + ∂W/∂ε] − drags)/J − d²θ/dt², of a shaft without any load; with what current
    and flux do between samples. With a spring between two masses its drag is −f J twist″
    (`machine.two_masses`).

    """
    stretch = 1.0 + clock_gain(RECORDER, model, values)
    torque = net_torque(x, pieces, values) + torque_between(segment, x, pieces, values)
    return unexplained_acceleration(segment, x, torque, values, stretch)[None]


def _reading(segment: Segment, _: str, model: Model, values: Values) -> Array:
    """Acceleration [n, rad/s²] that the length of the current makes."""
    return torque_reading(segment, model, values) / values["j_kgm2"]


EQUATION = Equation(
    name="motion",
    words="J dω/dt = 1.5 p [Im(ψ* i) + ∂W/∂ε] − drags",
    tests=("drive",),
    columns=("t_s", "iq_a"),
    channels=(Channel(TORQUE, "torque_nm", acceleration=True, as_torque=True),),
    cut=cut,
    state=state,
    measured=measured,
    predicted=predicted,
    observes=Observes(
        (
            *("ld_h", "lq_h", "psi_wb", "j_kgm2", "b_nm_s_rad"),
            *("ripple_mean", "ripple_torque", "ripple_sampled", *STATE),
        ),
        hooks=frozenset({"flux", "torque"}),
        sensors=frozenset({"angle", "current", "clock"}),
        form="affine",
    ),
    recorder=RECORDER,
    sensing=Sensing(_reading, frozenset({"standstill", "current_jumps", "pulses"})),
    use=Use(warms=frozenset({"flux"})),
    # behind the voltage of the same log
    rank=1,
)
