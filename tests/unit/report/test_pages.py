"""Pages: every number of the datasheet is on them, nothing foreign gets in, nothing is fetched."""

from __future__ import annotations

import re
import time
from collections.abc import Sequence
from dataclasses import replace
from html.parser import HTMLParser
from itertools import pairwise

import numpy as np
import pytest

from pipeline.records.datasheet import CaptureReference, Check, Datasheet
from pipeline.records.estimate import Estimate, not_identifiable
from pipeline.records.evidence import Evidence, Series
from pipeline.records.finding import Finding
from pipeline.records.naming import file_stem
from pipeline.records.uncertainty import Contribution
from pipeline.report.pages.fleet_page import page_of, render_fleet
from pipeline.report.pages.motor_page import render_motor
from pipeline.report.pages.page import Link, link_block
from pipeline.views.constants import GROUPS, KEY_CONSTANTS, grouped
from pipeline.views.motor import _relative, conditions, kind_of, parts_of
from tests.unit.report.conftest import flat

VOID = {"meta", "br", "input", "path", "rect", "circle"}
HOSTILE = '"><script>alert(1)</script>{{7*7}}<img src=x onerror=alert(2)>\u202e'
FINDINGS = (
    Finding("joint-P0/x.mcap", "refused", "truncated", "the file ends early", "record it again"),
    Finding("joint-P0/y.mcap", "warning", "gap", "12 are missing", "look at the cable", (400, 412)),
)


class Page(HTMLParser):
    """Tags in order, texts of table rows by id, attributes; fails on a tag left open."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.rows: list[list[str]] = []
        self.text = ""
        self.feed(html)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag == "tr":
            self.rows.append([])
        if tag in {"th", "td"}:
            self.rows[-1].append("")
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag
        if tag in {"th", "td"}:
            self.rows[-1][-1] = self.rows[-1][-1].strip()

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] in {"style", "script"}:
            return
        self.text += data
        if self.rows and {"th", "td"} & set(self.open):
            self.rows[-1][-1] += data

    def row(self, code: str) -> list[str]:
        return next(row for row in self.rows if row[0].endswith(code))


def squeezed(text: str) -> str:
    return re.sub(r"\s+", " ", text).strip()


def test_the_table_of_constants_is_the_datasheet(
    datasheet: Datasheet, evidence: tuple[Evidence, ...]
) -> None:
    """Golden structure: value ± U parsed back from the page equal the datasheet's to rounding."""
    page = Page(render_motor(datasheet, evidence, FINDINGS))
    factors = {"mΩ": 1e-3, "µH": 1e-6, "mWb": 1e-3, "mN·m/A": 1e-3, "mN·m": 1e-3}
    for name, estimate in datasheet.constants.items():
        row = page.row(name)
        if estimate.value is None:
            assert squeezed(row[1]) == "not identifiable"
            assert estimate.note in squeezed(row[-1])
            continue
        value, _, rest = re.sub(r" [\d.]+ %$", "", squeezed(row[1])).partition(" ± ")
        if estimate.u == 0.0:
            assert value == f"{estimate.value}"
            continue
        expanded, _, unit = rest.partition(" ")
        power = re.search("×10⁻([³⁶])", unit)
        factor = 10.0 ** -{"³": 3, "⁶": 6}[power[1]] if power else factors.get(unit, 1.0)
        factor = 1e-6 if unit.startswith("µ") else factor
        assert float(expanded) * factor == pytest.approx(2 * estimate.u, rel=0.05), name
        assert float(value) * factor == pytest.approx(estimate.value, abs=0.06 * 2 * estimate.u)
        parts = re.search(r"uA ([\d.]+), uB ([\d.]+)", squeezed(row[2]))
        assert parts is not None
        assert float(parts[1]) ** 2 + float(parts[2]) ** 2 == pytest.approx(
            (estimate.u / factor) ** 2, rel=0.06
        )


