"""A voltage step on a locked rotor, brought to the form that the step model is fitted to."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.estimation.electrical.step_wave import BETWEEN, Noise, Waveform, noise_of, waveform_of
from pipeline.estimation.electrical.terminals import pair_of, pair_signals
from pipeline.estimation.policy import policy
from pipeline.numerics.integrals import trapezoid
from pipeline.numerics.least_squares import linear_fit
from pipeline.physics.windings import PAIR_AXES_RAD
from pipeline.records.capture import Array, Capture, Flags


@dataclass(frozen=True, slots=True)
class StepRecord:
    """One capture of a voltage step, as means over groups of samples.

    Attributes
    ----------
    capture, pair
        The capture, and the terminals that the current flows through.
    axis_rad
        Electrical angle from the d axis to the axis of the pair's current.
    wave
        The voltage that drives the model.
    t_s, i_a, v_v
        Means [n] of time, current and voltage.
    level
        The supply's level of each mean [n]; `BETWEEN` for a mean taken while the voltage rose.
    count
        Samples of each mean [n].
    l_start_h, r_start_ohm
        Between the terminals, from the integrated form; start values of the fit.
    commanded
        Whether the voltage is an inverter's command, so that its drop is in it.
    starts_settled
        Whether the record begins with the current settled.
    current_noise, voltage_noise
        Noise of the channels.

    """

    capture: Capture
    pair: str
    axis_rad: float
    wave: Waveform
    t_s: Array
    i_a: Array
    v_v: Array
    level: NDArray[np.intp]
    count: Array
    l_start_h: float
    r_start_ohm: float
    commanded: bool
    starts_settled: bool
    current_noise: Noise
    voltage_noise: Noise

    @property
    def largest_a(self) -> float:
        """The largest current in magnitude."""
        return float(np.max(np.abs(self.i_a)))


def rotor_angle_rad(capture: Capture) -> float | None:
    """Electrical angle at which the rotor was locked.

    Parameters
    ----------
    capture
        Of a locked rotor.

    Returns
    -------
    float or None
        [rad], as stated, else the mean of the column; None where neither is there.

    """
    if capture.meta.theta_elec_deg is not None:
        return math.radians(capture.meta.theta_elec_deg)
    if capture.has("theta_elec_rad"):
        return float(np.nanmean(capture.arrays("theta_elec_rad")["theta_elec_rad"]))
    return None


def read_step(capture: Capture, unknown_rad: float | None = None) -> StepRecord | None:
    """The record of a capture, or None where it holds no step to speak of.

    Parameters
    ----------
    capture
        A voltage step on a locked rotor.
    unknown_rad
        Rotor angle to go by where the capture has none [rad, electrical].

    Returns
    -------
    StepRecord or None
        None where no step stands out of the noise.

    Raises
    ------
    KeyError
        Where voltage, current, pair or rotor angle is missing.

    """
    pair, angle = pair_of(capture), rotor_angle_rad(capture)
    angle = unknown_rad if angle is None else angle
    if pair is None or angle is None:
        raise KeyError(f"{capture.path}: pair or theta_elec_deg is not stated")
    columns = pair_signals(capture, pair)
    whole = ~(_spikes(columns["v_v"]) | _spikes(columns["i_a"]))
    t, v, i = (columns[name][whole] for name in ("t_s", "v_v", "i_a"))
    t, noise = t - t[:1], noise_of(i)
    if t.size < 50 or float(np.ptp(i)) < 10.0 * noise.sigma:
        return None
    commanded = capture.meta.voltage_kind == "commanded"
    wave = waveform_of(t, v, i, capture.meta.voltage_timing, ideal=commanded)
    start = integrated_form(t, v, i)
    if start is None:
        return None
    cuts = _cuts(t.size, wave)
    count = np.diff(np.append(cuts, t.size)).astype(np.float64)
    times, amps, volts = (np.add.reduceat(x, cuts) / count for x in (t, i, v))
    return StepRecord(
        capture=capture,
        pair=pair,
        axis_rad=PAIR_AXES_RAD[pair] - angle,
        wave=wave,
        t_s=times,
        i_a=amps,
        v_v=volts,
        level=wave.level_of[cuts] if wave.has_supply else np.full(cuts.size, BETWEEN),
        count=count,
        l_start_h=start[0],
        r_start_ohm=start[1],
        commanded=commanded,
        starts_settled=wave.has_supply and wave.edges_s[1] - wave.edges_s[0] >= 5.0 * wave.period_s,
        current_noise=noise,
        voltage_noise=noise_of(v),
    )


def _spikes(signal: Array) -> Flags:
    """Samples [n] more than `steps.spike_sigmas` of the noise from the median of five around them.

    A signal that rises or falls through the five is its own median, an edge too. Reference: Hampel,
    J. Am. Stat. Assoc. 69, 1974, 383 (the median as the estimator that outliers move least).
    """
    if signal.size < 5:
        return np.zeros(signal.size, dtype=bool)
    padded = np.pad(signal, 2, mode="edge")
    middle = np.median(np.lib.stride_tricks.sliding_window_view(padded, 5), axis=1)
    noise = noise_of(signal)
    return np.abs(signal - middle) > policy().steps.spike_sigmas * max(noise.sigma, noise.step)


def integrated_form(t_s: Array, v_v: Array, i_a: Array) -> tuple[float, float] | None:
    """L and R between the terminals by the integrated voltage equation, to begin a fit with.

    Parameters
    ----------
    t_s, v_v, i_a
        Times [n, s], voltage [n, V] and current [n, A] of one pair.

    Returns
    -------
    (L, R) or None
        [H] and [ohm]; None where the two integrals cannot be separated.

    Notes
    -----
    i = (1/L) ∫v dt − (R/L) ∫i dt + c takes no derivative, and is solved for i, in which alone the
    noise is white. Not an estimate: the trapezoid across an edge reads L up to half a sample of the
    time constant high.

    """
    volts, amps = trapezoid(t_s, v_v), trapezoid(t_s, i_a)
    fit = linear_fit(np.column_stack([volts, amps, np.ones(t_s.size)]), i_a)
    inverse, slope = float(fit.coefficients[0]), -float(fit.coefficients[1])
    if not fit.full_rank or inverse <= 0.0 or slope <= 0.0:
        return None
    return 1.0 / inverse, slope / inverse


def disagreement(records: Sequence[StepRecord]) -> str:
    """The captures that cannot be of one rotor with the others, in words.

    Parameters
    ----------
    records
        All captures.

    Returns
    -------
    str
        Empty where no L is more than `steps.most_apart` times another.

    Notes
    -----
    A clock or a current in another unit scales L by a thousand, and a common fit would follow it.

    """
    logs = np.log([record.l_start_h for record in records])
    if logs.size < 2 or np.ptp(logs) < math.log(policy().steps.most_apart):
        return ""
    apart = logs - np.median(logs)
    odd = [
        f"{record.capture.path} ({math.exp(ratio):.3g} times the usual L)"
        for record, ratio in zip(records, apart, strict=True)
        if abs(ratio) > 0.5 * math.log(policy().steps.most_apart) - 1e-9
    ]
    return f"look at t_s and the units of {', '.join(odd)}: not one rotor with the other steps"


def _cuts(size: int, wave: Waveform) -> NDArray[np.intp]:
    """First samples of equal groups, about `steps.most_bins`, none across an edge of a supply."""
    cuts = np.arange(0, size, max(1, size // policy().steps.most_bins))
    if not wave.has_supply:
        return cuts
    edges = np.flatnonzero(np.diff(wave.level_of)) + 1
    around = (edges[:, None] + np.arange(-2, 3)).ravel()
    return np.unique(np.concatenate([cuts, around[(around > 0) & (around < size)]]))
