"""A comparison for people: before and after, what was compared before, on page and terminal."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from pipeline.records.comparison import Comparison, ModelParameter, Move, SignalError, Trace
from pipeline.records.comparison_history import Earlier, document_of, history_of, with_latest
from pipeline.report.pages.comparison_page import render_comparison
from pipeline.report.pages.page import Link
from pipeline.report.text.comparison_text import comparison_text
from pipeline.views.comparison import comparison_view
from tests.unit.ladders import make_map, make_turn
from tests.unit.report.conftest import flat

HOSTILE = '"><script>alert(1)</script>{{7*7}}'


def error(capture: str, rmse: float, signal: str = "vq_v") -> SignalError:
    return SignalError(signal, capture, "held_out", rmse, 0.01, 10, 9.0, "V")


def make_comparison(motor_id: str = "m") -> Comparison:
    t_s = np.arange(500) * 1e-3
    traces = tuple(
        Trace(name, "vq_v", "equation", "held_out", t_s, np.sin(9 * t_s), np.sin(9 * t_s) - 0.01)
        for name in ("a.mcap", "b.mcap")
    )
    return Comparison(
        motor_id,
        "standard",
        ("dead_time",),
        {
            "r_ohm": ModelParameter(0.31, 0.001, "ohm"),
            "dead_time.loss_v": ModelParameter(0.18, 1e-4, "V"),
            "psi_wb": ModelParameter(None, None, "Wb"),
        },
        (error("a.mcap", 0.004), error("b.mcap", 0.003)),
        0.35,
        (),
        maps=(make_map(1.0), make_turn(1.0)),
        moved=(Move("r_ohm", "ohm", 0.32, 0.001, 0.31, 0.001),),
        bare=20.0,
        traces=traces,
        before=(error("a.mcap", 0.3), error("b.mcap", 0.4)),
        added=("dead_time",),
    )


def test_each_signal_is_told_before_and_after() -> None:
    (row,) = comparison_view(make_comparison()).signals
    assert (row.before, row.ratio) == ("35", "0.35")
    assert row.worst == "a.mcap (0.40)"
    assert "35" in comparison_text(make_comparison())
    without = replace(make_comparison(), before=(), bare=None)
    assert "before" not in comparison_text(without).splitlines()[1]


def test_a_capture_counts_by_its_windows() -> None:
    """Ninety windows of 1 mV and ten of 10 mV: sqrt(0.9 + 10) = 3.30 mV."""
    errors = (
        replace(error("a.mcap", 1e-3), n=90),
        replace(error("b.mcap", 1e-2), n=10),
    )
    (row,) = comparison_view(replace(make_comparison(), errors=errors)).signals
    assert row.rmse == "3.30 mV"


def test_the_page_shows_sizes_moves_maps_and_the_worst_capture_of_each_signal() -> None:
    links = (Link("Diagnosis", "../diagnosis/m.html"),)
    html = flat(render_comparison(make_comparison(), links=links))
    for words in (
        "With dead time the held-out error falls from 20 to 0.35 (1 is the noise floor)",
        '<td class="r num">35</td><td class="r num"><b>0.35</b></td>',
        "180.00 ± 0.20 mV",
        "Not identifiable from these captures: psi_wb",
        "320.0 ± 2.0 mΩ",
        '<svg class="heat"',
        'href="../diagnosis/m.html"',
    ):
        assert words in html
    traces = html.split('id="traces"')[1].split("</section>")[0]
    assert traces.count("<figure>") == 1 and "b.mcap" in traces, "worst before what was added"
    assert 'id="earlier"' not in html
    assert html == flat(render_comparison(make_comparison(), links=links))


def test_earlier_comparisons_are_kept_and_listed() -> None:
    first = Earlier("standard", (), 76.0, None)
    latest = Earlier.of(make_comparison())
    history = with_latest(with_latest((first,), latest), replace(latest, held_out=0.3))
    assert history == (first, replace(latest, held_out=0.3))
    document = json.loads(json.dumps(document_of("m", history)))
    assert history_of(document) == history
    html = render_comparison(make_comparison(), history)
    table = html.split('id="earlier"')[1]
    assert ">76</td>" in table and "dead_time" in table and ">0.3</td>" in table


@pytest.mark.parametrize(
    "document",
    [None, {}, {"schema": "other"}, {"schema": "comparison-history/1", "comparisons": [{}]}],
)
def test_a_history_that_is_none_is_empty(document: dict[str, object] | None) -> None:
    assert history_of(document) == ()


def test_hostile_names_stay_text() -> None:
    hostile = replace(make_comparison(HOSTILE), name=HOSTILE, notes=(HOSTILE,))
    html = render_comparison(hostile, (Earlier(HOSTILE, (HOSTILE,), 1.0, None),))
    assert "<script>alert" not in html
    assert "{{7*7}}" in html


def test_without_errors_the_page_says_why() -> None:
    none = Comparison("m", "standard", (), {}, (), None, (), ("record a torque map",))
    assert "Record a torque map" in render_comparison(none)
    assert comparison_text(none) == "m: record a torque map"
