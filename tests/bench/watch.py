"""How long `run watch=true` takes from the last byte of a campaign to what it makes of it.

`python -m tests.bench.watch [--count 120] [--every-s 30] [--settle-s 1]` simulates a station that
drops one campaign of a new motor at a time, and prints the median, the 99th percentile and the
longest time until datasheet, page and registry entry of the motor are there, and the processor time
of the watch a campaign. The defaults are an hour; `--every-s 0` drops each campaign when the one
before is done, which is the same work in a quarter of an hour.
"""

from __future__ import annotations

import argparse
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

LONGEST_S = 600.0


def campaign(number: int, folder: Path) -> str:
    """Writes the captures of one simulated motor to `folder`; its name."""
    motor = f"S-{number:04d}"
    words = f"simulate output={folder / motor} seed={number + 1} motor_id={motor}"
    subprocess.run([sys.executable, "-m", "pipeline", *words.split()], check=True, stdout=-3)
    return motor


def latency_s(source: Path, folder: Path, output: Path) -> float:
    """Seconds from the last byte of a dropped campaign until all that it becomes is there."""
    shutil.copytree(source, folder / source.name)
    begun = time.monotonic()
    motor = source.name
    made = (
        f"datasheets/{motor}.json",
        f"report/{motor}.html",
        f"registry/_versions/{motor}/*.json",
    )
    while not all(any(output.glob(name)) for name in made):
        if time.monotonic() - begun > LONGEST_S:
            raise TimeoutError(f"{motor} is not done after {LONGEST_S:g} s")
        time.sleep(0.02)
    return time.monotonic() - begun


def measured(given: argparse.Namespace) -> tuple[list[float], float]:
    """The latency of each campaign, and the processor time of the watch with its start [s].

    What simulates the campaigns is waited for before the watch ends, and is no part of it.
    """
    with tempfile.TemporaryDirectory() as name:
        bench, folder, output = (Path(name, part) for part in ("bench", "in", "out"))
        folder.mkdir()
        words = f"run watch=true settle_s={given.settle_s} input={folder} output={output}".split()
        watching = subprocess.Popen([sys.executable, "-m", "pipeline", *words, *given.options])
        try:
            found = []
            for number in range(given.count):
                motor, begun = campaign(number, bench), time.monotonic()
                found.append(latency_s(bench / motor, folder, output))
                shutil.rmtree(bench / motor)
                time.sleep(max(0.0, given.every_s - (time.monotonic() - begun)))
        finally:
            before_s = children_s()
            watching.send_signal(signal.SIGTERM)
            watching.wait(LONGEST_S)
    return found, children_s() - before_s


def children_s() -> float:
    """Processor time of the processes that have ended [s]."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def main() -> None:
    """Measures and prints."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=120)
    parser.add_argument("--every-s", type=float, default=30.0)
    parser.add_argument("--settle-s", type=float, default=1.0)
    parser.add_argument("options", nargs="*", help="keys of run, such as residual_test=false")
    given = parser.parse_args()
    found, used_s = measured(given)
    median, high = np.percentile(found, [50.0, 99.0])
    sys.stdout.write(
        f"{len(found)} campaigns, all after: median {median:.1f} s, 99 % {high:.1f} s, "
        f"longest {max(found):.1f} s (the first, with the start of the workers, {found[0]:.1f} s); "
        f"{used_s / len(found):.1f} s of processor each\n"
    )


if __name__ == "__main__":
    main()