def test_further_constants_that_are_not_determined_are_folded_away(datasheet: Datasheet) -> None:
    """Expected: those of the usual groups stay in sight, as a datasheet without them has a gap."""
    further = not_identifiable("holding_offset_a", "A", "holding_current", "hold the rotor")
    known = {**datasheet.constants, "holding_offset_a": further}
    html = flat(render_motor(replace(datasheet, constants=known), (), ()))
    before, _, folded = html.partition("<summary>1 more that these captures do not determine")
    assert 'id="holding_offset_a"' in folded.partition("</details>")[0]
    assert 'id="cogging_amplitude_nm"' in before


def test_the_other_method_stands_under_the_published_one(
    datasheet: Datasheet, evidence: tuple[Evidence, ...]
) -> None:
    page = Page(render_motor(datasheet, evidence, ()))
    place = next(i for i, row in enumerate(page.rows) if row[0].endswith("ld_h"))
    other = [squeezed(cell) for cell in page.rows[place + 1]]
    chosen, lcr = datasheet.constants["ld_h"], datasheet.alternatives[0]
    shared = 0.64 * chosen.u * lcr.u  # both carry 0.8 u of the same current sensor
    spread = np.sqrt(chosen.u**2 + lcr.u**2 - 2 * shared)
    gap = (lcr.number - chosen.number) / spread
    assert other[0] == "also by lcr"
    assert other[1] == "211.5 ± 1.8 µH"
    assert other[2] == f"+0.67 % apart, {gap:.1f} u of the difference"


def test_what_u_comes_from_is_a_bar_that_adds_up(
    datasheet: Datasheet, evidence: tuple[Evidence, ...]
) -> None:
    html = render_motor(datasheet, evidence, ())
    row = html.split('<tr id="r_phase_ohm"')[1].split("</tr>")[0]
    assert 'aria-label="current 64 %, scatter 36 %"' in row
    shares = re.findall(r'<i\s+class="b-(\w+)"\s+style="flex-grow:([\d.]+)"', row)
    assert shares == [("current", "0.6400"), ("scatter", "0.3600")]
    for name, estimate in datasheet.constants.items():
        parts = parts_of(estimate.budget)
        assert sum(part.share for part in parts) == pytest.approx(1.0 if parts else 0.0), name


@pytest.mark.parametrize(
    ("source", "kind"),
    [
        ("current@bench-1", "current"),
        ("voltage_commanded@bench-1", "voltage"),
        ("theta_elec:330@bench-1", "angle"),
        ("scatter:lcr:r_lcr_ohm", "scatter"),
        ("between:methods:ld_h", "disagreement"),
        ("assumed:drag_form", "assumptions"),
        ("lcr@bench-1", "LCR meter"),
        ("seal_gauge@bench-1", "seal gauge"),
    ],
)
def test_a_source_of_uncertainty_in_a_word(source: str, kind: str) -> None:
    assert kind_of(source) == kind


@pytest.mark.parametrize(("u", "share"), [(0.01, "2.0 %"), (0.49, "98 %"), (0.5, ""), (1.0, "")])
def test_a_value_that_could_be_zero_has_no_share(u: float, share: str) -> None:
    """An imbalance of 0.0007 ± 0.0014 was shown as known to 210 %."""
    parts = (Contribution("scatter", u, "A", 40.0),)
    assert _relative(Estimate("resistance_imbalance", 1.0, "1", "measured", "m", parts)) == share


def test_what_failed_is_a_card_above_the_constants(
    datasheet: Datasheet, evidence: tuple[Evidence, ...]
) -> None:
    html = render_motor(datasheet, evidence, ())
    cards = html.split('<div class="cards">')[1].split("</div>")[0]
    assert re.findall(r'class="card (\w+)" href="#(check-\d)"', cards) == [
        ("fail", "check-1"),
        ("marginal", "check-2"),
    ]
    for words in (
        "kt vs ke",
        "1.1547",
        "may deviate by 0.01",
        "torque test against back-EMF",
        "2/sqrt(3)",
    ):
        assert words in cards
    assert html.index('class="cards"') < html.index('id="constants"')
    sound = replace(datasheet, checks=(Check("kt_vs_ke", "pass", "holds", 1.0, 0.01, "1"),))
    assert 'class="cards"' not in render_motor(sound, evidence, ())


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("`run a=<b>` once more", "<code>run a=&lt;b&gt;</code> once more"),
        ("a ` that is alone & <i>", "a ` that is alone &amp; &lt;i&gt;"),
    ],
)
def test_a_command_in_a_message_is_code_and_everything_is_escaped(text: str, shown: str) -> None:
    block = link_block([Link(text, "page.html")])
    assert f">{shown}<" in block


