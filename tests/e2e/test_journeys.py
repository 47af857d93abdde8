"""What a user does one after another, each step by what the one before printed or showed."""

from __future__ import annotations

import html
import json
import re
import shlex
import shutil
from pathlib import Path

import pytest

from pipeline.__main__ import main
from pipeline.records.model_verdict import number

DEMO = Path(__file__).parents[2] / "data" / "demo"
MOTOR = "G52-0603"
"""Its bearing is dry: 2.5 mN·m more below 8 rad/s."""
NAMES = ("cogging_cw.mcap", "cogging_ccw.mcap", "drive_0.mcap", "spin_down_forward.mcap")
PROGRAM = "next: python -m pipeline "


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Captures that show the bearing, in a folder whose name a shell parts."""
    place = tmp_path / "my captures"
    place.mkdir()
    for name in NAMES:
        shutil.copy(DEMO / MOTOR / name, place / name)
    return place


def told(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    """What a command prints."""
    assert main(list(words)) in (0, 4)
    return capsys.readouterr().out


def following(printed: str) -> list[str]:
    """The words of the command that was named last, as a shell takes them."""
    (line,) = (line for line in printed.splitlines() if line.startswith("next: "))
    assert line.startswith(PROGRAM)
    return shlex.split(line.removeprefix(PROGRAM))


def test_from_a_hidden_effect_to_the_page_that_shows_it_gone(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Run names the effect, its page a command; that names another, whose page shows the fall."""
    output = tmp_path / "out"
    where = (f"input={folder}", f"output={output}", "model.effects=[cogging]")
    printed = told(capsys, "run", *where, "recordings=false")
    assert re.search(
        r"lacks extra friction of 2\.\d+ ± \S+ mN·m below [789]\.\d+ ± \S+ rad/s", printed
    )
    adding = following(printed)
    assert adding[0] == "run"
    assert set(adding[1:]) == {*where[:2], "model.effects=[cogging,stribeck]"}

    page = html.unescape((output / "report" / f"{MOTOR}.html").read_text())
    assert "lacks extra friction of 2." in page
    (command,) = set(re.findall(r"motor-datasheets (diagnose [^<]+)", page))
    words = [word.replace("FOLDER", str(folder)) for word in shlex.split(command)]
    comparing = following(told(capsys, *words, where[1]))
    assert comparing[0] == "compare"

    done = following(told(capsys, *comparing))
    total = json.loads((output / "comparison" / f"{MOTOR}.json").read_text())["total"]
    assert total["without_effects"] > 2.0
    assert total["held_out"] < 1.0
    shown = html.unescape((output / "comparison" / f"{MOTOR}.html").read_text())
    assert f"the held-out error falls from {number(total['without_effects'])} to" in shown
    assert "stribeck" in shown
    assert done == adding, "what explains the captures goes into the datasheet"


def test_from_a_registered_datasheet_to_its_export(
    folder: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Plan where constants are missing; else show, approve, export: each as the last one named."""
    output = tmp_path / "out"
    more = (f"output={output}", "residual_test=false", "recordings=false", "report=false")
    planning = following(told(capsys, "run", f"input={folder}", *more))
    assert planning == ["plan", f"motor={MOTOR}", f"output={output}"]
    assert "what to record next" in told(capsys, *planning)
    showing = ["registry", "show", MOTOR, f"output={output}"]
    assert following(told(capsys, *showing)) == planning
    assert following(told(capsys, "run", f"input={DEMO / MOTOR}", *more)) == showing
    approving = following(told(capsys, *showing))
    assert approving[:3] == ["registry", "approve", MOTOR]
    exporting = following(told(capsys, *approving))
    assert exporting[:3] == ["export", "json", MOTOR]
    printed = told(capsys, *exporting)
    (path,) = (output / "export").iterdir()
    exported = json.loads(path.read_text())
    lines = path.read_text().count("\n")
    assert printed.splitlines()[:2] == [f"{lines} lines", f"wrote {path}"]
    monkeypatch.setattr("pipeline.stages.export.MOST_LINES", lines)
    assert told(capsys, *exporting).strip() == path.read_text().strip()
    assert exported["constants"]["cogging_order"]["value"] == 84
