"""The page of one motor: may I use it, what are its constants, and why should I believe them.

Its sheet is one page to print, A4 or Letter, as a maker hands it out.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from urllib.parse import quote

from pipeline.physics.glossary import Term
from pipeline.records.current_status import current_status
from pipeline.records.datasheet import Datasheet
from pipeline.records.estimate import Estimate
from pipeline.records.evidence import Evidence
from pipeline.records.finding import Finding
from pipeline.records.naming import file_stem
from pipeline.records.performance import Performance
from pipeline.report.charts.chart import chart
from pipeline.report.charts.performance_chart import band_chart, efficiency_chart
from pipeline.report.pages.page import Link, link_block, render
from pipeline.report.pages.status_block import status_block
from pipeline.views.constants import GROUPS, KEY_CONSTANTS, OTHER, constant_words, grouped
from pipeline.views.model_words import model_words
from pipeline.views.motor import (
    CHECK_ORDER,
    LEAST_SHARE,
    Row,
    check_number,
    motor_rows,
    ordered_checks,
)
from pipeline.views.performance import performance_view

SHOWN = (
    "r_phase_ohm", "ld_h", "lq_h", "psi_pm_wb", "pole_pairs", "kt_peak_nm_a", "kv_ll_peak_rpm_v",
    "motor_constant_nm_sqrt_w", "j_rotor_kgm2", "torque_coulomb_nm", "b_visc_nm_s_rad",
    "cogging_amplitude_nm", "tau_elec_s", "tau_mech_s", "rth_winding_k_w",
)  # fmt: skip
"""Constants of the sheet, where they are known."""


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
    links: Sequence[Link] = (),
    performance: Performance | None = None,
) -> str:
    """The self-contained HTML page of one motor; equal input gives equal text.

    Its status is what the datasheet says of itself, until `status_block.with_status`.

    Parameters
    ----------
    datasheet
        The datasheet.
    evidence
        Measured and fitted samples of each plot.
    findings
        What was refused or is doubtful in the motor's captures.
    own
        Terms of plug-ins that the glossary lacks, by name.
    links
        Links to other pages.
    performance
        The performance of the motor; None for no such section.

    """
    rows = motor_rows(datasheet, own)
    figures = _figures(datasheet.constants, evidence)
    checks = ordered_checks(datasheet.checks)
    counts: Counter[str] = Counter(check.status for check in checks)
    return render(
        "motor.html.jinja",
        sheet=datasheet,
        file=quote(file_stem(datasheet.motor_id), safe="~"),
        status=status_block(datasheet, current_status(datasheet)),
        links=link_block(links),
        cards=[check for check in checks if check.status in ("fail", "marginal")],
        key_rows=[rows[n] for n in KEY_CONSTANTS if n in rows and rows[n].reading],
        groups=_groups(rows),
        least_share=LEAST_SHARE,
        checks=checks,
        check_counts=[(status, counts[status]) for status in CHECK_ORDER if counts[status]],
        check_number=check_number,
        model=model_words(datasheet.model, datasheet.motor_id),
        findings=sorted(findings),
        figures=figures,
        performance=None if performance is None else performance_view(performance),
        charts=[] if performance is None else _charts(performance),
        drawn={figure.estimator for figure in figures},
    )


def _groups(rows: Mapping[str, Row]) -> list[tuple[str, list[Row], list[Row]]]:
    """Title and rows of each group, and the rows that are folded away: further constants that are
    not determined.
    """
    groups = []
    for title, names in grouped(rows):
        members = [rows[name] for name in names]
        folded = [row for row in members if title == OTHER and not row.reading]
        groups.append((title, [row for row in members if row not in folded], folded))
    return groups


def _charts(performance: Performance) -> list[tuple[str, str]]:
    """Titles and drawings of the performance."""
    peak, steady = performance.curve("torque_peak"), performance.curve("torque_continuous")
    torque, power, kt = ("torque_shaft_nm", "power_w", "kt_peak_nm_a")
    of_one = [performance.curve(name) for name in ("power_peak", "kt_peak")]
    drawn = [
        (
            "Torque against speed",
            band_chart([c for c in (peak, steady) if c], torque, performance.regimes),
        ),
        ("Efficiency, with losses on hover", efficiency_chart(performance.cells, peak)),
        ("Shaft power at peak torque", band_chart([c for c in of_one[:1] if c], power)),
        ("Air-gap torque per ampere", band_chart([c for c in of_one[1:] if c], kt)),
    ]
    return [(title, svg) for title, svg in drawn if svg]


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


def render_sheet(sheet: Datasheet, performance: Performance) -> str:
    """The self-contained HTML page of one motor's sheet; equal input gives equal text.

    The status is what the datasheet says of itself; an approval is in the registry.

    Parameters
    ----------
    sheet
        The datasheet.
    performance
        The performance of the motor.

    """
    rows = motor_rows(sheet)
    curves = [
        c for c in (performance.curve("torque_peak"), performance.curve("torque_continuous")) if c
    ]
    return render(
        "sheet.html.jinja",
        sheet=sheet,
        file=quote(file_stem(sheet.motor_id), safe="~"),
        rows=[(constant_words(n), rows[n]) for n in SHOWN if n in rows and rows[n].reading],
        view=performance_view(performance),
        torque=band_chart(curves, "torque_shaft_nm", performance.regimes),
        efficiency=efficiency_chart(performance.cells, performance.curve("torque_peak")),
    )
