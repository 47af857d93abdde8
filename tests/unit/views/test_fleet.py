"""All motors beside each other: reasons told once, tables that fit a terminal, tidy files."""

from __future__ import annotations

import io
from dataclasses import replace

import polars as pl
import pytest

from pipeline.execution.outputs.sheet_memory import OF_BATCH
from pipeline.records.datasheet import AWAITS_APPROVAL, Datasheet
from pipeline.records.diagnosis import ReportedParameter
from pipeline.records.estimate import not_identifiable
from pipeline.records.model_verdict import Excess, FoundEffect, ModelVerdict
from pipeline.report.pages.fleet_page import render_fleet
from pipeline.report.text.console import summary
from pipeline.report.text.next_command import next_command
from pipeline.views.fleet import fleet_view, floors_of
from pipeline.views.table_text import blocks, table
from pipeline.views.tables import constants_frame, fleet_files
from tests.unit.report.conftest import make_datasheet

AWAITS = "not approved"


def misses(floors: float, motor_id: str) -> ModelVerdict:
    worst = Excess(f"{motor_id}/cogging_cw.mcap", "torque_shaft_nm", 84, floors, 0.004, "N·m")
    return ModelVerdict("missing", held_out=20.0, residual=floors, worst=worst, over=3)


def motor(motor_id: str, floors: float, *more: str) -> Datasheet:
    sheet = make_datasheet(motor_id)
    model = misses(floors, motor_id)
    reason = model.reason(motor_id)
    assert reason is not None
    return replace(sheet, model=model, why=(AWAITS, reason, *more))


def test_equal_reasons_are_told_once_with_their_motors_and_sizes() -> None:
    sheets = [motor("b", 252.0), motor("a", 364.0, "ld_h is not measured"), make_datasheet("c")]
    view = fleet_view(sheets)
    assert [(reason.text, reason.members) for reason in view.reasons] == [
        ("not approved", ("a", "b", "c")),
        ("the standard model misses shaft torque, 84 a turn", ("a", "b")),
    ]
    assert [floors_of(reason, view.rows) for reason in view.reasons] == [
        "",
        "by 252 to 364 noise floors",
    ]
    rows = {row.sheet.motor_id: row for row in view.rows}
    assert (rows["a"].why, rows["a"].shared) == ("ld_h is not measured", (1, 2))
    assert rows["b"].why == ""
    assert rows["c"].why == "cogging_amplitude_nm is not measured"
    html = render_fleet(sheets, ())
    assert html.count("the standard model misses shaft torque") == 1
    assert (
        "<b>2 motors</b>: the standard model misses shaft torque, 84 a turn, by 252 to 364" in html
    )


@pytest.mark.parametrize("length", [3, 60])
def test_a_summary_fits_eighty_columns_in_the_units_of_the_page(length: int) -> None:
    sheets = [motor("m" * length + name, 252.0) for name in "abc"]
    text = summary(sheets, (), "out", report=True)
    lines = text.split("\n\n")[0].splitlines()
    assert max(map(len, lines)) <= 80
    page = render_fleet(sheets, ())
    for unit in ("mΩ", "µH", "mWb", "mN·m/A", "×10⁻⁶ kg·m²"):
        assert f"[{unit}]" in text and f"[{unit}]" in page
    assert sum("310.04" in line for line in lines) == 3, "as on the page, to two digits of U"
    assert "all constants: out/fleet.csv" in text


def test_below_each_value_stands_its_expanded_uncertainty() -> None:
    sheets = [motor(name, 252.0) for name in "ab"]
    (first, *_) = summary(sheets, (), "out", report=True).split("\n\n")
    lines = first.splitlines()
    at = [n for n, line in enumerate(lines) if "310.04" in line]
    estimate = sheets[0].constants["r_phase_ohm"]
    for n in at:
        below = lines[n + 1]
        end = lines[n].index("310.04") + len("310.04")
        number = below[:end].rsplit("±", 1)[1]
        assert float(number) == pytest.approx(2e3 * estimate.u, rel=0.05)
    assert len(at) == 2


def test_many_motors_are_told_in_one_table() -> None:
    sheets = [make_datasheet(f"m{number:02d}") for number in range(30)]
    lines = summary(sheets, (), "out", report=False).split("\n\n")[0].splitlines()
    assert len(lines) == 32
    assert max(map(len, lines)) <= 80


def test_a_table_is_parted_where_it_would_be_too_wide() -> None:
    rows = [["motor", *(f"column {n}" for n in range(9))], ["a", *"123456789"]]
    found = blocks(rows, right=range(1, 10), width=40)
    assert all(len(line) <= 40 for block in found for line in block.splitlines())
    assert all(block.startswith("motor") for block in found)
    numbers = [word for block in found for word in block.splitlines()[1].split()[1:]]
    assert numbers == list("123456789")
    assert blocks(rows, right=range(1, 10), width=1000) == [table(rows, right=range(1, 10))]
    assert blocks([["a" * 50, "b" * 50]], width=40) == [f"{'a' * 50}  {'b' * 50}"]


