"""The torque that a transducer shows under the current of a log that lacks a voltage."""

from __future__ import annotations

import numpy as np

from pipeline.criticism.data.drive_log import in_time
from pipeline.criticism.data.segment import Segment, segment_of
from pipeline.criticism.data.sensors import TEMPERATURES, prepared, with_slow_columns
from pipeline.criticism.data.shaft_angle import shaft_angle, with_angle, with_smooth_angle
from pipeline.criticism.data.traces import even_clock, pad_of, thinned, window_between_gaps
from pipeline.criticism.equation import Channel, Equation, Observes, Sensing, Use
from pipeline.criticism.machine.model import STATE, Model, Pieces
from pipeline.criticism.operating import Array, Operating, Signals, Values
from pipeline.criticism.parameter import Machine
from pipeline.criticism.signals.shaft import net_torque, sensed_torque, torque_reading, true_load
from pipeline.criticism.signals.true_current import drive_current
from pipeline.criticism.signals.true_state import at_true_angle, motion_of, operating
from pipeline.numerics.projection import projection
from pipeline.records.capture import Capture

TORQUE, SHARE = "torque_shaft_nm", "unlogged_d_share"
_BOTH_AXES = ("vd_v", "vq_v", "id_a", "iq_a")


def cut(capture: Capture, machine: Machine) -> Segment | None:
    """Current, torque and angle of a log that has no voltages of both axes.

    Parameters
    ----------
    capture
        A torque map or a drive log with a transducer.
    machine
        Orders and policy.

    Returns
    -------
    Segment or None
        None where `dq` takes the log, or without a record of the motion. A d current that was not
        logged is taken as zero; a nuisance stands for what its reluctance torque may be of the
        magnet's.

    """
    angle = with_angle(capture, [])
    if capture.has(*_BOTH_AXES) or not angle:
        return None
    further = [name for name in ("id_a", *TEMPERATURES) if capture.has(name)]
    policy = machine.policy.cutting
    period, columns, keep = even_clock(capture, ("iq_a", TORQUE, *further, *angle), policy)
    speed = shaft_angle(columns, period, machine)
    size = keep.size
    window = window_between_gaps(period, keep, policy)
    sensors = prepared(columns, period, machine.policy, speed, machine.ripple_orders)
    sensors = with_smooth_angle(capture, columns, sensors, machine, window)
    sensors, every = with_slow_columns(capture, columns, sensors, period, machine.policy)
    columns["t_s"] = period * np.arange(size, dtype=np.float64)
    pad = pad_of(period, policy) + 2 * every
    cut_out, starts = thinned(columns, keep, window, policy.windows, pad)
    by_angle = "omega_mech_rad_s" not in angle
    orders = machine.electrical_orders if by_angle else ()
    weak = projection(cut_out["theta_mech_rad"], starts, window, orders)
    middle = np.rint(cut_out["t_s"][weak.starts + window // 2] / period)
    return segment_of(
        capture,
        "load",
        "drive",
        period,
        cut_out,
        sensors,
        channels=(TORQUE,),
        weak=weak,
        blocks=in_time(middle, size),
        fixed={} if "id_a" in cut_out else {SHARE: 1.0},
    )


def state(segment: Segment, signals: Signals, model: Model, values: Values) -> Operating:
    """True current, angle and speed [n]."""
    motion = motion_of(segment, signals, model.machine)
    current = drive_current(segment, signals, model, values, motion.theta_rad.size)
    x = operating(segment, signals, model, values, current, motion)
    return at_true_angle(segment, x.fed(), model, values)


def measured(segment: Segment, signals: Signals, model: Model, values: Values) -> Array:
    """The torque less the dynamics of its transducer [1, n, N·m]."""
    return true_load(segment, signals, model, values)[None]


def predicted(
    segment: Segment, x: Operating, pieces: Pieces, model: Model, values: Values
) -> Array:
    """The torque that the transducer shows [1, n, N·m].

    Parameters
    ----------
    segment
        The log, on its true clock.
    x
        True state [n].
    pieces
        Flux and drags of the model there.
    model
        Effects of its sensors.
    values
        Parameters by full name.

    Returns
    -------
    array [1, n]
        In N·m.

    Notes
    -----
    T = 1.5 p [Im(ψ* i) + ∂W/∂ε] − drags − J dω/dt; without the d current 1.5 p s ψ i_q as well, of
    the share s that the reluctance torque is of the magnet's.

    References
    ----------
    IEEE Std 1812-2014, 4.4 (torque against current).

    """
    torque = net_torque(x, pieces, values)
    if SHARE in segment.fixed:
        share = values[SHARE] * values["psi_wb"]
        torque = torque + 1.5 * x.machine.pole_pairs * share * x.iq_a
    return sensed_torque(segment, x, torque, model, values)[None]


def _reading(segment: Segment, _: str, model: Model, values: Values) -> Array:
    """Torque of the current's length [n, N·m]."""
    return torque_reading(segment, model, values)


EQUATION = Equation(
    name="load",
    words="T = 1.5 p [Im(ψ* i) + ∂W/∂ε] − drags − J dω/dt",
    tests=("torque_map", "drive"),
    columns=("t_s", "iq_a", TORQUE),
    channels=(Channel(TORQUE, "torque_nm", offset="transducer"),),
    cut=cut,
    state=state,
    measured=measured,
    predicted=predicted,
    observes=Observes(
        ("ld_h", "lq_h", "psi_wb", "j_kgm2", "b_nm_s_rad", *STATE),
        hooks=frozenset({"flux", "torque"}),
        sensors=frozenset({"angle", "current", "load", "clock"}),
        torque_in=TORQUE,
    ),
    recorder="log",
    sensing=Sensing(
        _reading,
        frozenset({"current_jumps", "torque_jumps", "encoder_lines", "standstill", "pulses"}),
    ),
    use=Use(turns=True, warms=frozenset({"flux"}), angle_maps=True),
    # behind the voltage of the same log
    rank=1,
)
