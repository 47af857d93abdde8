"""Files that kill, hang or starve whoever reads them, on real workers: each costs itself alone."""

from __future__ import annotations

import os
import re
import signal
import time
import warnings
from collections.abc import Iterator
from concurrent.futures import BrokenExecutor, ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest

from pipeline.execution.workers.gate import Gate
from pipeline.execution.workers.pools import Pool, local_pool
from pipeline.execution.workers.worker_pool import WorkerPool
from pipeline.io.ingest.guard import ReadLimits, reading
from pipeline.records.errors import CaptureError, MachineError

pytestmark = pytest.mark.workers
LIMITS = ReadLimits(seconds=1.0, memory_mb=200)


@dataclass(frozen=True)
class Reads:
    """Reads files whose names say what they do; the answer is what became of each."""

    files: tuple[str, ...]
    seen: str
    refused: tuple[tuple[str, str], ...] = ()

    @property
    def name(self) -> str:
        return f"task {self.files[0]}"

    def without(self, path: str, reason: str) -> Reads:
        return replace(self, refused=(*self.refused, (path, reason)))


def read(task: Reads) -> list[str]:
    refused = dict(task.refused)
    answers = []
    for file in task.files:
        if file in refused:
            answers.append(f"{file}: {refused[file]}")
            continue
        try:
            with reading(file, 0, LIMITS):
                parse(file, Path(task.seen))
        except CaptureError as fault:
            answers.append(f"{file}: {fault.code}")
        else:
            answers.append(f"{file}: read")
    if "breaks" in task.files[0]:
        raise RecursionError("too deep")
    return answers


def parse(file: str, seen: Path) -> None:
    if file == "kills":
        os.kill(os.getpid(), signal.SIGKILL)
    if file == "once" and not (seen / file).exists():
        (seen / file).write_text("")
        os.kill(os.getpid(), signal.SIGKILL)
    if "hangs" in file:
        re.match(r"(a+)+$", "a" * 40 + "b")  # holds the interpreter lock for years
    if "starves" in file:
        np.ones(300 * 2**20 // 8)
    if "warns" in file:
        warnings.warn("from the worker", stacklevel=1)


@pytest.fixture
def workers(tmp_path: Path) -> Iterator[WorkerPool]:
    with WorkerPool(local_pool, 2, tmp_path / "progress") as made:
        yield made
    assert not (tmp_path / "progress").exists()


def test_a_failing_task_affects_no_other(workers: WorkerPool, tmp_path: Path) -> None:
    """Of seven tasks one file kills, one hangs, one starves; every other file is read."""
    tasks = [
        Reads(("good 1", "good 2"), str(tmp_path)),
        Reads(("good 3", "kills", "good 4"), str(tmp_path)),
        Reads(("good 5",), str(tmp_path)),
        Reads(("hangs", "good 6"), str(tmp_path)),
        Reads(("good 7", "starves"), str(tmp_path)),
        Reads(("good 8",), str(tmp_path)),
        Reads(("once", "good 9"), str(tmp_path)),
    ]
    done: list[int] = []
    found = workers.map_tasks(read, tasks, lambda index, _: done.append(index))
    assert found == [
        ["good 1: read", "good 2: read"],
        ["good 3: read", "kills: the process that read it died, twice", "good 4: read"],
        ["good 5: read"],
        ["hangs: reading it took too long, twice", "good 6: read"],
        ["good 7: read", "starves: limit"],
        ["good 8: read"],
        ["once: read", "good 9: read"],
    ]
    assert sorted(done) == list(range(7))


def test_a_task_that_breaks_is_reported_and_the_others_are_done(
    workers: WorkerPool, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """A fault of ours: tried twice, then one error with the task's name. A warning arrives."""
    tasks = [Reads((name,), str(tmp_path)) for name in ("good", "breaks", "warns")]
    one, two, three = workers.map_tasks(read, tasks)
    assert (one, three) == (["good: read"], ["warns: read"])
    assert isinstance(two, MachineError)
    assert two.message == "task breaks could not be finished: RecursionError: too deep"
    assert "UserWarning: from the worker" in caplog.text


def behind(gate: Gate) -> int | None:
    return os.getpid() if gate.passed() else None


def test_a_task_that_was_begun_is_not_begun_again(workers: WorkerPool) -> None:
    """Expected: `map_tasks` waits for it; one whose gate is dropped ends, and nothing is left."""
    wanted, unwanted = workers.gate(), workers.gate()
    for gate in (wanted, unwanted):
        gate.close()
    workers.begin_tasks(behind, [wanted, unwanted])
    futures = [begun.future for begun in workers._begun]
    assert not any(future.done() for future in futures)
    unwanted.drop()
    assert futures[1].result().value is None
    wanted.open()
    assert workers.map_tasks(behind, [wanted]) == [futures[0].result().value]
    assert isinstance(futures[0].result().value, int)
    assert not workers.map_tasks(behind, [unwanted])[0]


def test_a_task_that_was_begun_and_lost_its_worker_is_done(
    workers: WorkerPool, tmp_path: Path
) -> None:
    task = Reads(("once",), str(tmp_path))
    workers.begin_tasks(read, [task])
    assert workers.map_tasks(read, [task]) == [["once: read"]]


def test_workers_end_with_their_driver(tmp_path: Path) -> None:
    """A driver that is killed leaves nobody at work."""
    from multiprocessing import get_context

    context = get_context("spawn")
    ours, theirs = context.Pipe(duplex=False)
    driver = context.Process(target=drive, args=(str(tmp_path), theirs))
    driver.start()
    worker = ours.recv()
    os.kill(worker, 0)
    driver.kill()
    driver.join()
    deadline = time.monotonic() + 10.0
    while time.monotonic() < deadline and Path(f"/proc/{worker}/stat").exists():
        if Path(f"/proc/{worker}/stat").read_text().rsplit(")", 1)[1].split()[0] == "Z":
            break
        time.sleep(0.05)
    else:
        assert time.monotonic() < deadline


def drive(folder: str, pipe: object) -> None:
    with WorkerPool(local_pool, 1, Path(folder) / "progress") as workers:
        (worker,) = workers.map_tasks(own_number, [1])
        pipe.send(worker)  # type: ignore[attr-defined]
        time.sleep(60)


def own_number(_: object) -> int:
    return os.getpid()


@contextmanager
def stillborn(workers: int) -> Iterator[Pool]:
    """Workers that die before they begin anything, as under a script without a main guard."""
    with ProcessPoolExecutor(workers, get_context("spawn"), os._exit, (1,)) as executor:
        yield Pool(executor, (BrokenExecutor,))


def test_workers_that_never_begin_are_not_waited_for(tmp_path: Path) -> None:
    with (
        WorkerPool(stillborn, 2, tmp_path / "progress") as workers,
        pytest.raises(MachineError, match="no worker process could begin") as caught,
    ):
        workers.map_tasks(read, [Reads(("a",), str(tmp_path)), Reads(("b",), str(tmp_path))])
    assert "__main__" in str(caught.value)
