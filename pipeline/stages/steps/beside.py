"""Residual tests of motors for workers that would be idle beside the motors themselves."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.execution.caches.run_cache import RunCache
from pipeline.execution.jobs import ModelTest, MotorJob
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
