"""The ladder's page: every number of the document, one scale for all steps, no injection."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Literal
from xml.etree import ElementTree

import numpy as np
import pytest

from pipeline.records.comparison import Comparison, Dependence, Move, SignalError
from pipeline.records.diagnosis import CurvePoint, Remainder, StepRecord, Unexcited
from pipeline.report.charts.curve_chart import curve_chart
from pipeline.report.charts.heatmap import angle_bars, colour, heatmap
from pipeline.report.charts.step_chart import step_chart
from pipeline.report.pages.ladder_page import render_ladder
from pipeline.report.text.comparison_text import comparison_text
from pipeline.views.notes import shown_and_folded
from tests.unit.ladders import make_diagnosis, make_map, make_turn
from tests.unit.report.conftest import flat

HOSTILE = '"><script>alert(1)</script>{{7*7}}<img src=x onerror=alert(2)>'


def cells(svg: str) -> list[tuple[str, str]]:
    """Colour and hover text of every cell of a heat map."""
    root = ElementTree.fromstring(svg)
    return [(g[1].attrib["fill"], g[0].text or "") for g in root.iter("g")]


def test_every_number_of_the_ladder_is_on_the_page() -> None:
    html = render_ladder(make_diagnosis())
    for words in (
        "20.5",
        "0.41",
        "130 mV",
        "2.60 mV",
        "−98 %",
        "179.90 ± 0.24 mV",
        "dead_time.loss_v",
    ):
        assert words in html
    assert "phase_imbalance" in html
    assert "low-speed current steps" in html
    assert "no test here excites compliance" in html
    assert html.count('<svg class="heat"') == 4


def test_the_page_leads_with_words_the_command_and_what_shows_it() -> None:
    html = flat(render_ladder(make_diagnosis(), (), "captures"))
    places = [
        html.index(words)
        for words in (
            "Voltage lost in the inverter, 179.90 ± 0.24 mV a phase. With it, the error falls",
            "motor-datasheets compare input=captures motor=joint-P1 "
            "&#39;model.effects=[dead_time]&#39;",
            "could as well be <b>phase_imbalance</b>",
            "v_q over i_q, drive_0.mcap",
            "<summary>Formula</summary><p>each phase loses V; offset at small current",
            'id="ladder"',
        )
    ]
    assert places == sorted(places)
    figure = html.split('id="shown"')[1].split("</section>")[0]
    assert figure.count("<svg") == 1
    assert 'class="fitted"' in figure and 'class="residual' in figure


UNEXCITED = (
    Unexcited("backlash", ("drive", "torque_map"), "reversals (load side)"),
    Unexcited("windage", ("spin_down", "drive"), "from the highest speed"),
    Unexcited("cogging", ("cogging", "holding_current"), "a slow turn"),
    Unexcited("torque_lag", ("torque_map",), "steps of torque"),
)


def test_effects_that_no_test_excites_are_told_by_the_test_to_record() -> None:
    """Thirty lines of one kind bury the verdict; a few are told as they are."""
    result = replace(make_diagnosis(), notes=("odd in iq_a",), unexcited=UNEXCITED)
    told, single = shown_and_folded(result)
    assert told == (
        "odd in iq_a",
        "no test here excites 4 effects, of which nothing can be said:",
        "record drive to excite backlash, windage",
        "record cogging to excite cogging",
        "record torque_map to excite torque_lag",
    )
    words = (
        "no test here excites backlash: record drive or torque_map (reversals (load side))",
        "no test here excites windage: record spin_down or drive (from the highest speed)",
        "no test here excites cogging: record cogging or holding_current (a slow turn)",
        "no test here excites torque_lag: record torque_map (steps of torque)",
    )
    assert single == words
    few = replace(result, unexcited=UNEXCITED[:3])
    assert shown_and_folded(few) == (("odd in iq_a", *words[:3]), ())
    assert result.document()["notes"] == ["odd in iq_a", *words]
    box, each = render_ladder(result).split("how to excite each of the 4")
    assert "record drive to excite backlash, windage" in box
    assert "excites windage" not in box and "excites windage: record spin_down" in each


def test_the_unknown_and_what_is_left_are_told() -> None:
    html = render_ladder(make_diagnosis(unknown=True))
    assert "odd in i_q" in html
    assert "at iq_a = 4" in html
    assert "120.0 mV" in html
    assert "drive_0.mcap" in html
    assert 'id="unknown"' not in render_ladder(make_diagnosis())


def test_nothing_foreign_runs_and_nothing_is_fetched() -> None:
    diagnosis = replace(make_diagnosis(HOSTILE), notes=(HOSTILE,))
    html = flat(render_ladder(diagnosis))
    assert "<script>alert(1)" not in html
    assert "<img" not in html
    assert "49" not in re.findall(r"<h1>(.*?)</h1>", html)[0]
    assert not re.search(r'(src|href)="(?!#)', html)


def test_equal_input_gives_equal_text_and_an_empty_ladder_a_page() -> None:
    assert render_ladder(make_diagnosis()) == render_ladder(make_diagnosis())
    empty = replace(make_diagnosis(), ladder=(), verdict="insufficient", missing=())
    assert "No model could be fitted" in render_ladder(empty)


def test_a_cell_has_its_colour_its_number_and_a_dot_where_it_is_sure() -> None:
    one = make_map(1.0)
    seen = cells(heatmap(one, one.reach))
    assert len(seen) == int(np.isfinite(one.mean).sum())
    assert seen[3] == (colour(-1.0), "−210 mV, n 12, p 1e-09")
    assert heatmap(one, one.reach).count('class="sure"') == int((np.abs(one.mean) > 0.1).sum())
    quiet = cells(heatmap(make_map(0.02), one.reach))
    assert quiet[3][0] == colour(-0.02)


def test_blue_is_below_white_is_nothing_red_is_above() -> None:
    assert colour(0.0) == "#f7f7f7"
    red, blue = (int(colour(s)[1:], 16) for s in (1.0, -1.0))
    assert red >> 16 > 150 > red & 255
    assert blue >> 16 < 50 < blue & 255
    assert colour(2.0) == colour(1.0)


def test_bars_over_the_angle_keep_their_axis() -> None:
    loud, quiet = angle_bars(make_turn(1.0), 1e-3), angle_bars(make_turn(0.02), 1e-3)

    def height(svg: str) -> float:
        root = ElementTree.fromstring(svg)
        marks = next(p.attrib["d"] for p in root.iter("path") if "bars" in p.attrib["class"])
        tops = [float(y) for y in re.findall(r"V([\d.]+)H", marks)]
        return max(tops) - min(tops)

    assert height(quiet) == pytest.approx(0.02 * height(loud), abs=0.2)


def test_the_chart_puts_the_floor_and_the_errors_on_one_logarithmic_scale() -> None:
    svg = step_chart(["0: standard", "1: + dead_time"], {"vq_v": [65.0, 1.3], "vd_v": [10.0, 1.0]})
    root = ElementTree.fromstring(svg)
    lines = [p.attrib["d"] for p in root.iter("path") if p.attrib["class"] in ("c0", "c1")]
    ys = [[float(y) for y in re.findall(r" ([\d.]+)", line)] for line in lines]
    band = next(r for r in root.iter("rect") if r.attrib["class"] == "band")
    assert ys[1][1] == pytest.approx(float(band.attrib["y"]), abs=0.1)
    decade = ys[1][1] - ys[1][0]
    assert ys[0][1] - ys[0][0] == pytest.approx(decade * np.log10(65.0 / 1.3), abs=0.3)


def test_the_chart_reaches_down_to_the_lowest_error_and_marks_what_is_below_it() -> None:
    """Far below its floor is a finding as well: a floor too high, or a signal fitted twice."""
    over = {"alpha_mech_rad_s2": [0.017, 0.011], "vq_v": [9.0, 0.0]}
    root = ElementTree.fromstring(step_chart(["0", "1"], over))
    lines = {p.attrib["class"]: p.attrib["d"] for p in root.iter("path")}
    first, second = (float(y) for y in re.findall(r" ([\d.]+)", lines["c0"]))
    grid = {
        t.text: float(t.attrib["y"]) - 4 for t in root.iter("text") if "tick y" in str(t.attrib)
    }
    decade = grid["0.1"] - grid["1"]
    assert (first - grid["1"]) / decade == pytest.approx(-np.log10(0.017), abs=0.01)
    assert (second - first) / decade == pytest.approx(np.log10(0.017 / 0.011), abs=0.01)
    assert [t.text for t in root.iter("text") if "↓" in (t.text or "")] == ["↓ 0"]


def test_errors_without_a_floor_are_on_the_page_and_all_together_in_the_chart() -> None:
    """A table of flux levels has no windows and so no floors: its error is told all the same."""
    steps = [
        StepRecord((), 1.6, {"vq_v": 0.00778, "alpha_mech_rad_s2": 3.0}),
        StepRecord(("saturation",), 1.1, {"vq_v": 0.00544, "alpha_mech_rad_s2": 3.0}),
    ]
    html = render_ladder(replace(make_diagnosis(), ladder=tuple(steps)))
    for words in ("v_q", "7.78 mV", "5.44 mV", "−30 %", "all signals", "3.00 rad/s²"):
        assert words in html
    assert "no errors to draw" not in html


@pytest.mark.parametrize(
    ("signal", "words", "size"),
    [
        ("omega_mech_rad_s", "shaft speed", "276 rad/s<"),
        ("alpha_mech_rad_s2", "shaft acceleration", "276 rad/s²"),
    ],
)
def test_what_is_left_has_its_unit(signal: str, words: str, size: str) -> None:
    left = (
        Remainder("spin_down_0.mcap", signal, 0, 9.0, 276.0),
        Remainder("lcr.csv", "lab_h", 2, 3.0, 1.3e-6, matters=False),
    )
    html = render_ladder(replace(make_diagnosis(), remainder=left))
    assert words in html and size in html and "1.30 µH" in html
    places = [html.index(word) for word in (size, "<td>yes", "1.30 µH", "<td>too small")]
    assert places == sorted(places)


def test_words_of_neighbouring_steps_do_not_meet() -> None:
    """Six pixels a letter at the size of the chart's words."""
    names = [f"{n}: + {name}" for n, name in enumerate(["magnet_temperature", "cogging"] * 3)]
    root = ElementTree.fromstring(step_chart(names, {"vq_v": [60.0, 9.0, 7.0, 5.0, 2.0, 1.0]}))
    words = [t for t in root.iter("text") if t.attrib["class"] == "tick x"]
    assert [t.text for t in words] == names
    rows: dict[str, float] = {}
    for one in words:
        half = 3.0 * len(one.text or "")
        middle, row = float(one.attrib["x"]), one.attrib["y"]
        assert middle - half > rows.get(row, 0.0)
        rows[row] = middle + half


