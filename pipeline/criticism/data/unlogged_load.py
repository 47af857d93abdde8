"""Whether a torque that nothing recorded drives the shaft of a log."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from pipeline.criticism.data.drive_log import DriveLog
from pipeline.criticism.data.segment import slow_orders
from pipeline.criticism.operating import Array, Flags
from pipeline.criticism.parameter import Machine
from pipeline.criticism.policy.captures import Cutting
from pipeline.numerics.weak_rows import WeakRows, smooth_speed, weak_rows


def runs_free(log: DriveLog, machine: Machine) -> bool:
    """Whether current and drags alone explain how the shaft of a log moves, of one mass or two.

    Parameters
    ----------
    log
        A drive log.
    machine
        Orders and policy.

    Returns
    -------
    bool
        False where the log is too short to decide.

    """
    share = unexplained_share(log, machine)
    return share is not None and share < machine.policy.cutting.unexplained_share


def unexplained_share(log: DriveLog, machine: Machine) -> float | None:
    """Power of the acceleration that neither current nor drags explain, nor a spring in the shaft.

    Parameters
    ----------
    log
        With an angle and the q current.
    machine
        Its orders of torque against angle.

    Returns
    -------
    float or None
        Over the power of what the current makes [1]; none where the shaft stands still, or the
        windows are too few to say.

    Notes
    -----
    A regression of the angle's second derivative over windows on i_q, i_d i_q and di_q/dt, drag
    against speed, a constant, waves of the angle, and the same times ω², as an encoder off its
    centre or tilted adds them. A torque that no column has is left in the
    residual; where a speed loop works against it, the current goes with it and its coefficient is
    too small. So what is left, its noise taken out, over what the current makes bounds the
    relative error of 1/J. With the second derivative of i_q and the fourth of the angle it is that
    of two masses and a spring, where the coefficients are such.

    References
    ----------
    Fuller, Measurement Error Models, 1987, 1.1 (attenuation).
    Ellis and Lorenz, IEEE Ind. Appl. Conf., 2000 (resonant loads).

    """
    theta = log.columns["theta_mech_rad"]
    policy = machine.policy.cutting
    width = max(policy.load_window_s, policy.load_samples * log.period_s)
    time = log.period_s * np.arange(theta.size, dtype=float)
    if time[-1] < 2.0 * width or float(np.ptp(theta)) < policy.turning_rad:
        return None
    weak = weak_rows(time, width)
    quarter = max(3, round(policy.load_window_s / 4 / log.period_s))
    usable = log.keep & ~rests(theta, quarter, policy)
    complete = weak.integral((~usable).astype(float)) == 0.0
    omega = smooth_speed(time, theta, policy.load_window_s / 8)
    driven, groups = _columns(log, weak, machine, omega)
    most_columns = np.count_nonzero(complete) // policy.load_windows - len(driven)
    chosen = [*driven]
    for group in groups:
        if len(chosen) + len(group) <= most_columns:
            chosen += group
        elif group is groups[0]:
            return None
    target = weak.integral(theta, order=2)[complete]
    noise = log.sensors.noise["theta_mech_rad"] * weak.noise_gain(2)
    spring, mounting = _spring(log, weak, omega), _mounting(theta, omega, weak)
    shares: list[float] = []
    for extra in ([], mounting):
        if extra and len(chosen) + len(extra) > most_columns:
            break
        columns = np.column_stack([*chosen, *extra])[complete]
        coefficients, residual, rank = _regressed(columns, target, policy)
        if columns.shape[1] + len(spring) <= most_columns:
            with_spring = np.column_stack([columns, np.column_stack(spring)[complete]])
            sprung = _regressed(with_spring, target, policy)
            of_current, of_bend, of_fourth = sprung[0][[0, -2, -1]].tolist()
            if _two_masses(of_current, of_bend, of_fourth, policy):
                coefficients, residual, rank = sprung
        explained = columns[:, : len(driven)] @ coefficients[: len(driven)]
        power = float(residual @ residual) / (target.size - rank) - noise**2
        shares.append(max(power, 0.0) / max(float(np.mean(explained**2)), 1e-300))
    return min(shares)


def rests(theta_rad: Array, size: int, policy: Cutting) -> Flags:
    """Where a shaft stays within what bristles bend.

    There dry friction holds any torque below its own, and no acceleration follows the current.

    Parameters
    ----------
    theta_rad
        Angle [n].
    size
        Samples for which it does.
    policy
        How far bristles bend.

    Returns
    -------
    array [n] of bool
        The samples in the middle of so many.

    """
    span = maximum_filter1d(theta_rad, size) - minimum_filter1d(theta_rad, size)
    return span < policy.rest_rad


def _mounting(theta: Array, omega: Array, weak: WeakRows) -> list[Array]:
    """Window means [w] of how an encoder off its centre, or tilted, seems to accelerate: ω² by the
    angle and by twice the angle.
    """
    waves = [part(k * theta) for k in (1, 2) for part in (np.cos, np.sin)]
    return [weak.integral(omega**2 * wave) for wave in waves]


def _regressed(columns: Array, target: Array, policy: Cutting) -> tuple[Array, Array, int]:
    """Coefficients [k] of columns [w, k], what they leave of a target [w], and their rank."""
    size = np.sqrt((columns**2).sum(axis=0))
    size = np.where(size > policy.load_rounding * size.max(), size, np.inf)
    scaled = columns / size
    coefficients, _, rank, _ = np.linalg.lstsq(scaled, target, rcond=policy.load_rounding)
    return coefficients / size, target - scaled @ coefficients, int(rank)


def _spring(log: DriveLog, weak: WeakRows, omega: Array) -> list[Array]:
    """Window means [w] of what a spring between two masses adds: the second derivatives of dry
    friction, of i_q and of d²θ/dt².
    """
    bend = np.pad(np.diff(log.columns["theta_mech_rad"], 2), 1) / log.period_s**2
    return [weak.integral(one, order=2) for one in (np.sign(omega), log.columns["iq_a"], bend)]


def _two_masses(of_current: float, of_bend: float, of_fourth: float, policy: Cutting) -> bool:
    """Whether coefficients of i_q, its second derivative and the angle's fourth are a spring's.

    θ″ + θ⁗/ω² = K (i_q + i_q″/ω_a²) + ..., with the share 1 − ω_a²/ω² of the inertia at the far
    end. A load that only pulsates has ω = ω_a.
    """
    soft = of_bend / of_current if of_current else 0.0
    share = 1.0 + of_fourth / soft if soft > 0.0 else 0.0
    return policy.spring_shares[0] < share < policy.spring_shares[1]


def _columns(
    log: DriveLog, weak: WeakRows, machine: Machine, omega: Array
) -> tuple[list[Array], list[list[Array]]]:
    """Window means [w] of what the current makes; and, in groups, of what else moves a shaft."""
    theta, q = log.columns["theta_mech_rad"], log.columns["iq_a"]
    policy = machine.policy.cutting
    knots = policy.drag_knots
    pace, sense = np.abs(omega) / max(float(np.abs(omega).max()), 1e-300), np.sign(omega)
    driven = [weak.integral(q)]
    if "id_a" in log.columns:
        driven.append(weak.integral(log.columns["id_a"] * q))
    drags = [weak.integral(sense), weak.integral(omega), np.ones(weak.count)]
    curve = [weak.integral(sense * np.interp(pace, knots, one)) for one in np.eye(len(knots))]
    turns = []
    for order in slow_orders(machine):
        wave = [weak.integral(part(order * theta)) for part in (np.cos, np.sin)]
        if float(np.hypot(*wave).mean()) > policy.averaged_out:
            turns += wave
    return driven, [drags, [weak.integral(q, order=1)], curve, turns]
