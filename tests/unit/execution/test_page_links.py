"""Pages lead to each other, whatever the order in which the commands that write them came."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from pipeline.execution.outputs.page_links import INDEX, LOTS, links_of, relink, relink_index
from pipeline.report.pages.fleet_page import render_fleet
from pipeline.report.pages.ladder_page import render_ladder
from pipeline.report.pages.motor_page import render_motor
from tests.unit.ladders import make_diagnosis
from tests.unit.report.conftest import make_datasheet

MOTOR = "joint/P1"
STEM = "joint~2fP1"


@pytest.fixture
def output(tmp_path: Path) -> Path:
    for room in ("report", "diagnosis", "comparison", "recordings", "regression"):
        (tmp_path / room).mkdir()
    (tmp_path / f"report/{STEM}.html").write_text(render_motor(make_datasheet(MOTOR), (), ()))
    (tmp_path / INDEX).write_text(render_fleet([make_datasheet(MOTOR)], ()))
    return tmp_path


def links(page: Path) -> dict[str, str]:
    """Texts and targets of the links between the marks of a page."""
    block = page.read_text().split("<!-- links -->")[1].split("<!-- end of links -->")[0]
    return {text: href for href, text in re.findall(r'href="([^"]*)">([^<]*)<', block)}


def test_a_diagnosis_that_comes_later_is_linked_both_ways(output: Path) -> None:
    motor, diagnosis = output / f"report/{STEM}.html", output / f"diagnosis/{STEM}.html"
    assert links(motor) == {}
    found = links_of(output, "diagnosis/{}.html", MOTOR)
    diagnosis.write_text(render_ladder(make_diagnosis(MOTOR), links=found))
    assert links(diagnosis) == {
        "All motors": "../report/index.html",
        "Datasheet": f"../report/{STEM}.html",
    }
    assert set(relink(output, MOTOR)) == {f"report/{STEM}.html"}
    assert links(motor) == {"Diagnosis": f"../diagnosis/{STEM}.html"}
    assert relink(output, MOTOR) == {}, "nothing is written twice"
    for page in (motor, diagnosis):
        for href in links(page).values():
            assert (page.parent / href).is_file()


def test_what_goes_is_no_longer_linked(output: Path) -> None:
    (output / f"comparison/{STEM}.html").write_text("no page of ours")
    relink(output, MOTOR)
    assert "Comparison" in links(output / f"report/{STEM}.html")
    assert (output / f"comparison/{STEM}.html").read_text() == "no page of ours"
    (output / f"comparison/{STEM}.html").unlink()
    relink(output, MOTOR)
    assert links(output / f"report/{STEM}.html") == {}


def test_what_is_about_to_be_written_counts_as_there(output: Path) -> None:
    name = f"recordings/motor-{STEM}.rrd"
    (found,) = links_of(output, "report/{}.html", MOTOR, (name,))
    assert found.href == f"../{name}"


def test_the_page_of_all_motors_leads_to_the_lots_and_the_tables(output: Path) -> None:
    (output / LOTS).write_text("<p>")
    (output / "fleet.csv").write_text("motor_id\n")
    relink_index(output)
    assert links(output / INDEX) == {
        "Lots": "../regression/report.html",
        "Constants as CSV": "../fleet.csv",
    }