def test_the_comparison_in_words_names_errors_places_and_moves() -> None:
    errors = (
        SignalError("vq_v", "a.mcap", "held_out", 0.03, 0.01, 10, 9.0, "V"),
        SignalError("vq_v", "b.mcap", "fit", 0.04, 0.01, 10, 9.0, "V"),
        SignalError("iq_a", "a.mcap", "held_out", 0.02, 0.01, 10, 9.0, "A", "free_run"),
        SignalError("vd_v", "a.mcap", "held_out", 0.009, 0.01, 10, 9.0, "V"),
    )
    where = (
        Dependence("vd_v", "id_a", 0.8, 1e-9),
        Dependence("vq_v", "iq_a", 0.8, 1e-9),
        Dependence("vq_v", "t_s", 0.01, 1e-9),
        Dependence("vq_v", "theta_mech_rad", 0.3, None),
    )
    moves = (
        Move("r_ohm", "ohm", 0.32, 0.001, 0.31, 0.001),
        Move("psi_wb", "Wb", 0.0094, 1e-6, 0.0094, 1e-6),
    )
    text = comparison_text(
        Comparison(
            "m",
            "standard",
            ("dead_time",),
            {},
            errors,
            3.5,
            where,
            (),
            (make_map(1.0),),
            moves,
            20.0,
        )
    )
    rows = text.splitlines()
    assert "with dead time the held-out error falls from 20 to 3.5" in rows[0]
    assert re.search(r"vq_v +35.4 mV +10.0 mV +3.5 +1 of 2 +b.mcap \(4.0\)", text)
    assert "iq_a, on its own" in text
    assert "vq_v depends on iq_a (80 %); worst at 100 to 200 rad/s, −15 to −5 A: −210 mV" in text
    assert "vd_v depends" not in text, "it is below its floor"
    assert re.search(r"r_ohm +320.0 ± 2.0 mΩ +310.0 ± 2.0 mΩ +−10.0", text)
    assert "1 parameter stayed within 3 u" in text


