"""Every page in a browser, wide and narrow: nothing scrolls sideways, no label is cut off."""

from __future__ import annotations

import json
import re
import subprocess
from collections.abc import Callable, Mapping
from dataclasses import replace
from html import escape, unescape
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline.performance.derive import performance_of
from pipeline.records.comparison_history import Earlier
from pipeline.records.diagnosis import Diagnosis
from pipeline.records.evidence import Evidence, Series
from pipeline.records.performance import Operation, Performance
from pipeline.report.pages.comparison_page import render_comparison
from pipeline.report.pages.fleet_page import render_fleet
from pipeline.report.pages.ladder_page import render_ladder
from pipeline.report.pages.lot_page import render_regression
from pipeline.report.pages.motor_page import render_motor, render_sheet
from tests.unit.ladders import make_diagnosis, make_step
from tests.unit.performance.constants import salient
from tests.unit.performance.sheets import sheet_of
from tests.unit.regressions import make_regression
from tests.unit.report.conftest import FINDINGS, make_datasheet, make_evidence
from tests.unit.views.test_comparison import make_comparison
from tests.unit.views.test_fleet import motor
from tests.viewing import browser_path

WIDE, NARROW = 1400, 420
LONG = "a-serial-number-that-somebody-made-up-of-many-parts-0000000001"
MEASURE = """
const told = {};
for (const frame of document.querySelectorAll("iframe")) {
  const page = frame.contentDocument;
  for (const fold of page.querySelectorAll("details")) fold.open = true;
  const name = (one) => `${one.tagName} ${one.getAttribute("class") ?? ""} ${one.textContent.slice(0, 40)}`;
  const all = [...page.body.querySelectorAll("*")];
  const scrolling = all.filter((one) => ["auto", "scroll"].includes(frame.contentWindow.getComputedStyle(one).overflowX) && one.scrollWidth > one.clientWidth + 1);
  const beyond = all.filter((one) => !one.closest("svg") && one.getBoundingClientRect().right > frame.clientWidth + 1);
  const cut = [...page.querySelectorAll("svg text")].filter((one) => {
    const inner = one.getBoundingClientRect(), outer = one.closest("svg").getBoundingClientRect();
    return inner.width > 0 && (inner.left < outer.left - 1 || inner.right > outer.right + 1);
  });
  const bare = [...page.querySelectorAll("table.stack > tbody td:not([data-label]):not([colspan])")].filter((one) => one.closest("table").tHead);
  told[frame.title] = {
    width: frame.contentWindow.innerWidth, page: page.documentElement.scrollWidth, texts: page.querySelectorAll("svg text").length,
    scrolling: scrolling.map(name), beyond: beyond.map(name), cut: cut.map(name), bare: bare.map(name),
  };
}
document.body.innerHTML = `<pre id="told">${JSON.stringify(told).replace(/[&<>]/g, (c) => `&#${c.charCodeAt(0)};`)}</pre>`;
"""  # noqa: E501


def long_ladder() -> Diagnosis:
    """Names of signals and effects as long as they come."""
    steps = [make_step(("dead_time",) * (n > 0), 0.5**n) for n in range(4)]
    longest = "temp_coefficient_of_something_torque_shaft_nm"
    many = (longest, *(f"torque_{word}_nm" for word in ("one", "two", "three", "four", "five")))
    told = [replace(r, errors={**r.errors, **dict.fromkeys(many, r.errors["vq_v"])}) for r in steps]
    return replace(make_diagnosis(LONG, unknown=True), ladder=tuple(told))


def named_curves() -> Evidence:
    """Curves that bear the names of files at their ends."""
    x = np.linspace(0.0, 1.0, 9)
    files = ("open_circuit_forward.mcap", "open_circuit_backward_warm.mcap", "open_circuit_w.mcap")
    series = tuple(Series(f"G52/{name}", x, x + n, x + n) for n, name in enumerate(files))
    return Evidence("open_circuit", "Back-EMF", "omega_mech_rad_s", "vab_v", "line", series, "")


PAGES: dict[str, Callable[[], str]] = {
    "motor": lambda: render_motor(
        make_datasheet(LONG),
        (*make_evidence(np.random.default_rng(2)), named_curves()),
        FINDINGS,
        performance=make_performance(),
    ),
    "sheet": lambda: render_sheet(make_datasheet(LONG), make_performance()),
    "fleet": lambda: render_fleet(
        [motor(LONG, 252.0), motor("b", 364.0), make_datasheet("c", 1.02)], FINDINGS
    ),
    "ladder": lambda: render_ladder(long_ladder(), (), "a/folder of captures/with a long name"),
    "comparison": lambda: render_comparison(
        make_comparison(LONG), (Earlier("standard", ("dead_time", "cogging"), 3.0, 76.0),)
    ),
    "lots": lambda: render_regression(make_regression()),
}


