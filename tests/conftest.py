"""One thread and one seed for every test: a result must not depend on cores, clock or history."""

from __future__ import annotations

import gc
import os
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from contextlib import contextmanager
from copy import deepcopy
from typing import Any

import hypothesis
import pytest

from pipeline.__main__ import THREADS

for name in THREADS:  # before anything imports numpy
    os.environ.setdefault(name, "1")

# As in the workers of the project: by the default of 700 new objects, looking for garbage takes a
# quarter of the time in which tests are collected.
gc.set_threshold(100_000)

hypothesis.settings.register_profile(
    "project", deadline=None, derandomize=True, database=None, print_blob=True
)
hypothesis.settings.load_profile("project")


def pytest_collection_finish() -> None:
    """What was collected stays until the end: looking for garbage passes over it."""
    gc.collect()
    gc.freeze()


class Here(Executor):
    """Does each task at once, where it is submitted."""

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except BaseException as error:  # noqa: BLE001 - as an executor of processes hands it on
            future.set_exception(error)
        return future


@pytest.fixture(autouse=True, scope="session")
def _on_one_core() -> Iterator[Callable[[int], Any]]:
    """`main([...])` and fits work in the test's own process and thread, in wider fixtures as well;
    the pool of processes that stands aside.

    Starting a worker costs seconds of imports, and where every core has a process of its own two
    threads add a fifth to the processor time.
    """
    from pipeline.criticism.regression.parallel import in_order, mapped_by
    from pipeline.execution.workers import pools

    @contextmanager
    def here(workers: int) -> Iterator[pools.Pool]:
        yield pools.Pool(Here(), ())

    with pytest.MonkeyPatch.context() as patch, mapped_by(in_order):
        processes = pools.local_pool
        patch.setattr(pools, "local_pool", here)
        yield processes


@pytest.fixture(autouse=True, scope="session")
def _settings_composed_once() -> Iterator[None]:
    """Hydra takes 0.1 s to compose the settings of a command: of the same words, the same ones."""
    from pipeline.cli import configuration

    compose, kept = configuration._composed, dict[object, Any]()

    def once(command: Any, overrides: list[str], config_dir: str | None) -> Any:
        if config_dir is not None:  # a test changes files there
            return compose(command, overrides, config_dir)
        key = command.name, command.settings, configuration.configuration_folder(), *overrides
        if key not in kept:
            kept[key] = compose(command, overrides, None)
        return deepcopy(kept[key])

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(configuration, "_composed", once)
        yield


@pytest.fixture(autouse=True)
def _workers_where_marked(
    request: pytest.FixtureRequest, _on_one_core: Callable[[int], Any]
) -> Iterator[None]:
    """Who needs real workers starts a command or is marked with `@pytest.mark.workers`."""
    with pytest.MonkeyPatch.context() as patch:
        if request.node.get_closest_marker("workers") is not None:
            patch.setattr("pipeline.execution.workers.pools.local_pool", _on_one_core)
        yield
