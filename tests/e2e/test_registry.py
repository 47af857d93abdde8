"""A run and its registry: every version once, whatever is run again, and never a new datasheet."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path
from typing import Any

import pytest

from pipeline.__main__ import main
from pipeline.io.registry.store import Registry
from tests.registered import NOON

HEAD = "# contract: 1\n# motor_id: J/1\n# test: resistance\n# pair: ab\n# station: hall\n# lot: 7\n"
LEVELS = [-2.0, -1.0, 1.0, 2.0]
UNDECIDED = 4  # one test: nothing to check it against


class Bench:
    """A resistance test of one motor, two terminals of 0.6 ohm, and a folder to write to."""

    def __init__(self, folder: Path) -> None:
        self.input, self.output = folder / "in", folder / "out"
        self.input.mkdir()
        self.record("ab.csv", 0.6)

    def record(self, name: str, r_ohm: float) -> None:
        rows = [
            f"{0.001 * (200 * level + k):.3f},{r_ohm * i_a},{i_a},25.0\n"
            for level, i_a in enumerate(LEVELS)
            for k in range(200)
        ]
        text = HEAD + "t_s,vab_v,ia_a,temp_winding_degc\n" + "".join(rows)
        (self.input / name).write_text(text)

    def run(self, *more: str) -> int:
        words = [f"input={self.input}", f"output={self.output}", "workers=1", "diagnose=false"]
        return main(["run", *words, "report=false", "recordings=false", *more])

    def sheet(self) -> tuple[bytes, dict[str, Any]]:
        (path,) = (self.output / "datasheets").iterdir()
        content = path.read_bytes()
        return content, json.loads(content)


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    return Bench(tmp_path)


def test_every_version_once(bench: Bench, capsys: pytest.CaptureFixture[str]) -> None:
    """A rerun adds nothing; other settings and another recording are revisions 2 and 3."""
    place = bench.output / "registry"
    assert bench.run() == UNDECIDED
    assert "1 new, 0 known" in capsys.readouterr().out
    content, said = bench.sheet()
    (file,) = (place / "_versions").rglob("*.json")
    assert file.read_bytes() == content
    before = {path: path.read_bytes() for path in place.rglob("*") if path.is_file()}
    assert bench.run() == UNDECIDED
    assert "0 new, 1 known" in capsys.readouterr().out
    assert {path: path.read_bytes() for path in place.rglob("*") if path.is_file()} == before

    assert bench.run("release=auto") == UNDECIDED
    bench.record("again.csv", 0.61)
    assert bench.run() == UNDECIDED
    history = Registry(str(place)).history("J/1")
    assert [version.revision for version in history] == [1, 2, 3]
    assert history[0].version == said["version"]
    assert history[2].version == bench.sheet()[1]["version"]
    own = history[0].published
    assert (own.lot, own.stations, own.status) == ("7", ("hall",), said["status"])
    assert Registry(str(place)).verify().faults == ()


def test_a_decision_leaves_the_datasheet_and_a_rerun_leaves_the_decision(bench: Bench) -> None:
    bench.run()
    content, _ = bench.sheet()
    place = bench.output / "registry"
    words = ["revoke", "J/1", "revision=1", "by=A. Smith", "why=wrong clamp"]
    assert main(["registry", *words, f"registry={place}"]) == 0
    bench.run()
    assert bench.sheet()[0] == content
    assert [version.status for version in Registry(str(place)).history("J/1")] == ["revoked"]


def test_a_registry_elsewhere_or_none(bench: Bench, tmp_path: Path) -> None:
    assert bench.run("registry=null") == UNDECIDED
    assert not (bench.output / "registry").exists()
    assert bench.run(f"registry={tmp_path / 'kept'}") == UNDECIDED
    assert not (bench.output / "registry").exists()
    assert len(Registry(str(tmp_path / "kept")).history("J/1")) == 1


def test_the_place_of_the_registry_is_no_part_of_the_version(bench: Bench, tmp_path: Path) -> None:
    bench.run("registry=null")
    content, _ = bench.sheet()
    bench.run(f"registry={tmp_path / 'kept'}", "registry_options.timeout=30s")
    assert bench.sheet()[0] == content


def test_other_content_under_a_registered_version_fails_the_run(
    bench: Bench, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Equal work gave other bytes: said in one line, exit 1, and the first content stays."""
    bench.run("registry=null")
    _, said = bench.sheet()
    other = said | {"lot": "8"}
    registry = Registry(str(tmp_path / "kept"))
    registry.publish([other], NOON)
    capsys.readouterr()
    assert bench.run(f"registry={tmp_path / 'kept'}") == 1
    assert "registered with other content" in capsys.readouterr().err
    assert registry.documents(registry.history("J/1")) == [other]


def test_a_registry_that_fails_leaves_the_outputs_whole(
    bench: Bench, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("no folder")
    assert bench.run(f"registry={tmp_path / 'file' / 'registry'}") == 5
    assert "error: registry" in capsys.readouterr().err
    assert bench.sheet()[1]["constants"]["r_ll_ohm"]["status"] != "not_identifiable"
    assert (bench.output / "findings.json").is_file()


def test_a_place_where_no_registry_can_be_is_said_before_any_work(bench: Bench) -> None:
    assert bench.run("registry=gopher://bench/registry") == 2
    assert not bench.output.exists()


QUICK = ("report=false", "recordings=false", "residual_test=false")


def test_the_readme_releases_and_exports_a_motor_of_the_demo(tmp_path: Path) -> None:
    """Its lines as they stand, in their order, on what a run of the demo's captures published."""
    root = Path(__file__).parents[2]
    readme = (root / "README.md").read_text(encoding="utf-8").split("## Releasing")[1]
    lines = re.findall(r"^ {4}\.venv/bin/python -m pipeline (.*)$", readme, flags=re.MULTILINE)
    approve, export = (shlex.split(line) for line in lines[:2])
    assert (approve[:2], export[0]) == (["registry", "approve"], "export")
    output, registry = f"output={tmp_path}", f"registry={tmp_path / 'registry'}"
    demo = root / "data" / "demo" / "G52-0601"
    assert main(["run", f"input={demo}", output, *QUICK]) == 0
    assert main([*export, output]) == 2
    assert main([*approve, registry]) == 0
    assert main([*export, output]) == 0
