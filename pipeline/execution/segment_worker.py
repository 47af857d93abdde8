"""A second worker that knows the segments of a campaign and does its half of the work on them.

Much of the work is on arrays too small for numpy to leave the interpreter, so that two threads are
worth 1.4 cores. Segments are sent once; what is to be done to them is a few kilobytes, what comes
back a few megabytes.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor, Future
from contextlib import contextmanager
from typing import Any

from pipeline.criticism.each import Work, by_threads, done_by
from pipeline.criticism.segment import Segment
from pipeline.execution.pools import Cluster, core_count, open_pool

_log = logging.getLogger(__name__)
_HELD: dict[int, Segment] = {}
"""Of the worker: the segments that it was sent, by number."""


class Mate:
    """The worker as `executor` takes its tasks, none to do all here. What it cannot do is done
    here as well: an effect whose hooks no other process can find, or the rest after its death.
    """

    def __init__(self, executor: Executor | None) -> None:
        self._executor = executor
        # kept, so that no other segment takes its identity
        self._sent: dict[int, Segment] = {}
        self._spent_s: dict[int, float] = {}

    @contextmanager
    def campaign(self) -> Iterator[None]:
        """Work on one campaign's segments is shared inside the block; then they are forgotten."""
        with done_by(self.share):
            yield
        self._sent.clear()
        self._spent_s.clear()
        if self._executor is not None:
            self._executor.submit(_forget)

    def share(
        self, work: Work, segments: Sequence[Segment], arguments: Sequence[tuple[Any, ...]]
    ) -> tuple[Any, ...]:
        """`work(segment, *arguments)` of every segment, in order, half of it by the worker."""
        if self._executor is None or len(segments) < 2:
            return by_threads(work, segments, arguments)
        mine, theirs = halves(self._costs(segments))
        try:
            given = [segments[n] for n in theirs], [arguments[n] for n in theirs]
            there = self._handed(self._executor, work, *given)
            done = {n: _timed(work, segments[n], arguments[n]) for n in mine}
            done |= dict(zip(theirs, there.result(), strict=True))
        except Exception as error:  # noqa: BLE001 - if it is of the work, it is raised again here
            _log.info("work on segments is not shared any more: %s", error)
            self._executor = None
            return by_threads(work, segments, arguments)
        for n, (_, seconds) in done.items():
            key = id(segments[n])
            self._spent_s[key] = self._spent_s.get(key, 0.0) + seconds
        return tuple(done[n][0] for n in range(len(segments)))

    def _costs(self, segments: Sequence[Segment]) -> list[float]:
        """What work on each segment costs: the time spent on it so far, or else its samples."""
        spent = [self._spent_s.get(id(segment), 0.0) for segment in segments]
        return spent if all(spent) else [float(segment.size) for segment in segments]

    def _handed(
        self,
        executor: Executor,
        work: Work,
        segments: Sequence[Segment],
        arguments: Sequence[tuple[Any, ...]],
    ) -> Future[list[tuple[Any, float]]]:
        new = {id(one): one for one in segments if id(one) not in self._sent}
        there = executor.submit(_done, new, [id(one) for one in segments], work, arguments)
        self._sent |= new
        return there


@contextmanager
def mate(effects_path: str | None) -> Iterator[Mate]:
    """A worker that knows the effects; none where this process may use one core only."""
    if core_count() < 2:
        yield Mate(None)
        return
    with open_pool("local", Cluster())(1) as pool:
        pool.executor.submit(_learn, effects_path)
        yield Mate(pool.executor)


def halves(sizes: Sequence[float]) -> tuple[list[int], list[int]]:
    """Indices in two shares of about the same sum of sizes, the largest dealt out first."""
    shares: tuple[list[int], list[int]] = [], []
    loads = [0.0, 0.0]
    for n in sorted(range(len(sizes)), key=lambda n: -sizes[n]):
        lighter = int(loads[1] < loads[0])
        shares[lighter].append(n)
        loads[lighter] += sizes[n]
    return shares


def _forget() -> None:
    _HELD.clear()


def _learn(effects_path: str | None) -> None:
    """A user's effects have to be known by name before they come."""
    from pipeline.criticism.registry import effects

    effects(effects_path)


def _done(
    new: dict[int, Segment], wanted: list[int], work: Work, arguments: Sequence[tuple[Any, ...]]
) -> list[tuple[Any, float]]:
    _HELD.update(new)
    return [_timed(work, _HELD[key], one) for key, one in zip(wanted, arguments, strict=True)]


def _timed(work: Work, segment: Segment, arguments: tuple[Any, ...]) -> tuple[Any, float]:
    """What comes of work on a segment, and the processor's time that it took [s]."""
    begun = time.thread_time()
    done = work(segment, *arguments)
    return done, time.thread_time() - begun
