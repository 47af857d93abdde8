"""`make demo` takes the one failed check that it expects, and no other."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from pipeline.io.storage.publish import canonical_json
from pipeline.records.datasheet import Check, Datasheet
from pipeline.records.model_verdict import FoundEffect, ModelVerdict
from tests import demo

MAKEFILE = Path(__file__).parents[3] / "Makefile"
JOINT = Check("resistance_balance", "fail", "spread of the phases", 0.1, 0.02, "1")


FAULTY = {"G52-0603": "stribeck", "G52-1402": "phase_imbalance"}


def sheet(motor_id: str, *checks: Check, lacks: str | None = None) -> Datasheet:
    """A datasheet that lacks what its motor is known to lack, or what it is told."""
    name = FAULTY.get(motor_id, "") if lacks is None else lacks
    missing = {name: FoundEffect({}, name)} if name else {}
    model = ModelVerdict("missing" if missing else "adequate", missing=missing)
    return Datasheet(
        motor_id, "made-up", None, "a" * 64, "refused", ("a check failed",), (), "0" * 64, "dev",
        {}, (), checks, model=model,
    )  # fmt: skip


BEARING = sheet("G52-0603")


def test_the_expected_failure_is_none() -> None:
    assert demo.surprises([sheet("G52-0601"), BEARING, sheet("G52-1402", JOINT)]) == []


def test_a_bearing_that_nobody_sees_is_one_and_so_is_a_false_name() -> None:
    sound = sheet("G52-0603", lacks="")
    (line,) = demo.surprises([sound, sheet("G52-1402", JOINT)])
    assert line == "G52-0603: stribeck was not found"
    (line,) = demo.surprises(
        [sheet("G52-0601", lacks="windage"), BEARING, sheet("G52-1402", JOINT)]
    )
    assert line == "G52-0601: lacks windage, and should not"


@pytest.mark.parametrize(
    ("motor", "check"),
    [("G52-0601", JOINT), ("G52-1402", replace(JOINT, name="kt_vs_ke"))],
)
def test_another_failure_is_one(motor: str, check: Check) -> None:
    """The same check of another motor, or another check of that motor."""
    (line,) = demo.surprises([BEARING, sheet("G52-1402", JOINT), sheet(motor, check)])
    assert line == f"{motor}: {check.name} failed, and should hold"


def test_a_joint_that_nobody_sees_is_one() -> None:
    (line,) = demo.surprises([BEARING, sheet("G52-1402", replace(JOINT, status="pass"))])
    assert line == "G52-1402: resistance_balance holds, and should fail"


def test_make_demo_asks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The recipe runs it on the folder that `run` wrote to; it answers by its exit code."""
    recipe = MAKEFILE.read_text().split("\ndemo:")[1].split("\n\n")[0]
    assert "output=reports/demo" in recipe
    assert recipe.endswith("-m tests.demo reports/demo")
    folder = tmp_path / "datasheets"
    folder.mkdir()
    (folder / "b.json").write_bytes(canonical_json(BEARING.document()))
    monkeypatch.setattr("sys.argv", ["demo", str(tmp_path)])
    for checks, code in (((JOINT,), 0), ((), 1)):
        document = sheet("G52-1402", *checks).document()
        (folder / "m.json").write_bytes(canonical_json(document))
        assert demo.main() == code
