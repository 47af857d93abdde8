"""How long `run watch=true` takes from the last byte of a campaign to what it makes of it.

`python -m tests.bench.watch [--count 120] [--every-s 30] [--settle-s 1]` simulates a station that
drops one campaign of a new motor at a time, and prints the median, the 99th percentile and the
longest time until datasheet, page and registry entry of the motor are there, whether it grows with
the motors that are there, and the processor time of the watch a campaign. The defaults are an hour;
`--every-s 0` drops each campaign when the one before is done, which is the same work in a quarter
of an hour. Ctrl-C ends it with the campaigns so far.
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
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from pipeline.api.simulated import simulated, single
from pipeline.settings import SimulateSettings
from pipeline.simulator.design import Recording
from pipeline.stages.simulate import write

LONGEST_S = 600.0
SIMULATIONS = 4
"""Motors that are simulated; the others are these under names of their own, as it takes longer to
simulate a campaign than to work on it.
"""


@cache
def simulation(seed: int) -> list[Recording]:
    """The captures of one simulated motor."""
    ((_, motor, bench, own_seed, plan),) = single(SimulateSettings(output=".", seed=seed))
    recordings, _ = simulated(motor, bench, own_seed, plan)
    return list(recordings)


def campaign(number: int, folder: Path) -> str:
    """Writes a campaign to `folder` under the name of a motor of its own; that name."""
    motor, recordings = f"S-{number:04d}", simulation(1 + number % SIMULATIONS)
    named = [replace(one, meta={**one.meta, "motor_id": motor}) for one in recordings]
    write(folder / motor, named, "mixed")
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
    """The latency of each campaign, and the processor time of the watch with its start [s]."""
    with tempfile.TemporaryDirectory() as name:
        bench, folder, output = (Path(name, part) for part in ("bench", "in", "out"))
        folder.mkdir()
        words = f"run watch=true settle_s={given.settle_s} input={folder} output={output}".split()
        watching = subprocess.Popen([sys.executable, "-m", "pipeline", *words, *given.options])
        found = list[float]()
        try:
            for number in range(given.count):
                motor, begun = campaign(number, bench), time.monotonic()
                found.append(latency_s(bench / motor, folder, output))
                shutil.rmtree(bench / motor)
                time.sleep(max(0.0, given.every_s - (time.monotonic() - begun)))
        except KeyboardInterrupt:
            sys.stdout.write(f"ended after {len(found)} of {given.count}\n")
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
    quarter = max(1, len(found) // 4)
    first, last = (float(np.median(part)) for part in (found[:quarter], found[-quarter:]))
    sys.stdout.write(
        f"{len(found)} campaigns, all after: median {median:.1f} s, 99 % {high:.1f} s, "
        f"longest {max(found):.1f} s (the first, with the start of the workers, {found[0]:.1f} s); "
        f"median of the first quarter {first:.1f} s, of the last {last:.1f} s; "
        f"{used_s / len(found):.1f} s of processor each\n"
    )


if __name__ == "__main__":
    main()
