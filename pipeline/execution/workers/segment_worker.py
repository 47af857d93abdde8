"""A second process that holds the segments of a campaign and does half of the work on them.

Much of the work is on arrays too small for numpy to release the interpreter lock, so two threads
use 1.4 cores. Segments are sent once. A task is a few kilobytes, its result a few megabytes. What a
task is about may hold functions made on the way, such as a curve of a residual: cloudpickle sends
them by value.
"""

from __future__ import annotations

import gc
import importlib
import logging
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from contextlib import AbstractContextManager, ExitStack, contextmanager
from functools import partial
from multiprocessing import parent_process
from multiprocessing.util import Finalize
from typing import Any, TypeVar

import cloudpickle

from pipeline.criticism.data.segment import Segment
from pipeline.criticism.regression.parallel import Work, by_threads, in_order, mapped_by
from pipeline.execution.workers.pools import Cluster, core_count, open_pool

Made = TypeVar("Made")
_log = logging.getLogger(__name__)
_SEGMENTS: dict[int, Segment] = {}
"""In the worker: the segments that it was sent, by number."""
_OWN: list[SegmentWorker] = []
"""The worker that `open_own` has opened in this process."""


class SegmentWorker:
    """Shares work on segments with the process behind `executor`; None does all of it here.

    Work that the process cannot do is done here, and everything after it: an effect whose module
    it cannot import, or a process that has died.
    """

    def __init__(self, executor: Executor | None) -> None:
        self._executor = executor
        # keeps references, so that no other segment gets the same id
        self._placed: tuple[dict[int, Segment], dict[int, Segment]] = {}, {}

    @contextmanager
    def campaign(self) -> Iterator[None]:
        """Shares the work on one campaign's segments inside the block, then drops the segments."""
        with mapped_by(self.share):
            yield
        for segments in self._placed:
            segments.clear()
        if self._executor is not None:
            self._executor.submit(_forget)

    def share(
        self, work: Work, segments: Sequence[Segment], arguments: Sequence[tuple[Any, ...]]
    ) -> tuple[Any, ...]:
        """`work(segment, *arguments)` of every segment, in order; the worker does half of it.

        A segment stays with the process that it was first given to. A process keeps what it has
        computed of a segment, and the last bits of a result depend on what was kept. So they are
        the same with and without a worker, however fast either is.

        Parameters
        ----------
        work
            What is done with a segment; importable in a worker.
        segments
            The segments.
        arguments
            Further arguments for each segment.

        """
        if self._executor is None:
            return by_threads(work, segments, arguments)
        new = self._place(segments)
        remote = [n for n, segment in enumerate(segments) if id(segment) in self._placed[1]]
        local = [n for n in range(len(segments)) if n not in remote]
        keys, given = [id(segments[n]) for n in remote], [arguments[n] for n in remote]
        try:
            task = cloudpickle.dumps((keys, work, given))
            future = self._executor.submit(_map, new, task)
            done = {n: work(segments[n], *arguments[n]) for n in local}
            done |= dict(zip(remote, future.result(), strict=True))
        except Exception as error:  # noqa: BLE001 - an error of the work itself is raised again here
            _log.info("work on segments is no longer shared: %s", error)
            self._executor = None
            return by_threads(work, segments, arguments)
        return tuple(done[n] for n in range(len(segments)))

    def aside(self, work: Callable[..., Made], *arguments: Any) -> Callable[[], Made]:
        """Begins other work in the process, while this one goes on.

        Parameters
        ----------
        work
            What is done; importable in a worker.
        *arguments
            Its arguments.

        Returns
        -------
        callable
            Waits for the result; does the work here where the process cannot.

        """
        here = partial(work, *arguments)
        if self._executor is None:
            return here
        try:
            future = self._executor.submit(work, *arguments)
        except Exception:  # noqa: BLE001 - the process is gone; an error of the work comes up here
            return here

        def result() -> Made:
            try:
                return future.result()
            except Exception as error:  # noqa: BLE001 - an error of the work itself is raised again
                _log.info("work is done here instead: %s", error)
                return here()

        return result

    def _place(self, segments: Sequence[Segment]) -> dict[int, Segment]:
        """Gives new segments to either process, the largest first; those that the worker gets."""
        local, remote = self._placed
        loads = [sum(_load_of(segment) for segment in one.values()) for one in self._placed]
        new = [s for s in segments if id(s) not in local and id(s) not in remote]
        sent: dict[int, Segment] = {}
        for segment in sorted(new, key=_load_of, reverse=True):
            lighter = int(loads[1] < loads[0])
            loads[lighter] += _load_of(segment)
            (sent if lighter else local)[id(segment)] = segment
        remote.update(sent)
        return sent


@contextmanager
def segment_worker(effects_path: str | None, *modules: str) -> Iterator[SegmentWorker]:
    """A worker that has loaded the effects; no process where only one core may be used.

    Parameters
    ----------
    effects_path
        Folder of the user's effects; None without any.
    *modules
        Further modules that it imports while it waits for work.

    """
    if core_count() < 2:
        yield SegmentWorker(None)
        return
    with open_pool("local", Cluster())(1) as pool:
        pool.executor.submit(_load_effects, effects_path)
        for module in modules:
            pool.executor.submit(_load, module)
        yield SegmentWorker(pool.executor)


def open_own() -> None:
    """Opens a segment worker of this worker process, which ends with it; not on a single core, and
    not in a driver.
    """
    if _OWN or core_count() < 2 or parent_process() is None:
        return
    stack = ExitStack()
    _OWN.append(stack.enter_context(segment_worker(None)))
    # before the queues of this process are closed (10), and before it waits for its children
    Finalize(None, stack.close, exitpriority=100)


def shared_or_in_order() -> AbstractContextManager[None]:
    """Shares the work on a campaign's segments inside the block with the worker that `open_own` has
    opened; without one, they are worked on one after the other.
    """
    return _OWN[0].campaign() if _OWN else mapped_by(in_order)


def _load_of(segment: Segment) -> int:
    """Samples that are predicted of a segment: what work on it takes goes with them."""
    return segment.size * len(segment.channels)


def _forget() -> None:
    _SEGMENTS.clear()
    gc.collect()


def _load_effects(effects_path: str | None) -> None:
    """Imports the user's effects, so that they can be unpickled by name, and what works on them."""
    from pipeline.criticism.library.registry import effects

    effects(effects_path)
    importlib.import_module("pipeline.criticism.diagnosis")


def _load(module: str) -> None:
    importlib.import_module(module)


def _map(new: dict[int, Segment], task: bytes) -> list[Any]:
    _SEGMENTS.update(new)
    keys, work, arguments = cloudpickle.loads(task)
    return [work(_SEGMENTS[key], *given) for key, given in zip(keys, arguments, strict=True)]
