"""Voltages of the winding: what flux and drops make, and what a meter says of it."""

from __future__ import annotations

from typing import Any

import numpy as np

from pipeline.criticism.data.segment import Segment
from pipeline.criticism.machine.model import Model, Pieces
from pipeline.criticism.operating import Array, Complex, Operating, Values
from pipeline.criticism.signals.angle_sensor import frame_turn

_EIGHTH_ORDER = (4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0)
"""Weights of a slope: of the differences of samples one, two, three and four to either side."""
RIPPLES = ("ripple_edge", "ripple_shift", "frame_lag_s", "command_lead")
"""Nuisances of held vectors and their frame that are in the voltage (`model.BASE`)."""


def rotor_voltage(pieces: Pieces, omega_e_rad_s: Array, period_s: float) -> Complex:
    """Voltage in the rotor frame at each sample.

    Parameters
    ----------
    pieces : Pieces
        Flux linkage and voltage drop [n, Wb and V].
    omega_e_rad_s : array [n], rad/s
        Electrical speed.
    period_s : float, s
        Sample period.

    Returns
    -------
    complex array [n], V
        d + jq; without the slope of the flux at both ends.

    Notes
    -----
    v = drop + dψ/dt + j ω_e ψ, the slope a central difference.

    """
    slope = central(pieces.psi_wb, period_s)
    return pieces.drop_v + slope + 1j * omega_e_rad_s * pieces.psi_wb


def held_voltage(pieces: Pieces, omega_e_rad_s: Array, period_s: float) -> Complex:
    """Voltage in the rotor frame that is held from each sample to the next.

    Parameters
    ----------
    pieces
        Flux linkage [n, Wb] and voltage drop [n, V].
    omega_e_rad_s
        Electrical speed from each sample to the next [n, rad/s].
    period_s
        Sample period [s].

    Returns
    -------
    complex array [n], V
        d + jq; without the step to a next sample at the last.

    Notes
    -----
    v = mean of drop + dψ/dt + j ω_e mean of ψ, means and slope over the step to the next sample.

    """
    slope = forward(pieces.psi_wb, period_s)
    psi, drop = ahead(pieces.psi_wb), ahead(pieces.drop_v)
    return drop + slope + 1j * omega_e_rad_s * psi


