"""The first page: every motor with its status and key constants, lots beside each other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from urllib.parse import quote

from pipeline.records.current_status import CurrentStatus
from pipeline.records.datasheet import Datasheet
from pipeline.records.finding import Finding
from pipeline.records.naming import file_stem
from pipeline.report.charts.strip import Dot, strip_plot
from pipeline.report.pages.page import Link, link_block, render
from pipeline.views.fleet import Column, FleetView, MotorRow, fleet_view, floors_of, known_estimates

NO_LOT = "no lot"
NO_TYPE = "type not stated"


@dataclass(frozen=True, slots=True)
class Strip:
    """One constant of one motor type, lot by lot."""

    column: Column
    svg: str


def render_fleet(
    datasheets: Sequence[Datasheet],
    findings: Sequence[Finding],
    statuses: Mapping[str, CurrentStatus] | None = None,
    links: Sequence[Link] = (),
) -> str:
    """The self-contained HTML page of all motors; pages of motors lie beside it.

    Equal input, equal text.

    Parameters
    ----------
    datasheets
        The datasheets of the batch.
    findings
        What was refused or is doubtful.
    statuses
        Current status of each motor; None for what each datasheet states of itself.
    links
        Links to other pages.

    """
    view = fleet_view(datasheets, statuses)
    ordered = sorted(findings)
    return render(
        "fleet.html.jinja",
        view=view,
        links=link_block(links),
        pages={row.sheet.motor_id: page_of(row.sheet.motor_id) for row in view.rows},
        reasons=[(reason, floors_of(reason, view.rows)) for reason in view.reasons],
        types=_strips(view),
        refused=[f for f in ordered if f.severity == "refused"],
        warnings=[f for f in ordered if f.severity != "refused"],
    )


def page_of(motor_id: str) -> str:
    """The relative link of a motor's page.

    Parameters
    ----------
    motor_id
        The motor.

    """
    return f"{quote(file_stem(motor_id), safe='~')}.html"


def _strips(view: FleetView) -> list[tuple[str, list[Strip]]]:
    """Strip plots by motor type; a constant that is the same in all motors has none."""
    by_type: dict[str, list[MotorRow]] = {}
    for row in view.rows:
        by_type.setdefault(row.sheet.motor_type or NO_TYPE, []).append(row)
    sections = []
    for motor_type, members in sorted(by_type.items()):
        strips = []
        for column in view.columns:
            known = known_estimates(column.name, [row.sheet for row in members])
            if len({estimate.number for estimate in known}) > 1:
                lots = _lots(column.name, members)
                strips.append(Strip(column, strip_plot(column.name, known[0].unit, lots)))
        if strips:
            sections.append((motor_type, strips))
    return sections


def _lots(name: str, rows: Sequence[MotorRow]) -> list[tuple[str, list[Dot]]]:
    lots: dict[str, list[Dot]] = {}
    for row in rows:
        sheet = row.sheet
        estimate = sheet.constants.get(name)
        if estimate is not None and estimate.known:
            motor_id, status = sheet.motor_id, row.current.status
            dot = Dot(motor_id, page_of(motor_id), status, estimate.number, estimate.u)
            lots.setdefault(sheet.lot or NO_LOT, []).append(dot)
    return sorted(lots.items())
