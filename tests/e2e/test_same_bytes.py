"""The same work gives the same bytes, whatever is not part of the work."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from pipeline.__main__ import main

ROOT = Path(__file__).parents[2]
TABLE = re.compile(r"registry/(_delta_log/|part-)")


def results(
    bench: Path, output: Path, workers: int, *more: str, **environment: str
) -> dict[str, bytes]:
    """Every output of a fresh process that is reproducible.

    Recordings (.rrd) never are, and the registry's table says when each row was added; its file of
    each version has no time in it.
    """
    words = [f"input={bench}", f"output={output}", f"workers={workers}", "recordings=false", *more]
    done = subprocess.run(
        [sys.executable, "-m", "pipeline", "run", *words],
        cwd=ROOT,
        env={**os.environ, **environment},
        check=False,
        capture_output=True,
        text=True,
    )
    assert done.returncode in (0, 1), done.stderr
    return {
        path.relative_to(output).as_posix(): path.read_bytes()
        for path in sorted(output.rglob("*"))
        if path.is_file() and not TABLE.match(path.relative_to(output).as_posix())
    }


STILL = ("resistance", "current", "lcr")
"""Tests of a locked rotor by the first word of their files: no model of motion is searched."""


SHORT = ("cogging", "spin", "open", "hand", "heat")
"""Further ones in which a model is searched in seconds."""
LEAST = ("cogging", "spin")
"""Of them, enough for a search of a model."""
ALL = (*SHORT, "drive", "flux", "holding", "torque")


def part_of(bench: Path, folder: Path, moving: tuple[str, ...]) -> Path:
    """A folder with the first capture of each test of one motor that is still or among the `moving`
    ones, and the first and the last of the still ones of another.
    """
    for motor in ("one", "two"):
        by_test: dict[str, list[Path]] = {}
        for path in sorted((bench / motor).iterdir()):
            by_test.setdefault(path.name.split("_")[0], []).append(path)
        (folder / motor).mkdir(parents=True)
        for test, found in by_test.items():
            both = {found[0], found[-1]} if test in STILL else set()
            one = found[:1] if test in (*STILL, *moving) else []
            for path in both if motor == "two" else one:
                shutil.copyfile(path, folder / motor / path.name)
    return folder


@pytest.mark.parametrize(
    "moving", [LEAST, *(pytest.param(more, marks=pytest.mark.slow) for more in (SHORT, ALL))]
)
def test_nothing_but_the_work_changes_the_bytes(
    bench: Path, tmp_path: Path, moving: tuple[str, ...]
) -> None:
    """A rerun; then a copy made in reverse order, 2 workers, elsewhere, elsewhen; then less."""
    bench = part_of(bench, tmp_path / "in", moving)
    first = results(bench, tmp_path / "a", 1, TZ="UTC", LC_ALL="C", PYTHONHASHSEED="1")
    assert len([name for name in first if name.startswith("datasheets/")]) == 2
    assert len([name for name in first if name.startswith("registry/_versions/")]) == 2
    assert results(bench, tmp_path / "a", 1, PYTHONHASHSEED="3") == first

    copy = tmp_path / "another place" / "k\u00f6pie"
    for path in sorted(bench.rglob("*"), reverse=True):
        if path.is_file():
            target = copy / path.relative_to(bench)
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(path, target)
    elsewhere = {"TZ": "Asia/Kathmandu", "LC_ALL": "de_DE.UTF-8", "PYTHONHASHSEED": "2"}
    assert results(copy, tmp_path / "b", 2, **elsewhere) == first

    one = results(bench / "one", tmp_path / "a", 1, "prune=true", "residual_test=false")
    kept = ("registry/", ".cache/")
    pages = {name for name in one if "gimbal" in name and not name.startswith(kept)}
    kinds = {"datasheets": "json", "performance": "json", "report": "html", "sheet": "html"}
    assert pages == {f"{kind}/gimbal~2fone.{form}" for kind, form in kinds.items()}


def test_auto_release_needs_every_condition(bench: Path, tmp_path: Path) -> None:
    """A whole, sound campaign is released; without its torque map and drives it says what lacks."""
    copy = tmp_path / "in"
    shutil.copytree(bench / "one", copy)
    words = ["release=auto", "report=false", "recordings=false", "workers=1"]
    words.append("model.effects=[cogging]")
    assert main(["run", f"input={copy}", f"output={tmp_path / 'whole'}", *words]) == 0
    (sheet,) = (tmp_path / "whole" / "datasheets").iterdir()
    whole = json.loads(sheet.read_bytes())
    assert (whole["status"], whole["why"]) == ("released", [])
    for path in (*copy.glob("torque_map*"), *copy.glob("drive_*")):
        path.unlink()  # both give a torque constant
    # the residual test has said its part above
    less = [f"input={copy}", f"output={tmp_path / 'part'}", *words[:-1], "residual_test=false"]
    assert main(["run", *less]) == 0
    (sheet,) = (tmp_path / "part" / "datasheets").iterdir()
    part = json.loads(sheet.read_bytes())
    assert part["status"] == "provisional"
    assert any("kt_peak_nm_a" in reason for reason in part["why"])
    assert part["version"] != whole["version"]


@pytest.mark.slow
def test_a_diagnosis_is_the_same_on_one_core_and_on_two(tmp_path: Path) -> None:
    """A second process shares the work on segments; which segments never depends on the clock."""
    cores = os.sched_getaffinity(0)
    if len(cores) < 2:
        pytest.skip("needs two cores")
    words = ["diagnose", f"input={ROOT / 'data' / 'demo'}", "motor=G52-0603"]
    texts = []
    for allowed in ({min(cores)}, cores):
        output = tmp_path / str(len(allowed))
        subprocess.run(
            [sys.executable, "-m", "pipeline", *words, f"output={output}"],
            cwd=ROOT,
            check=False,
            capture_output=True,
            preexec_fn=lambda allowed=allowed: os.sched_setaffinity(0, allowed),
        )
        texts.append((output / "diagnosis" / "G52-0603.json").read_bytes())
    assert texts[0] == texts[1]
