"""Bad input: one clear line each, the right exit code, and the rest done."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest

import pipeline.stages.run as run_stage
from pipeline.__main__ import main
from pipeline.execution.jobs import MotorJob, MotorResult

HEAD = "# contract: 1\n# motor_id: stray\n# test: {test}\n"


class Batch:
    """A folder with one good motor's resistance and spin, to which a test adds what is bad."""

    def __init__(self, bench: Path, folder: Path) -> None:
        self.input, self.output = folder / "in", folder / "out"
        self.input.mkdir()
        for name in ("resistance_ab.csv", "open_circuit_forward.mcap"):
            shutil.copyfile(bench / "one" / name, self.input / name)
        self.bench = bench

    def add(self, name: str, content: str | bytes) -> None:
        data = content.encode() if isinstance(content, str) else content
        (self.input / name).write_bytes(data)

    def run(self, *more: str) -> tuple[int, list[dict[str, Any]]]:
        """Exit code and findings; the good motor's datasheet must be there."""
        words = [f"input={self.input}", f"output={self.output}", "workers=1"]
        words.append("residual_test=false")
        code = main(["run", *words, "report=false", "recordings=false", *more])
        sheet = json.loads((self.output / "datasheets" / "gimbal~2fone.json").read_bytes())
        assert sheet["constants"]["r_phase_ohm"]["status"] == "measured"
        return code, json.loads((self.output / "findings.json").read_bytes())["findings"]


@pytest.fixture
def batch(bench: Path, tmp_path: Path) -> Batch:
    return Batch(bench, tmp_path)


def refused(findings: list[dict[str, Any]]) -> dict[str, Any]:
    """The only refusal."""
    (only,) = [finding for finding in findings if finding["severity"] == "refused"]
    assert only["message"]
    assert only["remedy"]
    return only


STEP = HEAD.format(test="current_step") + "# pair: ab\n# theta_elec_deg: 330\n"
SPIN = HEAD.format(test="open_circuit")
ROWS = "".join(f"{k * 1e-5},{1.0},{0.01 * k}\n" for k in range(400))


@pytest.mark.parametrize(
    ("name", "content", "code"),
    [
        ("words.mcap", "these are words, not a recording\n", "not_mcap"),
        ("column.csv", STEP + "t_s,vab_v\n" + "0.0,1.0\n0.1,1.0\n", "missing_column"),
        ("nan.csv", STEP + "t_s,vab_v,ia_a\n" + ROWS + "nan,1.0,0.0\n", "time_not_finite"),
        (
            "nobody.csv",
            STEP.replace("# motor_id: stray\n", "") + "t_s,vab_v,ia_a\n" + ROWS,
            "missing_metadata",
        ),
        ("test.csv", HEAD.format(test="dance") + "t_s,vab_v,ia_a\n" + ROWS, "unknown_test"),
        ("back.csv", STEP + "t_s,vab_v,ia_a\n" + ROWS + "0.0,1.0,0.0\n", "time_not_increasing"),
        ("one.csv", SPIN + "t_s,vab_v,vbc_v,theta_mech_rad\n0.0,1.0,0.5,0.1\n", "angle_coverage"),
        ("header.csv", STEP + "t_s,vab_v,ia_a\n", "no_rows"),
        ("excel.csv", STEP + "t_s;vab_v;ia_a\n" + "0,0;1,0;0,1\n0,1;1,0;0,2\n", "separator"),
        ("units.csv", STEP + "t_s,vab_v,ia_a\ns,V,A\n" + ROWS, "bad_number"),
        ("cut.csv", STEP + "t_s,vab_v,ia_a\n" + ROWS[:-4], "truncated"),
        ("future.csv", "# contract: 2\n# motor_id: x\n# test: drive\nt_s\n0\n", "contract_version"),
    ],
)
def test_a_bad_file_is_refused_by_name_and_the_rest_is_done(
    batch: Batch,
    capsys: pytest.CaptureFixture[str],
    name: str,
    content: str,
    code: str,
) -> None:
    batch.add(name, content)
    exit_code, findings = batch.run()
    assert exit_code == 3
    only = refused(findings)
    assert (only["file"], only["code"]) == (name, code)
    lines = [line for line in capsys.readouterr().err.splitlines() if name in line]
    assert len(lines) == 1


def test_rows_of_the_fault_are_named(batch: Batch) -> None:
    """Time is NaN in row 400 of 401, counted from 0."""
    batch.add("nan.csv", STEP + "t_s,vab_v,ia_a\n" + ROWS + "nan,1.0,0.0\n")
    assert refused(batch.run()[1])["rows"] == [400, 400]


def test_every_bad_key_is_named_in_one_line(batch: Batch) -> None:
    keys = "# pole_pairs: seven\n# slots: -3\n# winding: star\n# vdc_v: 24\n"
    batch.add("keys.csv", STEP.replace("# test", f"{keys}# test") + "t_s,vab_v,ia_a\n" + ROWS)
    code, findings = batch.run()
    only = refused(findings)
    assert (code, only["code"]) == (3, "bad_metadata")
    for said in ("pole_pairs is 'seven'", "slots is '-3'", "winding is 'star'"):
        assert said in only["message"]
    assert "from 1 to 200" in only["remedy"]
    for key, remedy in (("slots is '-3'", "from 1 to 1000"), ("winding is 'star'", "wye, delta")):
        assert remedy in only["message"].partition(key)[2].partition("; also")[0]
    assert "vdc_v" not in only["message"]


