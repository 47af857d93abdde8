"""A drive's log of the q axis alone: its voltage, and the drive's own speed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.criticism.data.drive_log import drive_log, in_time
from pipeline.criticism.data.segment import Segment, segment_of
from pipeline.criticism.data.traces import window_between_gaps
from pipeline.criticism.equation import Channel, Equation, Observes, Sensing, Use
from pipeline.criticism.machine.model import STATE, UNSAMPLED, Model, Pieces
from pipeline.criticism.operating import Array, Operating, Signals, Values
from pipeline.criticism.parameter import Machine
from pipeline.criticism.signals.true_current import drive_current
from pipeline.criticism.signals.true_state import at_true_angle, hold_s, motion_of, operating
from pipeline.criticism.signals.voltage import central, recorded_voltage, rotor_voltage, unresolved
from pipeline.numerics.projection import projection, window_starts
from pipeline.records.capture import Capture

SPEED = "omega_mech_rad_s"
_BOTH_AXES = ("vd_v", "vq_v", "id_a", "iq_a")


def cut(capture: Capture, machine: Machine) -> Segment | None:
    """The q voltage, and the drive's own speed where there is an angle beside it.

    Parameters
    ----------
    capture
        A drive log or heat run without both axes.
    machine
        Policy.

    Returns
    -------
    Segment or None
        None where `dq` takes the log, or without a record of the motion.

    Notes
    -----
    The d current is taken as zero, which is what a drive that logs the q axis alone controls it to.
    With an angle, the voltage is predicted from its speed, and the drive's own speed, which comes
    late, is compared with it; `sample_delay` is how late. The motor has no part in that.

    """
    log = None if capture.has(*_BOTH_AXES) else drive_log(capture, machine)
    if log is None:
        return None
    window = window_between_gaps(log.period_s, log.keep, machine.policy.cutting)
    starts = window_starts(log.keep, window)
    weak = projection(log.columns["theta_mech_rad"], starts, window, ())
    return segment_of(
        capture,
        "q",
        "drive",
        log.period_s,
        log.columns,
        log.sensors,
        channels=("vq_v", SPEED) if log.speed and log.angle else ("vq_v",),
        weak=weak,
        blocks=in_time(weak.starts + window // 2, log.keep.size),
        fixed={UNSAMPLED: 1.0},
    )


def state(segment: Segment, signals: Signals, model: Model, values: Values) -> Operating:
    """True current, angle and speed [n]; the drive's own speed where nothing records the angle.

    The ripple of a held vector is left out: it needs the d axis.
    """
    motion = motion_of(segment, signals, model.machine)
    current = drive_current(segment, signals, model, values, motion.theta_rad.size)
    if SPEED not in segment.channels:
        motion = replace(motion, omega_rad_s=signals.get(SPEED, motion.omega_rad_s))
    x = operating(segment, signals, model, values, current, motion)
    return at_true_angle(segment, x.fed(q_alone=True, hold_s=0.0), model, values)


def measured(segment: Segment, signals: Signals, _: Model, __: Values) -> Array:
    """Voltage and speed as the drive logged them [C, n]."""
    return np.stack([signals[channel] for channel in segment.channels])


def predicted(
    segment: Segment, x: Operating, pieces: Pieces, model: Model, values: Values
) -> Array:
    """The q voltage [V], and the angle's speed as the drive's estimate gives it [rad/s]: [C, n].

    Parameters
    ----------
    segment
        The log, on its true clock.
    x
        True state [n].
    pieces
        Flux and drops of the model there.
    model
        Effects of its sensors.
    values
        Parameters by full name.

    Returns
    -------
    array [C, n]
        v_q [V], and with its channel the speed [rad/s].

    Notes
    -----
    v_q = Im(R i + drops + dψ/dt + j ω_e ψ), ω = dθ/dt. A sample of the voltage is of an instant: of
    what drives a change of flux within a row it may show nothing, or much more than the row's mean.
    So that part of dψ/dt has a share of its own that is not known. A commanded voltage acts later
    than it is logged (`command_lead`), unless it is stated to be that of the row's middle.

    """
    turn = x.machine.pole_pairs * x.omega_rad_s * segment.ts_s
    voltage = rotor_voltage(pieces, turn / segment.ts_s, segment.ts_s)
    if share := values[UNSAMPLED]:
        change = share * central(pieces.psi_wb, segment.ts_s)
        voltage = voltage + unresolved(segment.recorded["iq_a"]) * change
    commanded = segment.instrument.commanded
    if commanded and segment.instrument.timing != "centred" and (lead := values["command_lead"]):
        lead_s = lead * hold_s(segment, x.omega_rad_s, x.machine)
        voltage = voltage + lead_s / segment.ts_s * np.gradient(voltage)
    voltage = recorded_voltage(voltage, segment, x, model, values, in_frame=True)
    rows = [voltage.imag]
    if SPEED in segment.channels:
        rows.append(_recorded_speed(segment, x, model, values))
    return np.stack(rows)


def _recorded_speed(segment: Segment, x: Operating, model: Model, values: Values) -> Array:
    """Speed [n] of the angle as a drive's own estimate gives it [rad/s]."""
    speed: Array = central(x.theta_rad, segment.ts_s)
    for estimate, q in model.hooks("speed", values):
        speed = estimate(speed, q, segment.ts_s)
    return speed


EQUATION = Equation(
    name="q",
    words="v_q = Im(R i + drops + dψ/dt + j ω_e ψ)",
    tests=("drive", "heat_run"),
    columns=("t_s", "vq_v", "iq_a"),
    channels=(Channel("vq_v", "voltage_v"), Channel(SPEED, "speed_rad_s", counts=False)),
    cut=cut,
    state=state,
    measured=measured,
    predicted=predicted,
    observes=Observes(
        ("r_ohm", "lead_ohm", "ld_h", "lq_h", "psi_wb", "command_lead", *STATE),
        hooks=frozenset({"flux", "drop"}),
        sensors=frozenset({"angle", "current", "voltage", "clock"}),
        form="affine",
    ),
    recorder="log",
    sensing=Sensing(errors=frozenset({"late_speed", "voltage_jumps", "unsampled", "instants"})),
    use=Use(turns=True, warms=frozenset({"drop", "flux"})),
)
