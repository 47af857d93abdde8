"""The shaft: torque of the air gap less drags less inertia, and what a transducer says of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.criticism.data.acceleration import acceleration_at_samples
from pipeline.criticism.data.segment import Segment, clock
from pipeline.criticism.machine.coenergy import air_gap_torque
from pipeline.criticism.machine.model import (
    EARLY_S,
    EARLY_SHARES,
    LATE_TORQUE,
    Model,
    Pieces,
)
from pipeline.criticism.machine.sample_period import ripple
from pipeline.criticism.operating import Array, Complex, Operating, Recorded, Signals, Values
from pipeline.criticism.signals.true_current import ahead_in
from pipeline.criticism.signals.voltage import central
from pipeline.records.row_means import row_means

TORQUE_RIPPLES = ("ripple_mean", "ripple_torque", "ripple_held", "ripple_sampled")
"""Nuisances of the current's ripple that are in the torque (`model.BASE`)."""


def drag_course(x: Operating, values: Values) -> tuple[Array | float, Array | float]:
    """Dry and viscous drags over those that a capture ends with.

    Parameters
    ----------
    x
        True state [n].
    values
        Parameters by full name.

    Returns
    -------
    tuple
        Each [n, 1], or 1 where friction does not change.

    Notes
    -----
    1 + s exp(−t/τ) at a time t since the capture began.

    """
    if x.shaft.age_s is None:
        return 1.0, 1.0
    left = np.exp(-x.shaft.age_s / max(abs(values[EARLY_S]), x.ts_s))
    dry, viscous = (1.0 + values[name] * left for name in EARLY_SHARES)
    return dry, viscous


def net_torque(x: Operating, pieces: Pieces, values: Values) -> Array:
    """Torque of the air gap less the drags.

    Parameters
    ----------
    x
        True state [n].
    pieces
        Flux and drags of the model there.
    values
        Parameters by full name.

    Returns
    -------
    array [n]
        1.5 p [Im(ψ* i) + ∂W/∂ε] − drags [N·m].

    """
    drag_nm = pieces.drag_nm
    if x.shaft.age_s is not None:
        dry, viscous = drag_course(x, values)
        of_speed = values["b_nm_s_rad"] * x.omega_rad_s
        drag_nm = dry * drag_nm + (viscous - dry) * of_speed
    return air_gap_torque(x, pieces.psi_wb, pieces.slope_wb) - drag_nm


def torque_reading(segment: Segment, model: Model, values: Values) -> Array:
    """Torque that the length of a drive's recorded current would give.

    Parameters
    ----------
    segment
        A log with currents.
    model
        Number of pole pairs.
    values
        Parameters by full name.

    Returns
    -------
    array [n]
        1.5 p ψ_m |i| [N·m].

    """
    kt = 1.5 * model.machine.pole_pairs * values["psi_wb"]
    direct = segment.recorded.get("id_a", np.zeros(segment.size))
    return kt * np.hypot(direct, segment.recorded["iq_a"])


def torque_between(segment: Segment, x: Operating, pieces: Pieces, values: Values) -> Array:
    """Torque [n, N·m] of what current and flux do between samples.

    The current moves on for a part of a period; and while a held voltage turns, both are off their
    means. A free shaft responds to sample-period means; a locked shaft's transducer has a
    nuisance parameter of its own. A sample that is not in the middle of a pulse is off its mean by
    what the back-EMF moves the current over the time between, in proportion to speed.
    """
    if not any(values[name] for name in TORQUE_RIPPLES):
        return np.zeros(x.theta_rad.size)
    flux, current = ripple(x, values["ripple_held" if x.shaft.held else "ripple_mean"], values)
    moved = _moved_on(segment, x, values) + _sampled_beside(x, values) - current
    torque = _torque_of_current(x, pieces, moved)
    ripple_torque: Array = 1.5 * x.machine.pole_pairs * (np.conj(flux) * x.i_a).imag
    return torque - ripple_torque


