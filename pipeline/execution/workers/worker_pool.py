"""A pool of workers that returns a result for each task, even where a task kills its worker.

Tasks are idempotent. A task that fails or loses its worker is retried once, isolated. A task whose
worker dies twice while it reads the same file is continued without that file, which is refused. So
one bad capture affects no other capture.
"""

from __future__ import annotations

import logging
import os
import secrets
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import as_completed
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple, Protocol, Self

from pipeline.execution.workers.gate import Gate
from pipeline.execution.workers.pools import Cluster, OpenPool, Pool, open_pool
from pipeline.execution.workers.task import LOGGER, Report, perform
from pipeline.io.ingest.guard import CrashReport, crash_report
from pipeline.records.errors import MachineError, PipelineError

RERUN = "finished work is cached: run the same command again to continue"

MOST_IDLE_ROUNDS = 3
"""Rounds in which every worker dies before it begins a task, until the pool gives up."""

START = (
    "is there memory for a process? A script of your own needs its work under "
    "`if __name__ == '__main__':`, and cannot come from standard input"
)
Done = Callable[[int, Any], None]


class Task(Protocol):
    """Work that has a name and can leave out a file that kills its reader."""

    @property
    def name(self) -> str:
        """What the task works on, for messages."""
        ...

    def without(self, path: str, reason: str) -> Self:
        """The task with a file refused for a reason.

        Parameters
        ----------
        path
            The file, relative to the input folder.
        reason
            The reason, in words.

        """
        ...


class Begun(NamedTuple):
    """A task that a worker has begun, and its progress file."""

    task: Any
    future: Any
    progress: Path