def make_performance() -> Performance:
    """Numbers, curves and a map of a motor made up by hand."""
    operation = Operation(24.0, 30.0, 25.0, 25.0, 25.0, 105.0)
    return performance_of(sheet_of(salient()), operation)


WRONG = "wrong"
ALL_WRONG = """<!doctype html><body><p style="width:600px">beyond</p>
<div style="overflow-x:auto;width:100px"><p style="width:300px">scrolls</p></div>
<svg viewBox="0 0 100 20" width="200"><text x="90" y="10">off the drawing</text></svg>"""


def measure(pages: Mapping[str, str], folder: Path) -> dict[str, Any]:
    """What the browser says of pages, by `NAME WIDTH`: how wide, what scrolls, what is cut off."""
    browser = browser_path()
    frames = "".join(
        f'<iframe title="{name} {width}" style="width:{width}px;height:900px;border:0" '
        f'srcdoc="{escape(page)}"></iframe>'
        for name, page in pages.items()
        for width in (WIDE, NARROW)
    )
    whole = folder / "pages.html"
    script = f"<script>addEventListener('load', () => {{{MEASURE}}})</script>"
    whole.write_text(f"<!doctype html><meta charset=utf-8><body>{frames}{script}", "utf-8")
    words = ["--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--dump-dom"]
    words += ["--disable-background-networking", "--disable-component-update", "--disable-sync"]
    words += [f"--user-data-dir={folder / 'profile'}", "--virtual-time-budget=20000"]
    done = subprocess.run(
        [browser, *words, whole.as_uri()], capture_output=True, text=True, timeout=300, check=False
    )
    found = re.search(r'<pre id="told">(.*?)</pre>', done.stdout, re.DOTALL)
    assert found is not None, done.stderr[-2000:]
    told: dict[str, Any] = json.loads(unescape(found[1]))
    return told


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What the browser says of each page at each width."""
    pages = {name: page() for name, page in PAGES.items()} | {WRONG: ALL_WRONG}
    return measure(pages, tmp_path_factory.mktemp("browser"))


@pytest.mark.parametrize("width", [WIDE, NARROW])
@pytest.mark.parametrize("name", PAGES)
def test_nothing_scrolls_sideways(measured: dict[str, Any], name: str, width: int) -> None:
    told = measured[f"{name} {width}"]
    assert told["width"] == width
    assert told["page"] <= width, told["beyond"][:10]
    assert told["scrolling"] == []
    assert told["beyond"] == []


@pytest.mark.parametrize("width", [WIDE, NARROW])
@pytest.mark.parametrize("name", PAGES)
def test_no_label_of_a_drawing_is_cut_off(measured: dict[str, Any], name: str, width: int) -> None:
    told = measured[f"{name} {width}"]
    assert told["texts"] > 0
    assert told["cut"] == []


@pytest.mark.parametrize("name", PAGES)
def test_each_cell_of_a_stacked_row_says_which_column_it_was(
    measured: dict[str, Any], name: str
) -> None:
    """The page's script writes it: one that broke off on this page would leave it undone."""
    assert measured[f"{name} {NARROW}"]["bare"] == []


def test_what_is_too_wide_or_cut_off_is_seen(measured: dict[str, Any]) -> None:
    """The measure itself, on a page that does everything wrong."""
    told = measured[f"{WRONG} {NARROW}"]
    assert told["page"] > NARROW
    assert len(told["scrolling"]) == 1
    assert any("beyond" in one for one in told["beyond"])
    assert told["cut"] == ["text  off the drawing"]


@pytest.mark.parametrize("size", ["A4", pytest.param("Letter", marks=pytest.mark.slow)])
def test_the_sheet_prints_on_one_page(tmp_path: Path, size: str) -> None:
    """As many constants, numbers and notes as there are; the page of the printer's size."""
    page = PAGES["sheet"]()
    known = "margin: 12mm;"
    assert page.count(known) == 1
    path = tmp_path / "sheet.html"
    path.write_text(page.replace(known, f"size: {size}; {known}"), "utf-8")
    words = ["--headless", "--no-sandbox", "--disable-gpu", "--no-first-run"]
    words += ["--disable-background-networking", "--disable-component-update", "--disable-sync"]
    words += [f"--user-data-dir={tmp_path / 'profile'}", "--no-pdf-header-footer"]
    printed = tmp_path / "sheet.pdf"
    subprocess.run(
        [browser_path(), *words, f"--print-to-pdf={printed}", path.as_uri()],
        capture_output=True, timeout=300, check=True,
    )  # fmt: skip
    assert len(re.findall(rb"/Type\s*/Page\b", printed.read_bytes())) == 1
