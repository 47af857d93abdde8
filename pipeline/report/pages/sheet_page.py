"""The printable sheet of one motor: one page, A4 or Letter, as a maker hands it out."""

from __future__ import annotations

from urllib.parse import quote

from pipeline.records.datasheet import Datasheet
from pipeline.records.naming import file_stem
from pipeline.records.performance import Performance
from pipeline.report.charts.performance_chart import band_chart, efficiency_chart
from pipeline.report.pages.page import render
from pipeline.views.constants import constant_words
from pipeline.views.motor import motor_rows
from pipeline.views.performance import performance_view

SHOWN = (
    "r_phase_ohm", "ld_h", "lq_h", "psi_pm_wb", "pole_pairs", "kt_peak_nm_a", "kv_ll_peak_rpm_v",
    "motor_constant_nm_sqrt_w", "j_rotor_kgm2", "torque_coulomb_nm", "b_visc_nm_s_rad",
    "cogging_amplitude_nm", "tau_elec_s", "tau_mech_s", "rth_winding_k_w",
)  # fmt: skip
"""Constants of the sheet, where they are known."""


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
