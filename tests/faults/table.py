"""The figures of `docs/fleet.md`, measured: `python -m tests.faults.table [NAME ...]`.

Each name is one row or some rows; without any all are measured, an hour or so. Rows that are not
measured stay as they stand in the document.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from tests.bench.decoding import PUBLIC, TARGETS
from tests.bench.decoding import measure as decode
from tests.faults.bombs import write
from tests.faults.damage import LAYOUTS, damage
from tests.faults.fleet import CAPTURES, ROOT, Cost, cost, make_fleet, simulated
from tests.faults.fuzz import fuzz
from tests.faults.kills import full_disk, kill_runs

DOCUMENT = ROOT / "docs" / "fleet.md"
BEGIN, END = "<!-- figures -->", "<!-- end of figures -->"
HEAD = "| what | asked | measured |\n| --- | --- | --- |\n"
Row = tuple[str, str, str]


def damages(_: Path) -> list[Row]:
    """Truncations and flips of four layouts."""
    found = [damage(layout) for layout in LAYOUTS]
    cuts, flips = sum(d.truncations for d in found), sum(d.flips for d in found)
    silent = sum(len(d.silent) for d in found)
    untyped = sum(len(d.untyped) for d in found)
    seconds = sum(d.seconds for d in found)
    words = f"{cuts} and {flips}: {silent} silent, {untyped} untyped, {seconds:.0f} s"
    asked = "0 silent, 0 untyped, under 60 s"
    return [("every truncation and bit flip of four layouts", asked, words)]


def bombs(scratch: Path) -> list[Row]:
    """Crafted files."""
    count = len(list(write(scratch)))
    words = [sys.executable, "-m", "tests.faults.bombs", str(scratch)]
    done = subprocess.run(words, cwd=ROOT, check=True, capture_output=True)
    found = [json.loads(line) for line in done.stdout.splitlines()]
    worst = max(found, key=lambda bomb: bomb["seconds"])
    read = sum("READ" in bomb["codes"] for bomb in found)
    peak = max(bomb["peak_mb"] for bomb in found)
    said = f"{count} files, {read} read; {worst['seconds']:.2f} s of computing at most, {peak} MB"
    return [("crafted bombs", "none read, 2 s and 256 MB each", said)]


def ratios(_: Path) -> list[Row]:
    """Decoding of large files."""
    rows = []
    for kind, limit in TARGETS.items():
        found = decode(kind, 200.0)
        said = f"{found.ratio:.2f} ({found.rows_a_second / 1e6:.1f} million rows/s)"
        rows.append((f"decode {kind} to unpack and copy", f"{limit:g}", said))
    for kind, limit in PUBLIC.items():
        times = decode(kind, 20.0, public=True).public
        rows.append((f"public loop over ours, {kind}", f"{limit:g}", f"{times:.0f}"))
    return rows


def kills(scratch: Path) -> list[Row]:
    """Runs killed at random points."""
    folder = make_fleet(simulated(scratch / "one"), scratch / "in", 6)
    found = kill_runs(folder, scratch, 100)
    words = (
        f"{found.kills} kills, {found.during_work} during work: {len(found.torn)} torn, "
        f"{found.lost} lost, {len(found.different)} different, {found.orphans} orphans"
    )
    return [("kill -9 of `run`, then a rerun", "nothing torn or lost, equal bytes", words)]


def disks(scratch: Path) -> list[Row]:
    """Full disks."""
    folder = make_fleet(simulated(scratch / "one"), scratch / "in", 2)
    limits = (500, 4000, 30_000, 80_000, 120_000)
    found = [full_disk(folder, scratch / f"o{n}", scratch / "home", n) for n in limits]
    codes = ", ".join(str(f.code) for f in found)
    torn = sum(len(f.torn) + len(f.left_over) for f in found)
    words = f"{len(found)} limits: exit {codes}; {torn} torn or left over"
    return [("a full disk", "non-zero exit, nothing half-written", words)]


def rerun(scratch: Path) -> list[Row]:
    """1,000 captures with nothing changed."""
    folder = make_fleet(simulated(scratch / "one"), scratch / "in", 334)
    (scratch / "none").mkdir()
    words = ("recordings=false", "report=true")
    home = scratch / "home"
    place = (f"input={folder}", f"output={scratch / 'out'}")
    cost("run", *place, *words, cache=home)
    again = min(cost("run", *place, *words, cache=home).seconds for _ in range(3))
    empty = (f"input={scratch / 'none'}", f"output={scratch / 'nothing'}")
    start = min(cost("run", *empty, *words, cache=home).seconds for _ in range(3))
    said = f"{again - start:.2f} s beyond {start:.2f} s"
    name = f"rerun with nothing changed, {334 * len(CAPTURES)} captures"
    return [(name, "0.5 s beyond start-up", said)]


def fleet(scratch: Path) -> list[Row]:
    """500 motors, the least of two rounds; 1 and 2 workers on 100, the least of three."""
    one = simulated(scratch / "one")
    single, small, some, many = (
        make_fleet(one, scratch / f"of {motors}", motors) for motors in (1, 50, 100, 500)
    )
    plain = ("recordings=false", "report=false", "cache=false")

    def run(folder: Path, *words: str) -> Cost:
        found = cost("run", f"input={folder}", f"output={scratch / 'out'}", *plain, *words)
        assert found.code in (0, 1, 4), found.errors
        return found

    def least(folder: Path, *words: str) -> float:
        return min(run(folder, *words).seconds for _ in range(3))

    start = least(single, "workers=1")
    alone, two = least(some, "workers=1"), least(some, "workers=2")
    few = run(small, "workers=2")
    rounds = [
        [run(many, "workers=2", f"executor={kind}") for kind in ("local", "dask")] for _ in range(2)
    ]
    local, dask = (min(pair, key=lambda c: c.seconds) for pair in zip(*rounds, strict=True))
    speed = 500 * len(CAPTURES) / local.seconds / 2

    def memory(found: Cost) -> str:
        return f"{found.driver_mb:.0f} + {found.worker_mb:.0f} MB"

    return [
        ("captures a second and core, 500 motors", "", f"{speed:.1f}"),
        (
            "memory of driver and worker, 50 and 500 motors",
            "flat",
            f"{memory(few)}, {memory(local)}; Dask {memory(dask)}",
        ),
        (
            "2 workers over 1, beyond start-up, 100 motors",
            "1.8",
            f"{(alone - start) / (two - start):.2f}",
        ),
        (
            "Dask over local, 2 workers, 500 motors, whole",
            "1.15",
            f"{dask.seconds / local.seconds:.2f}",
        ),
    ]


def fuzzing(_: Path) -> list[Row]:
    """Ten minutes of fuzzing."""
    counted, kept = fuzz(10.0)
    return [("fuzzing, 10 minutes", "0 kept", f"{counted} files, {len(kept)} kept")]


TRIALS: dict[str, Callable[[Path], list[Row]]] = {
    "damage": damages,
    "bombs": bombs,
    "decode": ratios,
    "kills": kills,
    "disk": disks,
    "rerun": rerun,
    "fleet": fleet,
    "fuzz": fuzzing,
}


def render(measured: list[Row]) -> None:
    """Writes rows into the document, between its marks, in place of those of the same name."""
    before, _, rest = DOCUMENT.read_text().partition(BEGIN)
    table, _, after = rest.partition(END)
    lines = [line for line in table.splitlines() if line.startswith("|")][2:]
    said = {line.split("|")[1].strip(): line for line in lines}
    said |= {what: f"| {what} | {asked} | {words} |" for what, asked, words in measured}
    rows = "".join(f"{line}\n" for line in said.values())
    DOCUMENT.write_text(f"{before}{BEGIN}\n\n{HEAD}{rows}\n{END}{after}")


def main() -> int:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(TRIALS))
    os.environ["PYTHONPATH"] = str(ROOT)
    for name in parser.parse_args().names or TRIALS:
        with tempfile.TemporaryDirectory() as scratch:
            render(TRIALS[name](Path(scratch)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
