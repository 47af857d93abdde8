"""What a page, a table and a terminal say of a model and of a decision."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pipeline.io.storage.datasheets import datasheet_of
from pipeline.records.current_status import current_status
from pipeline.records.datasheet import Datasheet
from pipeline.records.diagnosis import ReportedParameter
from pipeline.records.ledger import histories
from pipeline.records.model_verdict import Excess, FoundEffect, ModelVerdict
from pipeline.report.pages.fleet_page import render_fleet
from pipeline.report.pages.motor_page import render_motor
from pipeline.report.pages.status_block import END, with_status
from pipeline.report.text.console import summary
from tests.unit.records.test_current_status import event, events

WORST = Excess("drive_0.mcap", "vd_v", 0, 76.3, 0.9, "V")
OVER = ModelVerdict("missing", held_out=31.0, residual=76.3, worst=WORST, over=3)
SOUND = ModelVerdict("adequate", held_out=0.5, residual=1.1)
WRONG = "Nothing was found wrong"


def sheet_with(datasheet: Datasheet, model: ModelVerdict | None, motor_id: str = "m") -> Datasheet:
    return replace(datasheet, motor_id=motor_id, model=model, checks=datasheet.checks[:1])


@pytest.mark.parametrize(
    ("model", "said"),
    [
        (OVER, "missing, error 31 floors"),
        (None, "older than the residual test"),
        (ModelVerdict("not_tested", note="residual_test=false"), "residual_test=false"),
        (ModelVerdict("insufficient", note="record a torque map"), "Record a torque map"),
    ],
)
def test_nothing_was_found_wrong_is_not_said(
    datasheet: Datasheet, model: ModelVerdict | None, said: str
) -> None:
    """What was over its floor, or not tested, is not called right, with no finding at all."""
    page = render_motor(sheet_with(datasheet, model), (), ())
    assert WRONG not in page
    assert said in page


def test_nothing_was_found_wrong_is_said_of_a_test_that_was_passed(datasheet: Datasheet) -> None:
    sheet = sheet_with(datasheet, SOUND)
    assert WRONG in render_motor(sheet, (), ())
    assert "adequate, error 0.5 floors" in render_motor(sheet, (), ())
    doubted = replace(sheet, checks=datasheet.checks)
    assert WRONG not in render_motor(doubted, (), ()), "a check failed"


def test_the_page_says_where_how_much_and_which_command(datasheet: Datasheet) -> None:
    page = render_motor(sheet_with(datasheet, OVER, "a <b>"), (), ())
    assert "v_d of drive_0.mcap by 76 noise floors, 900 mV beyond the noise" in page
    assert "diagnose input=FOLDER motor=&#39;a &lt;b&gt;&#39;" in page
    assert "<td>31 noise floors</td>" in page


def test_above_the_fold_the_model_is_said_once_and_both_numbers_are_told_apart(
    datasheet: Datasheet,
) -> None:
    found = FoundEffect(
        {"cos_84_nm": ReportedParameter(0.007, 1e-5, "N·m")}, "cogging torque of 7 mN·m"
    )
    model = replace(OVER, missing={"cogging": found}, held_out_with=0.6)
    sheet = sheet_with(replace(datasheet, why=(model.reason("m") or "",)), model)
    fold = render_motor(sheet, (), ()).split('<section id="constants">')[0]
    assert fold.count("cogging torque of 7 mN·m") == 1
    assert '<a href="#model">model: missing cogging</a>' in fold
    assert "31 floors are over all signals of captures held out" in fold
    assert "one signal alone reaches 76." in fold


def test_the_terminal_names_the_one_that_misses_most(datasheet: Datasheet) -> None:
    less = replace(OVER, held_out=20.0)
    sheets = [sheet_with(datasheet, less, "one"), sheet_with(datasheet, OVER, "two")]
    text = summary([*sheets, sheet_with(datasheet, SOUND, "three")], (), "out", report=False)
    assert "2 motors, two most: The standard model misses v_d of drive_0.mcap" in text
    rows = {line.split()[0]: line.split()[3:5] for line in text.splitlines()[2:8:2]}
    assert rows == {
        "one": ["missing,", "20"],
        "three": ["adequate,", "0.5"],
        "two": ["missing,", "31"],
    }


def test_the_table_of_motors_shows_verdict_and_floors(datasheet: Datasheet) -> None:
    html = render_fleet([sheet_with(datasheet, OVER), sheet_with(datasheet, None, "old")], ())
    assert '<span class="badge marginal">missing</span>' in html
    assert "error 31 floors" in html
    assert '<span class="badge not_evaluated">not tested</span>' in html


def test_a_document_comes_back_with_its_model_and_without(datasheet: Datasheet) -> None:
    for model in (OVER, None):
        document = sheet_with(datasheet, model).document()
        assert ("model" in document) == (model is not None)
        back = datasheet_of(document)
        assert back.model == model
        assert back.document() == document


def test_a_decision_is_put_into_the_page_and_nowhere_else(datasheet: Datasheet) -> None:
    """A serial number that looks like the mark is text."""
    sheet = sheet_with(datasheet, OVER, f"m {END}")
    page = render_motor(sheet, (), ())
    key = {"motor_id": sheet.motor_id, "version": sheet.version}
    decided = events(event("publish", **key), event("approve", by="A <S>", why="w", **key))
    history = histories(decided)[sheet.motor_id]
    shown = with_status(page, sheet, current_status(sheet, history))
    assert "approved by A &lt;S&gt; on" in shown
    assert '<span class="badge released">' in shown
    before, after = page.split("<nav")[0], shown.split("<nav")[0]
    assert before != after
    assert shown.removeprefix(after) == page.removeprefix(before)
    assert with_status(shown, sheet, current_status(sheet)) == page
    assert with_status("an older page", sheet, current_status(sheet)) == "an older page"