def mean_voltage(
    pieces: Pieces, eps_rad: Array, points: int, period_s: float, *, ahead: bool
) -> Complex:
    """Mean of the voltage in the rotor frame over a sample in which the rotor turns far.

    Parameters
    ----------
    pieces
        Flux linkage [n·m, Wb] and voltage drop [n·m, V].
    eps_rad
        Electrical angle [n·m].
    points
        Points m a sample, an even number.
    period_s
        Sample period T [s].
    ahead
        Whether it is the mean from each sample to the next, or over half a period either side.

    Returns
    -------
    complex array [n], V
        (1/T) ∫ (drop + dψ/dt + j ψ dε/dt) dt; of the first and the last sample a part.

    """
    psi, size = pieces.psi_wb, pieces.psi_wb.size
    drop = 0.5 / points * (pieces.drop_v[1:] + pieces.drop_v[:-1])
    turned = 0.5j / period_s * (psi[1:] + psi[:-1]) * np.diff(eps_rad)
    total = np.concatenate([[0.0], np.cumsum(drop + turned)]) + psi / period_s
    first = np.arange(0, size, points) - (0 if ahead else points // 2)
    mean: Complex = total[np.minimum(first + points, size - 1)] - total[np.maximum(first, 0)]
    return mean


def recorded_voltage(
    voltage: Complex,
    segment: Segment,
    x: Operating,
    model: Model,
    values: Values,
    *,
    in_frame: bool = False,
) -> Complex:
    """What the voltmeter shows of a true voltage: with the effects of its errors, and its gain.

    Parameters
    ----------
    voltage
        True vector [n, V].
    segment
        Whose meter it is.
    x
        State of the machine.
    model, values
        With the effects of the meter's errors.
    in_frame
        Whether the voltage was turned into the rotor's frame by the recorded angle, error and all.

    Returns
    -------
    complex array [n], V

    """
    for shown, q in model.hooks("voltage", values):
        voltage = shown(voltage, x, q, segment.instrument.name)
    if in_frame and (turn := frame_turn(segment, x, model, values)) is not None:
        voltage = voltage * np.conj(turn)
    return voltage * (1.0 + values[segment.instrument.meter])


def central(signal: Any, period_s: float) -> Any:
    """Slope by central differences.

    Parameters
    ----------
    signal
        [n, any unit]
    period_s
        Sample period [s].

    Returns
    -------
    array [n]
        (x_(k+1) − x_(k−1))/2T, zero at both ends.

    """
    slope = np.zeros_like(signal)
    slope[1:-1] = (signal[2:] - signal[:-2]) * (0.5 / period_s)
    return slope


def fine_slope(signal: Complex, period_s: float) -> Complex:
    """Slope by central differences of eighth order, of a signal that is smooth between samples.

    Parameters
    ----------
    signal
        [n, any unit]
    period_s
        Sample period [s].

    Returns
    -------
    array [n]
        Of a wave with five samples a cycle it misses a hundredth, where the difference of two
        neighbours misses a quarter; zero in four samples at both ends.

    References
    ----------
    Fornberg, Math. Comp. 51 (1988), 699, doi:10.1090/S0025-5718-1988-0935077-0.

    """
    slope = np.zeros_like(signal)
    for reach, weight in enumerate(_EIGHTH_ORDER, 1):
        after, before = signal[4 + reach :], signal[4 - reach : signal.size - 4 - reach]
        slope[4:-4] += (weight / period_s) * (after[: slope.size - 8] - before)
    return slope


def unresolved(signal: Array, least: float = 0.0) -> Array:
    """The share of a signal's slope that its samples do not resolve.

    Parameters
    ----------
    signal
        [n, any unit].
    least
        Second difference [same unit] below which it is straight, such as one of its noise.

    Returns
    -------
    array [n]
        From 0 to 1.

    Notes
    -----
    The largest of min(|h/c|, 1) at a sample and its two neighbours, c the central difference and h
    half of what the slopes before and after a sample differ by. Of a line it is zero, beside a step
    between two samples one.

    Examples
    --------
    >>> unresolved(np.array([0.0, 0.0, 1.0, 1.0]))
    array([1., 1., 1., 1.])
    >>> unresolved(np.array([0.0, 1.0, 2.0, 3.0]))
    array([0., 0., 0., 0.])

    """
    share = np.zeros(signal.size)
    bend, size = np.abs(np.diff(signal, 2)), np.abs(signal[2:] - signal[:-2])
    bend[bend < least] = 0.0
    share[1:-1] = np.minimum(bend / np.where(size > 0.0, size, np.inf), 1.0)
    beside = share.copy()
    beside[:-1] = np.maximum(beside[:-1], share[1:])
    beside[1:] = np.maximum(beside[1:], share[:-1])
    return beside


def forward(signal: Any, period_s: float) -> Any:
    """Slope to the next sample.

    Parameters
    ----------
    signal
        [n, any unit]
    period_s
        Sample period [s].

    Returns
    -------
    array [n]
        (x_(k+1) − x_k)/T, zero at the last.

    """
    slope = np.zeros_like(signal)
    slope[:-1] = np.diff(signal) * (1.0 / period_s)
    return slope


def ahead(signal: Any) -> Any:
    """Mean of each sample and the next.

    Parameters
    ----------
    signal
        [n].

    Returns
    -------
    array [n]
        The last sample as it is.

    """
    mean = signal.copy()
    mean[:-1] = 0.5 * (signal[:-1] + signal[1:])
    return mean
