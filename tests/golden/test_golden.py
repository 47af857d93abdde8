"""The golden tool sees a change of one bit, and nothing where there is none."""

from __future__ import annotations

import copy
import json
import math
import shutil
from pathlib import Path
from typing import Any

import pytest

from tests.golden.__main__ import main
from tests.golden.collect import SETS
from tests.golden.differences import differences

MOTOR = "G52-0601"


@pytest.fixture(scope="module")
def few(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two captures of a motor, constants of their own."""
    folder = tmp_path_factory.mktemp("few")
    for name in ("lcr.csv", "resistance_ab.mcap"):
        shutil.copy(next(p for p in (SETS["demo"] / MOTOR).iterdir() if p.name == name), folder)
    return folder


def test_a_file_is_written_and_compared(
    few: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(SETS, "demo", few)
    file = tmp_path / "golden.json"
    assert main(["--output", str(file), "--sets", "demo"]) == 0
    found = json.loads(file.read_bytes())
    sheet = found["demo"][MOTOR]
    assert sheet["constants"]["ld_h"]["status"] == "measured"
    assert sheet["diagnosis"]["verdict"] == "insufficient"
    value = sheet["constants"]["ld_h"]["value"]
    sheet["constants"]["ld_h"]["value"] = math.nextafter(value, 1.0)
    sheet["diagnosis"]["verdict"] = "other"
    file.write_text(json.dumps(found))
    assert main(["--against", str(file), "--sets", "demo", "--constants"]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith(f"demo {MOTOR} constants ld_h value: ")
    assert lines[1:] == ["1 differences"]


GOLDEN: dict[str, Any] = {"a": {"x": {"value": 2.0, "u": None}, "names": ["cogging", "windage"]}}


def test_nothing_differs_from_itself() -> None:
    assert list(differences(GOLDEN, copy.deepcopy(GOLDEN))) == []


def test_every_kind_of_difference_is_told() -> None:
    new = copy.deepcopy(GOLDEN)
    new["a"]["x"] = {"value": 2.5, "u": 0.0, "status": "measured"}
    new["a"]["names"] = ["cogging"]
    new["b"] = {}
    assert list(differences(GOLDEN, new)) == [
        "a names: ['cogging', 'windage'] -> ['cogging']",
        "a x status: absent -> measured",
        "a x u: None -> 0.0",
        "a x value: 2.0 -> 2.5 (+0.25)",
        "b: absent -> {}",
    ]
