"""Maps a function over the segments of a campaign: on two threads, or as a caller says."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

from pipeline.criticism.data.segment import Segment

Work = Callable[..., Any]
Mapper = Callable[[Work, Sequence[Segment], Sequence[tuple[Any, ...]]], tuple[Any, ...]]
"""Calls `work(segment, *arguments)` for every segment; results in their order."""

_THREADS = 2
"""Threads: two are worth 1.4 cores on arrays of this size (docs/criticism.md)."""


def by_threads(
    work: Work, segments: Sequence[Segment], arguments: Sequence[tuple[Any, ...]]
) -> tuple[Any, ...]:
    """Maps a function over segments on two threads.

    Parameters
    ----------
    work
        Function of a segment and its arguments.
    segments
        The segments.
    arguments
        Further arguments of each.

    Returns
    -------
    tuple
        Results in the order of the segments. numpy releases the interpreter where arrays are large.

    """
    with ThreadPoolExecutor(max_workers=_THREADS) as pool:
        return tuple(pool.map(lambda one, with_: work(one, *with_), segments, arguments))


def in_order(
    work: Work, segments: Sequence[Segment], arguments: Sequence[tuple[Any, ...]]
) -> tuple[Any, ...]:
    """Maps a function over segments one after the other.

    Where every core has a process of its own, threads add a fifth to the processor time.

    Parameters
    ----------
    work
        Function of a segment and its arguments.
    segments
        The segments.
    arguments
        Further arguments of each.

    """
    return tuple(work(one, *with_) for one, with_ in zip(segments, arguments, strict=True))


_MAPPER: ContextVar[Mapper] = ContextVar("mapper", default=by_threads)


@contextmanager
def mapped_by(mapper: Mapper) -> Iterator[None]:
    """Inside the block, `on_each` is another function.

    Parameters
    ----------
    mapper
        Takes `work`, segments and arguments, as `by_threads` does.

    """
    before = _MAPPER.set(mapper)
    try:
        yield
    finally:
        _MAPPER.reset(before)


def on_each(
    work: Work, segments: Sequence[Segment], arguments: Sequence[tuple[Any, ...]]
) -> tuple[Any, ...]:
    """Maps a function over segments, as `mapped_by` says, on threads by default.

    Parameters
    ----------
    work
        Function of a module, so that another process can find it.
    segments
        The segments.
    arguments
        Further arguments of each.

    Returns
    -------
    tuple
        Results in the order of the segments.

    """
    return _MAPPER.get()(work, segments, arguments)
