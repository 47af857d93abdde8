"""What a worker saves whose motor's residual test is made beside it."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest

from pipeline.__main__ import main
from pipeline.execution.jobs import ModelTest
from pipeline.execution.workers.worker_pool import WorkerPool

DEMO = Path(__file__).parents[2] / "data" / "demo"

CAPTURES = ("resistance_ab.mcap", "current_step_*.mcap", "open_circuit_*.mcap", "drive_*.mcap")


@pytest.mark.slow
def test_the_test_beside_takes_a_third_of_the_motors_time_off(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Processor time of the two tasks, in this process one after the other, so that no other load
    counts; the datasheets are the same.
    """
    for pattern in CAPTURES:
        for path in (DEMO / "G52-0601").glob(pattern):
            (tmp_path / "in").mkdir(exist_ok=True)
            shutil.copyfile(path, tmp_path / "in" / path.name)
    spent: dict[tuple[bool, str], float] = {}

    def here(
        _: WorkerPool,
        function: Callable[[Any], Any],
        tasks: Sequence[Any],
        done: Callable[[int, Any], None] | None = None,
    ) -> list[Any]:
        found: list[Any] = [None] * len(tasks)
        beside = any(isinstance(task, ModelTest) for task in tasks)
        for n in reversed(range(len(tasks))):
            begun_s = time.process_time()
            found[n] = function(tasks[n])
            spent[beside, type(tasks[n]).__name__] = time.process_time() - begun_s
        return found

    monkeypatch.setattr(WorkerPool, "map_tasks", here)
    sheets = []
    for workers in (1, 1, 2):  # the first one imports
        output = tmp_path / "out"
        shutil.rmtree(output, ignore_errors=True)
        keys = ("recordings=false", "report=false", f"workers={workers}")
        main(["run", f"input={tmp_path / 'in'}", f"output={output}", *keys])
        sheets.append((output / "datasheets" / "G52-0601.json").read_bytes())
    capsys.readouterr()
    assert sheets[1] == sheets[2]
    assert spent[True, "MotorJob"] < 0.67 * spent[False, "MotorJob"]