def test_numbers_in_names_go_by_size() -> None:
    names = ["bemf_harmonic_11", "bemf_harmonic_5", "bemf_harmonic_13", "bemf_harmonic_7", "a"]
    ((_, others),) = grouped(names)
    assert others == ["a", *(f"bemf_harmonic_{n}" for n in (5, 7, 11, 13))]


def test_checks_stand_worst_first_with_value_limit_and_suspect(
    datasheet: Datasheet, evidence: tuple[Evidence, ...]
) -> None:
    page = Page(render_motor(datasheet, evidence, ()))
    names = {check.name.replace("_", " ") for check in datasheet.checks}
    rows = [[squeezed(c) for c in row] for row in page.rows if len(row) == 5 and row[1] in names]
    assert [row[0] for row in rows] == ["✗ fail", "! marginal", "– not evaluated", "✓ pass"]
    assert rows[0][2:4] == ["1.1547", "0.01"]
    assert rows[0][4].startswith("torque test against back-EMF")
    assert rows[0][4].endswith("Suspect: 2/sqrt(3)")
    assert rows[1][2:4] == ["940.0 µs", "920.0 µs"]
    assert rows[2][2:4] == ["–", "–"]


def test_status_reason_bound_and_provenance_are_said(datasheet: Datasheet) -> None:
    constants = dict(datasheet.constants)
    constants["j_rotor_kgm2"] = replace(constants["j_rotor_kgm2"], bounds=(0, 1), at_bound=True)
    unverified = CaptureReference("joint-P0/z.csv", "ef" * 32, "drive", "unverified")
    sheet = replace(datasheet, constants=constants, captures=(*datasheet.captures, unverified))
    page = Page(render_motor(sheet, (), FINDINGS))
    text = squeezed(page.text)
    assert "joint-P0 ! provisional" in text
    assert "not approved" in text
    assert "2 captures, 1 of them unverified" in text
    assert "at its bound" in page.row("j_rotor_kgm2")[1]
    for digest in (sheet.version, sheet.config_sha256, sheet.code_version, "ef" * 32):
        assert digest in text
    assert "400–412" in text
    assert "record it again" in text


def test_every_fit_has_its_residual_panel(
    datasheet: Datasheet, evidence: tuple[Evidence, ...]
) -> None:
    page = render_motor(datasheet, evidence, ())
    figures = re.findall("<figure.*?</figure>", page, re.DOTALL)
    assert len(figures) == len(evidence)
    fitted = sum(any(s.fitted.size for s in e.series) for e in evidence)
    assert sum('class="scale"' in figure for figure in figures) == fitted == 5


def test_hostile_names_stay_text() -> None:
    hostile = Estimate(HOSTILE, 1.0, "1", "measured", HOSTILE, at={"x": HOSTILE}, note=HOSTILE)
    sheet = Datasheet(
        motor_id=HOSTILE,
        motor_type=HOSTILE,
        lot=HOSTILE,
        version=HOSTILE,
        status="refused",
        why=(HOSTILE,),
        captures=(CaptureReference(HOSTILE, HOSTILE, HOSTILE, HOSTILE),),
        config_sha256=HOSTILE,
        code_version=HOSTILE,
        constants={HOSTILE: hostile, "ld_h": not_identifiable("ld_h", "H", HOSTILE, HOSTILE)},
        alternatives=(replace(hostile, captures=(HOSTILE,)),),
        checks=(Check(HOSTILE, "fail", HOSTILE, 1.0, 2.0, HOSTILE, HOSTILE),),
    )
    series = (Series(HOSTILE, np.arange(3.0), np.arange(3.0), np.empty(0)),) * 2
    shown = Evidence(HOSTILE, HOSTILE, "t_s", "ia_a", "line", series, HOSTILE, HOSTILE)
    found = (Finding(HOSTILE, "refused", HOSTILE, HOSTILE, HOSTILE),)
    for html in (render_motor(sheet, (shown,), found), render_fleet([sheet, sheet], found)):
        page = Page(html)
        scripts = [attrs for tag, attrs in page.tags if tag == "script"]
        assert scripts == [{}]
        assert not [tag for tag, _ in page.tags if tag == "img"]
        assert not [a for _, attrs in page.tags for a in attrs if a.startswith("on")]
        assert HOSTILE in page.text
        assert "49" not in page.text


