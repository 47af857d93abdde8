"""A watched folder: what is taken up, when, and what is shown of it."""

from __future__ import annotations

import json
import math
import os
import shutil
import sys
from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack, nullcontext
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from pipeline.execution.jobs import ModelTest, WarmUp
from pipeline.execution.outputs import sheet_memory
from pipeline.execution.outputs.sheet_memory import SheetMemory
from pipeline.execution.workers.worker_pool import WorkerPool
from pipeline.io.ingest.arrivals import Arrivals, snapshot
from pipeline.io.registry.store import Receipt, Registry
from pipeline.records.datasheet import Datasheet
from pipeline.records.errors import MachineError, UsageError
from pipeline.records.ledger import Selection
from pipeline.records.outcome import Outcome
from pipeline.settings import RunSettings
from pipeline.stages import run
from pipeline.stages.steps import motor, watch
from pipeline.stages.steps.watch import FolderChangedError, Watch

DEMO = Path(__file__).parents[3] / "data" / "demo"


def test_a_folder_rests_from_its_last_change_on() -> None:
    arrivals, first = Arrivals(), frozenset({("a.csv", 1, 1, 1)})
    grown = frozenset({("a.csv", 2, 2, 1)})
    assert [arrivals.rested_s(first, t) for t in (10.0, 11.5, 12.0)] == [0.0, 1.5, 2.0]
    assert [arrivals.rested_s(grown, t) for t in (12.25, 14.0)] == [0.0, 1.75], "it grew"
    arrivals.taken = grown
    assert arrivals.rested_s(grown, 100.0) == -math.inf, "it is taken up"
    assert [arrivals.rested_s(first, t) for t in (100.0, 102.0)] == [0.0, 2.0], "it changed"


@pytest.mark.parametrize("change", ["bigger", "same size", "replaced", "new", "gone", "sidecar"])
def test_each_change_of_a_folder_is_seen(tmp_path: Path, change: str) -> None:
    file = tmp_path / "sub" / "a.csv"
    file.parent.mkdir()
    file.write_text("1,2\n")
    os.utime(file, ns=(10**18, 10**18))
    before = snapshot(tmp_path)
    if change == "bigger":
        file.write_text("1,2\n3,4\n")
    elif change == "same size":
        file.write_text("1,3\n")
    elif change == "replaced":
        other = tmp_path / ".a.csv"
        other.write_text("1,4\n")
        os.utime(other, ns=(10**18, 10**18))
        other.replace(file)
    elif change == "gone":
        file.unlink()
    else:
        (file.parent / ("b.csv" if change == "new" else "a.csv.meta.yaml")).write_text("")
    assert snapshot(tmp_path) != before


def test_hidden_files_are_none_of_the_folder(tmp_path: Path) -> None:
    """As a run leaves them out: copying programs write under a hidden name first."""
    before = snapshot(tmp_path)
    (tmp_path / ".a.csv.Xy12").write_text("half")
    (tmp_path / ".cache").mkdir()
    (tmp_path / ".cache" / "a").write_text("")
    assert snapshot(tmp_path) == before


def test_a_folder_that_is_gone_is_one_error(tmp_path: Path) -> None:
    with pytest.raises(MachineError, match="is gone"):
        snapshot(tmp_path / "none")


@pytest.fixture
def settings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> RunSettings:
    monkeypatch.setattr(watch, "LOOK_EVERY_S", 0.01)
    monkeypatch.setattr(watch, "RETRY_S", 0.01)
    monkeypatch.setattr(watch, "end_at_once_or_next", lambda _: None)
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "a.csv").write_text("1")
    return RunSettings(
        input=str(tmp_path / "in"), output=str(tmp_path / "out"), watch=True, settle_s=0.02
    )


def following(outcome: Outcome) -> Outcome:
    assert outcome.then is not None
    return outcome.then()


