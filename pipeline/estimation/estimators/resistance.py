"""Resistance of each terminal pair from settled direct-current plateaus, at 25 degC."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from pipeline.estimation.electrical.direct_current import (
    COPPER_SOURCE,
    POINT_OPTIONS,
    TEST,
    Columns,
    Point,
    captures_of,
    columns_of,
    direct_current_points,
    fit_direct_current,
    shifted,
)
from pipeline.estimation.electrical.terminals import PAIRS
from pipeline.estimation.protocol import Estimator, Fit
from pipeline.estimation.uncertainty.instruments import (
    Shift,
    contributions,
    instrument_uncertainties,
    unstated_note,
    voltage_source,
)
from pipeline.estimation.uncertainty.measured import measured
from pipeline.physics.conventions import phase_from_line, phase_resistances_ohm
from pipeline.physics.glossary import Term
from pipeline.records.capture import Campaign, Capture
from pipeline.records.constants import Constants
from pipeline.records.estimate import Estimate, not_identifiable
from pipeline.records.evidence import Evidence, Series
from pipeline.records.uncertainty import Contribution

NAME = "resistance"
EXPERIMENT = (
    "record a resistance capture a terminal pair: settled direct-current plateaus of both signs "
    "and at least two levels, with temp_winding_degc"
)
RANGE_OF_THREE = 3.314 / (1.960 * math.sqrt(2.0))
Array = NDArray[np.float64]

TERMS = (
    *(
        Term(f"r_{p}_ohm", "ohm", f"between terminals {p[0]} and {p[1]}, at 25 degC", "constant", 0)
        for p in PAIRS
    ),
    *(
        Term(
            f"r_{p}_ohm",
            "ohm",
            f"wye-equivalent resistance of phase {p}, at 25 degC",
            "constant",
            0,
        )
        for p in "abc"
    ),
    Term("voltage_offset_v", "V", "part of the terminal voltage that follows sign(I)", "constant"),
)
GIVES = (
    "r_phase_ohm",
    "r_ll_ohm",
    "resistance_imbalance",
    *(term.name for term in TERMS),
)
UNITS = {"resistance_imbalance": "1", "voltage_offset_v": "V"}


def _results(columns: Columns, r_pairs: Array) -> dict[str, float]:
    """The published resistances from those of the measured pairs [k]."""
    by_pair = dict(zip(columns.pairs, (float(r) for r in r_pairs), strict=True))
    r_ll = float(np.mean(r_pairs))
    results = {"r_phase_ohm": phase_from_line(r_ll), "r_ll_ohm": r_ll}
    results |= {f"r_{pair}_ohm": r for pair, r in by_pair.items()}
    if len(by_pair) == 3:
        phases = phase_resistances_ohm(by_pair["ab"], by_pair["bc"], by_pair["ca"])
        results |= {f"r_{name}_ohm": r for name, r in phases._asdict().items()}
    return results


def fit_resistance(campaign: Campaign, known: Constants, options: Mapping[str, float]) -> Fit:
    """R of each pair by the plateaus of all captures at once, brought to 25 degC by copper's law.

    R(T) = R25 (234.5 + T)/(234.5 + 25), IEEE Std 112-2017. The published values are linear in the
    pairs' (conventions.phase_resistances_ohm), and so is their scatter.
    """
    del known
    points, notes = direct_current_points(campaign, options)
    if not points:
        return Fit(_missing(f"no settled plateau with current; {EXPERIMENT}"))
    columns = columns_of(points)
    fit = fit_direct_current(points, columns, options["u_rel_copper"])
    if not fit.full_rank:
        return Fit(_missing(f"the plateaus do not part R from the offset; {EXPERIMENT}"))
    used = captures_of(campaign, points)
    size = len(columns.pairs)
    names = tuple(_results(columns, fit.coefficients[:size]))

    def published(coefficients: Array) -> Array:
        values = list(_results(columns, coefficients[:size]).values())
        if columns.drops:
            values.append(float(np.mean(coefficients[columns.drop_start :])))
        return np.array(values)

    def evaluate(shift: Shift) -> Array:
        alpha_rel = shift.get(COPPER_SOURCE, 0.0)
        moved = fit_direct_current(
            shifted(points, shift), columns, options["u_rel_copper"], alpha_rel
        )
        return published(moved.coefficients)

    uncertainties = instrument_uncertainties(used) | {COPPER_SOURCE: options["u_rel_copper"]}
    shared = contributions(evaluate, uncertainties)
    matrix = np.column_stack([published(row) for row in np.eye(columns.size)])
    covariance = matrix @ fit.covariance @ matrix.T
    values = published(fit.coefficients)
    if columns.drops:
        names += ("voltage_offset_v",)
    allowances = _allowances(points, columns, names, matrix, options)
    notes.append(unstated_note(used))
    estimates = {}
    for k, name in enumerate(names):
        u = math.sqrt(max(float(covariance[k, k]), 0.0))
        parts = [Contribution(f"scatter:{NAME}:{name}", u, "A", fit.dof), *shared[k]]
        parts += allowances[name]
        estimates[name] = _estimate(name, float(values[k]), parts, points, used, notes)
    if size == 3:
        estimates["resistance_imbalance"] = _imbalance(
            names, values, covariance, fit.dof, points, used
        )
    return Fit(
        tuple(estimates.get(n) or _absent(n) for n in GIVES), (_evidence(points, fit.residuals),)
    )


def _allowances(
    points: Sequence[Point],
    columns: Columns,
    names: Sequence[str],
    matrix: Array,
    options: Mapping[str, float],
) -> dict[str, list[Contribution]]:
    """Type B allowances for what the captures cannot tell: V0 and the pairs not measured.

    `matrix` [names, columns] holds the published values' shares of the pairs. V0 is that of one
    inverter and one set of leads, so what it adds to the pairs adds up in what is made of them.
    """
    found: dict[str, list[Contribution]] = {name: [] for name in names}
    if len(columns.pairs) < 3:
        r_scale = float(np.mean([abs(p.v_v / p.i_a) for p in points]))
        for name, share in (("r_phase_ohm", 0.5), ("r_ll_ohm", 1.0)):
            u = share * r_scale * options["u_rel_imbalance"]
            found[name].append(Contribution("assumed:resistance_imbalance", u, "B"))
    drops = np.array([_unknown_drop_ohm(points, columns, pair, options) for pair in columns.pairs])
    for name, shares in zip(names, matrix[:, : drops.size], strict=True):
        if u := float(shares @ drops):
            found[name].append(Contribution("assumed:voltage_offset_v", u, "B"))
    return found


def _unknown_drop_ohm(
    points: Sequence[Point], columns: Columns, pair: str, options: Mapping[str, float]
) -> float:
    """What a V0 that was not fitted may add to the resistance of a pair, 0 where it was."""
    own = [p for p in points if p.pair == pair]
    blind = [p for p in own if voltage_source(p.meta) not in columns.drops]
    if not blind:
        return 0.0
    commanded = any(p.meta.voltage_kind == "commanded" for p in blind)
    drop_v = options["drop_commanded_v" if commanded else "drop_measured_v"]
    return drop_v / max(abs(p.i_a) for p in own)


def _estimate(
    name: str,
    value: float,
    parts: Sequence[Contribution],
    points: Sequence[Point],
    captures: Sequence[Capture],
    notes: Sequence[str],
) -> Estimate:
    at = {
        "temp_winding_degc": 25.0,
        "current_a": max(abs(p.i_a) for p in points),
        "temp_measured_degc": round(float(np.mean([p.temp_degc for p in points])), 3),
    }
    return measured(NAME, name, UNITS.get(name, "ohm"), value, parts, captures, at, notes)


def _imbalance(
    names: Sequence[str],
    values: Array,
    covariance: Array,
    dof: float,
    points: Sequence[Point],
    captures: Sequence[Capture],
) -> Estimate:
    """(max - min)/mean of the phases; the gains cancel, the scatter of the two extremes stays.

    The range of three equal phases exceeds 3.31 of their standard deviations in 5 % of cases, a
    given pair's difference 2.77: their ratio widens u (studentized range, Tukey 1949).
    """
    rows = [names.index(f"r_{phase}_ohm") for phase in "abc"]
    phases = values[rows]
    mean = float(phases.mean())
    top, low = rows[int(phases.argmax())], rows[int(phases.argmin())]
    spread = covariance[top, top] + covariance[low, low] - 2.0 * covariance[top, low]
    u = RANGE_OF_THREE * math.sqrt(max(float(spread), 0.0)) / mean
    part = Contribution(f"scatter:{NAME}:resistance_imbalance", u, "A", dof)
    value = float(np.ptp(phases)) / mean
    note = "read high by chance where the phases differ by less than u"
    return _estimate("resistance_imbalance", value, [part], points, captures, [note])


def _absent(name: str) -> Estimate:
    why = {
        "voltage_offset_v": "needs plateaus of two levels of |I| in one capture",
        "resistance_imbalance": "needs a resistance capture on each of the pairs ab, bc and ca",
    }
    return not_identifiable(
        name, UNITS.get(name, "ohm"), NAME, why.get(name, f"pair not measured; {EXPERIMENT}")
    )


def _missing(note: str) -> tuple[Estimate, ...]:
    return tuple(not_identifiable(n, UNITS.get(n, "ohm"), NAME, note) for n in GIVES)


def _evidence(points: Sequence[Point], residuals: Array) -> Evidence:
    series = []
    for pair in sorted({p.pair for p in points}):
        rows = [k for k, p in enumerate(points) if p.pair == pair]
        rows.sort(key=lambda k: points[k].i_a)
        x = np.array([points[k].i_a for k in rows])
        y = np.array([points[k].v_v for k in rows])
        series.append(Series(pair, x, y, y - residuals[rows]))
    return Evidence(
        NAME,
        "Terminal voltage against current",
        "current_a",
        "voltage_v",
        "scatter",
        tuple(series),
        caption="Means over settled plateaus; R is the slope, the zero crossing is left out.",
    )


ESTIMATOR = Estimator(
    NAME,
    GIVES,
    (TEST,),
    EXPERIMENT,
    fit_resistance,
    terms=TERMS,
    options={
        **POINT_OPTIONS,
        "u_rel_copper": 0.01,
        "u_rel_imbalance": 0.005,
        "drop_measured_v": 0.0005,
        "drop_commanded_v": 0.3,
    },
)