@dataclass
class WorkerPool:
    """The workers of one command, started when first needed; a context manager.

    `progress_folder` holds their progress files: the file that each worker is reading.
    """

    open: OpenPool
    count: int
    progress_folder: Path
    _run: str = field(default_factory=lambda: f"{os.getpid()}-{secrets.token_hex(4)}")
    _pool: Pool | None = None
    _stack: ExitStack = field(default_factory=ExitStack)
    _begun: list[Begun] = field(default_factory=list)
    _gates: int = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self._close()
        for path in self.progress_folder.glob(f"{self._run}-*"):
            path.unlink(missing_ok=True)
        with suppress(OSError):
            self.progress_folder.rmdir()

    def map_tasks(
        self, function: Callable[[Any], Any], tasks: Sequence[Any], done: Done | None = None
    ) -> list[Any]:
        """`function` of each task, in the order of the tasks; a MachineError for one that failed.

        `done(index, value)` is called as results arrive.

        Parameters
        ----------
        function
            What is done with a task; importable in a worker.
        tasks
            The tasks.
        done
            Called as `done(index, value)` as results arrive.

        Raises
        ------
        the
            PipelineError of a task, as a full disk affects the next task too.
        MachineError
            No worker begins a task.

        """
        answers: list[Any] = [None] * len(tasks)
        pending = list(range(len(tasks)))
        retries: list[tuple[int, CrashReport | None]] = []
        idle_rounds = 0

        def finish(index: int, value: Any) -> None:
            answers[index] = value
            if done is not None:
                done(index, value)

        while pending:
            not_begun = self._run_round(function, tasks, pending, finish, retries)
            idle_rounds = idle_rounds + 1 if len(not_begun) == len(pending) else 0
            if idle_rounds == MOST_IDLE_ROUNDS:
                raise MachineError("no worker process could begin its work", START)
            pending = not_begun
        for index, crash in sorted(retries, key=lambda retry: retry[0]):
            finish(index, self._retry_isolated(function, tasks[index], crash, index))
        return answers

    def all_of(self, function: Callable[[Any], Any], tasks: Sequence[Any]) -> list[Any]:
        """`function` of each task, in the order of the tasks.

        Parameters
        ----------
        function
            What is done with a task; importable in a worker.
        tasks
            The tasks.

        Raises
        ------
        MachineError
            A task failed.

        """
        answers = self.map_tasks(function, tasks)
        for answer in answers:
            if isinstance(answer, MachineError):
                raise answer
        return answers

    def begin_tasks(self, function: Callable[[Any], Any], tasks: Sequence[Any]) -> None:
        """Begins tasks, in place of those that were begun before.

        `map_tasks` waits for those that it is given as well. Nothing waits for the others: what
        they do is kept elsewhere, or is done again.

        Parameters
        ----------
        function
            What is done with a task; importable in a worker.
        tasks
            The tasks.

        """
        pool = self._workers()
        self._begun.clear()
        for index, task in enumerate(tasks):
            progress = self.progress_folder / f"{self._run}-ahead-{index}"
            with suppress(*pool.died):
                future = pool.executor.submit(perform, function, task, str(progress))
                self._begun.append(Begun(task, future, progress))

    def gate(self) -> Gate:
        """A gate of its own, not closed yet."""
        self._gates += 1
        return Gate(str(self.progress_folder / f"{self._run}-gate-{self._gates}"))

    def _run_round(
        self,
        function: Callable[[Any], Any],
        tasks: Sequence[Any],
        pending: Sequence[int],
        finish: Done,
        retries: list[tuple[int, CrashReport | None]],
    ) -> list[int]:
        """Submits the pending tasks; returns the numbers of those that no worker began."""
        not_begun = []
        for index, end in self._outcomes(self._workers(), function, tasks, pending):
            if isinstance(end, CrashReport):
                if end.begun:
                    retries.append((index, end))
                else:
                    not_begun.append(index)
            elif end.error is None:
                finish(index, end.value)
            else:
                retries.append((index, None))
        if not_begun or any(crash is not None for _, crash in retries):
            self._workers(restart=True)
        return sorted(not_begun)

    def _workers(self, *, restart: bool = False) -> Pool:
        """The running pool; `restart` replaces one in which a crash has ended every worker."""
        if self._pool is not None and restart and not self._pool.isolates_crashes:
            self._close()
        if self._pool is None:
            self._pool = self._stack.enter_context(self.open(self.count))
        return self._pool

    def _close(self) -> None:
        self._pool = None
        self._stack.close()

    def _outcomes(
        self,
        pool: Pool,
        function: Callable[[Any], Any],
        tasks: Mapping[int, Any] | Sequence[Any],
        indices: Sequence[int],
    ) -> Iterator[tuple[int, Report | CrashReport]]:
        """The outcome of each task: its report, or the crash report of its worker."""
        futures: dict[Any, tuple[int, Path]] = {}
        refused: list[int] = []
        for index in indices:
            progress = self._progress_file(index)
            if (begun := self._taken(tasks[index])) is not None:
                futures[begun.future] = index, begun.progress
                continue
            try:
                future = pool.executor.submit(perform, function, tasks[index], str(progress))
                futures[future] = index, progress
            except pool.died:  # a worker died while tasks were being submitted
                refused.append(index)
        for future in as_completed(futures):
            index, progress = futures.pop(future)
            yield index, self._outcome(pool, future, progress)
        for index in refused:
            yield index, CrashReport(begun=False)

    def _taken(self, task: Any) -> Begun | None:
        """The task where it was begun and nothing waits for it yet."""
        number = next((n for n, begun in enumerate(self._begun) if begun.task is task), None)
        return None if number is None else self._begun.pop(number)

    def _outcome(self, pool: Pool, future: Any, progress: Path) -> Report | CrashReport:
        try:
            report: Report = future.result()
        except pool.died:
            return crash_report(progress)
        except pool.lost as error:
            raise MachineError(f"the scheduler was lost ({type(error).__name__})", RERUN) from error
        log = logging.getLogger(LOGGER)
        for level, text in report.logged:
            log.log(level, "%s", text)
        if isinstance(report.error, PipelineError):
            raise report.error
        return report

    def _retry_isolated(
        self, function: Callable[[Any], Any], task: Any, crash: CrashReport | None, index: int
    ) -> Any:
        """The result of a task that failed or lost its worker, retried with no task beside it."""
        deaths: dict[str | None, int] = {crash.path: 1} if crash is not None else {}
        while True:
            with self._single_worker() as pool:
                ((_, end),) = self._outcomes(pool, function, {index: task}, [index])
            if isinstance(end, Report):
                if end.error is None:
                    return end.value
                return _failed(task, str(end.error))
            deaths[end.path] = deaths.get(end.path, 0) + 1
            if deaths[end.path] < 2:
                continue
            if end.path is None:
                return _failed(task, "its worker died twice")
            task = task.without(end.path, _reason(end))

    @contextmanager
    def _single_worker(self) -> Iterator[Pool]:
        """A single-worker pool, for executors in which one crash fails every task."""
        if self._workers().isolates_crashes:
            yield self._workers()
            return
        with self.open(1) as pool:
            yield pool

    def _progress_file(self, index: int) -> Path:
        return self.progress_folder / f"{self._run}-{index}"


def _reason(crash: CrashReport) -> str:
    if crash.timed_out:
        return "reading it took too long, twice"
    return "the process that read it died, twice"


def _failed(task: Any, reason: str) -> MachineError:
    return MachineError(
        f"{task.name} could not be finished: {reason}",
        "report it with this line; the others are done",
    )


@contextmanager
def local_workers(count: int) -> Iterator[WorkerPool]:
    """Processes of this machine whose progress files are kept nowhere.

    Parameters
    ----------
    count
        How many.

    """
    with (
        TemporaryDirectory() as progress,
        WorkerPool(open_pool("local", Cluster()), count, Path(progress) / "work") as workers,
    ):
        yield workers
