"""Plug-ins of other packages: found by entry point, and named where they are at fault."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
GROUPS = {
    "readers": ("pipeline.io.tables.foreign", "readers"),
    "gates": ("pipeline.contracts.registry", "gates"),
    "estimators": ("pipeline.estimation.registry", "estimators"),
    "rules": ("pipeline.crosscheck.registry", "rules"),
    "exporters": ("pipeline.export.registry", "exporters"),
    "effects": ("pipeline.criticism.library.registry", "effects"),
}
MARKS = {
    "gates": "GATE",
    "estimators": "ESTIMATOR",
    "rules": "RULE",
    "exporters": "EXPORTER",
    "effects": "EFFECT",
}
READER = """
from pipeline.io.tables.foreign import Reader
from pipeline.io.tables.raw_table import RawTable

READER = Reader("hall_binary", lambda data: (RawTable("hall", {}),))
"""


def package(folder: Path, group: str, source: str, mark: str) -> None:
    """An installed package of one module that offers one plug-in."""
    (folder / "outside_plug_in.py").write_text(source)
    info = folder / "outside_plug_in-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: outside-plug-in\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(
        f"[motor_datasheets.{group}]\nours = outside_plug_in:{mark}\n"
    )


def python(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": f"{folder}{os.pathsep}{ROOT}"}
    return subprocess.run(
        [sys.executable, *words],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


def example(mark: str) -> str:
    """The complete example of CONTRIBUTING.md that ends in a plug-in of this name."""
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / "CONTRIBUTING.md").read_text(), re.DOTALL)
    (source,) = [text for text in blocks if f"\n{mark} = " in text]
    return source


@pytest.mark.parametrize("group", GROUPS)
def test_one_file_of_another_package_is_found(group: str, tmp_path: Path) -> None:
    """The documented examples, each in a package outside; nothing of this one is edited."""
    mark = MARKS.get(group, "READER")
    package(tmp_path, group, READER if group == "readers" else example(mark), mark)
    module, function = GROUPS[group]
    code = (
        f"import json, outside_plug_in as o\n"
        f"from {module} import {function} as found\n"
        f"names = [getattr(one, 'name', one) for one in found()]\n"
        f"print(json.dumps([o.{mark}.name in names, len(names)]))"
    )
    done = python(tmp_path, "-c", code)
    assert done.returncode == 0, done.stderr
    there, count = json.loads(done.stdout)
    assert there
    assert count > 1


@pytest.mark.parametrize(
    ("source", "said"),
    [
        ("EFFECT = 7", "is no Effect"),
        ("import nothing_there", "ModuleNotFoundError"),
        (
            "from pipeline.criticism.effects.cogging import EFFECT",
            "cogging is in pipeline.criticism.effects.cogging already",
        ),
    ],
)
def test_one_at_fault_is_named_and_no_traceback_shown(
    source: str, said: str, tmp_path: Path
) -> None:
    package(tmp_path, "effects", source, "EFFECT")
    words = [f"input={ROOT / 'data' / 'demo' / 'G52-0601'}", f"output={tmp_path / 'out'}"]
    done = python(tmp_path, "-m", "pipeline", "compare", *words, "model.effects=[cogging]")
    assert done.returncode == 2
    assert said in done.stderr
    assert "outside_plug_in:EFFECT" in done.stderr
    assert "Traceback" not in done.stderr


def test_what_is_kept_hangs_on_the_sources_of_outside_plug_ins(tmp_path: Path) -> None:
    """A fit that is kept must not outlive an edit of the estimator that gave it."""
    package(tmp_path, "estimators", example("ESTIMATOR"), "ESTIMATOR")
    code = "from pipeline.plugins import outside_version as v; print(v())"
    before = python(tmp_path, "-c", code).stdout
    assert "outside_plug_in:ESTIMATOR 1.0" in before
    module = tmp_path / "outside_plug_in.py"
    module.write_text(module.read_text().replace("least_swing_a", "smallest_swing_a"))
    after = python(tmp_path, "-c", code).stdout
    assert after != before
    assert python(ROOT, "-c", code).stdout == "\n"
    whole = "from pipeline.execution.versions import datasheet_libraries as v; print(v())"
    assert after.strip() in python(tmp_path, "-c", whole).stdout
