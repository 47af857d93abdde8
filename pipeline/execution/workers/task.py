"""Running one task in a worker, with a progress file; its log lines return with its result."""

from __future__ import annotations

import gc
import logging
import os
import threading
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import parent_process
from multiprocessing.connection import wait
from pathlib import Path
from typing import Any, NoReturn

from pipeline.io.ingest.guard import progress_file
from pipeline.records.errors import PipelineError

LOGGER = "pipeline"
GARBAGE_ROUND = 100_000
"""New objects between two garbage collections of a worker; the default of 700 costs a tenth of its
time.
"""


@dataclass(frozen=True, slots=True)
class Report:
    """The outcome of a task: its value or its error, and (level, text) of what was logged."""

    value: Any
    error: Exception | None
    logged: tuple[tuple[int, str], ...]


def perform(function: Callable[[Any], Any], task: Any, progress: str | None) -> Report:
    """Runs `function(task)` with its warnings and log lines collected.

    An error is part of the report, not raised, so that its log lines are not lost.

    Parameters
    ----------
    function
        What is done with a task; importable in a worker.
    task
        The task.
    progress
        Folder of the progress files; None for none.

    """
    logged: list[tuple[int, str]] = []
    answer: Any = None
    error: Exception | None = None
    with _collected(logged), progress_file(None if progress is None else Path(progress)):
        try:
            answer = function(task)
        except PipelineError as fault:
            error = fault
        except Exception as fault:  # noqa: BLE001 (the driver reports it, with the motor's name)
            error = RuntimeError(f"{type(fault).__name__}: {fault}"[:500])
    return Report(answer, error, tuple(logged))


@contextmanager
def _collected(logged: list[tuple[int, str]]) -> Iterator[None]:
    """Warnings and the records of every logger, as (level, text), instead of on standard error."""

    class Collector(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            logged.append((record.levelno, record.getMessage()))

    root, collector = logging.getLogger(), Collector(logging.WARNING)
    root.addHandler(collector)
    try:
        with warnings.catch_warnings(record=True) as caught:
            yield
        logged += [(logging.WARNING, f"{w.category.__name__}: {w.message}") for w in caught]
    finally:
        root.removeHandler(collector)


def begin_worker(threads: str) -> None:
    """Ends this worker as soon as the driver is gone; `threads` is its share of the cores.

    Polars runs every query in threads of its own, and those of several workers would compete.
    Garbage is collected less often.

    Parameters
    ----------
    threads
        Number of threads of this worker.

    """
    os.environ.setdefault("POLARS_MAX_THREADS", threads)
    gc.set_threshold(GARBAGE_ROUND)
    driver = parent_process()
    if driver is None:
        return

    def follow() -> NoReturn:
        wait([driver.sentinel])
        os._exit(1)

    threading.Thread(target=follow, daemon=True, name="follows its driver").start()
