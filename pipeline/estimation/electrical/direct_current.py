"""Settled direct-current plateaus of all captures of one motor, and how far they warm it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.estimation.electrical.step_record import integrated_form
from pipeline.estimation.electrical.terminals import (
    bridged,
    first_temperature,
    pair_of,
    pair_signals,
)
from pipeline.estimation.policy import policy
from pipeline.estimation.uncertainty.instruments import (
    Shift,
    current_source,
    instrument_uncertainties,
    temperature_source,
    voltage_source,
)
from pipeline.numerics.integrals import trapezoid
from pipeline.numerics.least_squares import autocorrelation_time, linear_fit
from pipeline.numerics.plateaus import Plateau, find_plateaus
from pipeline.numerics.quantisation import (
    EXACT,
    Rounding,
    noise_after_rounding,
    noise_before_rounding,
    resolution,
    rounded_column,
    rounding_rms,
)
from pipeline.physics.copper import COPPER_COEFFICIENT_25_1_K
from pipeline.physics.glossary import OHMMETER, of_ohmmeter
from pipeline.records.capture import Array, Campaign, Capture, CaptureMeta

TEST = "resistance"
STEP = "current_step"
UNLOGGED = "assumed:temp_winding_degc"
WARMED = "assumed:winding_warmed"
POINT_OPTIONS = {"zero_crossing": 0.03, "temp_assumed_degc": 25.0}


@dataclass(frozen=True, slots=True)
class Point:
    """Means over one settled plateau of current.

    Attributes
    ----------
    capture
        Index among the resistance captures of the campaign.
    pair
        Terminals that the current flows through.
    v_v, i_a
        Mean voltage and current of the pair [V, A].
    temp_degc
        Mean winding temperature.
    u_v, u_i
        Standard errors of the means by noise, correlation included [V, A].
    rounded_v, rounded_i
        What rounding leaves in the means [V, A].
    meta
        Metadata of the capture.
    temp_logged
        Whether the temperature was recorded and not assumed.
    u_temp_k
        Standard error of the mean temperature by noise and rounding; 0 where it was not logged.
    warming
        How far the resistance of this pair rises within its capture [1], where the temperature was
        not logged.

    """

    capture: int
    pair: str
    v_v: float
    i_a: float
    temp_degc: float
    u_v: float
    u_i: float
    meta: CaptureMeta
    temp_logged: bool = True
    u_temp_k: float = 0.0
    warming: float = 0.0
    rounded_v: Rounding = EXACT
    rounded_i: Rounding = EXACT

    @property
    def temperature_source(self) -> str:
        """The source of the error of its temperature: a thermometer, or what stands in for one.

        That is one error in all captures without, as far as the winding stays as warm as it is.
        """
        return temperature_source(self.meta) if self.temp_logged else UNLOGGED

    @property
    def warming_source(self) -> str:
        """The source of the error by what the winding warmed unlogged, the capture's own."""
        return f"{WARMED}:{self.capture}"


def direct_current_points(
    campaign: Campaign, options: Mapping[str, float]
) -> tuple[list[Point], list[str]]:
    """The plateaus of all resistance captures, and what had to be assumed about them.

    Where there are none, the ends of current steps stand in for them: V/I once the current settles.

    Plateaus below `zero_crossing` times the largest current of all are left out: the sign of their
    current, and what an inverter adds there, is in doubt. Temperature is the plateau's own, else
    the capture's ambient, else `temp_assumed_degc`.

    Parameters
    ----------
    campaign
        All captures of one motor.
    options
        `zero_crossing` [1], of the largest current, and `temp_assumed_degc` [degC].

    Returns
    -------
    points : list of Point
        Means [V, A, degC] with standard errors.
    notes : list of str
        What had to be assumed.

    """
    points: list[Point] = []
    notes: list[str] = []
    temp_assumed_degc = options["temp_assumed_degc"]
    for index, capture in enumerate(_captures(campaign)):
        ambient = capture.meta.ambient_degc
        temp_degc = temp_assumed_degc if ambient is None else ambient
        meter = of_ohmmeter(capture.meta.test, capture.columns)
        pair = pair_of(capture)
        if not meter and pair is None:
            notes.append(f"{capture.path}: which terminal pair is not stated")
            continue
        if first_temperature(capture, "winding") is None:
            about = f"ambient ± {policy().magnet.unlogged_k:g} K"
            notes.append(f"{capture.path}: no temp_winding_degc, taken at {about}")
        if pair is None or meter:
            points += _of_ohmmeter(capture, index, temp_degc)
            continue
        try:
            points += _points_of(capture, index, pair, temp_degc)
        except KeyError:
            notes.append(f"{capture.path}: no voltage and current of pair {pair}")
    largest = max((abs(p.i_a) for p in points), default=0.0)
    return [p for p in points if abs(p.i_a) > options["zero_crossing"] * largest], notes