def _sampled_beside(x: Operating, values: Values) -> Complex:
    """Mean of a pulse of the current over its sample [n, A]: j ω_e ψ_m τ/L_q of a drive's own.

    Parameters
    ----------
    x
        True state [n].
    values
        Parameters by full name; `ripple_sampled` is the time τ.

    """
    late_s = values["ripple_sampled"] * float(x.inverter and x.supply.hold_s > 0.0)
    l_h = max(values["lq_h"], values["ld_h"] / x.machine.policy.cutting.saliency)
    if not late_s or not l_h:
        return np.zeros(x.theta_rad.size, dtype=np.complex128)
    back_emf = x.machine.pole_pairs * x.omega_rad_s * values["psi_wb"]
    return (1j * late_s / l_h * back_emf).astype(np.complex128)


def _moved_on(segment: Segment, x: Operating, values: Values) -> Complex:
    """Change of the current within a part of a sample period.

    Parameters
    ----------
    segment
        A log.
    x
        True state [n m].
    values
        Parameters by full name; `ripple_torque` is the part c.

    Returns
    -------
    array [n m], complex
        c T_s di/dt [A].

    Notes
    -----
    Steps of the current come at one phase of the samples of a log, which are means over no period.

    """
    period = segment.ts_s * segment.size / x.theta_rad.size
    return values["ripple_torque"] * segment.ts_s * central(x.i_a, period)


def _torque_of_current(x: Operating, pieces: Pieces, current: Complex) -> Array:
    """Torque of a small further current at the same flux.

    Parameters
    ----------
    x
        True state [n].
    pieces
        Flux of the model there.
    current
        Complex [n, A].

    Returns
    -------
    array [n]
        1.5 p Im(ψ* i) [N·m].

    """
    return 1.5 * x.machine.pole_pairs * (np.conj(pieces.psi_wb) * current).imag


def unexplained_acceleration(
    segment: Segment, x: Operating, torque_nm: Array, values: Values, stretch: float
) -> Array:
    """Acceleration of a free shaft that its torque leaves unexplained.

    Parameters
    ----------
    segment : Segment
        The segment, on its true clock.
    x : Operating
        Its state, at one or more points a sample.
    torque_nm : array [n·m], N·m
        What turns the shaft, at the points of `x`.
    values : mapping
        Values of the model; `j_kgm2` is the inertia.
    stretch : float, 1
        Recorded time over true time.

    Returns
    -------
    array [n], rad/s²
        By the recorded clock.

    Notes
    -----
    (T/J − d²θ/dt²)/stretch². It is reported in the angle sensor's units, since a
    torque's noise floor would shrink with the inertia, and by the recorded clock, since a gain must
    not win by making its residual small.

    """
    finer = x.theta_rad.size // segment.size
    torque = averaged(torque_nm, finer) if finer > 1 else torque_nm
    acceleration = second_difference(x.theta_rad[::finer], segment.ts_s)
    return (torque / values["j_kgm2"] - acceleration) / stretch**2


def sensed_torque(
    segment: Segment, x: Operating, torque_nm: Array, model: Model, values: Values
) -> Array:
    """Torque that a transducer between shaft and load shows, or one that holds the stator.

    Parameters
    ----------
    segment
        On its true clock.
    x
        State of the machine, at one or more points a sample.
    torque_nm
        What turns the shaft, at the points of `x` [n·m, N·m].
    model, values
        With the effects of the transducer's errors, its gain and `j_kgm2`.

    Returns
    -------
    array [n, N·m]

    Notes
    -----
    T − J d²θ/dt² in the shaft, T at the stator and where the speed is held, with its errors and
    its gain. Rows that are means (`centred`) have the mean of a held shaft's torque too: little is
    left there of a wave that turns far in a row.

    """
    finer, torque = x.theta_rad.size // segment.size, torque_nm
    if finer > 1:
        torque = _of_held(segment, torque_nm, finer) if x.shaft.held else averaged(torque_nm, finer)
    if not segment.instrument.stator and not segment.sensors.held_speed:
        torque = torque - values["j_kgm2"] * _acceleration(segment, x.theta_rad[::finer])
    return as_sensed(segment, _at_samples(segment, torque), model, values)


