"""The shaft angle of a capture: from which column, smoothed, and where its speed is steady."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from pipeline.criticism.data.rounding import coarse_step, scatter
from pipeline.criticism.data.segment import UNSMOOTHED, Sensors, SpeedSensor
from pipeline.criticism.data.sensors import sensor_noise, slow_noise
from pipeline.criticism.data.traces import parabolas, smoothed, window_of
from pipeline.criticism.operating import Array, Flags
from pipeline.criticism.parameter import Machine
from pipeline.criticism.policy.captures import Cutting
from pipeline.records.capture import Capture

ANGLES = frozenset({"theta_mech_rad", "theta_elec_rad"})


def with_angle(capture: Capture, names: list[str]) -> list[str]:
    """Some columns and the first column that gives the angle.

    Parameters
    ----------
    capture
        Any capture.
    names
        Columns.

    Returns
    -------
    list of str
        `names` alone where there is no angle or speed.

    """
    for name in ("theta_mech_rad", "theta_elec_rad", "omega_mech_rad_s"):
        if capture.has(name):
            return [*names, name]
    return names


def shaft_angle(columns: dict[str, Array], period: float, machine: Machine) -> SpeedSensor | None:
    """Adds the shaft angle to columns, from whatever gives it.

    Parameters
    ----------
    columns
        Columns [n]; `theta_mech_rad` is put in, an electrical angle or a speed taken out. Without
        any of them the angle is 0.
    period
        Sample period [s].
    machine
        Pole pairs and policy.

    Returns
    -------
    SpeedSensor or None
        That of a speed that was integrated; None of an angle.

    """
    if "theta_mech_rad" in columns:
        return None
    if "theta_elec_rad" in columns:
        columns["theta_mech_rad"] = columns.pop("theta_elec_rad") / machine.pole_pairs
    elif "omega_mech_rad_s" in columns:
        speed = columns.pop("omega_mech_rad_s")
        columns["theta_mech_rad"] = np.concatenate(
            [[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1])) * period]
        )
        noise = sensor_noise(speed, policy := machine.policy.sensor_noise)
        if step := coarse_step(speed, noise, policy):
            return SpeedSensor(max(noise, scatter(speed, step, policy)), step)
        window = window_of(period, speed.size, machine.policy.cutting)
        return SpeedSensor(slow_noise(speed, window / policy.window_means, policy), 0.0)
    else:
        columns["theta_mech_rad"] = np.zeros(next(iter(columns.values())).size)
    return None


def smooth_angle(
    columns: dict[str, Array], noise: dict[str, float], window: int, policy: Cutting
) -> int:
    """Smooths an angle by a local parabola, as long a one as the motion of the shaft allows.

    Parameters
    ----------
    columns
        Columns; `theta_mech_rad` [n] is replaced, and stays as `UNSMOOTHED`.
    noise
        Of each column; that of the angle is lowered to what the parabola leaves [rad].
    window
        Samples of a weak window; a parabola has as many.
    policy
        Constants of judgement.

    Returns
    -------
    int
        Samples of the parabola; 1 where the shaft itself moves.

    Notes
    -----
    A dynamometer that holds its speed leaves only the encoder's rounding to difference twice; times
    J that would be a torque, and a model that takes inertia away would seem to explain it. Where
    the speed gives way for a moment, at a step of the load, a long parabola would take that
    acceleration away: the width is halved until no stretch of one width scatters by more than the
    angle's noise does. An acceleration that hides in that noise may still be more than the noise of
    the torque: what the smoothing changes in an equation is part of its noise floor.

    References
    ----------
    Savitzky and Golay, Anal. Chem. 36(8), 1964, 1627, doi:10.1021/ac60214a047.

    """
    theta, half = columns["theta_mech_rad"], window // 2
    if theta.size < 3 * (2 * half + 1) or noise["theta_mech_rad"] <= 0.0:
        return 1
    while (width := 2 * half + 1) >= policy.narrowest:
        smooth = parabolas(theta, width)
        power = np.convolve((theta - smooth) ** 2, np.full(width, 1.0 / width), mode="valid")
        if float(power.max()) <= (policy.motion_u * noise["theta_mech_rad"]) ** 2:
            columns |= {"theta_mech_rad": smooth, UNSMOOTHED: theta}
            # variance of a parabola's middle by least squares
            noise["theta_mech_rad"] *= math.sqrt(2.25 / width)
            return width
        half //= 2
    return 1


def with_smooth_angle(
    capture: Capture, columns: dict[str, Array], sensors: Sensors, machine: Machine, window: int
) -> Sensors:
    """Smooths the angle of a torque map by `smooth_angle`, and gives the sensors of the log.

    Parameters
    ----------
    capture
        Any capture; only a torque map is changed, since a dynamometer turns it evenly.
    columns
        Columns [n]; the angle is replaced in place.
    sensors
        Noise of the columns.
    machine
        Step of its encoder, which drive logs show; an even speed hides it.
    window
        Samples a window.

    Returns
    -------
    Sensors
        With the noise of the smoothed angle.

    """
    if capture.meta.test != "torque_map":
        return sensors
    noise = dict(sensors.noise)
    noise["theta_mech_rad"] = max(noise["theta_mech_rad"], machine.encoder_rad / math.sqrt(12))
    width = smooth_angle(columns, noise, window, machine.policy.cutting)
    return replace(sensors, noise=noise, parabola=width)


def held_speed(theta_rad: Array, noise_rad: float, window: int, policy: Cutting) -> Flags:
    """Samples around which a recorded speed does not change beyond its noise.

    Parameters
    ----------
    theta_rad
        Integral of the speed [n].
    noise_rad
        Standard deviation of the speed's noise, times the sample period.
    window
        Samples of a weak window.
    policy
        Constants of judgement.

    Returns
    -------
    array [n] of bool
        Where the speed scatters no more than its noise in a window, and the means of the window
        before and of the one behind agree; none in a record of less than three windows.

    """
    step, width = np.diff(theta_rad), 2 * (window // 2) + 1
    if step.size < 3 * width:
        return np.zeros(theta_rad.size, dtype=bool)
    mean = smoothed(step, width)
    change = np.zeros(step.size)
    change[width:-width] = mean[2 * width :] - mean[: -2 * width]
    level = np.abs(change) <= policy.change_u * noise_rad * math.sqrt(2.0 / width)
    quiet = smoothed((step - mean) ** 2, width) <= (policy.motion_u * noise_rad) ** 2
    return np.append(level & quiet, False)


def out_of_step(
    capture: Capture, theta_rad: Array, keep: Flags, machine: Machine, window: int
) -> Flags:
    """Samples of a drive's log but for those at whose speed its encoder counts in step with them.

    Parameters
    ----------
    capture
        Whose rows they are.
    theta_rad
        Recorded angle [n].
    keep
        Samples that count [n].
    machine
        Step of its encoder.
    window
        Samples of a weak window.

    Returns
    -------
    array [n] of bool
        `keep` without those where the counts of a row are within one a window of a whole number,
        but for zero; all of it where that is most of them or leaves no window, and where rows are
        means.

    Notes
    -----
    The loops of a drive answer the rounding of its angle, a line at the rate of the counts. There,
    rows that are instants see one phase of that ripple of currents and voltages, and not its mean.

    """
    if not machine.encoder_rad or capture.meta.voltage_timing == "centred":
        return keep
    turned = smoothed(np.abs(np.gradient(theta_rad)), 2 * (window // 2) + 1)
    counts = turned / machine.encoder_rad
    whole = np.rint(counts)
    apart = keep & ((whole == 0.0) | (np.abs(counts - whole) >= 1.0 / window))
    inside = np.cumsum(np.concatenate([[0], apart]))
    leaves_windows = np.any(inside[window:] - inside[:-window] == window)
    return apart if leaves_windows and 2 * inside[-1] > keep.size else keep


def whole_log(columns: Mapping[str, Array], period: float, policy: Cutting) -> dict[str, Array]:
    """The signals of a log that an instrument may record late, of all samples.

    Parameters
    ----------
    columns
        Columns [N].
    period
        Sample period [s].
    policy
        Smoothing of the speed.

    Returns
    -------
    dict of array [N]
        Currents, torque, and the smoothed angle.

    """
    names = ("id_a", "iq_a", "torque_shaft_nm")
    turned = smoothed(columns["theta_mech_rad"], 2 * round(policy.speed_s / period / 2) + 1)
    return {"theta_mech_rad": turned, **{name: columns[name] for name in names if name in columns}}