def _of_ohmmeter(capture: Capture, index: int, temp_degc: float) -> Iterator[Point]:
    """The readings of an ohmmeter, as voltages at one ampere.

    Their noise is what they scatter; the meter's gain is that of a voltage over a current.
    """
    logged = first_temperature(capture, "winding") is not None
    for column in (name for name in OHMMETER if capture.has(name)):
        names = (column, "temp_winding_degc") if logged else (column,)
        ohms, *temps = capture.finite(*names).values()
        degcs = temps[0] if temps else np.full(ohms.size, temp_degc)
        u_ohm = _scatter_ohm(ohms, degcs)
        for ohm, degc in zip(ohms, degcs, strict=True):
            means = float(ohm), 1.0, float(degc)
            yield Point(index, column[1:3], *means, u_ohm, 0.0, capture.meta, logged)


def _scatter_ohm(ohms: Array, degcs: Array) -> float:
    """Standard deviation of readings about a line against temperature; of two or three, which a
    line would follow, about copper's.
    """
    excess = degcs - 25.0
    if ohms.size > 3:
        fit = linear_fit(np.column_stack([np.ones(ohms.size), excess]), ohms)
        return math.sqrt(float(fit.residuals @ fit.residuals) / fit.dof)
    factor = 1.0 + COPPER_COEFFICIENT_25_1_K * excess
    return float(np.std(ohms / factor, ddof=1) * factor.mean()) if ohms.size > 1 else 0.0


def captures_of(campaign: Campaign, points: Sequence[Point]) -> tuple[Capture, ...]:
    """The captures that some points came from, in the order of their paths.

    Parameters
    ----------
    campaign
        The captures of the motor.
    points
        Points of `direct_current_points` on the same campaign.

    """
    captures = _captures(campaign)
    return tuple(captures[k] for k in sorted({p.capture for p in points}))


def _points_of(capture: Capture, index: int, pair: str, temp_degc: float) -> Iterator[Point]:
    column = first_temperature(capture, "winding")
    columns = pair_signals(capture, pair, *((column,) if column else ()))
    temps = np.full(columns["t_s"].size, temp_degc)
    logged = column is not None and bool(np.isfinite(columns[column]).any())
    readings = temps
    if column is not None and logged:
        readings = capture.arrays(column)[column]
        temps = bridged(columns["t_s"], columns[column])
    settled = _settled(capture, columns["i_a"])
    levels = [plateau.rows for plateau in settled]
    volts, amperes = (rounded_column(columns[name], levels) for name in ("v_v", "i_a"))
    warmed = 0.0 if logged or capture.meta.test == STEP else warming(columns, settled)
    for plateau in settled:
        v, i = columns["v_v"][plateau.rows], columns["i_a"][plateau.rows]
        temp = float(temps[plateau.rows].mean())
        errors = (_standard_error(v), _standard_error(i))
        rising = _rising_v(columns, plateau.rows) if capture.meta.test == STEP else 0.0
        if rising is None:
            continue
        means = (float(v.mean()) - rising, float(i.mean()))
        errors = (math.hypot(errors[0], rising / math.sqrt(3.0)), errors[1])
        u_temp_k = _error_of_temperature(readings, plateau.size / temps.size) if logged else 0.0
        left_v, left_a = (one.error_of_mean(plateau.rows) for one in (volts, amperes))
        made = Point(index, pair, *means, temp, *errors, capture.meta, logged, u_temp_k, warmed)
        yield replace(made, rounded_v=left_v, rounded_i=left_a)


def _captures(campaign: Campaign) -> tuple[Capture, ...]:
    """The resistance captures; where there are none, current steps with measured voltages: of a
    commanded one, what the inverter drops would be taken for resistance.
    """
    steps = (c for c in campaign.of(STEP) if c.meta.voltage_kind != "commanded")
    return tuple(campaign.of(TEST)) or tuple(steps)


def _settled(capture: Capture, i_a: Array) -> Sequence[Plateau]:
    """The plateaus of a current; of a step the one of most current, as others may be on its way."""
    plateaus = find_plateaus(i_a)
    if capture.meta.test != STEP or not plateaus:
        return plateaus
    return (max(plateaus, key=lambda plateau: abs(float(i_a[plateau.rows].mean()))),)


def _rising_v(columns: Mapping[str, Array], rows: slice) -> float | None:
    """L Δi/Δt [V] over a plateau of a step whose current still rises. Where L is unknown, as of a
    rise within one sample: zero of a current that is level within 3 u, else None.

    Iron that saturates has less than the L of the whole step: a uniform doubt, up to all of it.
    """
    t, v, i = (columns[name] for name in ("t_s", "v_v", "i_a"))
    form = integrated_form(t, v, i)
    ends = linear_fit(np.column_stack([t[rows] - t[rows].mean(), np.ones(t[rows].size)]), i[rows])
    slope_a_s = float(ends.coefficients[0])
    if form is None:
        return 0.0 if abs(slope_a_s) <= 3.0 * ends.u(0) else None
    return abs(form[0]) * slope_a_s