def _acceleration(segment: Segment, theta_rad: Array) -> Array:
    """Acceleration [n, rad/s²] of an angle [n]. Beside a torque that is slower than the rows it is
    differenced over more of them: windows do not average its noise at samples.
    """
    sensors = segment.sensors
    if sensors.torque_s is None:
        return second_difference(theta_rad, segment.ts_s)
    return acceleration_at_samples(theta_rad, segment.ts_s, sensors.every["torque_shaft_nm"])


def _at_samples(segment: Segment, torque_nm: Array) -> Array:
    """A true torque [n] on straight lines between the instants of a transducer that is slower than
    the rows. What it does between them, and faster than them, is in the recorded one as in this.
    """
    at_s = segment.sensors.torque_s
    if at_s is None:
        return torque_nm
    time_s = clock(segment)
    return np.interp(time_s, at_s, np.interp(at_s, time_s, torque_nm))


def _of_held(segment: Segment, torque_nm: Array, finer: int) -> Array:
    """Torque [n] of the rows of a held shaft from that of `finer` points a row, which are its mean
    over half a row either side or its instant.
    """
    if segment.instrument.timing != "centred":
        return torque_nm[::finer]
    points = np.arange(torque_nm.size, dtype=np.float64)
    return row_means(points[::finer], points, torque_nm)


def as_sensed(segment: Segment, torque_nm: Array, model: Model, values: Values) -> Array:
    """A true torque [n, N·m] of the shaft as its transducer shows it.

    Parameters
    ----------
    segment
        Whose transducer it is.
    torque_nm
        True torque [n].
    model
        Effects of the transducer.
    values
        Parameters by full name.

    Returns
    -------
    array [n]
        In N·m.

    """
    for shaft, q in model.hooks("shaft", values):
        torque_nm = shaft(torque_nm, q)
    return torque_nm * (1.0 + values[segment.instrument.transducer])


def true_load(
    segment: Segment, signals: Signals, model: Model, values: Values, *, inverter: bool = False
) -> Array:
    """Recorded torque, the dynamics of its transducer taken out.

    Parameters
    ----------
    segment
        Whose transducer it is.
    signals
        Recorded signals, `torque_shaft_nm` [n, N·m] among them.
    model, values
        With the effects of the transducer's dynamics.
    inverter
        Whether a drive feeds the machine.

    Returns
    -------
    array [n, N·m]

    """
    hooks = list(model.hooks("load", values))
    torque = signals["torque_shaft_nm"]
    if late_s := values[LATE_TORQUE]:
        torque = torque + late_s * np.gradient(torque, segment.ts_s)
    if not hooks:
        return torque
    zero = np.zeros(torque.size)
    r = Recorded(
        zero.astype(np.complex128),
        torque,
        zero,
        zero,
        segment.ts_s,
        inverter,
        segment.instrument.name,
        ahead=ahead_in(segment, signals, model.machine.pole_pairs),
    )
    for load, q in hooks:
        r = replace(r, torque_nm=load(r, q))
    return r.torque_nm


def second_difference(theta: Array, period: float) -> Array:
    """Acceleration [n, rad/s²] of an angle [n, rad] over samples of a period [s]; 0 at both ends.

    Parameters
    ----------
    theta
        Angle [n].
    period
        Of the samples [s].

    """
    return np.pad(np.diff(theta, 2), 1) / period**2


def averaged(fine: Array, finer: int) -> Array:
    """Means of a signal under a triangle of two samples around each sample.

    Parameters
    ----------
    fine
        A signal at some points a sample [n·m].
    finer
        Points m a sample [1].

    Returns
    -------
    array [n]

    Notes
    -----
    The second difference of the angle over T² is the mean acceleration under that triangle.

    """
    ramp = np.arange(finer) / finer**2
    cells = fine.reshape(-1, finer)
    # the part of each cell that counts for its own sample, and for the next one
    before, after = cells @ (1.0 / finer - ramp), cells @ ramp
    mean: Array = before.copy()
    mean[1:] += after[:-1]
    return mean