def test_a_pass_begins_again_where_files_came_while_it_looked(settings: RunSettings) -> None:
    """Expected: the pass in which a file came writes nothing, and the next one sees both."""
    written, hurried = list[int](), list[bool]()

    def perform(surveyed: Callable[[], object], *, ahead: bool) -> Outcome:
        hurried.append(ahead)
        files = sorted(Path(settings.input).iterdir())
        if not written and len(files) == 1:
            (Path(settings.input) / "b.csv").write_text("half a fi")
        surveyed()
        written.append(len(files))
        return Outcome(3, errors=("refused: a.csv",))

    first = following(Watch(settings, perform, ExitStack()).begin())
    assert (written, first.errors) == ([], ())
    second = following(first)
    assert written == [2]
    assert second.errors == ("refused: a.csv",)
    assert second.exit_code == 0, "what a pass came to is told, and the watch goes on"
    (Path(settings.input) / "c.csv").write_text("")
    third = following(second)
    assert written == [2, 3]
    assert third.errors == (), "it was told before"
    assert hurried == [True, False, True], "nothing is begun ahead that the next pass waits for"


def test_a_file_that_comes_while_the_folder_settles_begins_the_pass_again(
    settings: RunSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A look at the files begins before the folder has settled; nothing is written until it has."""
    monkeypatch.setattr(watch, "LOOK_EVERY_S", 0.125)
    settings.settle_s = 1.0
    time_s, looked_at_s = [0.0], list[float]()
    written: list[tuple[int, float]] = []
    late = Path(settings.input) / "b.csv"

    def sleep(pause_s: float) -> None:
        time_s[0] += pause_s
        if time_s[0] > 0.5 and not late.exists():
            late.write_text("half a fi")

    def perform(surveyed: Callable[[], object], *, ahead: bool) -> Outcome:
        looked_at_s.append(time_s[0])
        files = sorted(Path(settings.input).iterdir())
        surveyed()
        written.append((len(files), time_s[0]))
        return Outcome()

    clock = SimpleNamespace(sleep=sleep, monotonic=lambda: time_s[0])
    monkeypatch.setattr(watch, "time", clock)
    first = following(Watch(settings, perform, ExitStack()).begin())
    assert written == [], "a file came"
    following(first)
    ((files, at_s),) = written
    assert (files, looked_at_s, at_s) == (2, [0.125, 0.75], 1.625)


def test_a_full_disk_is_told_and_tried_again(settings: RunSettings) -> None:
    passes: list[int] = []

    def perform(surveyed: Callable[[], object], *, ahead: bool) -> Outcome:
        surveyed()
        passes.append(1)
        if len(passes) == 1:
            raise MachineError("the disk is full", "make room")
        return Outcome()

    first = following(Watch(settings, perform, ExitStack()).begin())
    assert first.errors[0].startswith("error: the disk is full") and first.exit_code == 0
    following(first)
    assert len(passes) == 2


def test_the_end_closes_the_workers(settings: RunSettings) -> None:
    closed: list[bool] = []
    workers = ExitStack()
    workers.callback(lambda: closed.append(True))

    def perform(surveyed: Callable[[], object], *, ahead: bool) -> Outcome:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        following(Watch(settings, perform, workers).begin())
    assert closed == [True]


def test_a_signal_between_two_passes_ends_the_next(settings: RunSettings) -> None:
    """While a line is printed nothing is torn: the watch ends where it would have gone on."""
    passes: list[int] = []

    def perform(surveyed: Callable[[], object], *, ahead: bool) -> Outcome:
        passes.append(1)
        if len(passes) == 2:
            watching._signalled()
        return Outcome()

    watching = Watch(settings, perform, ExitStack())
    first = following(watching.begin())
    (Path(settings.input) / "b.csv").write_text("")
    with pytest.raises(KeyboardInterrupt):
        following(first)
    again = Watch(settings, perform, ExitStack())
    third = following(again.begin())
    again._signalled()
    with pytest.raises(KeyboardInterrupt):
        following(third)
    assert len(passes) == 3


def test_a_motor_and_its_residual_test_begin_while_the_folder_settles(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Expected: each is begun once, before the folder has settled; nothing but the cache is written
    until it has.
    """
    folder, output = tmp_path / "in", tmp_path / "out"
    folder.mkdir()
    shutil.copy(DEMO / "G52-0601" / "resistance_ab.mcap", folder)
    begun, worked = list[str](), list[str]()

    def begin(_: WorkerPool, function: object, tasks: Sequence[ModelTest]) -> None:
        begun.extend(task.name for task in tasks)

    def here(_: WorkerPool, function: Any, tasks: Sequence[Any], *__: object) -> list[Any]:
        worked.extend(task.name for task in tasks)
        return [function(task) for task in tasks]

    def settled() -> None:
        assert begun == ["the residual test of motor G52-0601", "motor G52-0601"]
        assert {path.name for path in output.iterdir()} <= {".cache", ".work"}

    monkeypatch.setattr(WorkerPool, "begin_tasks", begin)
    monkeypatch.setattr(WorkerPool, "map_tasks", here)
    keys = RunSettings(input=str(folder), output=str(output), report=False, recordings=False)
    output.mkdir()
    workers = WorkerPool(lambda _: nullcontext(), 2, output / ".work")
    run._run(keys, None, workers, SheetMemory(), settled, ahead=True)
    assert (output / "datasheets" / "G52-0601.json").is_file()
    assert [name for name in worked if "G52" in name] == ["motor G52-0601"]


def test_a_motor_that_was_begun_writes_nothing_where_the_folder_does_not_settle(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nor does one that was revoked meanwhile: its job is another one by then."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    folder, output = tmp_path / "in", tmp_path / "out"
    folder.mkdir()
    output.mkdir()
    resistance(folder, "a", 0.6)
    begun: list[Any] = []
    worked: list[Any] = []

    def begin(_: object, __: object, tasks: Sequence[Any]) -> None:
        begun.extend(tasks)

    def here(_: object, work: Callable[[Any], Any], tasks: Sequence[Any], __: Any = None) -> Any:
        worked.extend(task for task in tasks if "survey" not in task.name)
        return [work(task) for task in tasks]

    monkeypatch.setattr(WorkerPool, "begin_tasks", begin)
    monkeypatch.setattr(WorkerPool, "map_tasks", here)
    keys = RunSettings(input=str(folder), output=str(output), recordings=False, residual_test=False)
    workers = WorkerPool(lambda _: nullcontext(), 2, output / ".work")
    registry = Registry(str(output / "registry"))

    def moved() -> None:
        raise FolderChangedError

    with pytest.raises(FolderChangedError):
        run._run(keys, registry, workers, SheetMemory(), moved, ahead=True)
    (held,) = begun
    assert run.process_motor(held) is None
    assert not (output / "datasheets").exists()
    run._run(keys, registry, workers, SheetMemory())
    (output / "datasheets" / "a.json").unlink()

    def revoked() -> None:
        last = Selection("a", revision=1)
        registry.decide("revoke", last, "A. Smith", "wrong", datetime(2026, 1, 1, tzinfo=UTC))

    begun.clear()
    worked.clear()
    run._run(keys, registry, workers, SheetMemory(), revoked, ahead=True)
    (held,) = begun
    assert worked == [replace(held.job, revoked=worked[0].revoked, key=worked[0].key)]
    assert run.process_motor(held) is None


def resistance(folder: Path, motor_id: str, r_ohm: float) -> None:
    """A resistance test of one motor, of four levels of current."""
    levels = (level for level in (-2.0, -1.0, 1.0, 2.0) for _ in range(200))
    rows = "".join(f"{1e-3 * k:.3f},{r_ohm * i},{i},25.0\n" for k, i in enumerate(levels))
    head = f"# contract: 1\n# motor_id: {motor_id}\n# test: resistance\n# pair: ab\n"
    body = f"{head}t_s,vab_v,ia_a,temp_winding_degc\n{rows}"
    (folder / f"{motor_id}.csv").write_text(body)


def written(output: Path) -> dict[str, bytes]:
    """Every file of an output but those of its registry and cache."""
    files = (path for path in output.rglob("*") if path.is_file())
    names = {path.relative_to(output).as_posix(): path for path in files}
    return {
        name: path.read_bytes()
        for name, path in names.items()
        if not name.startswith(("registry/", ".cache/"))
    }


def test_passes_leave_what_a_run_by_itself_leaves(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A pass reads nothing again that did not change; each file is as a run that knows nothing of
    earlier ones makes it, whatever came, changed, went or was decided in between.
    """
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    folder, output = tmp_path / "in", tmp_path / "out"
    folder.mkdir()
    (output / "comparison").mkdir(parents=True)
    read: list[str] = []
    published: list[str] = []
    publish = Registry.publish

    def publishing(self: Registry, documents: Iterable[bytes], now: datetime) -> Receipt:
        given = list(documents)
        published.extend(json.loads(document)["motor_id"] for document in given)
        return publish(self, given, now)

    whole = sheet_memory.datasheet_from

    def reading(data: bytes, name: str) -> Datasheet:
        read.append(name)
        return whole(data, name)

    def here(_: object, work: Callable[[Any], Any], tasks: Sequence[Any], __: Any = None) -> Any:
        return [work(task) for task in tasks]

    monkeypatch.setattr(sheet_memory, "datasheet_from", reading)
    monkeypatch.setattr(Registry, "publish", publishing)
    monkeypatch.setattr(WorkerPool, "map_tasks", here)
    keys = RunSettings(input=str(folder), output=str(output), recordings=False, residual_test=False)
    workers = WorkerPool(lambda _: nullcontext(), 1, output / ".work")
    registry, memory = Registry(str(output / "registry")), SheetMemory()

    def a_pass(*changed: str) -> None:
        read.clear()
        published.clear()
        run._run(keys, registry, workers, memory)
        memory.forget_others()
        assert read == [f"{motor_id}.json" for motor_id in changed]
        assert published == list(changed)
        by_watch = written(output)
        (output / ".cache" / "run.json").unlink()
        run._run(keys, registry, workers, SheetMemory())
        assert by_watch == written(output)

    resistance(folder, "a", 0.6)
    a_pass("a")
    resistance(folder, "b", 0.7)
    a_pass("b")
    last = Selection("a", revision=1)
    registry.decide("revoke", last, "A. Smith", "wrong leads", datetime(2026, 1, 1, tzinfo=UTC))
    resistance(folder, "c", 0.8)
    a_pass("c")
    assert "wrong leads" in (output / "report" / "a.html").read_text()
    (output / "comparison" / "b.html").write_text("")
    resistance(folder, "c", 0.9)
    a_pass("c")
    assert "comparison/b.html" in (output / "report" / "b.html").read_text()
    (folder / "a.csv").unlink()
    a_pass()
    by_watch = written(output)
    run._run(replace(keys, cache=False), registry, workers, SheetMemory())
    assert by_watch == written(output)


@pytest.mark.parametrize("wrong", [{"settle_s": -1.0}, {"json": True}])
def test_settings_that_no_watch_can_keep(settings: RunSettings, wrong: dict[str, object]) -> None:
    for name, value in wrong.items():
        setattr(settings, name, value)
    with pytest.raises(UsageError, match=next(iter(wrong))):
        run.main(settings)


def test_a_watch_starts_every_worker_before_the_first_campaign(tmp_path: Path) -> None:
    """Nothing that a motor imports late is left for the first one to wait for."""
    given: list[object] = []

    def kept(_: object, function: object, tasks: Sequence[object], *__: object) -> list[object]:
        given.extend(tasks)
        return []

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(WorkerPool, "map_tasks", kept)
        patch.setattr(watch, "end_at_once_or_next", lambda _: None)
        keys = RunSettings(input=str(tmp_path), output=str(tmp_path / "out"), watch=True, workers=3)
        assert run.main(keys).text.startswith("watching")
    assert given == [WarmUp(shares=True)] * 3
    assert given[0].without("a.csv", "slow") == given[0]
    assert run.process_motor(WarmUp()) is None
    assert set(motor.LATE_IMPORTS) <= set(sys.modules)
