"""The page of one motor: may I use it, what are its constants, and why should I believe them."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

from pipeline.physics.glossary import Term
from pipeline.physics.notation import MINUS, Reading, plain, quantity, reading, significant
from pipeline.records.current_status import current_status
from pipeline.records.datasheet import Check, Datasheet
from pipeline.records.estimate import Estimate
from pipeline.records.evidence import Evidence
from pipeline.records.finding import Finding
from pipeline.records.uncertainty import covariance
from pipeline.report.chart import chart
from pipeline.report.page import render
from pipeline.report.status_block import status_block
from pipeline.views.conditions import conditions
from pipeline.views.constants import GROUPS, KEY_CONSTANTS, constant_words, grouped, symbol
from pipeline.views.model_words import model_words

NEGLIGIBLE = 1e-3
CHECK_ORDER = ("fail", "marginal", "not_evaluated", "pass")


@dataclass(frozen=True, slots=True)
class Alternative:
    """The same constant by another method, and how far it lies from the published one."""

    method: str
    reading: Reading
    difference: str


@dataclass(frozen=True, slots=True)
class Row:
    """One constant of the table, every text ready to be shown."""

    name: str
    symbol: tuple[str, str]
    words: str
    estimate: Estimate
    reading: Reading | None
    relative: str
    u_a: str
    u_b: str
    dof: str
    at: str
    alternatives: tuple[Alternative, ...]


@dataclass(frozen=True, slots=True)
class Figure:
    """One evidence with its drawing."""

    estimator: str
    title: str
    caption: str
    capture: str | None
    svg: str


def render_motor(
    datasheet: Datasheet,
    evidence: tuple[Evidence, ...],
    findings: tuple[Finding, ...],
    own: Mapping[str, Term] | None = None,
) -> str:
    """The self-contained HTML page of one motor; equal input gives equal text.

    Its status is what the datasheet says of itself, until `status_block.with_status`.
    `own` are the terms of constants that the glossary does not know, by name.
    """
    words = {name: constant_words(name, own) for name in sorted(datasheet.constants)}
    rows = {name: _row(name, words[name], datasheet) for name in words}
    figures = _figures(datasheet.constants, evidence)
    counts: Counter[str] = Counter(check.status for check in datasheet.checks)
    return render(
        "motor.html.jinja",
        sheet=datasheet,
        status=status_block(datasheet, current_status(datasheet)),
        key_rows=[rows[n] for n in KEY_CONSTANTS if n in rows and rows[n].reading],
        groups=[(title, [rows[n] for n in names]) for title, names in grouped(rows)],
        checks=_ordered(datasheet.checks),
        doubted=counts["fail"] + counts["marginal"],
        check_counts=[(status, counts[status]) for status in CHECK_ORDER if counts[status]],
        check_number=check_number,
        model=model_words(datasheet.model, datasheet.motor_id),
        findings=sorted(findings),
        figures=figures,
        drawn={figure.estimator for figure in figures},
    )


def check_number(value: float | None, unit: str, digits: int = 5) -> str:
    """A number of a check with its unit; a dash where it was not evaluated."""
    if value is None:
        return "–"
    return plain(value, digits) if unit == "1" else quantity(value, unit)


def _row(name: str, words: str, datasheet: Datasheet) -> Row:
    estimate = datasheet.constants[name]
    others = tuple(_alternative(e, estimate) for e in datasheet.alternatives if e.name == name)
    shown = reading(estimate.number, estimate.u, estimate.unit) if estimate.known else None
    return Row(
        name=name,
        symbol=symbol(name),
        words=words,
        estimate=estimate,
        reading=shown,
        relative=_relative(estimate),
        u_a=_in_scale(estimate.u_a, estimate.u, shown),
        u_b=_in_scale(estimate.u_b, estimate.u, shown),
        dof=_dof(estimate),
        at=conditions(estimate.at),
        alternatives=tuple(sorted(others, key=lambda other: other.method)),
    )


def _alternative(other: Estimate, chosen: Estimate) -> Alternative:
    shown = reading(other.number, other.u, other.unit)
    difference = ""
    if chosen.known and chosen.number != 0.0:
        delta = other.number - chosen.number
        spread = other.u**2 + chosen.u**2 - 2.0 * covariance(other.budget, chosen.budget)
        difference = f"{_percent(delta / abs(chosen.number))} apart"
        if spread > 0.0:
            difference += f", {abs(delta) / math.sqrt(spread):.1f} u of the difference"
    return Alternative(other.method, shown, difference)


def _percent(share: float) -> str:
    text = f"{100.0 * share:+.2g}" if abs(share) < 0.1 else f"{100.0 * share:+.0f}"
    return f"{text.replace('-', MINUS)} %"


def _in_scale(u: float, total: float, shown: Reading | None) -> str:
    """A part of the standard uncertainty in the unit that the value is shown in, two digits."""
    if shown is None or not shown.expanded:
        return ""
    return significant(u / 10.0**shown.exponent, 2) if u >= NEGLIGIBLE * total else "≈ 0"


def _relative(estimate: Estimate) -> str:
    if not estimate.known or estimate.number == 0.0 or estimate.u == 0.0:
        return ""
    return f"{significant(200.0 * estimate.u / abs(estimate.number), 2)} %"


def _dof(estimate: Estimate) -> str:
    if not estimate.known or estimate.u == 0.0:
        return ""
    return f"{estimate.dof:.0f}" if estimate.dof < 1e4 else "∞"


def _ordered(checks: tuple[Check, ...]) -> list[Check]:
    return sorted(checks, key=lambda check: (CHECK_ORDER.index(check.status), check.name))


def _figures(constants: Mapping[str, Estimate], evidence: tuple[Evidence, ...]) -> list[Figure]:
    """Figures, each estimator's together, in the order in which their constants stand."""
    order = [name for names in GROUPS.values() for name in names]
    first: dict[str, int] = {}
    for place, name in enumerate(order):
        if name in constants:
            first.setdefault(constants[name].method, place)
    place_of = {one.estimator: first.get(one.estimator, len(order)) for one in evidence}
    ordered = sorted(evidence, key=lambda e: (place_of[e.estimator], e.estimator))
    return [
        Figure(one.estimator, one.title, one.caption, one.capture, chart(one)) for one in ordered
    ]
