"""A drive's log of both axes: voltages in the rotor frame, and the torque of a loaded shaft."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from pipeline.criticism.data.drive_log import in_time
from pipeline.criticism.data.segment import Segment, Unthinned, segment_of
from pipeline.criticism.data.sensors import TEMPERATURES, prepared, with_slow_columns
from pipeline.criticism.data.shaft_angle import (
    ANGLES,
    held_speed,
    out_of_step,
    shaft_angle,
    whole_log,
    with_angle,
    with_smooth_angle,
)
from pipeline.criticism.data.traces import even_clock, pad_of, thinned, window_between_gaps
from pipeline.criticism.equation import Channel, Equation, Observes, Sensing, Use
from pipeline.criticism.machine.model import STATE, Model, Pieces
from pipeline.criticism.operating import Array, Complex, Operating, Signals, Values
from pipeline.criticism.parameter import Machine
from pipeline.criticism.signals.between_rows import on_points
from pipeline.criticism.signals.shaft import (
    net_torque,
    sensed_torque,
    torque_between,
    torque_reading,
    true_load,
)
from pipeline.criticism.signals.true_current import HOLD_ENDS, current_between, drive_current
from pipeline.criticism.signals.true_state import (
    at_true_angle,
    averaging,
    motion_of,
    operating,
)
from pipeline.criticism.signals.voltage import (
    ahead,
    central,
    forward,
    held_voltage,
    mean_voltage,
    recorded_voltage,
    rotor_voltage,
)
from pipeline.numerics.projection import projection
from pipeline.records.capture import Capture

VOLTS = ("vd_v", "vq_v")
TORQUE = "torque_shaft_nm"


def cut(capture: Capture, machine: Machine) -> Segment | None:
    """Voltages, currents and angle of a log; with its torque where the shaft turns.

    Parameters
    ----------
    capture
        A torque map, a drive log or a heat run.
    machine
        Orders and policy.

    Returns
    -------
    Segment or None
        None without a record of the motion, except for a heat run, which is at rest, and where gaps
        leave no window.

    """
    temperatures = [name for name in TEMPERATURES if capture.has(name)]
    names = with_angle(capture, ["vd_v", "vq_v", "id_a", "iq_a", *temperatures])
    turning = len(names) > 4 and any("theta" in n or "omega" in n for n in names)
    if not turning and capture.meta.test != "heat_run":
        return None
    angle = not ANGLES.isdisjoint(names)
    held = not angle and capture.meta.test != "heat_run"
    torque = capture.has("torque_shaft_nm") and turning and (angle or held)
    names += ["torque_shaft_nm"] if torque else []
    policy = machine.policy.cutting
    period, columns, keep = even_clock(capture, tuple(names), policy)
    speed = shaft_angle(columns, period, machine)
    turned = float(np.ptp(columns["theta_mech_rad"]))
    size = columns["vd_v"].size
    window = window_between_gaps(period, keep, policy)
    orders = machine.electrical_orders if angle and turned > policy.turning_rad else ()
    sensors = prepared(columns, period, machine.policy, speed, machine.ripple_orders)
    sensors = with_smooth_angle(capture, columns, sensors, machine, window)
    sensors, every = with_slow_columns(capture, columns, sensors, period, machine.policy)
    keep = out_of_step(capture, columns["theta_mech_rad"], keep, machine, window)
    if held and torque:
        # a noisy speed that is differenced, times J, would be a torque
        noise_rad = speed.noise_rad_s * period if speed is not None else 0.0
        rows = min(window, max(round(policy.held_s / period), policy.held_rows))
        still = held_speed(columns["theta_mech_rad"], noise_rad, rows, policy)
        torque = bool(2 * np.count_nonzero(still) > size)
        keep = keep & still if torque else keep
        window = window_between_gaps(period, keep, policy)
        sensors = replace(sensors, held_speed=torque)
    channels: tuple[str, ...] = ("vd_v", "vq_v")
    if torque and turned > policy.turning_rad:
        channels += ("torque_shaft_nm",)
    most = policy.windows if capture.meta.test == "torque_map" else policy.windows_drive
    columns["t_s"] = period * np.arange(size, dtype=np.float64)
    logged = capture.meta.test == "drive" and len(channels) > 2
    full = {**columns, "good": keep.astype(float)} if logged else None
    log = whole_log(columns, period, policy)
    columns, starts = thinned(columns, keep, window, most, pad_of(period, policy) + 2 * every)
    if not starts.size:
        return None
    weak = projection(columns["theta_mech_rad"], starts, window, orders)
    middle = np.rint(columns["t_s"][starts + window // 2] / period)
    segment = segment_of(
        capture,
        "dq",
        "drive",
        period,
        columns,
        sensors,
        channels=channels,
        weak=weak,
        blocks=in_time(middle, size),
    )
    return replace(
        segment,
        unthinned=Unthinned(full, log),
        instrument=averaging(segment, machine),
    )


def state(segment: Segment, signals: Signals, model: Model, values: Values) -> Operating:
    """True currents, angle and speed of a machine that a drive feeds and logs.

    Parameters
    ----------
    segment
        The log, on its true clock.
    signals
        Recorded columns [n].
    model
        Effects of its sensors.
    values
        Parameters by full name.

    Returns
    -------
    Operating
        The state [n], with the logged voltage.

    """
    motion = motion_of(segment, signals, model.machine, segment.instrument.points)
    current = drive_current(segment, signals, model, values, motion.theta_rad.size)
    x = operating(segment, signals, model, values, current, motion)
    ends = _hold_ends(segment, x, current, model, values) if segment.instrument.snapshots else None
    volts = (signals["vd_v"] + 1j * signals["vq_v"]).astype(np.complex128)
    volts = volts * (1.0 / (1.0 + values[segment.instrument.meter]))
    volts = on_points(volts, motion.theta_rad.size)
    if segment.instrument.frame:
        turn = model.machine.pole_pairs * motion.omega_rad_s * x.supply.hold_s
        volts = volts * np.exp(-1j * segment.instrument.frame * turn)
    return at_true_angle(segment, x.fed(volts_v=volts, hold_ends=ends), model, values)


def _hold_ends(
    segment: Segment, x: Operating, current: Complex, model: Model, values: Values
) -> tuple[tuple[float, Complex], tuple[float, Complex]]:
    """When the vector that a snapshot shows begins and ends, and the current then
    (`Supply.hold_ends`). A commanded one acts later (`command_lead`).
    """
    lead = values["command_lead"] if segment.instrument.commanded else 0.0
    begin, end = (segment.instrument.frame + lead + part for part in (-0.5, 0.5))
    parts = (begin * x.supply.hold_s / segment.ts_s, end * x.supply.hold_s / segment.ts_s)
    both = current_between(segment, current, model, parts, HOLD_ENDS)
    first, last = both.reshape(-1, 2).T
    return (begin * x.supply.hold_s, first - current), (end * x.supply.hold_s, last - current)


def measured(segment: Segment, signals: Signals, model: Model, values: Values) -> Array:
    """Recorded voltages, and the torque less the dynamics of its transducer.

    Parameters
    ----------
    segment
        The log, on its true clock.
    signals
        Recorded columns [n].
    model
        Effects of its sensors.
    values
        Parameters by full name.

    Returns
    -------
    array [C, n]
        v_d and v_q [V], and with its channel the torque [N·m].

    """
    rows = [signals[name] for name in VOLTS]
    if TORQUE in segment.channels:
        rows.append(true_load(segment, signals, model, values, inverter=True))
    return np.stack(rows)


def predicted(
    segment: Segment, x: Operating, pieces: Pieces, model: Model, values: Values
) -> Array:
    """Voltages v_d, v_q [V], and with its channel the torque at the shaft [N·m]: [C, n].

    Parameters
    ----------
    segment
        The log, on its true clock.
    x
        True state [n].
    pieces
        Flux, drops and drags of the model there.
    model
        Effects of its sensors.
    values
        Parameters by full name.

    Returns
    -------
    array [C, n]
        As `measured`.

    Notes
    -----
    v = R i + drops + dψ/dt + j ω_e ψ over what the log's voltage samples stand for;
    T = 1.5 p [Im(ψ* i) + ∂W/∂ε] − drags − J dω/dt.

    """
    voltage = _logged_voltage(segment, x, pieces, values)
    voltage = recorded_voltage(voltage, segment, x.sampled(), model, values, in_frame=True)
    rows = [voltage.real, voltage.imag]
    if TORQUE in segment.channels:
        torque = net_torque(x, pieces, values) + torque_between(segment, x, pieces, values)
        rows.append(sensed_torque(segment, x, torque, model, values))
    return np.stack(rows)


def _logged_voltage(segment: Segment, x: Operating, pieces: Pieces, values: Values) -> Complex:
    """Rotor-frame voltage [n, V] of vectors that the stationary frame holds as the rotor turns.

    A log that is slower than the PWM has the mean of such vectors in the rotor frame. `ripple_edge`
    and `ripple_shift` are what the log samples otherwise. A vector that is held may also be in the
    frame of the instant from which on it is (`Instrument.frame`).

    A drive turns its next vector to where the rotor will be, by a speed of its own. That speed lags
    (`frame_lag_s`, of commanded voltages), so as the shaft gathers speed the vector is behind the
    frame it is logged in. A vector acts later than it is commanded (`command_lead`): turned ahead,
    it is right at steady state, and early by that where it changes.
    """
    period, is_held = segment.ts_s, segment.instrument.timing == "held"
    difference, points = forward if is_held else central, segment.instrument.points
    if points > 1:
        voltage = mean_voltage(pieces, x.eps_rad, points, period, ahead=is_held)
        pieces, x = pieces.every(points), x.sampled()
    omega, turn = x.once(x.theta_rad, "pace", lambda: _pace(segment, x, difference))
    if points == 1:
        voltage = (held_voltage if is_held else rotor_voltage)(pieces, omega, period)
    edge, shift = values["ripple_edge"], values["ripple_shift"]
    averaged = 1.0 if segment.instrument.timing != "instant" else 0.0
    share = averaged / 24.0 + edge
    factor = x.once(x.theta_rad, ("shortened", share), lambda: _shortened(share * turn**2))
    mean: Complex = factor * voltage
    if segment.instrument.frame:
        mean = mean * np.exp(1j * segment.instrument.frame * turn)
    commanded = segment.instrument.commanded
    if commanded and (lag := values["frame_lag_s"]):
        mean = mean * x.once(
            x.theta_rad, ("behind", lag), lambda: np.exp(1j * lag * _frame_lag(segment, x))
        )
    lead = values["command_lead"] if commanded and x.supply.hold_ends is None else 0.0
    if lead and x.supply.hold_s:
        mean = mean + lead * x.supply.hold_s / segment.ts_s * np.gradient(mean)
    if shift:
        psi = ahead(pieces.psi_wb) if is_held else pieces.psi_wb
        pairs, speed = x.machine.pole_pairs, x.omega_rad_s
        gathers = x.once(x.theta_rad, "gathers", lambda: np.gradient(pairs * speed))
        mean = mean - shift * 1j * psi * gathers
    return mean


def _shortened(shortening: Array) -> Array:
    """What is left [n] of a vector's mean over a turn φ [rad] of which `shortening` is φ²/24.

    Notes
    -----
    sinc: sin(φ/2) / (φ/2), continued to a mean that is too long: sinh for a negative φ².

    """
    half = np.sqrt(6.0 * np.abs(shortening))
    factor: Array = np.where(shortening > 0.0, np.sinc(half / math.pi), 1.0)
    longer = shortening < 0.0
    factor[longer] = np.sinh(half[longer]) / half[longer]
    return factor


def _pace(
    segment: Segment, x: Operating, difference: Callable[[Array, float], Array]
) -> tuple[Array, Array]:
    """Electrical speed [n, rad/s], and what it turns [n, rad] while a voltage vector is held."""
    turn = x.machine.pole_pairs * x.omega_rad_s * x.supply.hold_s
    return difference(x.machine.pole_pairs * x.theta_rad, segment.ts_s), turn


def _frame_lag(segment: Segment, x: Operating) -> Array:
    """Angle [n, rad/s] by which a voltage vector is behind its logged frame for every second that
    the drive's speed lags: a vector is computed one and a half periods before its middle.
    """
    speed = x.machine.pole_pairs * x.omega_rad_s
    return 1.5 * x.supply.hold_s * np.gradient(speed, segment.ts_s)


def _reading(segment: Segment, channel: str, model: Model, values: Values) -> Array:
    """Length of the voltage [n, V], or the torque of the current's length [n, N·m]."""
    if channel == TORQUE:
        return torque_reading(segment, model, values)
    return np.sqrt(sum(segment.recorded[name] ** 2 for name in VOLTS))


