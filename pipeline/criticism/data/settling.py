"""How fast a shaft follows its voltage, from logs without a current: before any fit."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from pipeline.criticism.data.traces import with_values
from pipeline.criticism.operating import Array
from pipeline.criticism.policy.policy import Policy
from pipeline.numerics.plateaus import noise_about_cubics
from pipeline.numerics.shaft_log import shaft_log
from pipeline.numerics.weak_rows import smooth_speed, weak_rows
from pipeline.records.capture import Capture


def settling_of(captures: Iterable[Capture], policy: Policy) -> tuple[float, float] | None:
    """Mechanical time constant and delay of the log without a current that shows them best.

    Parameters
    ----------
    captures
        Drive logs.
    policy
        Windows and delays.

    Returns
    -------
    tuple of float or None
        kA/kV and the delay of the motion behind the voltage, both in s; None where no log has
        voltage and motion alone, or its voltage does not go with its speed.

    Notes
    -----
    v(t − τ) = kS sign(ω) + kV ω + kA dω/dt over windows (weak form), for each τ of a grid whose
    steps are a quarter of a window; the one that leaves least counts. It is where a fit begins,
    which from another order of magnitude takes inertia for a delay.

    """
    estimates = [fit for capture in captures if (fit := _of_log(capture, policy)) is not None]
    return min(estimates)[1:] if estimates else None


def unexplained_voltage(capture: Capture, policy: Policy) -> float | None:
    """Power of a log's voltage that its motion does not explain, over what acceleration takes.

    Parameters
    ----------
    capture
        A drive log.
    policy
        Windows and delays.

    Returns
    -------
    float or None
        A torque that nothing recorded turns the shaft where it is large [1]; None where
        `settling_of` says nothing of the log.

    """
    estimate = _of_log(capture, policy)
    return None if estimate is None else estimate[0]


def _of_log(recorded: Capture, policy: Policy) -> tuple[float, float, float] | None:
    """Unexplained voltage over what acceleration takes, squared, time constant and delay [s]."""
    capture = with_values(recorded)
    log = None if capture is None or capture.has("iq_a") else shaft_log(capture, "vq_v")
    if log is None or log.t_s.size < 2:
        return None
    t_s, volts, theta = log.t_s, log.data["vq_v"], log.theta_rad
    width = max(policy.cutting.load_window_s, policy.cutting.load_samples * log.period_s)
    try:
        weak = weak_rows(t_s, width)
        speed = smooth_speed(t_s, theta, width / 8.0)
    except ValueError:
        return None
    ends = zip(weak.starts, weak.starts + weak.sizes, strict=True)
    slowest = np.array([np.abs(speed[first:last]).min() for first, last in ends])
    turns = slowest > policy.cutting.slowest_share * float(np.abs(speed).max())
    if np.count_nonzero(turns) < 2 * policy.cutting.load_windows:
        return None
    noise = [noise_about_cubics(t_s, one) for one in (volts, theta)]
    columns = [
        weak.integral(np.sign(speed)), weak.integral(theta, order=1), weak.integral(theta, order=2)
    ]  # fmt: skip
    design = np.column_stack(columns)[turns]
    best = (np.inf, 0.0, 0.0)
    longest = 5.0 * policy.priors.late_voltage_s
    for late_s in np.linspace(0.0, longest, max(2, round(4.0 * longest / width) + 1)).tolist():
        target = weak.integral(np.interp(t_s - late_s, t_s, volts))[turns]
        (_, k_speed, k_gain), power = _fitted(design, target)
        sigma = np.hypot(noise[0] * weak.noise_gain(0), k_gain * noise[1] * weak.noise_gain(2))
        power = max(power - target.size * float(sigma) ** 2, 0.0)
        unexplained = power / max(float(np.sum((k_gain * design[:, 2]) ** 2)), 1e-300)
        if k_speed > 0.0 and k_gain > 0.0:
            best = min(best, (unexplained, float(k_gain / k_speed), late_s))
    return best if np.isfinite(best[0]) else None


def _fitted(design: Array, target: Array) -> tuple[Array, float]:
    """Coefficients [3], and the power that they leave of the target [w]."""
    coefficients = np.asarray(np.linalg.lstsq(design, target, rcond=None)[0], dtype=np.float64)
    residual = target - design @ coefficients
    return coefficients, float(residual @ residual)
