"""A second process that holds the segments of a campaign and does half of the work on them.

Much of the work is on arrays too small for numpy to release the interpreter lock, so two threads
use 1.4 cores. Segments are sent once. A task is a few kilobytes, its result a few megabytes.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor, Future
from contextlib import contextmanager
from typing import Any

from pipeline.criticism.data.segment import Segment
from pipeline.criticism.regression.parallel import Work, by_threads, done_by
from pipeline.execution.workers.pools import Cluster, core_count, open_pool

_log = logging.getLogger(__name__)
_SEGMENTS: dict[int, Segment] = {}
"""In the worker: the segments that it was sent, by number."""


class SegmentWorker:
    """Shares work on segments with the process behind `executor`; None does all of it here.

    Work that the process cannot do is done here: an effect whose hooks it cannot import, or
    everything after the process has died.
    """

    def __init__(self, executor: Executor | None) -> None:
        self._executor = executor
        # keeps a reference, so that no other segment gets the same id
        self._sent: dict[int, Segment] = {}
        self._cost_s: dict[int, float] = {}

    @contextmanager
    def campaign(self) -> Iterator[None]:
        """Shares the work on one campaign's segments inside the block, then drops the segments."""
        with done_by(self.share):
            yield
        self._sent.clear()
        self._cost_s.clear()
        if self._executor is not None:
            self._executor.submit(_forget)

    def share(
        self, work: Work, segments: Sequence[Segment], arguments: Sequence[tuple[Any, ...]]
    ) -> tuple[Any, ...]:
        """`work(segment, *arguments)` of every segment, in order; the worker does half of them.

        Parameters
        ----------
        work
            What is done with a segment; importable in a worker.
        segments
            The segments.
        arguments
            Further arguments for each segment.

        """
        if self._executor is None or len(segments) < 2:
            return by_threads(work, segments, arguments)
        local, remote = halves(self._costs(segments))
        try:
            given = [segments[n] for n in remote], [arguments[n] for n in remote]
            future = self._submit(self._executor, work, *given)
            done = {n: _timed(work, segments[n], arguments[n]) for n in local}
            done |= dict(zip(remote, future.result(), strict=True))
        except Exception as error:  # noqa: BLE001 - an error of the work itself is raised again here
            _log.info("work on segments is no longer shared: %s", error)
            self._executor = None
            return by_threads(work, segments, arguments)
        for n, (_, seconds) in done.items():
            key = id(segments[n])
            self._cost_s[key] = self._cost_s.get(key, 0.0) + seconds
        return tuple(done[n][0] for n in range(len(segments)))

    def _costs(self, segments: Sequence[Segment]) -> list[float]:
        """The cost of each segment: the time spent on it so far, else its number of samples."""
        spent_s = [self._cost_s.get(id(segment), 0.0) for segment in segments]
        return spent_s if all(spent_s) else [float(segment.size) for segment in segments]

    def _submit(
        self,
        executor: Executor,
        work: Work,
        segments: Sequence[Segment],
        arguments: Sequence[tuple[Any, ...]],
    ) -> Future[list[tuple[Any, float]]]:
        new = {id(segment): segment for segment in segments if id(segment) not in self._sent}
        keys = [id(segment) for segment in segments]
        future = executor.submit(_map_timed, new, keys, work, arguments)
        self._sent |= new
        return future


@contextmanager
def segment_worker(effects_path: str | None) -> Iterator[SegmentWorker]:
    """A worker that has loaded the effects; no process where only one core may be used.

    Parameters
    ----------
    effects_path
        Folder of the user's effects; None without any.

    """
    if core_count() < 2:
        yield SegmentWorker(None)
        return
    with open_pool("local", Cluster())(1) as pool:
        pool.executor.submit(_load_effects, effects_path)
        yield SegmentWorker(pool.executor)


def halves(sizes: Sequence[float]) -> tuple[list[int], list[int]]:
    """Indices in two shares of about equal total size; the largest is assigned first.

    Parameters
    ----------
    sizes
        Size of each item.

    """
    shares: tuple[list[int], list[int]] = [], []
    loads = [0.0, 0.0]
    for n in sorted(range(len(sizes)), key=lambda n: -sizes[n]):
        lighter = int(loads[1] < loads[0])
        shares[lighter].append(n)
        loads[lighter] += sizes[n]
    return shares


def _forget() -> None:
    _SEGMENTS.clear()


def _load_effects(effects_path: str | None) -> None:
    """Imports the user's effects, so that they can be unpickled by name."""
    from pipeline.criticism.library.registry import effects

    effects(effects_path)


def _map_timed(
    new: dict[int, Segment], keys: list[int], work: Work, arguments: Sequence[tuple[Any, ...]]
) -> list[tuple[Any, float]]:
    _SEGMENTS.update(new)
    return [_timed(work, _SEGMENTS[key], given) for key, given in zip(keys, arguments, strict=True)]


def _timed(work: Work, segment: Segment, arguments: tuple[Any, ...]) -> tuple[Any, float]:
    """The result of work on a segment, and its processor time [s]."""
    begun_s = time.thread_time()
    result = work(segment, *arguments)
    return result, time.thread_time() - begun_s
