"""`run` killed at random points, and the run after it; and a disk that is full."""

from __future__ import annotations

import json
import os
import random
import resource
import shutil
import signal
import subprocess
import time
from dataclasses import dataclass
from pathlib import Path

from pipeline.io.registry.store import Registry
from tests.faults.fleet import ROOT, command, family

WORDS = ("report=true", "recordings=false", "residual_test=false", "workers=1")


def begin(
    folder: Path, output: Path, home: Path, *more: str, limit: int | None = None
) -> subprocess.Popen[bytes]:
    """Starts a run in a process group of its own; `limit` is the largest file it may write."""

    def small_files() -> None:
        if limit is not None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    return subprocess.Popen(
        command("run", f"input={folder}", f"output={output}", *WORDS, *more),
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT), "XDG_CACHE_HOME": str(home)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        start_new_session=True,
        preexec_fn=small_files,  # noqa: PLW1509 (one thread)
    )


def results(output: Path) -> dict[str, bytes]:
    """Everything that is no note, no table of the registry and no trace of an interrupted write."""
    files = (path for path in sorted(output.rglob("*")) if path.is_file())
    named = {path.relative_to(output).as_posix(): path for path in files}
    left_out = (".cache/", ".work/", "registry/_delta_log", "registry/part-")
    return {n: p.read_bytes() for n, p in named.items() if not n.startswith(left_out)}


def acknowledged(output: Path) -> set[tuple[str, str]]:
    """Versions that have their file in the registry, which is the acknowledgement."""
    place = output / "registry"
    return {(path.parent.name, path.stem) for path in (place / "_versions").rglob("*.json")}


def torn(output: Path) -> list[str]:
    """Files under their own names that are not whole."""
    found = []
    for path in output.rglob("*.json"):
        if path.name.startswith(".") or {".cache", "_delta_log"} & set(path.parts):
            continue
        try:
            json.loads(path.read_bytes())
        except ValueError:
            found.append(path.name)
    pages = output.glob("report/*.html")
    return found + [p.name for p in pages if not p.read_bytes().rstrip().endswith(b"</html>")]


@dataclass(frozen=True)
class Killed:
    """What a series of kills came to."""

    kills: int
    during_work: int
    torn: tuple[str, ...]
    lost: int
    different: tuple[str, ...]
    left_over: tuple[str, ...]
    orphans: int


def kill_runs(folder: Path, scratch: Path, kills: int, seed: int = 7) -> Killed:
    """Kills runs of one folder at random points, each from where the last one stopped.

    Every tenth one is followed by a run to its end, which must leave the bytes of a clean run;
    then the output begins anew.
    """
    draws = random.Random(seed)
    clean, output, home = scratch / "clean", scratch / "out", scratch / "home"
    start = time.perf_counter()
    process = begin(folder, clean, scratch / "clean-home")
    process.communicate()
    whole_s = time.perf_counter() - start
    expected = results(clean)
    during, lost, orphans = 0, 0, 0
    broken: list[str] = []
    different: list[str] = []
    left: set[str] = set()
    for kill in range(kills):
        known = acknowledged(output)
        process = begin(folder, output, home)
        time.sleep(draws.uniform(0.0, 1.05 * whole_s))
        members = family(process.pid)
        during += process.poll() is None
        process.send_signal(signal.SIGKILL)
        process.communicate()
        broken += torn(output)
        lost += len(known - acknowledged(output))
        if kill % 10 == 9 or kill == kills - 1:
            orphans += _outlived(members)
            process = begin(folder, output, home)
            process.communicate()
            found = results(output)
            different += sorted(
                n for n in found.keys() | expected.keys() if found.get(n) != expected.get(n)
            )
            left |= {p.name for p in output.rglob("*.partial")}
            lost += len(Registry(str(output / "registry")).verify().faults)
            for place in (output, home):
                shutil.rmtree(place, ignore_errors=True)
    return Killed(
        kills, during, tuple(broken), lost, tuple(different), tuple(sorted(left)), orphans
    )


def _outlived(members: list[int]) -> int:
    """How many of a killed driver's workers are still there after ten seconds."""

    def alive(member: int) -> bool:
        try:
            return bool(Path(f"/proc/{member}/cmdline").read_bytes())
        except OSError:
            return False

    deadline = time.monotonic() + 10.0
    while time.monotonic() < deadline and any(map(alive, members)):
        time.sleep(0.1)
    return sum(map(alive, members))


@dataclass(frozen=True)
class Full:
    """A run whose files may not grow beyond a size: exit code, error lines, files that are torn."""

    limit_bytes: int
    code: int
    errors: tuple[str, ...]
    torn: tuple[str, ...]
    left_over: tuple[str, ...]


def full_disk(folder: Path, output: Path, home: Path, limit_bytes: int) -> Full:
    """A run on a disk that takes no file beyond a limit, which the system says as it is full."""
    process = begin(folder, output, home, limit=limit_bytes)
    _, errors = process.communicate()
    left = tuple(sorted(p.name for p in output.rglob("*.partial"))) if output.exists() else ()
    lines = tuple(errors.decode().splitlines())
    return Full(limit_bytes, process.returncode, lines, tuple(torn(output)), left)
