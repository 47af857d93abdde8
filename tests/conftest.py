"""One thread and one seed for every test: a result must not depend on cores, clock or history."""

from __future__ import annotations

import gc
import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

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


@pytest.fixture(autouse=True)
def _in_this_process(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """`main([...])` works in a thread of the test's own process; `@pytest.mark.workers` does not.

    Starting a worker costs seconds of imports. Who needs a real one starts a command or is marked.
    """
    if request.node.get_closest_marker("workers") is not None:
        return
    from pipeline.execution.workers import pools

    @contextmanager
    def threads(workers: int) -> Iterator[pools.Pool]:
        with ThreadPoolExecutor(1) as executor:
            yield pools.Pool(executor, ())

    monkeypatch.setattr(pools, "local_pool", threads)