@pytest.mark.parametrize(
    ("split", "said"),
    [("held_out", "held-out error 0.4 (1"), ("fit", "error of the fit, none held")],
)
def test_a_comparison_tells_its_notes_and_whether_anything_was_held_out(
    split: Literal["held_out", "fit"], said: str
) -> None:
    error = SignalError("psi_d_wb", "map.csv", split, 0.004, 0.01, 10, 9.0, "Wb")
    found = Comparison("m", "ideal", (), {}, (error,), 0.4, (), ("not used: a.mcap",))
    rows = comparison_text(found).splitlines()
    assert said in rows[0]
    assert rows[1] == "  note: not used: a.mcap"


def test_a_curve_has_its_band_around_it() -> None:
    points = [
        CurvePoint(a, 0.01 * a, 0.01 * a - 0.005, 0.01 * a + 0.005) for a in (-4.0, 0.0, 2.0, 4.0)
    ]
    root = ElementTree.fromstring(curve_chart("iq_a", "drop", "V", points))
    paths = {p.attrib["class"]: p.attrib["d"] for p in root.iter("path")}
    line = [float(y) for y in re.findall(r" ([\d.]+)", paths["fitted"])]
    band = [float(y) for y in re.findall(r" ([\d.]+)", paths["band"])]
    up, down = band[:4], band[7:3:-1]
    assert line == pytest.approx([(u + d) / 2 for u, d in zip(up, down, strict=True)], abs=0.1)
    assert min(d - u for u, d in zip(up, down, strict=True)) > 5.0
    texts = [t.text for t in root.iter("text")]
    assert "i_q [A]" in texts
    assert "drop [mV]" in texts


def test_a_test_that_lacks_a_signal_is_told_with_it() -> None:
    lacking = [replace(one, signals=("torque_shaft_nm",)) for one in UNEXCITED[-1:]]
    result = replace(make_diagnosis(), unexcited=(*UNEXCITED[:3], *lacking))
    told, _ = shown_and_folded(result)
    assert told[-1] == "record torque_map with torque_shaft_nm to excite torque_lag"