def test_a_motor_that_breaks_leaves_the_others(
    batch: Batch, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Fault: work on one of two motors raises what nobody foresaw. The other's results stand."""
    batch.add("other.csv", STEP + "t_s,vab_v,ia_a\n" + ROWS)
    whole = run_stage.process_motor

    def breaking(job: MotorJob) -> MotorResult:
        if job.motor_id == "stray":
            raise RecursionError("too deep")
        return whole(job)

    monkeypatch.setattr(run_stage, "process_motor", breaking)
    code, _ = batch.run()
    assert code == 5
    (line,) = [line for line in capsys.readouterr().err.splitlines() if "stray" in line]
    assert line.startswith("error: motor stray could not be finished: RecursionError: too deep")
    listed = json.loads((batch.output / "outputs.json").read_bytes())["files"]
    tables = ["fleet.csv", "fleet.parquet"]
    own = [f"{kind}/gimbal~2fone.json" for kind in ("datasheets", "performance")]
    assert listed == sorted([*own, "findings.json", *tables])


def test_an_output_whose_place_a_file_has_taken(
    batch: Batch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Exit 5 where `datasheets` cannot be made because it is a file."""
    output = batch.output
    output.mkdir()
    (output / "datasheets").write_text("in the way")
    words = [f"input={batch.input}", f"output={output}", "workers=1", "residual_test=false"]
    assert main(["run", *words, "report=false", "recordings=false"]) == 5
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("error: cannot write gimbal~2fone.json in ")
    assert str(output / "datasheets") in line
    assert "name an output folder that can be written" in line


def test_a_truncated_recording(batch: Batch) -> None:
    whole = (batch.bench / "one" / "spin_down_forward.mcap").read_bytes()
    batch.add("cut.mcap", whole[: len(whole) // 2])
    code, findings = batch.run()
    assert code == 3
    assert refused(findings)["file"] == "cut.mcap"


def test_an_unknown_unit(batch: Batch, tmp_path: Path) -> None:
    """A column named after no unit of the contract is left alone; a needed one is missed."""
    batch.add("unit.csv", STEP + "t_s,vab_furlong,ia_a\n" + ROWS)
    code, findings = batch.run()
    assert code == 3
    only = refused(findings)
    assert only["file"] == "unit.csv"
    assert "vab" in only["message"]


def test_captures_that_disagree_on_pole_pairs_fail_the_nameplate(batch: Batch) -> None:
    """7 is measured; one capture's nameplate says 14: both files are named, the check fails."""
    text = (batch.input / "resistance_ab.csv").read_text()
    assert "# pole_pairs: 7\n" in text
    batch.add("resistance_ab.csv", text.replace("# pole_pairs: 7\n", "# pole_pairs: 14\n"))
    code, findings = batch.run()
    assert code == 1
    (only,) = [f for f in findings if "pole_pairs" in f["message"]]
    assert "resistance_ab.csv" in only["file"] + only["message"]
    assert "open_circuit_forward.mcap" in only["file"] + only["message"]
    sheet = json.loads((batch.output / "datasheets" / "gimbal~2fone.json").read_bytes())
    assert sheet["status"] == "refused"
    (check,) = [c for c in sheet["checks"] if c["name"] == "pole_pairs_nameplate"]
    assert check["status"] == "fail"
    assert "poles" in check["suspect"]


def test_a_motor_with_one_test_is_undecided(batch: Batch) -> None:
    """Nothing can be checked against anything: exit 4, and the constant is there all the same."""
    (batch.input / "open_circuit_forward.mcap").unlink()
    code, findings = batch.run()
    assert code == 4
    assert not [f for f in findings if f["severity"] == "refused"]


def test_an_empty_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "in").mkdir()
    assert main(["run", f"input={tmp_path / 'in'}", f"output={tmp_path / 'out'}"]) == 4
    assert capsys.readouterr().err.count("\n") == 1


def test_a_typo_in_an_option_is_usage(bench: Path, tmp_path: Path) -> None:
    words = [f"input={bench / 'one'}", f"output={tmp_path}"]
    assert main(["run", *words, "crosscheck.kt_vs_ke.alowance=0.1"]) == 2
    assert main(["run", *words, "fit.nothing.x=1"]) == 2
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "word", ["read_seconds=-5", "read_memory_mb=0", "read_memory_mb=59", "workers=-1"]
)
def test_impossible_limits_are_a_mistake_of_the_command(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], word: str
) -> None:
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "one.csv").write_text(STEP + "t_s,vab_v,ia_a\n" + ROWS)
    assert main(["run", f"input={tmp_path / 'in'}", f"output={tmp_path / 'out'}", word]) == 2
    assert word in capsys.readouterr().err.replace(".0", "")
    assert not list((tmp_path / "out").rglob("*.json"))
