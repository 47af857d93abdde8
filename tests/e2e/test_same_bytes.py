"""The same work gives the same bytes, whatever is not part of the work."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]


def results(bench: Path, output: Path, workers: int, **environment: str) -> dict[str, bytes]:
    """Every output of a fresh process but the recordings (.rrd files are never reproducible)."""
    words = [f"input={bench}", f"output={output}", f"workers={workers}", "recordings=false"]
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
        if path.is_file()
    }


def test_order_workers_folder_zone_locale_and_hash_seed_change_nothing(
    bench: Path, tmp_path: Path
) -> None:
    """A copy made in reverse order, 2 workers, elsewhere, elsewhen, against the original."""
    copy = tmp_path / "another place" / "k\u00f6pie"
    for path in sorted(bench.rglob("*"), reverse=True):
        if path.is_file():
            target = copy / path.relative_to(bench)
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(path, target)
    first = results(bench, tmp_path / "a", 1, TZ="UTC", LC_ALL="C", PYTHONHASHSEED="1")
    second = results(
        copy, tmp_path / "b", 2, TZ="Asia/Kathmandu", LC_ALL="de_DE.UTF-8", PYTHONHASHSEED="2"
    )
    assert {name for name in first if name.startswith("datasheets/")}
    assert first == second


def test_a_rerun_into_the_same_folder_changes_nothing(bench: Path, tmp_path: Path) -> None:
    assert results(bench, tmp_path, 1) == results(bench, tmp_path, 1)


def test_a_motor_taken_away_leaves_nothing_behind(bench: Path, tmp_path: Path) -> None:
    """The report of a smaller batch holds no page of a motor that is no longer in it."""
    both = results(bench, tmp_path, 1)
    one = results(bench / "one", tmp_path, 1)
    assert len([name for name in both if name.startswith("datasheets/")]) == 2
    assert [name for name in one if name.startswith("datasheets/")] == [
        "datasheets/gimbal~2fone.json"
    ]
