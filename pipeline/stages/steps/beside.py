"""What workers do that would be idle: residual tests beside the motors themselves, and all of it
before a watched folder has settled.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from pipeline.execution.caches.run_cache import RunCache
from pipeline.execution.jobs import ModelTest, MotorJob
from pipeline.execution.workers.gate import HeldJob
from pipeline.execution.workers.worker_pool import WorkerPool
from pipeline.settings import RunSettings


def due_jobs(jobs: Sequence[MotorJob], cache: RunCache) -> list[MotorJob]:
    """The jobs that are not cached.

    Parameters
    ----------
    jobs
        Jobs of motors.
    cache
        The cache of the run.

    """
    return [j for j in jobs if j.key is None or cache.finished(j.motor_id, j.key) is None]


def beside_motors(
    settings: RunSettings, motors: Sequence[MotorJob], workers: int
) -> list[ModelTest]:
    """Residual tests for the workers that would be idle; a motor finds its own in the cache.

    Parameters
    ----------
    settings
        The keys of `run`.
    motors
        The jobs that are not cached.
    workers
        Number of workers.

    """
    tested = settings.residual_test and settings.diagnose != "true" and settings.cache
    if not tested or settings.executor != "local":
        return []
    return [ModelTest(job) for job in motors[: max(0, workers - len(motors))]]


@contextmanager
def begun_ahead(
    settings: RunSettings,
    motors: Sequence[MotorJob],
    workers: WorkerPool,
    work: Callable[[Any], Any],
) -> Iterator[tuple[HeldJob, ...]]:
    """Begins motors and the tests beside them, a worker each; what is written before their gates
    open is in the cache alone. Motors whose gate is still closed at the end of the block are
    dropped.

    Parameters
    ----------
    settings
        The keys of `run`.
    motors
        The jobs that are not cached.
    workers
        The workers.
    work
        What is done with a job; importable in a worker.

    Yields
    ------
    tuple of HeldJob
        The motors that were begun.

    """
    held = _held(motors[: workers.count], workers) if settings.executor == "local" else ()
    try:
        # the tests first: they take longest
        workers.begin_tasks(work, [*beside_motors(settings, motors, workers.count), *held])
        yield held
    finally:
        for one in held:
            one.gate.drop()


def _held(motors: Sequence[MotorJob], workers: WorkerPool) -> tuple[HeldJob, ...]:
    """The jobs behind closed gates; none where the disk takes no gate."""
    held = tuple(HeldJob(job, workers.gate()) for job in motors)
    try:
        for one in held:
            one.gate.close()
    except OSError:
        return ()
    return held