EQUATION = Equation(
    name="dq",
    words="v = R i + drops + dψ/dt + j ω_e ψ, T = 1.5 p [Im(ψ* i) + ∂W/∂ε] − drags − J dω/dt",
    tests=("torque_map", "drive", "heat_run"),
    columns=("t_s", "vd_v", "vq_v", "id_a", "iq_a"),
    channels=(
        Channel("vd_v", "voltage_v", beside=VOLTS),
        Channel("vq_v", "voltage_v", beside=VOLTS),
        Channel(TORQUE, "torque_nm", offset="transducer"),
    ),
    cut=cut,
    state=state,
    measured=measured,
    predicted=predicted,
    observes=Observes(
        (
            *("r_ohm", "lead_ohm", "ld_h", "lq_h", *STATE),
            *(
                "ripple_slope",
                "ripple_mean",
                "ripple_edge",
                "ripple_shift",
                "frame_lag_s",
                "command_lead",
            ),
            *("ripple_torque", "ripple_held", "ripple_sampled"),
            *("psi_wb", "j_kgm2", "b_nm_s_rad"),
        ),
        hooks=frozenset({"flux", "drop", "torque"}),
        sensors=frozenset({"angle", "current", "voltage", "load", "clock"}),
        torque_in=TORQUE,
    ),
    recorder="log",
    sensing=Sensing(
        _reading,
        frozenset(
            {
                *("voltage_jumps", "instants"),
                *("current_jumps", "torque_jumps", "encoder_lines", "standstill", "pulses"),
            }
        ),
    ),
    use=Use(
        turns=True,
        warms=frozenset({"drop", "flux"}),
        free_runs=("torque_map", "drive"),
        currents=("id_a", "iq_a"),
        angle_maps=True,
        whole_beside=("dq",),
    ),
)
