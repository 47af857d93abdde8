"""Damage, bombs, kills and full disks; the table of `docs/fleet.md` runs the same at full size."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from pipeline.__main__ import main
from tests.faults.bombs import BESIDE, BOMBS, write
from tests.faults.damage import LAYOUTS, damage
from tests.faults.fleet import CAPTURES, ROOT, cost, make_fleet, simulated
from tests.faults.kills import WORDS, full_disk, kill_runs

FULL = pytest.mark.slow


@pytest.fixture(scope="session")
def one(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The captures of one simulated motor."""
    return simulated(tmp_path_factory.mktemp("fleet") / "one")


@pytest.mark.parametrize("step", [24, pytest.param(1, marks=FULL)])
@pytest.mark.parametrize("layout", LAYOUTS)
def test_no_damage_is_silent(layout: str, step: int) -> None:
    """Every truncation and every flipped bit: refused, and by a CaptureError."""
    found = damage(layout, step)
    assert found.truncations > found.size_bytes // (step + 1)
    assert (found.silent, found.untyped) == ((), ())


def test_bombs_are_refused_in_little_time_and_memory(tmp_path: Path) -> None:
    """One process reads them all: 2 s of computing each, 256 MB in all, and none gives a sample.

    A packed table is no capture, since nobody unpacks it to see.
    """
    names = [path.name for path in write(tmp_path)]
    done = subprocess.run(
        [sys.executable, "-m", "tests.faults.bombs", str(tmp_path)],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        check=True,
        capture_output=True,
    )
    found = [json.loads(line) for line in done.stdout.splitlines()]
    assert sorted(f["file"] for f in found) == sorted(names) == sorted([*BOMBS, *BESIDE])
    unread = {"gzip.csv", "zlib.csv", "many keys.csv"}
    for bomb in found:
        assert bomb["seconds"] < 2.0, bomb
        assert bomb["peak_mb"] < 256, bomb
        assert "READ" not in bomb["codes"], bomb
        assert bomb["codes"] or bomb["file"] in unread, bomb


@pytest.mark.parametrize("kills", [1, pytest.param(100, marks=FULL)])
def test_a_killed_run_is_finished_by_the_next(one: Path, tmp_path: Path, kills: int) -> None:
    """No torn file, no version lost that the registry had, the bytes of a clean run, no orphan."""
    folder = make_fleet(one, tmp_path / "in", 1 if kills < 10 else 6)
    found = kill_runs(folder, tmp_path, kills)
    assert found.kills == kills
    assert (found.torn, found.lost, found.different, found.left_over) == ((), 0, (), ())
    assert found.orphans == 0


@pytest.mark.parametrize("share", [0.3, *(pytest.param(n, marks=FULL) for n in (0.005, 0.04, 1.0))])
def test_a_full_disk(one: Path, tmp_path: Path, share: float) -> None:
    """Exit 5, one line that says what to do, and no file that is not whole.

    The disk takes no file beyond a share of the largest one that a run writes, less a byte.
    """
    folder = make_fleet(one, tmp_path / "in", 1)
    assert main(["run", f"input={folder}", f"output={tmp_path / 'whole'}", *WORDS]) in (0, 4)
    largest = max(p.stat().st_size for p in (tmp_path / "whole").rglob("*") if p.is_file())
    limit_bytes = int(share * largest) - 1
    found = full_disk(folder, tmp_path / "out", tmp_path / "home", limit_bytes)
    assert (found.torn, found.left_over) == ((), ())
    assert found.code == 5, found
    assert "free the disk" in found.errors[-1]


@FULL
def test_a_fleet(one: Path, tmp_path: Path) -> None:
    """500 motors: the driver's memory grows by less than 0.2 MB a motor, a worker's not at all."""
    few = make_fleet(one, tmp_path / "few", 50)
    many = make_fleet(one, tmp_path / "many", 500)
    words = ("recordings=false", "report=false", "workers=2")
    costs = [
        cost("run", f"input={folder}", f"output={tmp_path / f'out{n}'}", *words)
        for n, folder in enumerate((few, many))
    ]
    assert [c.code for c in costs] == [0, 0] or all(c.code in (0, 1, 3, 4) for c in costs)
    assert len(list((tmp_path / "out1" / "datasheets").iterdir())) == 500
    assert costs[1].driver_mb - costs[0].driver_mb < 0.2 * 450
    assert costs[1].worker_mb < 1.15 * costs[0].worker_mb
    assert len(CAPTURES) == 3


@FULL
def test_ninety_nine_of_a_hundred(tmp_path: Path, one: Path) -> None:
    """One capture of a hundred is a bomb: 99 are used, one line, exit 3."""
    folder = make_fleet(one, tmp_path / "in", 33)
    (folder / "bomb.mcap").write_bytes(BOMBS["zstd, 4 GiB out of 100 declared bytes.mcap"]())
    words = [f"input={folder}", f"output={tmp_path / 'out'}", "report=false", "recordings=false"]
    words.append("residual_test=false")
    done = subprocess.run(
        [sys.executable, "-m", "pipeline", "run", *words],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT), "XDG_CACHE_HOME": str(tmp_path / "home")},
        check=False,
        capture_output=True,
        text=True,
    )
    assert done.returncode in (1, 3), done.stderr
    refused = [line for line in done.stderr.splitlines() if line.startswith("refused: ")]
    assert len(refused) == 1
    assert refused[0].startswith("refused: bomb.mcap")
    sheets = (tmp_path / "out" / "datasheets").glob("*.json")
    used = [c for s in sheets for c in json.loads(s.read_bytes())["provenance"]["captures"]]
    assert len(used) == 99
