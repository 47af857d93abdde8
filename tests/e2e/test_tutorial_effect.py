"""The tutorial's commands and file, run in order, do what the page says."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path

import pytest

from pipeline.__main__ import main
from pipeline.io.storage.plain_yaml import load_plain
from pipeline.simulator.catalogue import motor_from

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "tutorial-effect.md"


def blocks(language):
    text = PAGE.read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL)


def document(folder, kind="comparison"):
    path = folder / kind / "braked.json"
    return json.loads(path.read_text(encoding="utf-8"))


@pytest.mark.slow
def test_the_error_falls_to_the_floor(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "reports" / "tutorial" / "effects"
    folder.mkdir(parents=True)
    (source,) = blocks("python")
    (folder / "eddy_brake.py").write_text(source, encoding="utf-8")
    for command in blocks("bash"):
        words = shlex.split(command)
        assert words[:3] == ["python", "-m", "pipeline"]
        assert main(words[3:]) == 0, command
    before = document(tmp_path / "reports" / "tutorial" / "before")
    after = document(tmp_path / "reports" / "tutorial" / "after")
    assert before["total"]["held_out"] > 5.0
    assert after["total"]["held_out"] < 1.3
    # the simulator's brake peaks at a third of rated speed with 3 % of rated torque
    motor = motor_from(load_plain((ROOT / "conf/motor/gimbal-5208.yaml").read_bytes(), "motor"))
    found = {name: one["value"] for name, one in after["model"]["parameters"].items()}
    assert found["eddy_brake.speed_rad_s"] == pytest.approx(motor.speed_rated_rad_s / 3, rel=0.03)
    assert found["eddy_brake.torque_nm"] == pytest.approx(0.03 * motor.torque_rated_nm, rel=0.03)
    told = document(tmp_path / "reports" / "tutorial" / "without", "diagnosis")
    assert (told["verdict"], told["missing"]) == ("unknown", ["cogging"])
    (term,) = told["unknown"]["sketch"]
    assert told["unknown"]["variables"] == ["omega_mech_rad_s"]
    assert term["coefficient"] == pytest.approx(0.03 * motor.torque_rated_nm, rel=0.03)
