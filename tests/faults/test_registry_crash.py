"""The registry under writers at once, and writers killed in the middle of it."""

from __future__ import annotations

import json
import random
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing import get_context
from multiprocessing.connection import Connection
from multiprocessing.context import ForkServerContext
from multiprocessing.process import BaseProcess
from pathlib import Path

import pytest

from pipeline.io.registry.exports import FOLDER
from pipeline.io.registry.store import Registry
from pipeline.records.ledger import Event
from tests.registered import NOON, document, version_of, write

ROOT = Path(__file__).parents[2]
FULL = pytest.mark.slow
Start = Callable[[Sequence[str], int, int], "Writer"]


@dataclass(frozen=True)
class Writer:
    """A process that registers versions, and the end of the pipe on which it says which."""

    process: BaseProcess
    said: Connection

    def told(self) -> list[int]:
        """Every number that it said is registered, read until the pipe ends."""
        numbers = []
        with suppress(EOFError, ConnectionResetError):
            while True:
                numbers.append(self.said.recv())
        return numbers


@pytest.fixture(scope="module")
def context() -> Iterator[ForkServerContext]:
    """Processes forked from a server that has imported the libraries but used none of them."""
    made = get_context("forkserver")
    made.set_forkserver_preload(["polars", "deltalake", "tests.registered"])
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", str(ROOT))
        yield made


@pytest.fixture
def writer(context: ForkServerContext, tmp_path: Path) -> Start:
    """Starts a writer of versions `first` to `last` of motors, into `tmp_path / registry`."""

    def start(motors: Sequence[str], first: int, last: int) -> Writer:
        ours, theirs = context.Pipe(duplex=False)
        words = (str(tmp_path / "registry"), motors, range(first, last + 1), theirs)
        process = context.Process(target=write, args=words)
        process.start()
        theirs.close()
        return Writer(process, ours)

    return start


def finish(writers: Sequence[Writer]) -> list[list[int]]:
    """The numbers that each writer was told are registered; every writer must end well."""
    told = [writer.told() for writer in writers]
    for writer in writers:
        writer.process.join(timeout=300)
        assert writer.process.exitcode == 0
    return told


def published(place: Path) -> list[Event]:
    return [event for event in Registry(str(place)).events() if event.kind == "publish"]


def assert_whole(place: Path) -> None:
    """No fault, no torn or missing file, no commit or row missing."""
    found = Registry(str(place)).verify()
    assert found.faults == ()
    for path in (place / FOLDER).rglob("*.json"):
        assert json.loads(path.read_bytes())["version"] == path.stem


@pytest.mark.parametrize(("writers", "count"), [(4, 5), pytest.param(8, 20, marks=FULL)])
def test_writers_of_their_own_versions_lose_none(
    writer: Start, tmp_path: Path, writers: int, count: int
) -> None:
    """8 x 20 = 160 of 160, of one motor: revisions 1 to 160 without gap or repeat."""
    place = tmp_path / "registry"
    spans = [(1 + k * count, (k + 1) * count) for k in range(writers)]
    told = finish([writer(["joint/1"], *span) for span in spans])
    assert [len(numbers) for numbers in told] == [count] * writers
    rows = published(place)
    everything = {version_of("joint/1", n) for n in range(1, writers * count + 1)}
    assert len(rows) == writers * count
    assert {event.version for event in rows} == everything
    assert [event.revision for event in rows] == list(range(1, writers * count + 1))
    assert len(list((place / FOLDER).rglob("*.json"))) == writers * count
    assert_whole(place)


@pytest.mark.parametrize(("writers", "count"), [(4, 5), pytest.param(8, 20, marks=FULL)])
def test_writers_of_the_same_versions_double_none(
    writer: Start, tmp_path: Path, writers: int, count: int
) -> None:
    """20 of 20 when 8 write the same 20, and again 20 when all of them are run again."""
    place = tmp_path / "registry"
    for _ in range(2):
        told = finish([writer(["joint/1"], 1, count) for _ in range(writers)])
        assert told == [list(range(1, count + 1))] * writers
        rows = published(place)
        assert [event.version for event in rows] == [
            version_of("joint/1", n) for n in range(1, count + 1)
        ]
        assert len(list((place / FOLDER).rglob("*.json"))) == count
        assert_whole(place)


def killed(writer: Writer, after_s: float, *, begun: bool) -> list[int]:
    """What a writer was told before it was killed, `after_s` after its start or its first word."""
    first = [writer.said.recv()] if begun else []
    time.sleep(after_s)
    writer.process.kill()
    return first + writer.told()


@pytest.mark.parametrize("kills", [8, pytest.param(100, marks=FULL)])
def test_a_killed_writer_loses_nothing_it_was_told_is_safe(
    writer: Start, tmp_path: Path, kills: int
) -> None:
    """Kill -9 at random points, one writer after another: what was acknowledged is there, whole.

    Every writer begins where the registry stands; at the end the work is run to its end, and the
    registry holds each version once.
    """
    place, motors, last = tmp_path / "registry", ["joint/1", "joint/2"], 100_000
    draws = random.Random(5)
    safe = 0
    for kill in range(kills):
        begun = kill % 2 == 1
        told = killed(
            writer(motors, 1 + safe, last), draws.uniform(0.0, 0.2 if begun else 0.06), begun=begun
        )
        assert told == list(range(1 + safe, 1 + safe + len(told)))
        safe += len(told)
        if safe == 0:
            continue
        for motor in motors:
            history = Registry(str(place)).history(motor)
            expected = [version_of(motor, n) for n in range(1, safe + 1)]
            assert [version.version for version in history][:safe] == expected
            # At most the commit under way is there without having been acknowledged.
            assert len(history) - safe in (0, 1)
        assert_whole(place)
    end = safe + 2
    finish([writer(motors, 1, end)] if end < 40 else [writer(motors, safe, end)])
    assert len(published(place)) == 2 * end
    assert_whole(place)


def test_a_writer_killed_between_commit_and_file(tmp_path: Path) -> None:
    """The row is there, the file still pending: `verify` gives it its name, and says so."""
    place = tmp_path / "registry"
    registry = Registry(str(place))
    registry.publish([document("m", 1)], NOON)
    (final,) = (place / FOLDER).rglob("*.json")
    final.rename(final.with_name(f".{final.stem}.4711.pending"))
    found = registry.verify()
    assert found.faults == ()
    assert len(found.notes) == 1
    assert final.is_file()
    assert registry.verify().notes == ()
