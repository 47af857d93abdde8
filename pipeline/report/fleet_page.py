"""The first page: every motor with its status and key constants, lots beside each other."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import median
from urllib.parse import quote

from pipeline.physics.notation import Reading, Scale, reading, scale_for
from pipeline.records.current_status import CurrentStatus, current_status
from pipeline.records.datasheet import Datasheet
from pipeline.records.estimate import Estimate
from pipeline.records.finding import Finding
from pipeline.records.naming import file_stem
from pipeline.report.page import render
from pipeline.report.status_text import status_lines
from pipeline.report.strip import Dot, strip_plot
from pipeline.views.constants import KEY_CONSTANTS, constant_words, symbol
from pipeline.views.model_words import ModelWords, model_words

STATUS_ORDER = ("refused", "revoked", "provisional", "released")
NO_LOT = "no lot"
NO_TYPE = "type not stated"


@dataclass(frozen=True, slots=True)
class Column:
    """One constant across all motors, on one scale."""

    name: str
    symbol: tuple[str, str]
    words: str
    unit: str


@dataclass(frozen=True, slots=True)
class Cell:
    """One constant of one motor; `reading` is None where it has no value."""

    reading: Reading | None
    sort: str


@dataclass(frozen=True, slots=True)
class MotorRow:
    """One line of the fleet table."""

    sheet: Datasheet
    current: CurrentStatus
    why: str
    link: str
    failed: tuple[tuple[str, str], ...]
    model: ModelWords
    cells: tuple[Cell, ...]


@dataclass(frozen=True, slots=True)
class Strip:
    """One constant of one motor type, lot by lot."""

    column: Column
    svg: str


def render_fleet(
    datasheets: Sequence[Datasheet],
    findings: Sequence[Finding],
    statuses: Mapping[str, CurrentStatus] | None = None,
) -> str:
    """The self-contained HTML page of all motors; pages of motors lie beside it.

    `statuses` are the current ones, by motor; what a datasheet says of itself without.
    Motors stand in order of their id, whatever order they came in; equal input, equal text.
    """
    sheets = sorted(datasheets, key=lambda sheet: sheet.motor_id)
    now = {s.motor_id: (statuses or {}).get(s.motor_id, current_status(s)) for s in sheets}
    scales = {name: _scale(name, sheets) for name in KEY_CONSTANTS}
    shown = [(name, scale) for name, scale in scales.items() if scale is not None]
    counts: Counter[str] = Counter(current.status for current in now.values())
    ordered = sorted(findings)
    return render(
        "fleet.html.jinja",
        counts=[(status, counts[status]) for status in STATUS_ORDER if counts[status]],
        motors=len(sheets),
        columns=[_column(name, scale) for name, scale in shown],
        rows=[_motor_row(sheet, now[sheet.motor_id], shown) for sheet in sheets],
        types=_strips(sheets, shown, now),
        refused=[f for f in ordered if f.severity == "refused"],
        warnings=[f for f in ordered if f.severity != "refused"],
    )


def page_of(motor_id: str) -> str:
    """The relative link of a motor's page."""
    return f"{quote(file_stem(motor_id), safe='~')}.html"


def _known(name: str, sheets: Sequence[Datasheet]) -> list[Estimate]:
    found = (sheet.constants.get(name) for sheet in sheets)
    return [estimate for estimate in found if estimate is not None and estimate.known]


def _scale(name: str, sheets: Sequence[Datasheet]) -> Scale | None:
    """One power of ten for a constant of all motors; None where no motor has it."""
    known = _known(name, sheets)
    if not known:
        return None
    return scale_for(median(abs(estimate.number) for estimate in known), known[0].unit)


def _column(name: str, scale: Scale) -> Column:
    return Column(name, symbol(name), constant_words(name), scale.unit)


def _motor_row(
    sheet: Datasheet, current: CurrentStatus, shown: Sequence[tuple[str, Scale]]
) -> MotorRow:
    failed = tuple((c.name, c.status) for c in sheet.checks if c.status in ("fail", "marginal"))
    cells = tuple(_cell(sheet.constants.get(name), scale) for name, scale in shown)
    model = model_words(sheet.model, sheet.motor_id)
    why = "; ".join((*status_lines(current), *current.why))
    return MotorRow(sheet, current, why, page_of(sheet.motor_id), failed, model, cells)


def _cell(estimate: Estimate | None, scale: Scale) -> Cell:
    if estimate is None or not estimate.known:
        return Cell(None, "")
    shown = reading(estimate.number, estimate.u, estimate.unit, scale)
    return Cell(shown, repr(estimate.number))


def _strips(
    sheets: Sequence[Datasheet],
    shown: Sequence[tuple[str, Scale]],
    now: Mapping[str, CurrentStatus],
) -> list[tuple[str, list[Strip]]]:
    """Strip plots by motor type; a constant that is the same in all motors has none."""
    by_type: dict[str, list[Datasheet]] = {}
    for sheet in sheets:
        by_type.setdefault(sheet.motor_type or NO_TYPE, []).append(sheet)
    sections = []
    for motor_type, members in sorted(by_type.items()):
        strips = [
            Strip(
                _column(name, scale),
                strip_plot(name, _known(name, members)[0].unit, _lots(name, members, now)),
            )
            for name, scale in shown
            if len({estimate.number for estimate in _known(name, members)}) > 1
        ]
        if strips:
            sections.append((motor_type, strips))
    return sections


def _lots(
    name: str, sheets: Sequence[Datasheet], now: Mapping[str, CurrentStatus]
) -> list[tuple[str, list[Dot]]]:
    lots: dict[str, list[Dot]] = {}
    for sheet in sheets:
        estimate = sheet.constants.get(name)
        if estimate is not None and estimate.known:
            motor_id, status = sheet.motor_id, now[sheet.motor_id].status
            dot = Dot(motor_id, page_of(motor_id), status, estimate.number, estimate.u)
            lots.setdefault(sheet.lot or NO_LOT, []).append(dot)
    return sorted(lots.items())
