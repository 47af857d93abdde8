"""Ld and Lq from the LCR meter's table over rotor angle, or of three pairs at one angle."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.estimation.electrical.terminals import PAIRS, UNALIGNED
from pipeline.estimation.method import Method, over_x
from pipeline.estimation.policy import policy
from pipeline.estimation.protocol import Estimator, Fit
from pipeline.estimation.uncertainty.instruments import (
    instrument_uncertainties,
    station,
    unstated_note,
)
from pipeline.numerics.least_squares import linear_fit
from pipeline.physics.glossary import Term
from pipeline.physics.windings import PAIR_AXES_RAD, unaligned_inductances_h
from pipeline.records.capture import Array, Campaign, Capture
from pipeline.records.constants import Constants
from pipeline.records.estimate import Estimate
from pipeline.records.evidence import Evidence
from pipeline.records.uncertainty import Contribution

EXPERIMENT = (
    "record an lcr table of lab_h over at least six rotor angles theta_elec_deg across half an "
    "electrical turn, or lab_h, lbc_h and lca_h at one angle"
)
TERMS = (
    Term(
        "r_lcr_ohm", "ohm", "series resistance a to b at the LCR meter's frequency", "constant", 0
    ),
    Term(
        "lcr_angle_offset_deg",
        "deg",
        "where the table's inductance is that of d, less where theta_elec_deg says",
        "constant",
        -90.0,
        90.0,
    ),
)
GIVES = ("ld_h", "lq_h", *(term.name for term in TERMS))
METHOD = Method("lcr", TERMS)


@dataclass(frozen=True, slots=True)
class Table:
    """All readings [n]: capture number, direction of the pair's current, inductance, place.

    `theta_rad` is NaN where the angle is not known; `row` numbers the rotor positions.
    """

    capture: Array
    axis_rad: Array
    l_h: Array
    theta_rad: Array
    row: Array


def inductance(theta_rad: Array, axis_rad: Array) -> Array:
    """The derivatives of the inductance between two terminals by what is fitted.

    Parameters
    ----------
    theta_rad : array [n], rad
        Electrical angle of the rotor, d axis from phase a.
    axis_rad : array [n], rad
        Direction of the current of the pair that was read.

    Returns
    -------
    array [n, 3]
        dL/dm, dL/dA, dL/dB [1].

    Notes
    -----
    L = m + A cos 2(θ - θ_pair) + B sin 2(θ - θ_pair), with m = L_d + L_q and A = L_d - L_q; B is
    0 where the angle is read from the d axis, else atan2(B, A)/2 is by how much it is not.

    References
    ----------
    IEEE Std 1812-2014 (inductance against rotor position, at standstill).

    """
    turn = 2.0 * (theta_rad - axis_rad)
    return np.column_stack([np.ones(turn.size), np.cos(turn), np.sin(turn)])


def fit_lcr(campaign: Campaign, known: Constants, options: Mapping[str, float]) -> Fit:
    """Ld, Lq = (m ± A)/2 by `inductance` of the whole table.

    A and B are free, so that a rotor zero that is off is found instead of shrinking the saliency;
    within its own error of zero it is taken as zero, and A alone is fitted. With angles unknown
    the low inductance is taken as Ld, which holds for interior magnets; the note says so.
    """
    captures = campaign.of("lcr")
    table = _table(captures)
    if np.isfinite(table.theta_rad).sum() >= 6:
        axes = _over_angle(table, options)
    else:
        axes = _at_unknown_angle(table)
    if axes is None:
        return METHOD.nothing(GIVES, EXPERIMENT)
    used = tuple(captures[k] for k in sorted({int(k) for k in table.capture}))
    estimates = {
        name: _estimate(name, read, axes.note, used, options) for name, read in axes.values.items()
    }
    resistance = _resistance(used, options)
    if resistance is not None:
        estimates["r_lcr_ohm"] = resistance
    absent = {
        "r_lcr_ohm": "no rab_ohm in the lcr table",
        "lcr_angle_offset_deg": "needs the table over known rotor angles and a salient rotor",
    }
    reported = tuple(
        estimates.get(n) or METHOD.missing(n, absent.get(n, EXPERIMENT)) for n in GIVES
    )
    return Fit(reported, _evidence(table, axes))


def _table(captures: Sequence[Capture]) -> Table:
    parts: list[list[float]] = []
    for index, capture in enumerate(captures):
        columns = [pair for pair in PAIRS if capture.has(f"l{pair}_h")]
        if not columns:
            continue
        names = [f"l{pair}_h" for pair in columns]
        angled = capture.has("theta_elec_deg")
        data = capture.arrays(*names, *(("theta_elec_deg",) if angled else ()))
        stated = capture.meta.theta_elec_deg
        angle = math.nan if stated is None else stated
        theta = data.get("theta_elec_deg", np.full(data[names[0]].size, angle))
        for pair, name in zip(columns, names, strict=True):
            for row, value in enumerate(data[name]):
                if math.isfinite(value):
                    place = 1e6 * index + row
                    axis = PAIR_AXES_RAD[pair]
                    parts.append([index, axis, value, math.radians(theta[row]), place])
    columns_of = np.array(parts).reshape(-1, 5).T
    return Table(*columns_of)


@dataclass(frozen=True, slots=True)
class Found:
    """Values with scatter and degrees of freedom, and the model [mean, A, B] of the table."""

    values: dict[str, tuple[float, float, float]]
    note: str
    model: Array | None


def _over_angle(table: Table, options: Mapping[str, float]) -> Found | None:
    known = np.isfinite(table.theta_rad)
    design = inductance(table.theta_rad[known], table.axis_rad[known])
    free = linear_fit(design, table.l_h[known])
    if (
        not free.full_rank
        or free.dof < 2
        or np.linalg.cond(design) > policy().meter_table.most_condition
    ):
        return None
    mean, a, b = (float(c) for c in free.coefficients)
    swing, u_swing = math.hypot(a, b), math.sqrt(float(np.trace(free.covariance[1:, 1:])) / 2.0)
    values: dict[str, tuple[float, float, float]] = {}
    note = ""
    shift, u_shift = 0.0, math.inf
    if swing > policy().evidence.sigmas * u_swing:
        # Modulo half a turn of 2 theta: the sign of A decides which axis is the low one.
        shift = 0.5 * math.degrees(math.atan2(b, a) if a > 0.0 else math.atan2(-b, -a))
        u_shift = 0.5 * math.degrees(u_swing / swing)
        values["lcr_angle_offset_deg"] = (shift, u_shift, float(free.dof))
    if abs(shift) > max(3.0 * u_shift, options["least_offset_deg"]):
        signed = math.copysign(swing, a)
        slope = np.array([0.0, a, b]) / signed
        model, fit = np.array([mean, a, b]), free
        note = f"theta_elec_deg is off by {shift:.1f} deg, found from the table itself"
        if abs(shift) > policy().meter_table.exchanged_deg:
            note += "; the axes are distinguished by that zero alone and may be exchanged"
    else:
        fit = linear_fit(design[:, :2], table.l_h[known])
        mean, signed = (float(c) for c in fit.coefficients)
        slope = np.array([0.0, 1.0])
        model = np.array([mean, signed, 0.0])
    level = np.zeros(slope.size)
    level[0] = 1.0
    for name, sign in (("ld_h", 1.0), ("lq_h", -1.0)):
        row = 0.5 * (level + sign * slope)
        u = math.sqrt(max(float(row @ fit.covariance @ row), 0.0))
        values[name] = (0.5 * (mean + sign * signed), u, float(fit.dof))
    return Found(values, note, model)


def _at_unknown_angle(table: Table) -> Found | None:
    """Mean over the rotor positions at which all three pairs were read.

    Where the angle is stated it separates the axes: the low inductance is Lq if its place lies
    nearer to a quarter period from the stated angle than to the angle itself. Where it is not
    stated, the low one is low by its noise as well: a swing that scatters as noise alone does is
    none, and both are their mean, to half of it.
    """
    first, second, has_angle = [], [], []
    for row in np.unique(table.row):
        rows = np.flatnonzero(table.row == row)
        read = {float(table.axis_rad[k]): float(table.l_h[k]) for k in rows}
        if len(read) < 3:
            continue
        low, high, place = unaligned_inductances_h(*(read[PAIR_AXES_RAD[p]] for p in PAIRS))
        theta = float(table.theta_rad[rows[0]])
        exchanged = math.isfinite(theta) and math.cos(2.0 * (theta - place)) < 0.0
        first.append(high if exchanged else low)
        second.append(low if exchanged else high)
        has_angle.append(math.isfinite(theta))
    if not first:
        return None
    values = {}
    unparted = _swing_of_noise(np.array(second) - np.array(first)) and not any(has_angle)
    means = 0.5 * (np.array(first) + np.array(second))
    for name, reading in (("ld_h", first), ("lq_h", second)):
        count = len(reading)
        scatter = float(np.std(reading, ddof=1)) / math.sqrt(count) if count > 1 else 0.0
        values[name] = (float(np.mean(reading)), scatter, float(max(count - 1, 1)))
        if unparted:
            spread = float(np.std(means, ddof=1)) / math.sqrt(count)
            half = abs(float(np.mean(reading) - np.mean(means)))
            values[name] = (float(np.mean(means)), math.hypot(spread, half), float(count - 1))
    note = ""
    if unparted:
        note = "the three pairs differ by noise alone: Ld and Lq cannot be distinguished"
    elif not all(has_angle):
        note = UNALIGNED
    if len(first) == 1:
        note = "; ".join(n for n in (note, "one position: scatter unknown") if n)
    return Found(values, note, None)


def _swing_of_noise(swing_h: Array) -> bool:
    """Whether swings Lq - Ld [n, H] of several positions may be those of equal inductances.

    Noise alone has the length of a vector of two components, whose mean is 1.9 of its standard
    deviations (Rayleigh's distribution); a swing that is there lies further off.
    """
    if swing_h.size < 2:
        return False
    return bool(np.mean(swing_h) < policy().evidence.sigmas * np.std(swing_h, ddof=1))


def _estimate(
    name: str,
    read: tuple[float, float, float],
    note: str,
    used: Sequence[Capture],
    options: Mapping[str, float],
) -> Estimate:
    """The estimate of a value read with its scatter and degrees of freedom.

    What one reading scatters is not known: no more than the meter's gain may be off.
    """
    value, u, dof = read
    parts = [METHOD.scatter(name, u, dof)]
    words = [note]
    if METHOD.unit(name) != "deg":
        gain, unstated = _gain(used, options)
        parts.append(Contribution(f"lcr@{station(used[0].meta)}", gain * abs(value), "B"))
        if u == 0.0:
            parts.append(Contribution(f"assumed:one_reading:{name}", gain * abs(value), "B"))
        words.append(unstated)
    frequencies = [
        float(np.nanmean(c.arrays("freq_hz")["freq_hz"])) for c in used if c.has("freq_hz")
    ]
    at: dict[str, float | int | str] = {"current_a": 0.0}
    if frequencies:
        at["freq_hz"] = float(np.mean(frequencies))
    return METHOD.measured(name, value, parts, used, at, words)


def _gain(used: Sequence[Capture], options: Mapping[str, float]) -> tuple[float, str]:
    """The meter's relative standard uncertainty, and in words where no capture states it.

    A meter that does not state its own (`u_rel_lcr`) is a voltage over a current; the option of
    that name replaces this where it is not 0.
    """
    for capture in used:
        if (stated := capture.meta.stated_u_rel("u_rel_lcr")) is not None:
            return stated, ""
    gains = instrument_uncertainties(used, ("voltage", "current"))
    gain = options["u_rel_lcr"] or math.hypot(*gains.values())
    unstated = "" if options["u_rel_lcr"] else unstated_note(used, ("voltage", "current"))
    return gain, "; ".join(w for w in (f"u_rel_lcr not stated, taken as {gain:.2g}", unstated) if w)


def _resistance(used: Sequence[Capture], options: Mapping[str, float]) -> Estimate | None:
    readings = [
        column[np.isfinite(column)]
        for column in (c.arrays("rab_ohm")["rab_ohm"] for c in used if c.has("rab_ohm"))
    ]
    values = np.concatenate(readings) if readings else np.zeros(0)
    if values.size < 2:
        return None
    u = float(values.std(ddof=1)) / math.sqrt(values.size)
    note = "at the meter's frequency and the winding's temperature of the day"
    mean = float(values.mean())
    return _estimate("r_lcr_ohm", (mean, u, float(values.size - 1)), note, used, options)


def _evidence(table: Table, result: Found) -> tuple[Evidence, ...]:
    if result.model is None:
        return ()
    series = []
    for pair in PAIRS:
        rows = (table.axis_rad == PAIR_AXES_RAD[pair]) & np.isfinite(table.theta_rad)
        if not rows.any():
            continue
        theta = table.theta_rad[rows]
        fitted = inductance(theta, table.axis_rad[rows]) @ result.model
        series.append(over_x(pair, np.degrees(theta), table.l_h[rows], fitted))
    title = "Inductance between the terminals against rotor angle"
    axes, caption = ("theta_elec_deg", "inductance_ll_h"), "Mean is Ld + Lq, swing Ld - Lq."
    return (METHOD.plot(title, axes, "scatter", series, caption),)


ESTIMATOR = Estimator(
    METHOD.name,
    GIVES,
    ("lcr",),
    EXPERIMENT,
    fit_lcr,
    rank=1,
    terms=TERMS,
    options={"u_rel_lcr": 0.0, "least_offset_deg": 0.5},
)