def test_pages_fetch_nothing(datasheet: Datasheet, evidence: tuple[Evidence, ...]) -> None:
    motor = render_motor(datasheet, evidence, FINDINGS)
    fleet = render_fleet([datasheet], FINDINGS)
    for html in (motor, fleet):
        page = Page(html)
        assert not [a for _, attrs in page.tags for a in attrs if a in {"src", "srcset", "data"}]
        links = [attrs["href"] for _, attrs in page.tags if "href" in attrs]
        beside = re.compile(r"#.*|[\w~.-]+\.html|\.\./datasheets/[\w~.-]+\.json")
        assert all(beside.fullmatch(link) for link in links)
        assert "@import" not in html
        assert "url(" not in html
        assert not {tag for tag, _ in page.tags} & {"link", "iframe", "object", "embed", "base"}
    anchors = {
        attrs["href"][1:] for _, attrs in Page(motor).tags if attrs.get("href", "")[:1] == "#"
    }
    ids = [attrs["id"] for _, attrs in Page(motor).tags if "id" in attrs]
    assert anchors <= set(ids)
    assert len(ids) == len(set(ids))


def test_tables_have_headers_and_drawings_have_names(
    datasheet: Datasheet, evidence: tuple[Evidence, ...]
) -> None:
    for html in (render_motor(datasheet, evidence, FINDINGS), render_fleet([datasheet], FINDINGS)):
        tags = Page(html).tags
        assert all(attrs.get("scope") in {"col", "row"} for tag, attrs in tags if tag == "th")
        assert all(attrs.get("aria-label") for tag, attrs in tags if tag == "svg")
        levels = [int(tag[1]) for tag, _ in tags if re.fullmatch("h[1-6]", tag)]
        assert levels[0] == 1
        assert all(b - a <= 1 for a, b in pairwise(levels))


def test_equal_input_gives_equal_text_in_any_order(
    datasheet: Datasheet, evidence: tuple[Evidence, ...]
) -> None:
    turned = replace(datasheet, constants=dict(reversed(datasheet.constants.items())))
    assert render_motor(datasheet, evidence, FINDINGS) == render_motor(
        turned, evidence, FINDINGS[::-1]
    )
    other = replace(datasheet, motor_id="joint-P1")
    assert render_fleet([datasheet, other], FINDINGS) == render_fleet(
        [other, turned], FINDINGS[::-1]
    )


def test_the_fleet_shows_each_motor_once_on_one_scale(datasheet: Datasheet) -> None:
    twice = datasheet.constants["r_phase_ohm"]
    other = replace(
        datasheet,
        motor_id="p0 <x>",
        lot=None,
        status="released",
        why=(),
        checks=(),
        constants={"r_phase_ohm": replace(twice, value=2.0)},
    )
    html = render_fleet([other, datasheet], FINDINGS)
    page = Page(html)
    rows = {squeezed(row[0]): [squeezed(c) for c in row] for row in page.rows if len(row) > 8}
    assert set(rows) == {"Motor", "joint-P0", "p0 <x>"}
    place = next(i for i, c in enumerate(rows["Motor"]) if c.startswith("Rphase"))
    assert rows["Motor"][place] in {"Rphase [Ω]", "Rphase [mΩ]"}
    unit = 1e-3 if "mΩ" in rows["Motor"][place] else 1.0
    for motor_id, ohms in (("joint-P0", 0.31004), ("p0 <x>", 2.0)):
        assert float(rows[motor_id][place].split(" ± ")[0]) * unit == pytest.approx(ohms, abs=5e-4)
    links = {attrs["href"] for tag, attrs in page.tags if tag == "a" and "html" in attrs["href"]}
    assert links == {"joint-P0.html", f"{file_stem('p0 <x>')}.html"}
    assert "kt vs ke" in rows["joint-P0"][3]
    assert "the file ends early" in page.text
    assert "record it again" in page.text


