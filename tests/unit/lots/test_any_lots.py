"""Comparisons of anything: few motors, one value, no stations, constants that some lack."""

from __future__ import annotations

import json

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.io.storage.publish import canonical_json
from pipeline.lots.regression import compare_lots
from pipeline.physics.glossary import CONSTANTS
from pipeline.records.limits import Amount, ConstantLimits, Limits
from pipeline.records.lot_regression import LotRegression
from pipeline.records.plain_form import record_of
from pipeline.report.pages.lot_page import render_regression
from pipeline.report.text.junit import junit_xml
from pipeline.report.text.lot_text import regression_text
from tests.unit.lots import production as line

NAMES = ("psi_pm_wb", "pole_pairs", "resistance_imbalance")
LIMITS = Limits(
    "any",
    "0" * 64,
    (),
    (
        ConstantLimits(
            "psi_pm_wb", tolerance=Amount(0.2, "nominal"), margins=(Amount(0.02, "nominal"),)
        ),
        ConstantLimits("pole_pairs", tolerance=Amount(0.5, "unit"), guard_band=Amount(0.0, "unit")),
        ConstantLimits("resistance_imbalance", maximum=0.05, margins=(Amount(1.5, "sd"),)),
    ),
)


@st.composite
def motors(draw: st.DrawFn) -> list[tuple[str, str | None, dict[str, float]]]:
    """(lot, station, values) of one to five motors; equal values are frequent."""
    made = []
    for _ in range(draw(st.integers(1, 5))):
        values = {
            "psi_pm_wb": draw(st.sampled_from([1.0, 1.01, 0.97, 1.5, 1e-9])),
            "pole_pairs": draw(st.sampled_from([7.0, 7.0, 7.0, 8.0])),
            "resistance_imbalance": draw(st.sampled_from([0.0, 1e-3, 0.06])),
        }
        kept = draw(st.sets(st.sampled_from(NAMES), max_size=3))
        lot = draw(st.sampled_from(["A", "B", "lot <&> C"]))
        station = draw(st.sampled_from(["S1", "S1", "S2", None]))
        made.append((lot, station, {n: v for n, v in values.items() if n in kept}))
    return made


@settings(max_examples=60, deadline=None)
@given(base=motors(), candidate=motors())
def test_any_comparison_is_told(base, candidate) -> None:
    """No crash, valid JSON that reads back, and no pass without a link between the stations."""
    sheets = [
        [
            line.sheet(f"{side}{k}", lot if side == "b" else "N", station, values, u=1e-4)
            for k, (lot, station, values) in enumerate(side_motors)
        ]
        for side, side_motors in (("b", base), ("c", candidate))
    ]
    found = compare_lots(line.samples([sheets[0]], sheets[1]), LIMITS, CONSTANTS)
    assert record_of(LotRegression, json.loads(canonical_json(found.document()))) == found
    assert render_regression(found)
    assert junit_xml(found)
    assert regression_text(found, ())
    for one in found.constants:
        if one.verdict in ("pass", "marginal"):
            assert any(motor.stations for motor in one.of("candidate"))
    for one in found.constants:
        numbers = [one.effect.u, one.power.power, one.equivalence.p_value, one.test.p_value]
        assert all(n is None or np.isfinite(n) for n in numbers)