def uncertainties_of(points: Sequence[Point], captures: Sequence[Capture]) -> dict[str, float]:
    """Standard uncertainty of each source of `shifted`.

    Between captures without a thermometer the winding may be as warm as all others together made
    it, or have cooled again: uniform (GUM 4.3.7) over what their currents warm it within them.

    Parameters
    ----------
    points
        The points of a fit.
    captures
        The captures that they came from.

    Returns
    -------
    dict
        By source: relative for gains [1], absolute for temperatures [K].

    """
    u_rel = instrument_uncertainties(captures)
    if any(not point.temp_logged for point in points):
        u_rel[UNLOGGED] = policy().magnet.unlogged_k
    warmed = {p.warming_source: p.warming for p in points if p.warming > 0.0}
    kelvin = sum(warmed.values()) / COPPER_COEFFICIENT_25_1_K
    u_rel |= dict.fromkeys(warmed, kelvin / math.sqrt(12.0))
    return u_rel


def _standard_error(samples: Array) -> float:
    scatter = float(samples.std(ddof=1))
    return scatter * math.sqrt(autocorrelation_time(samples) / samples.size)


def _error_of_temperature(readings: Array, share: float) -> float:
    """Standard error [K] of the mean temperature over a share [1] of the capture, by the noise and
    the steps of the thermometer's own readings: a slow one has a part of a reading there.
    """
    step = resolution(readings)
    noise = noise_after_rounding(readings, step)
    rounding = rounding_rms(step, noise_before_rounding(noise, step))
    return math.hypot(noise / math.sqrt(share * np.isfinite(readings).sum()), rounding)


def shifted(points: Sequence[Point], shift: Shift) -> list[Point]:
    """The points as read by instruments that are off by `shift`.

    Parameters
    ----------
    points
        Plateaus as read.
    shift
        By source: gains of voltage and current [1, relative], offsets of thermometers [K].

    """
    return [
        replace(
            p,
            v_v=p.v_v * (1.0 + shift.get(voltage_source(p.meta), 0.0)),
            i_a=p.i_a * (1.0 + shift.get(current_source(p.meta), 0.0)),
            temp_degc=p.temp_degc
            + shift.get(p.temperature_source, 0.0)
            + shift.get(p.warming_source, 0.0),
        )
        for p in points
    ]


def warming(columns: Mapping[str, Array], plateaus: Sequence[Plateau]) -> float:
    """The rise of resistance within a capture, relative to its start [1].

    Parameters
    ----------
    columns
        `t_s`, `v_v` and `i_a` [n] of a terminal pair.
    plateaus
        Settled stretches of the current.

    Returns
    -------
    float
        With its standard uncertainty added in quadrature; 0 where the plateaus do not part it from
        resistance and offsets.

    Notes
    -----
    V = V_off + V_0 sign(I) + R (1 + g E) I, dE/dt = I² - E/τ: a body of one heat capacity, which
    the current heats, E = 0 at the start. Of a few τ, shares of the capture's length, the one that
    leaves least counts. A thermometer is not asked.

    References
    ----------
    Incropera, DeWitt, Bergman and Lavine, Fundamentals of Heat and Mass Transfer, 6th ed., 5.1
    (lumped capacitance).

    """
    how = policy().self_heating
    shares = [np.inf, *(how.cooling_step**-k for k in range(how.cooling_times))]
    t, current = columns["t_s"], columns["i_a"]
    rows = [part for plateau in plateaus for part in np.array_split(_rows_of(plateau), how.parts)]
    rows = [part for part in rows if part.size]
    volts, amps = (np.array([float(columns[n][p].mean()) for p in rows]) for n in ("v_v", "i_a"))
    weights = 1.0 / np.sqrt([float(part.size) for part in rows])
    best, rise = np.inf, 0.0
    for share in shares:
        heat = _heat(t, current**2, share * float(t[-1] - t[0]))
        over = np.array([float(heat[part].mean()) for part in rows])
        design = np.column_stack([amps, amps * over])
        for column in (np.sign(amps), np.ones(amps.size)):
            wider = np.column_stack([design, column])
            design = wider if linear_fit(wider, volts).full_rank else design
        fit = linear_fit(design, volts, weights)
        left = float(np.sum((fit.residuals / weights) ** 2))
        if fit.full_rank and fit.dof > 0 and left < best:
            size = float(heat.max()) / float(fit.coefficients[0])
            found, u = fit.coefficients[1] * size, fit.u(1) * fit.chi2_dof**0.5 * size
            best, rise = left, float(np.hypot(max(float(found), 0.0), u))
    return rise


def _rows_of(plateau: Plateau) -> Array:
    return np.arange(plateau.rows.start, plateau.rows.stop)


def _heat(t_s: Array, power: Array, tau_s: float) -> Array:
    """E [n] of dE/dt = power - E/τ."""
    if not np.isfinite(tau_s):
        return trapezoid(t_s, power)
    place = (t_s - t_s[0]) / tau_s
    return trapezoid(t_s, power * np.exp(place)) * np.exp(-place)
