"""What one hand turn says of the flux: cycles a turn and amplitude, a voltage channel at a time."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from pipeline.estimation.electrical.spin import Channel, Spin
from pipeline.numerics.integrals import REST, cubic
from pipeline.numerics.least_squares import Array, LinearFit, autocorrelation_time, linear_fit
from pipeline.numerics.plateaus import white_noise_sigma
from pipeline.physics.units import TURN_RAD


@dataclass(frozen=True, slots=True)
class Turn:
    """What one voltage channel gives of a turn by hand.

    Attributes
    ----------
    channel
        Column of the capture.
    cycles
        Electrical cycles in the record [1].
    psi_wb, u_psi_wb
        Flux amplitude, phase peak, and its standard uncertainty [Wb].
    dof
        Degrees of freedom of `u_psi_wb`; infinite where the noise is known beforehand.
    t_s, flux_wb, fitted_wb
        Traces for a plot [n].

    """

    channel: str
    cycles: float
    psi_wb: float
    u_psi_wb: float
    dof: float
    t_s: Array
    flux_wb: Array
    fitted_wb: Array


def turns_of(spin: Spin) -> list[Turn]:
    """What each loud voltage channel says of the turn, by its angle, by two channels, or alone.

    Parameters
    ----------
    spin
        The voltages of one turn by hand, and the angle where there.

    Returns
    -------
    list of Turn
        Cycles a turn [1] and flux amplitude [Wb, phase peak] a channel; empty where none is loud.

    Notes
    -----
    λ = ∫(v - v_0) dt, so the speed of the hand does not enter.

    """
    moving = [
        c
        for c in spin.channels
        if float(np.quantile(np.abs(c.v_v), 0.9)) > 5.0 * white_noise_sigma(c.v_v)
    ]
    if not moving or spin.t_s.size < 2:
        return []
    if spin.theta_rad is not None and np.isfinite(spin.theta_rad).all():
        return _by_angle(spin, moving, spin.theta_rad)
    if len(moving) >= 2:
        return _by_vector(replace(spin, channels=tuple(moving)))
    return [t for t in (_by_swings(spin, c) for c in moving) if t is not None]


def _flux_of(spin: Spin, channel: Channel) -> Array:
    """Integral of a voltage [Wb], phase to star point, less the offset seen at rest."""
    v = channel.v_v - float(np.mean(channel.v_v[_at_rest(channel.v_v)]))
    return cubic(spin.t_s, v) / channel.gain


def _at_rest(v: Array) -> NDArray[np.bool_]:
    """Rows at rest: the first and last stretch below five sigma, or all where there is none."""
    sigma = max(white_noise_sigma(v), 1e-12)
    moving = np.flatnonzero(np.abs(v - np.median(v)) > 5.0 * sigma)
    at_rest = np.zeros(v.size, dtype=bool)
    if moving.size:
        at_rest[: moving[0]] = True
        at_rest[moving[-1] + 1 :] = True
    return at_rest if np.count_nonzero(at_rest) >= 20 else np.ones(v.size, dtype=bool)


def _by_angle(spin: Spin, moving: Sequence[Channel], theta: Array) -> list[Turn]:
    """Cycles a turn as a real number: a scan of whole ones by the first voltage, then each own."""
    if float(np.ptp(theta)) < 0.5 * TURN_RAD:
        return []
    rows = _knots(theta, float(np.ptp(theta)) / 1200.0)
    if rows.size < 50:
        return []
    t, angle = spin.t_s[rows], theta[rows]

    def residual_square(flux: Array, cycles: float) -> float:
        residuals = _steps_fit(t, flux, cycles * angle).residuals
        return float(residuals @ residuals)

    highest = int(min(200, math.pi / float(np.abs(np.diff(angle)).max())))
    first = _flux_of(spin, moving[0])[rows]
    best = min(range(1, max(highest, 2)), key=lambda cycles: residual_square(first, cycles))
    turns = []
    for channel in moving:
        flux = _flux_of(spin, channel)
        cycles = _golden_section(partial(residual_square, flux[rows]), best - 0.4, best + 0.4)
        turns.append(_amplitude(spin, channel, flux, cycles * theta, cycles))
    return [turn for turn in turns if turn is not None]


def _knots(phase: Array, step: float) -> NDArray[np.intp]:
    """Rows at which a phase has moved on by `step` since the last one, both ends in."""
    travelled = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(phase)))])
    marks = np.arange(0.0, travelled[-1], step)
    return np.unique(np.append(np.searchsorted(travelled, marks), phase.size - 1))


def _steps_fit(t_s: Array, flux: Array, phase: Array) -> LinearFit:
    """Flux steps [n - 1] on steps of t (an offset), cos and sin of the phase, all [n].

    Noise of a step grows with the root of its duration.
    """
    design = np.diff(np.column_stack([t_s, np.cos(phase), np.sin(phase)]), axis=0)
    weight = 1.0 / np.sqrt(np.diff(t_s))
    return linear_fit(design * weight[:, None], np.diff(flux) * weight)


def _amplitude(
    spin: Spin, channel: Channel, flux: Array, phase: Array, cycles: float
) -> Turn | None:
    rows = _knots(phase, TURN_RAD / 24.0)
    if rows.size < 12:
        return None
    fit = _steps_fit(spin.t_s[rows], flux[rows], phase[rows])
    drift, a, b = (float(c) for c in fit.coefficients)
    amplitude = math.hypot(a, b)
    slope = np.array([0.0, a, b]) / max(amplitude, 1e-300)
    tau = autocorrelation_time(fit.residuals)
    u = math.sqrt(float(slope @ fit.covariance @ slope) * tau)
    dof = max(fit.dof / tau, 1.0)
    u = math.hypot(u, amplitude * REST * float(np.max(np.abs(np.diff(phase)))) ** 4)
    fitted = drift * spin.t_s + a * np.cos(phase) + b * np.sin(phase)
    level = float(np.mean(flux - fitted))
    return Turn(channel.name, cycles, amplitude, u, dof, spin.t_s, flux, fitted + level)


def _by_vector(spin: Spin) -> list[Turn]:
    """Cycles from the phase that the flux vector turns through about its drifting centre.

    The centre c0 + c1 t is where |flux - centre|² is constant: |f|² = 2 Re(conj(f) centre) + k,
    linear in c0, c1 and k with the small |centre|² left in k.
    """
    zeroed = [replace(c, v_v=c.v_v - float(np.mean(c.v_v[_at_rest(c.v_v)]))) for c in spin.channels]
    vector = replace(spin, channels=tuple(zeroed)).vector_v(centred=False)
    flux = cubic(spin.t_s, vector)
    flux = flux - flux.mean()
    time = (spin.t_s - spin.t_s.mean()) / float(np.ptp(spin.t_s))
    rows = _knots(np.unwrap(np.angle(flux)), TURN_RAD / 24.0)
    for _ in range(3):
        f, t = flux[rows], time[rows]
        design = np.column_stack(
            [2.0 * f.real, 2.0 * f.imag, 2.0 * f.real * t, 2.0 * f.imag * t, np.ones(t.size)]
        )
        c = linear_fit(design, np.abs(f) ** 2).coefficients
        flux = flux - (complex(c[0], c[1]) + complex(c[2], c[3]) * time)
    phase = np.unwrap(np.angle(flux))
    cycles = abs(float(phase[-1] - phase[0])) / TURN_RAD
    vector_turns = (
        _amplitude(spin, channel, _flux_of(spin, channel), phase, cycles)
        for channel in spin.channels
    )
    return [turn for turn in vector_turns if turn is not None]


def _golden_section(value: Callable[[float], float], low: float, high: float) -> float:
    """Minimum of a smooth function between two ends by golden section, to 1e-6."""
    shrink = (math.sqrt(5.0) - 1.0) / 2.0
    left, right = high - shrink * (high - low), low + shrink * (high - low)
    at_left, at_right = value(left), value(right)
    while high - low > 1e-6:
        if at_left < at_right:
            high, right, at_right = right, left, at_left
            left = high - shrink * (high - low)
            at_left = value(left)
        else:
            low, left, at_left = left, right, at_right
            right = low + shrink * (high - low)
            at_right = value(right)
    return 0.5 * (low + high)


def _by_swings(spin: Spin, channel: Channel) -> Turn | None:
    """Half cycles between the extremes of one flux, and whether its end closes on its start.

    Extremes are those that the flux reaches and leaves by more than its own noise. The offset is
    known from the rest at both ends and from the extremes, which lie at +A and -A in turn.
    """
    v = channel.v_v
    duration = float(np.ptp(spin.t_s))
    rate = white_noise_sigma(v) * math.sqrt(duration / spin.t_s.size) / channel.gain
    offset, u_offset = _offset_at_rest(v)
    flux = cubic(spin.t_s, v - offset) / channel.gain
    noise, swing = 4.0 * rate * math.sqrt(duration), float(np.ptp(flux))
    unsure = 3.0 * u_offset * duration / channel.gain
    reversal = max(noise, min(0.1 * swing, max(0.005 * swing, unsure)))
    drift, ends = 0.0, None
    for _ in range(4):
        straight = flux - drift * (spin.t_s - spin.t_s[0])
        turning = _extremes(straight, reversal)
        if turning.size < 2:
            return _one_swing(spin, channel, straight, turning, max(reversal, unsure))
        ends = _ends(spin.t_s, flux, turning, rate, u_offset / channel.gain)
        drift = float(ends.coefficients[0])
        reversal = max(noise, 0.005 * float(np.ptp(straight)))
    if ends is None or ends.coefficients[1] <= 0.0:
        return None
    sense = math.copysign(1.0, straight[turning[0]] - straight[turning[1]])
    cycles = _cycles(ends, turning.size, sense, reversal)
    u = math.sqrt(float(ends.covariance[1, 1]) * max(1.0, _excess(ends)))
    amplitude = float(ends.coefficients[1])
    # The extreme falls up to T/2 beside a sample, so it reads (omega T)²/24 low on average and up
    # to three times as much.
    step = float(np.max(np.abs(np.diff(flux)))) / amplitude
    u = math.hypot(u, amplitude * step**2 / 12.0)
    dof = float(ends.dof) if _excess(ends) > 1.0 else math.inf
    return Turn(channel.name, cycles, amplitude, u, dof, spin.t_s, straight, np.zeros(0))


def _one_swing(
    spin: Spin, channel: Channel, flux: Array, turning: NDArray[np.intp], hidden_wb: float
) -> Turn | None:
    """One pole pair turned from an extreme over the other one back to the first.

    One whole turn passes at least 2 p - 1 extremes, so a single one allows p = 1 alone; what
    noise or an unknown offset can hide, `hidden_wb`, is all by which the ends may differ, and
    the whole swing lies between the one seen and that much more.
    """
    if turning.size == 0 or abs(float(flux[-1] - flux[0])) > hidden_wb:
        return None
    swing_wb = abs(float(flux[turning[0]]) - 0.5 * float(flux[0] + flux[-1]))
    amplitude, u = 0.5 * swing_wb + 0.25 * hidden_wb, 0.25 * hidden_wb
    return Turn(channel.name, 1.0, amplitude, u, math.inf, spin.t_s, flux, np.zeros(0))


def _offset_at_rest(v: Array) -> tuple[float, float]:
    """Offset of a voltage at rest and its uncertainty, from the outer thirds of the quiet ends.

    A hand that already moves shows as a difference between those and the whole quiet ends; for
    a voltage that leaves rest in a straight line half of it remains in the outer thirds.
    """
    sigma = max(white_noise_sigma(v), 1e-12)
    level = float(np.median(np.concatenate([v[:10], v[-10:]])))
    moving = np.flatnonzero(np.abs(v - level) > 5.0 * sigma)
    if moving.size == 0 or moving[0] < 3 or v.size - 1 - moving[-1] < 3:
        return float(np.mean(v)), float(np.std(v))
    first, last = int(moving[0]), int(v.size - 1 - moving[-1])
    outer = np.concatenate([v[: first // 3], v[v.size - last // 3 :]])
    at_rest = np.concatenate([v[:first], v[v.size - last :]])
    offset = float(np.mean(outer))
    moved = 0.5 * (float(np.mean(at_rest)) - offset)
    return offset, math.hypot(sigma / math.sqrt(outer.size), moved)


def _ends(
    t_s: Array, flux: Array, turning: NDArray[np.intp], rate: float, u_drift: float
) -> LinearFit:
    """Drift [Wb/s], amplitude, flux at the start and at the end [Wb], both from the centre.

    Least squares of the flux steps between the start, the extremes and the end, whose variance
    is rate² [Wb²/s] times their duration; the rest holds the drift to `u_drift`.
    """
    rows = np.concatenate([[0], turning, [flux.size - 1]])
    levels = np.zeros((rows.size, 4))
    levels[:, 0] = t_s[rows]
    first = math.copysign(1.0, flux[turning[0]] - flux[turning[1]])
    levels[1:-1, 1] = first * (-1.0) ** np.arange(turning.size)
    levels[0, 2] = levels[-1, 3] = 1.0
    sigma = max(rate, 1e-9 * float(np.ptp(flux))) * np.sqrt(np.diff(t_s[rows]))
    held = max(u_drift, 1e-9 * float(np.ptp(flux)))
    return linear_fit(
        np.vstack([np.diff(levels, axis=0), [1.0, 0.0, 0.0, 0.0]]),
        np.append(np.diff(flux[rows]), 0.0),
        np.append(sigma, held),
    )


def _excess(fit: LinearFit) -> float:
    """Chi squared per degree of freedom, 1 where none is left."""
    return fit.chi2_dof if fit.dof > 0 else 1.0


def _cycles(ends: LinearFit, extremes: int, sense: float, reversal: float) -> float:
    """Electrical cycles of the record, whole where its end closes on its start.

    A whole number p has 2 p extremes and the same flux at both ends within three of its own
    uncertainties; or, both ends on an extreme that noise hides or shows, one more or less. Else
    the broken ends count by arc cosine. A record that falls short by whole electrical cycles, or
    by less than its uncertainty, closes as well: only an angle could separate it from one turn.
    """
    _, amplitude, start, end = (float(c) for c in ends.coefficients)
    scale = 3.0 * math.sqrt(max(1.0, _excess(ends)))
    apart = np.array([0.0, 0.0, -1.0, 1.0])
    closes = abs(end - start) <= scale * math.sqrt(float(apart @ ends.covariance @ apart))
    last = sense * (-1.0) ** (extremes - 1)
    if extremes % 2 == 0 and closes:
        return extremes / 2.0
    hidden = []
    for column, level in ((2, start), (3, end)):
        slope = np.array([0.0, 1.0, 0.0, 0.0])
        slope[column] = -math.copysign(1.0, level)
        u = math.sqrt(float(slope @ ends.covariance @ slope))
        hidden.append(amplitude - abs(level) <= reversal + scale * u)
    if extremes % 2 == 1 and all(hidden) and start * end > 0.0:
        return (extremes - math.copysign(1.0, sense * start)) / 2.0
    pieces = [
        math.acos(float(np.clip(side * level / amplitude, -1.0, 1.0)))
        for side, level in ((sense, start), (last, end))
    ]
    return (math.pi * (extremes - 1) + sum(pieces)) / TURN_RAD


def _extremes(flux: Array, reversal: float) -> NDArray[np.intp]:
    """Rows of alternating maxima and minima reached and left again by at least `reversal`."""
    places: list[int] = []
    low = high = 0
    rising: bool | None = None
    for row in range(flux.size):
        low = row if flux[row] < flux[low] else low
        high = row if flux[row] > flux[high] else high
        if rising is not False and flux[high] - flux[row] > reversal:
            if rising or flux[high] - flux[0] > reversal:
                places.append(high)
            rising, low = False, row
        elif rising is not True and flux[row] - flux[low] > reversal:
            if rising is False or flux[0] - flux[low] > reversal:
                places.append(low)
            rising, high = True, row
    return np.array(places, dtype=np.intp)
