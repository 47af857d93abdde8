"""Pole pairs and magnet flux from one mechanical turn by hand."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.fit.back_emf import Channel, Spin, read_spin
from pipeline.fit.instruments import (
    budget_of,
    instrument_uncertainties,
    unstated_note,
    voltage_source,
)
from pipeline.fit.protocol import Estimator, Fit
from pipeline.fit.terminals import first_temperature
from pipeline.numerics.least_squares import autocorrelation_time, linear_fit
from pipeline.numerics.plateaus import decimated, white_noise_sigma
from pipeline.physics.conventions import POLE_PAIRS_TOLERANCE, pole_pairs_from
from pipeline.records.capture import Campaign, Capture
from pipeline.records.constants import Constants
from pipeline.records.estimate import Estimate, not_identifiable
from pipeline.records.evidence import Evidence, Series
from pipeline.records.uncertainty import Contribution

NAME = "hand_turn"
GIVES = ("pole_pairs", "psi_pm_wb")
UNITS = {"pole_pairs": "1", "psi_pm_wb": "Wb"}
EXPERIMENT = (
    "record a hand_turn: terminals open, shaft turned by hand through exactly one turn from rest "
    "to rest, a line voltage, theta_mech_rad if there is a sensor"
)
MAGNET_SOURCE = "assumed:temp_coeff_magnet_1_k"
TURN = 2.0 * math.pi
Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Turn:
    """What one voltage channel says: cycles a turn, flux amplitude [Wb, phase peak], traces."""

    channel: str
    cycles: float
    psi_wb: float
    u_psi_wb: float
    t_s: Array
    flux_wb: Array
    fitted_wb: Array


def fit_hand_turn(campaign: Campaign, known: Constants, options: Mapping[str, float]) -> Fit:
    """Flux is the integral of the voltage, so the hand's speed does not enter.

    With the angle: flux = offset + drift t + amplitude cos(p theta + phase), p real, least
    squares. Without: swings of the flux between the voltage's zeros count half cycles, and their
    mean height is twice the amplitude.
    """
    turns: list[tuple[Capture, Turn]] = []
    notes: list[str] = []
    for capture in campaign.of("hand_turn"):
        try:
            spin = read_spin(capture, None)
        except KeyError:
            notes.append(f"{capture.path}: no terminal voltage")
            continue
        found = [t for t in (_turn(spin, channel) for channel in spin.channels) if t is not None]
        turns += [(capture, turn) for turn in found]
        if not found:
            notes.append(f"{capture.path}: the voltage does not stand out of the noise")
    if not turns:
        reason = "; ".join([*notes, EXPERIMENT])
        return Fit(tuple(not_identifiable(n, UNITS[n], NAME, reason) for n in GIVES))
    pairs = _pole_pairs(turns)
    psi = _flux(turns, known, options)
    return Fit((pairs, psi), (_evidence(turns),))


def _flux_of(spin: Spin, channel: Channel) -> Array:
    """Integral of a voltage [Wb], phase to star point, less the offset seen at rest.

    The offset is the mean where the speed is least; what is left of it is fitted as a drift.
    """
    v = channel.v_v - float(np.median(channel.v_v[_quiet(channel.v_v)]))
    steps = 0.5 * (v[1:] + v[:-1]) * np.diff(spin.t_s)
    return np.concatenate([[0.0], np.cumsum(steps)]) / channel.gain


def _quiet(v: Array) -> NDArray[np.bool_]:
    """Rows at rest: the first and last stretch below five sigma, or all where there is none."""
    sigma = max(white_noise_sigma(v), 1e-12)
    loud = np.flatnonzero(np.abs(v - np.median(v)) > 5.0 * sigma)
    quiet = np.zeros(v.size, dtype=bool)
    if loud.size:
        quiet[: loud[0]] = True
        quiet[loud[-1] + 1 :] = True
    return quiet if np.count_nonzero(quiet) >= 20 else np.ones(v.size, dtype=bool)


def _turn(spin: Spin, channel: Channel) -> Turn | None:
    sigma = white_noise_sigma(channel.v_v)
    if float(np.quantile(np.abs(channel.v_v), 0.9)) < 5.0 * sigma:
        return None
    flux = _flux_of(spin, channel)
    if spin.theta_rad is not None and np.isfinite(spin.theta_rad).all():
        return _by_angle(spin, channel, flux)
    return _by_swings(spin, channel, flux, sigma)


def _by_angle(spin: Spin, channel: Channel, flux: Array) -> Turn | None:
    """Least squares over a real number of cycles a turn, the start from a scan of whole ones."""
    theta = spin.theta_rad
    if theta is None or float(np.ptp(theta)) < 0.5 * TURN:
        return None
    time = (spin.t_s - spin.t_s[0]) / (spin.t_s[-1] - spin.t_s[0])
    rows = decimated(theta.size, 4000)

    def design(cycles: float, where: slice) -> Array:
        angle = cycles * theta[where]
        ones = np.ones(angle.size)
        return np.column_stack([ones, time[where], np.cos(angle), np.sin(angle)])

    def misfit(cycles: float) -> float:
        residuals = linear_fit(design(cycles, rows), flux[rows]).residuals
        return float(residuals @ residuals)

    travel = np.abs(np.diff(theta[rows]))
    highest = int(min(200, math.pi / max(float(travel.max()), 1e-9)))
    best = min(range(1, max(highest, 2)), key=misfit)
    cycles = _least(misfit, best - 0.5, best + 0.5)
    fit = linear_fit(design(cycles, slice(None)), flux)
    tau = autocorrelation_time(fit.residuals)
    a, b = (float(c) for c in fit.coefficients[2:])
    amplitude = math.hypot(a, b)
    slope = np.array([0.0, 0.0, a, b]) / amplitude
    u = math.sqrt(float(slope @ fit.covariance @ slope) * tau)
    return Turn(channel.name, cycles, amplitude, u, spin.t_s, flux, flux - fit.residuals)


def _least(value: Callable[[float], float], low: float, high: float) -> float:
    """Minimum of a smooth function between two ends by golden section, to 1e-7."""
    shrink = (math.sqrt(5.0) - 1.0) / 2.0
    left, right = high - shrink * (high - low), low + shrink * (high - low)
    at_left, at_right = value(left), value(right)
    while high - low > 1e-7:
        if at_left < at_right:
            high, right, at_right = right, left, at_left
            left = high - shrink * (high - low)
            at_left = value(left)
        else:
            low, left, at_left = left, right, at_right
            right = low + shrink * (high - low)
            at_right = value(right)
    return 0.5 * (low + high)


def _by_swings(spin: Spin, channel: Channel, flux: Array, sigma: float) -> Turn | None:
    """Half cycles between the extremes of the flux, the broken ones at both ends by arc cosine.

    Extremes are those that the flux leaves again by more than its own noise, so that noise about
    a standstill makes none.
    """
    period = float(np.median(np.diff(spin.t_s)))
    noise = sigma * period * math.sqrt(flux.size) / channel.gain
    turning = _extremes(flux, max(8.0 * noise, 0.1 * float(np.ptp(flux))))
    if turning.size < 3:
        return None
    swings = np.abs(np.diff(flux[turning]))
    amplitude = float(np.median(swings)) / 2.0
    whole = swings[np.abs(swings / 2.0 - amplitude) < 0.2 * amplitude]
    amplitude = float(whole.mean()) / 2.0
    centre = 0.5 * (flux[turning[:-1]] + flux[turning[1:]]).mean()
    ends = 0.0
    for end, extreme in ((0, turning[0]), (flux.size - 1, turning[-1])):
        sense = math.copysign(1.0, flux[extreme] - centre)
        ends += math.acos(float(np.clip(sense * (flux[end] - centre) / amplitude, -1.0, 1.0)))
    cycles = (math.pi * (turning.size - 1) + ends) / TURN
    scatter = float(whole.std(ddof=1)) / 2.0 if whole.size > 1 else noise
    u = max(scatter / math.sqrt(whole.size), noise / 2.0)
    return Turn(channel.name, cycles, amplitude, u, spin.t_s, flux, np.zeros(0))


def _extremes(flux: Array, reversal: float) -> NDArray[np.intp]:
    """Rows of alternating maxima and minima that are left again by at least `reversal`."""
    found: list[int] = []
    low = high = 0
    rising: bool | None = None
    for row in range(flux.size):
        low = row if flux[row] < flux[low] else low
        high = row if flux[row] > flux[high] else high
        if rising is not False and flux[high] - flux[row] > reversal:
            if rising or high > 0:
                found.append(high)
            rising, low = False, row
        elif rising is not True and flux[row] - flux[low] > reversal:
            if rising is False or low > 0:
                found.append(low)
            rising, high = True, row
    return np.array(found, dtype=np.intp)


def _pole_pairs(turns: Sequence[tuple[Capture, Turn]]) -> Estimate:
    paths = tuple(sorted({c.path for c, _ in turns}))
    cycles = float(np.median([t.cycles for _, t in turns]))
    number = pole_pairs_from(cycles, 1.0).number
    if number is None:
        note = (
            f"{cycles:.3f} electrical cycles a turn, no whole number within "
            f"{POLE_PAIRS_TOLERANCE}; repeat the hand_turn, exactly once around, from rest to rest"
        )
        return not_identifiable("pole_pairs", "1", NAME, note)
    apart = abs(cycles - number)
    note = f"{cycles:.4f} electrical cycles a turn, {apart:.1g} from the whole number"
    return Estimate("pole_pairs", number, "1", "measured", NAME, captures=paths, note=note)


def _flux(
    turns: Sequence[tuple[Capture, Turn]], known: Constants, options: Mapping[str, float]
) -> Estimate:
    """Weighted mean of the channels at 25 degC."""
    captures = tuple(dict.fromkeys(c for c, _ in turns))
    coefficient = known.best("temp_coeff_magnet_1_k")
    alpha = options["alpha_assumed_1_k"] if coefficient is None else coefficient.number
    values, weights, excesses = [], [], []
    notes = []
    for capture, turn in turns:
        column = first_temperature(capture, "magnet", "winding", "case")
        ambient = capture.meta.ambient_degc
        temp = options["temp_assumed_degc"] if ambient is None else ambient
        if column is not None:
            temp = float(np.nanmean(capture.arrays(column)[column]))
        excesses.append(temp - 25.0)
        values.append(turn.psi_wb / (1.0 + alpha * (temp - 25.0)))
        weights.append(1.0 / max(turn.u_psi_wb, 1e-12) ** 2)
    if all(first_temperature(c, "magnet") is None for c in captures):
        notes.append("magnets taken at ambient, no temp_magnet_degc")
    share = np.array(weights) / np.sum(weights)
    value = float(share @ np.array(values))
    u = math.sqrt(1.0 / float(np.sum(weights)))
    if len(values) > 1:
        spread = float(share @ (np.array(values) - value) ** 2) / (len(values) - 1)
        u = max(u, math.sqrt(spread))
    excess = float(share @ np.array(excesses))
    u_alpha = options["u_alpha_assumed_1_k"] if coefficient is None else coefficient.u
    parts = [
        Contribution(f"scatter:{NAME}:psi", u, "A", float(max(len(values) - 1, 1))),
        Contribution(MAGNET_SOURCE, -value * excess * u_alpha, "B"),
    ]
    for source, gain in instrument_uncertainties(captures, ("voltage",)).items():
        mine = [voltage_source(c.meta) == source for c, _ in turns]
        parts.append(Contribution(source, value * gain * float(share[mine].sum()), "B"))
    for source, offset in instrument_uncertainties(captures, ("temperature",)).items():
        parts.append(Contribution(source, -value * alpha * offset, "B"))
    notes.append(unstated_note(captures, ("voltage", "temperature")))
    return Estimate(
        "psi_pm_wb",
        value,
        "Wb",
        "measured",
        NAME,
        budget_of(parts),
        {"temp_magnet_degc": 25.0, "temp_measured_degc": round(excess + 25.0, 2)},
        tuple(c.path for c in captures),
        "; ".join(n for n in notes if n),
    )


def _evidence(turns: Sequence[tuple[Capture, Turn]]) -> Evidence:
    series = []
    for capture, turn in turns:
        rows = decimated(turn.t_s.size)
        fitted = turn.fitted_wb[rows] if turn.fitted_wb.size else turn.fitted_wb
        label = f"{capture.path} {turn.channel}"
        series.append(Series(label, turn.t_s[rows], turn.flux_wb[rows], fitted))
    return Evidence(
        NAME,
        "Flux linkage over one turn by hand",
        "t_s",
        "psi_pm_wb",
        "line",
        tuple(series),
        caption="Integral of the voltage, phase to star point; each cycle is one pole pair.",
    )


ESTIMATOR = Estimator(
    NAME,
    GIVES,
    ("hand_turn",),
    EXPERIMENT,
    fit_hand_turn,
    uses=("temp_coeff_magnet_1_k",),
    rank=1,
    options={
        "temp_assumed_degc": 25.0,
        "alpha_assumed_1_k": -0.0011,
        "u_alpha_assumed_1_k": 4e-4,
    },
)
