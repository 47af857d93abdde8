"""Working through tasks: a result for each, whatever one of them does to its worker.

Tasks are idempotent. One that fails or loses its worker is done once more, alone. One whose worker
dies twice while it reads the same file goes on without that file, which is refused. So one bad
capture costs itself, and nothing else.
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
from typing import Any, Protocol, Self

from pipeline.execution.pools import OpenPool, Pool
from pipeline.execution.task import LOGGER, Report, perform
from pipeline.io.ingest.guard import LastWords, last_words
from pipeline.records.errors import MachineError, PipelineError

RERUN = "what was finished is kept: run the same command again to go on"


PATIENCE = 3
"""Rounds in which every worker dies before it begins anything, until nobody is waited for."""

START = (
    "is there memory for a process? A script of your own needs its work under "
    "`if __name__ == '__main__':`, and cannot come from standard input"
)


class Task(Protocol):
    """Something to do that names itself and can leave out a file that kills its reader."""

    @property
    def name(self) -> str:
        """What the task works on, for messages."""
        ...

    def without(self, path: str, reason: str) -> Self:
        """The task with a file refused for a reason."""
        ...


Done = Callable[[int, Any], None]


@dataclass
class Crew:
    """Workers for one command, opened when first needed; a context manager.

    `crumbs` is the folder in which they say what they are reading.
    """

    open: OpenPool
    workers: int
    crumbs: Path
    _run: str = field(default_factory=lambda: f"{os.getpid()}-{secrets.token_hex(4)}")
    _pool: Pool | None = None
    _stack: ExitStack = field(default_factory=ExitStack)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self._dismiss()
        for path in self.crumbs.glob(f"{self._run}-*"):
            path.unlink(missing_ok=True)
        with suppress(OSError):
            self.crumbs.rmdir()

    def work_through(
        self, function: Callable[[Any], Any], tasks: Sequence[Any], done: Done | None = None
    ) -> list[Any]:
        """`function` of each task, in their order; a MachineError stands for one that failed.

        `done(index, value)` is called as results come. Raises the PipelineError of a task: a full
        disk would meet the next one too; and MachineError where no worker ever begins a task.
        """
        results: list[Any] = [None] * len(tasks)
        left = list(range(len(tasks)))
        suspects: list[tuple[int, LastWords | None]] = []
        idle = 0

        def finish(index: int, value: Any) -> None:
            results[index] = value
            if done is not None:
                done(index, value)

        while left:
            again = self._through(function, tasks, left, finish, suspects)
            idle = idle + 1 if len(again) == len(left) else 0
            if idle == PATIENCE:
                raise MachineError("no worker process could begin its work", START)
            left = again
        for index, words in sorted(suspects, key=lambda suspect: suspect[0]):
            finish(index, self._alone(function, tasks[index], words, index))
        return results

    def _through(
        self,
        function: Callable[[Any], Any],
        tasks: Sequence[Any],
        left: Sequence[int],
        finish: Done,
        suspects: list[tuple[int, LastWords | None]],
    ) -> list[int]:
        """Gives out the tasks that are `left`; those that none began, by number, are left again."""
        again = []
        for index, end in self._round(self._gathered(), function, tasks, left):
            if isinstance(end, LastWords):
                if end.begun:
                    suspects.append((index, end))
                else:
                    again.append(index)
            elif end.error is None:
                finish(index, end.value)
            else:
                suspects.append((index, None))
        if again or any(words is not None for _, words in suspects):
            self._gathered(anew=True)
        return sorted(again)

    def _gathered(self, *, anew: bool = False) -> Pool:
        """The workers at work; `anew` where one of them has died and taken the others along."""
        if self._pool is not None and anew and not self._pool.spares:
            self._dismiss()
        if self._pool is None:
            self._pool = self._stack.enter_context(self.open(self.workers))
        return self._pool

    def _dismiss(self) -> None:
        self._pool = None
        self._stack.close()

    def _round(
        self,
        pool: Pool,
        function: Callable[[Any], Any],
        tasks: Mapping[int, Any] | Sequence[Any],
        indices: Sequence[int],
    ) -> Iterator[tuple[int, Report | LastWords]]:
        """What became of each task: its report, or the last words of its worker."""
        futures = {}
        ends: list[int] = []
        for index in indices:
            crumb = str(self._crumb(index))
            try:
                futures[pool.executor.submit(perform, function, tasks[index], crumb)] = index
            except pool.died:  # a worker died while tasks were being handed out
                ends.append(index)
        for future in as_completed(futures):
            index = futures.pop(future)
            yield index, self._end(pool, future, index)
        for index in ends:
            yield index, LastWords(begun=False)

    def _end(self, pool: Pool, future: Any, index: int) -> Report | LastWords:
        try:
            report: Report = future.result()
        except pool.died:
            return last_words(self._crumb(index))
        except pool.lost as error:
            raise MachineError(f"the scheduler was lost ({type(error).__name__})", RERUN) from error
        log = logging.getLogger(LOGGER)
        for level, text in report.logged:
            log.log(level, "%s", text)
        if isinstance(report.error, PipelineError):
            raise report.error
        return report

    def _alone(
        self, function: Callable[[Any], Any], task: Any, words: LastWords | None, index: int
    ) -> Any:
        """The result of a task that failed or lost its worker, done again with nobody beside it."""
        deaths: dict[str | None, int] = {words.path: 1} if words is not None else {}
        while True:
            with self._lone() as pool:
                ((_, end),) = self._round(pool, function, {index: task}, [index])
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
    def _lone(self) -> Iterator[Pool]:
        """A worker with nobody beside it, where the death of one is the death of all."""
        if self._gathered().spares:
            yield self._gathered()
            return
        with self.open(1) as pool:
            yield pool

    def _crumb(self, index: int) -> Path:
        return self.crumbs / f"{self._run}-{index}"


def _reason(words: LastWords) -> str:
    if words.timed_out:
        return "reading it took too long, twice"
    return "the process that read it died, twice"


def _failed(task: Any, reason: str) -> MachineError:
    return MachineError(
        f"{task.name} could not be finished: {reason}",
        "report it with this line; the others are done",
    )