def test_the_tidy_files_hold_every_constant_of_every_motor() -> None:
    lacking = make_datasheet("two")
    lacking = replace(
        lacking,
        constants={**lacking.constants, "ld_h": not_identifiable("ld_h", "H", "lcr", "record it")},
    )
    sheets = [make_datasheet("one"), lacking]
    files = fleet_files([constants_frame(sheet) for sheet in sheets])
    flat = pl.read_csv(io.BytesIO(files["fleet.csv"]))
    packed = pl.read_parquet(io.BytesIO(files["fleet.parquet"]))
    assert packed["captures"].dtype == pl.List(pl.String)
    assert flat.height == packed.height == sum(len(sheet.constants) for sheet in sheets)
    for frame in (flat, packed):
        told = {(m, c): v for m, c, v in frame.select("motor_id", "constant", "value").rows()}
        for sheet in sheets:
            for name, estimate in sheet.constants.items():
                expected = None if estimate.value is None else estimate.number
                assert told[sheet.motor_id, name] == expected
    assert flat["datasheet_status"].unique().to_list() == ["provisional"]
    assert fleet_files([constants_frame(sheet) for sheet in sheets]) == files


def test_the_tidy_files_hold_the_sizes_of_the_effects_that_were_found() -> None:
    """One that the captures do not determine is there without a value, and is no constant."""
    parameters = {
        "loss_nm": ReportedParameter(0.1, 0.01, "N·m"),
        "knee_rad_s": ReportedParameter(None, None, "rad/s"),
    }
    found = FoundEffect(parameters, "windage of 0.10 ± 0.02 N·m", (), "spin it fast")
    sheet = replace(
        make_datasheet("one"), model=replace(misses(76.0, "one"), missing={"windage": found})
    )
    rows = constants_frame(sheet).filter(pl.col("method") == "residual_test")
    assert rows.select("constant", "value", "u", "unit", "status", "note").rows() == [
        ("windage.loss_nm", 0.1, 0.01, "N·m", "measured", found.headline),
        ("windage.knee_rad_s", None, None, "rad/s", "not_identifiable", found.experiment),
    ]
    assert not any("." in name for name in sheet.constants)


def test_motors_that_lack_the_same_effect_have_one_reason() -> None:
    """Whatever its size and wherever it shows most."""

    def lacking(motor_id: str, size: str) -> Datasheet:
        found = FoundEffect({}, f"cogging torque of {size}")
        model = replace(
            misses(76.0, motor_id), missing={"cogging": found}, held_out=15.0, held_out_with=0.6
        )
        sheet = replace(make_datasheet(motor_id), model=model)
        return replace(sheet, why=(model.reason(motor_id) or "",))

    view = fleet_view([lacking("a", "7 mN·m"), lacking("b", "9 mN·m")])
    assert [(one.text, one.members) for one in view.reasons] == [
        ("the standard model lacks cogging", ("a", "b"))
    ]
    assert [row.model.short for row in view.rows] == ["missing cogging, error 15 → 0.6 floors"] * 2
    assert floors_of(view.reasons[0], view.rows) == "with an error of 15 noise floors"
    alike = [lacking("a", "7 mN·m"), lacking("b", "9 mN·m")]
    text = summary(alike, (), "out", report=False)
    assert "2 motors, a most: The standard model lacks cogging torque of 7 mN·m" in text
    assert "with it, the error falls from 15 to 0.6 noise floors" in text
    assert next_command(alike, "in", "out") == "run input=in 'model.effects=[cogging]' output=out"
    others = [make_datasheet(name) for name in "cde"]
    looked = "diagnose input=in motor=a output=out"
    assert next_command([*alike, *others], "in", "out") == looked, "it is no matter of the design"


def test_the_next_command_is_what_most_motors_need() -> None:
    """Effects before a diagnosis before a decision; one that a check has refused comes last."""
    sound = ModelVerdict("adequate", held_out=0.5, residual=1.0)
    fine = replace(make_datasheet("fine"), model=sound, why=(AWAITS_APPROVAL,))
    unclear = replace(make_datasheet("un clear"), model=misses(76.0, "un clear"))
    refused = replace(unclear, motor_id="refused", status="refused")
    diagnosis = "diagnose input=in motor='un clear' output=out"
    assert next_command([fine, unclear, refused], "in", "out") == diagnosis
    assert next_command([fine, refused], "in", "out") == "registry show fine output=out"
    released = replace(fine, status="released")
    assert next_command([released, refused], "in", "out") == "export json fine output=out"
    lacking = replace(fine, why=(AWAITS_APPROVAL, "missing: ld_h (record current steps)"))
    assert next_command([lacking, refused], "in", "out") == "plan motor=fine output=out"
    assert next_command([], "in", "out") == ""
    bare = replace(fine, constants={}, alternatives=())
    assert next_command([bare], "in", "out") == "compare input=in output=out"


def test_a_batch_of_partial_logs_shows_what_they_give() -> None:
    """KS and its like stand in the table where no motor has one of the usual constants."""
    whole = make_datasheet("a")
    value = next(one for one in whole.constants.values() if one.known)
    ks = replace(value, name="ks_v", unit="V")
    partial = replace(whole, constants={"ks_v": ks})
    assert [column.name for column in fleet_view([partial]).columns] == ["ks_v"]
    both = replace(whole, constants={**whole.constants, "ks_v": ks})
    assert "ks_v" not in [column.name for column in fleet_view([both, partial]).columns]
    assert {"ks_v", "coast_coulomb_rad_s2", "cogging_amplitude_a"} <= OF_BATCH
