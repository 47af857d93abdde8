"""A fleet of motors made quickly, and what a batch of it costs.

Every motor has the captures of one simulated motor under a serial number of its own.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from pipeline.__main__ import main

ROOT = Path(__file__).parents[2]
CAPTURES = ("resistance_ab.csv", "lcr.csv", "torque_map_backward.csv")


def simulated(folder: Path) -> Path:
    """The captures of one motor."""
    words = ["simulate", f"output={folder}", "motor=gimbal-5208", "motor_id=fleet", "seed=3"]
    assert main(words) == 0
    return folder


def make_fleet(one: Path, folder: Path, motors: int) -> Path:
    """The captures of so many motors, one folder a motor."""
    texts = {name: (one / name).read_bytes() for name in CAPTURES}
    for number in range(motors):
        place = folder / f"{number:04d}"
        place.mkdir(parents=True)
        for name, text in texts.items():
            said = b"# motor_id: fleet-%04d" % number
            own = re.sub(rb"(?m)^# motor_id: .*$", said, text, count=1)
            (place / name).write_bytes(own)
    return folder


def command(*words: str) -> list[str]:
    return [sys.executable, "-m", "pipeline", *words]


@dataclass(frozen=True)
class Cost:
    """What a command took: its exit code, wall time [s], and the most memory of a process [MB]."""

    code: int
    seconds: float
    cpu_seconds: float
    driver_mb: float
    worker_mb: float
    errors: str


def cost(*words: str, cache: Path | None = None) -> Cost:
    """Runs a command and watches the memory of the driver and of its largest child."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    if cache is not None:
        environment["XDG_CACHE_HOME"] = str(cache)
    start = time.perf_counter()
    process = subprocess.Popen(
        command(*words),
        cwd=ROOT,
        env=environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
    )
    most: dict[int, float] = {}
    while process.poll() is None:
        for member in family(process.pid):
            most[member] = max(most.get(member, 0.0), peak_mb(member))
        time.sleep(0.05)
    seconds = time.perf_counter() - start
    errors = process.stderr.read().decode() if process.stderr else ""
    before = most.pop(process.pid, 0.0)
    # Children of a process that has ended count through their parent.
    cpu = os.times()
    return Cost(
        process.returncode,
        seconds,
        cpu.children_user + cpu.children_system,
        before,
        max(most.values(), default=0.0),
        errors,
    )


def family(process: int) -> list[int]:
    """A process, its children and theirs, whichever thread has started them (Linux)."""
    found = [process]
    for member in found:
        try:
            threads = list(Path(f"/proc/{member}/task").iterdir())
        except OSError:
            continue
        for thread in threads:
            with suppress(OSError):
                found += [int(child) for child in (thread / "children").read_text().split()]
    return found


def peak_mb(process: int) -> float:
    """Most memory that a process has held [MB]."""
    try:
        text = Path(f"/proc/{process}/status").read_text()
    except OSError:
        return 0.0
    found = re.search(r"VmHWM:\s+(\d+)", text)
    return int(found[1]) / 1024 if found else 0.0
