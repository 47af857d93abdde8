"""What a pass of a watched folder costs beside the motors that it works on."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import pytest

from pipeline.execution.outputs.sheet_memory import SheetMemory
from pipeline.execution.workers.worker_pool import WorkerPool
from pipeline.io.registry.store import Registry
from pipeline.settings import RunSettings
from pipeline.stages import run
from tests.unit.stages.test_watch import resistance

MOTORS, PASSES = 48, 3
MOST = 0.5
"""Of the time of a pass that reads and registers all datasheets; measured: 0.29 to 0.36."""


@pytest.mark.slow
def test_a_pass_that_remembers_costs_less_than_one_by_itself(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where the captures of one motor of many changed; the rest is looked at and not read."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    folder, output = tmp_path / "in", tmp_path / "out"
    folder.mkdir()
    output.mkdir()
    worked_s = [0.0]

    def here(_: object, work: Callable[[Any], Any], tasks: Sequence[Any], __: Any = None) -> Any:
        begun_s = time.process_time()
        results = [work(task) for task in tasks]
        worked_s[0] += time.process_time() - begun_s
        return results

    monkeypatch.setattr(WorkerPool, "map_tasks", here)
    keys = RunSettings(input=str(folder), output=str(output), recordings=False, residual_test=False)
    workers = WorkerPool(lambda _: nullcontext(), 1, output / ".work")

    def nothing() -> tuple[Registry, SheetMemory]:
        return Registry(str(output / "registry")), SheetMemory()

    def beside_the_work_s(known: tuple[Registry, SheetMemory], r_ohm: float) -> float:
        resistance(folder, "m0", r_ohm)
        begun_s, worked_s[0] = time.process_time(), 0.0
        run._run(keys, known[0], workers, known[1])
        return time.process_time() - begun_s - worked_s[0]

    for number in range(1, MOTORS):
        resistance(folder, f"m{number}", 0.5 + 0.01 * number)
    memory = nothing()
    beside_the_work_s(memory, 0.3)
    pairs = [
        (beside_the_work_s(memory, 0.6 + k), beside_the_work_s(nothing(), 0.7 + k))
        for k in range(PASSES)
    ]
    remembering_s, alone_s = (min(seconds) for seconds in zip(*pairs, strict=True))
    assert remembering_s < MOST * alone_s