def test_an_empty_fleet_says_why() -> None:
    text = squeezed(Page(render_fleet([], FINDINGS)).text)
    assert "No datasheet came out" in text
    assert "the file ends early" in text


@pytest.mark.parametrize("findings", [(), FINDINGS[:1], FINDINGS])
def test_a_count_leads_to_what_it_counts_and_none_to_nothing(
    datasheet: Datasheet, findings: Sequence[Finding]
) -> None:
    """A link within the page ends at a section that is there; a count of nothing has neither."""
    page = Page(render_fleet([datasheet], findings))
    places = {ref for tag, attrs in page.tags if (ref := attrs.get("href") or "")[:1] == "#"}
    ids = {attrs["id"] for tag, attrs in page.tags if "id" in attrs}
    severities = {finding.severity for finding in findings}
    expected = {"#refused"} if "refused" in severities else set()
    expected |= {"#warnings"} if "warning" in severities else set()
    assert places == expected
    assert {place[1:] for place in places} == ids & {"refused", "warnings"}
    text = squeezed(page.text)
    for severity, count in (("refused", "captures refused"), ("warning", "warnings")):
        assert (f"0 {count}" in text) == (severity not in severities)


def test_strips_need_two_motors_that_differ(datasheet: Datasheet) -> None:
    def strips(*sheets: Datasheet) -> int:
        return render_fleet(sheets, ()).count('class="strip"')

    other = replace(datasheet, motor_id="joint-P1", lot="B")
    ohms = replace(datasheet.constants["r_phase_ohm"], value=0.33)
    worse = replace(other, constants={**datasheet.constants, "r_phase_ohm": ohms})
    assert strips(datasheet) == 0
    assert strips(datasheet, other) == 0
    assert strips(datasheet, worse) == 1
    assert strips(datasheet, replace(worse, motor_type="another")) == 0


def test_a_motor_called_index_does_not_take_the_first_page() -> None:
    assert page_of("index") != "index.html"
    assert page_of("INDEX").lower() not in {"index.html", page_of("index")}


def test_conditions_are_short() -> None:
    at = {
        "temp_winding_degc": 25.0,
        "omega_low_rad_s": 40,
        "omega_high_rad_s": 240.5,
        "iq_a": -0.016,
        "winding": "delta",
        "current_high_a": 2.0,
    }
    assert conditions(at) == (
        "current high 2 A, iq −16 mA, speed 40 to 240.5 rad/s, winding 25 °C, winding delta"
    )
    assert conditions({}) == ""


def test_groups_know_every_published_constant() -> None:
    from pipeline.physics.glossary import CONSTANTS

    assert {name for names in GROUPS.values() for name in names} == set(CONSTANTS)
    assert set(KEY_CONSTANTS) <= set(CONSTANTS)
    assert grouped(["zeta", "ld_h", "alpha"]) == [
        ("Electrical", ["ld_h"]),
        ("Further constants", ["alpha", "zeta"]),
    ]


def test_a_page_of_fourteen_charts_is_quick(
    datasheet: Datasheet, evidence: tuple[Evidence, ...]
) -> None:
    render_motor(datasheet, evidence, ())
    start = time.process_time()
    render_motor(datasheet, evidence * 2, ())
    assert time.process_time() - start < 0.5


def test_the_page_of_five_hundred_motors_is_below_three_megabytes(datasheet: Datasheet) -> None:
    """1.4 MB; in a browser on an idle machine it can be used 0.4 s after the click."""
    motors = [replace(datasheet, motor_id=f"M-{n:04d}", lot=f"lot-{n % 12}") for n in range(500)]
    page = render_fleet(motors, FINDINGS)
    assert all(f">{sheet.motor_id}<" in page for sheet in motors)
    assert len(page.encode()) < 3e6
