"""Damage, rivals and full disks: what `verify` names, and what a failed writer leaves behind."""

from __future__ import annotations

import errno
import json
import re
from collections.abc import Callable
from pathlib import Path

import polars as pl
import pytest
from deltalake import write_deltalake

from pipeline.io.registry import exports as registry_exports
from pipeline.io.registry import table as registry_table
from pipeline.io.registry.exports import place_of
from pipeline.io.registry.store import Registry
from pipeline.io.storage.publish import canonical_json
from pipeline.records.errors import MachineError
from pipeline.records.ledger import Selection
from tests.registered import NOON, document, version_of


@pytest.fixture
def registry(tmp_path: Path) -> Registry:
    return Registry(str(tmp_path / "registry"))


@pytest.fixture
def kept(registry: Registry, tmp_path: Path) -> Path:
    """A registry of two versions of `a` and an approval, in commits 1, 2 and 3."""
    registry.publish([document("a", 1)], NOON)
    registry.publish([document("a", 2)], NOON)
    registry.decide("approve", Selection(motor_id="a", revision=1), "A. Smith", "seen", NOON)
    assert registry.verify().faults == ()
    return tmp_path / "registry"


def export(place: Path, number: int) -> Path:
    return place / place_of(("a", version_of("a", number)))


def flip(place: Path) -> None:
    path = export(place, 1)
    path.write_bytes(path.read_bytes().replace(b"0.301", b"0.302"))


def drop(place: Path) -> None:
    export(place, 2).unlink()


def forge(place: Path) -> None:
    """A file nobody published."""
    export(place, 1).with_name(f"{'e' * 64}.json").write_bytes(canonical_json(document("a", 9)))


def cut_log(place: Path) -> None:
    """The last publish is gone from the log, and the approval after it."""
    for number in (2, 3):
        (place / "_delta_log" / f"{number:020d}.json").unlink()


def gap_in_log(place: Path) -> None:
    (place / "_delta_log" / f"{2:020d}.json").unlink()


def lost_rows(place: Path) -> None:
    for path in place.glob("*.parquet"):
        path.unlink()


def rewritten(place: Path, change: Callable[[pl.DataFrame], pl.DataFrame]) -> None:
    """The table as somebody with another tool would leave it."""
    frame = change(pl.read_delta(str(place)).sort("sequence"))
    for path in [*place.glob("*.parquet"), *(place / "_delta_log").iterdir()]:
        path.unlink()
    write_deltalake(str(place), frame)


def other_reason(place: Path) -> None:
    rewritten(place, lambda f: f.with_columns(why=pl.col("why").str.replace("seen", "unseen")))


def other_content(place: Path) -> None:
    changed = pl.col("content").str.replace("0.301", "0.302", literal=True)
    rewritten(place, lambda f: f.with_columns(content=changed))


def lost_inside(place: Path) -> None:
    rewritten(place, lambda f: f.filter(pl.col("sequence") != 2))


def doubled(place: Path) -> None:
    rewritten(place, lambda f: pl.concat([f, f.filter(pl.col("sequence") == 1)]))


DAMAGE = [
    (flip, "the file is not what was published"),
    (drop, "the file is missing"),
    (forge, "the file has no row"),
    (cut_log, "the file has no row"),
    (gap_in_log, "commit 2 is missing"),
    (lost_rows, "registry"),
    (other_reason, "row 3 .*does not follow"),
    (other_content, "its datasheet is not what was published"),
    (lost_inside, "row 3 .*row 2 is expected"),
    (doubled, "there twice"),
]


@pytest.mark.parametrize(("damage", "words"), DAMAGE, ids=[d.__name__ for d, _ in DAMAGE])
def test_damage_is_named(kept: Path, damage: Callable[[Path], None], words: str) -> None:
    damage(kept)
    found = Registry(str(kept)).verify()
    assert [line for line in found.faults if re.search(words, line)], found.faults


def test_a_rerun_heals_a_lost_file(kept: Path) -> None:
    drop(kept)
    registry = Registry(str(kept))
    registry.publish([document("a", 2)], NOON)
    assert registry.verify().faults == ()
    assert json.loads(export(kept, 2).read_bytes()) == document("a", 2)


def test_a_file_is_written_once(kept: Path) -> None:
    """Publishing again leaves even a damaged file for `verify` to name."""
    flip(kept)
    before = export(kept, 1).read_bytes()
    Registry(str(kept)).publish([document("a", 1)], NOON)
    assert export(kept, 1).read_bytes() == before


def test_a_full_disk_leaves_nothing(
    registry: Registry, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The second file of a batch does not fit: no row, no file, and exit code 5."""
    registry.publish([document("a", 1)], NOON)
    before = sorted((tmp_path / "registry").rglob("*"))
    full = registry_exports.write_synced

    def write(path: Path, content: bytes) -> None:
        if version_of("b", 2) in path.name:
            full(path, content[:100])
            raise OSError(errno.ENOSPC, "No space left on device")
        full(path, content)

    monkeypatch.setattr(registry_exports, "write_synced", write)
    with pytest.raises(MachineError, match="No space left") as caught:
        registry.publish([document("a", 2), document("b", 2)], NOON)
    assert caught.value.exit_code == 5
    left = [path for path in (tmp_path / "registry").rglob("*") if path.is_file()]
    assert sorted(left) == [path for path in before if path.is_file()]
    assert [event.version for event in registry.events()] == [version_of("a", 1)]


def test_a_failure_after_the_commit_keeps_what_is_needed_to_finish(
    registry: Registry, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The row is in, then the disk fails: the pending file stays, and `verify` names it."""

    def fail(path: Path) -> None:
        raise OSError(errno.EIO, "Input/output error")

    with monkeypatch.context() as patch:
        patch.setattr(registry_table, "sync_file", fail)
        with pytest.raises(MachineError, match="Input/output"):
            registry.publish([document("a", 1)], NOON)
    found = registry.verify()
    assert (found.versions, found.faults, len(found.notes)) == (1, (), 1)
    assert export(tmp_path / "registry", 1).is_file()
    assert registry.verify().notes == ()


def test_what_a_writer_left_before_its_commit_is_noted(registry: Registry, tmp_path: Path) -> None:
    registry.publish([document("a", 1)], NOON)
    left = export(tmp_path / "registry", 2)
    left.with_name(f".{left.stem}.4711.pending").write_bytes(b"{")
    found = registry.verify()
    assert found.faults == ()
    assert "1 pending" in found.notes[0]


def test_the_next_writer_of_a_version_clears_what_an_interrupted_one_left(
    registry: Registry, tmp_path: Path
) -> None:
    final = export(tmp_path / "registry", 1)
    final.parent.mkdir(parents=True)
    final.with_name(f".{final.stem}.4711.pending").write_bytes(b"{")
    registry.publish([document("a", 1)], NOON)
    assert final.is_file()
    assert not list((tmp_path / "registry").rglob("*.pending"))


def test_a_writer_whose_version_another_has_settled_is_content(
    registry: Registry, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The other one's file appears, and this one's pending file goes, just before it is named."""
    replace = Path.replace

    def late(path: Path, target: Path) -> Path:
        if path.suffix == ".pending":
            target.write_bytes(path.read_bytes())
            path.unlink()
        return replace(path, target)

    monkeypatch.setattr(Path, "replace", late)
    registry.publish([document("a", 1)], NOON)
    assert export(tmp_path / "registry", 1).is_file()
    assert registry.verify().faults == ()


def test_a_place_that_is_a_file(tmp_path: Path) -> None:
    (tmp_path / "registry").write_text("not a folder")
    registry = Registry(str(tmp_path / "registry"))
    with pytest.raises(MachineError):
        registry.publish([document("a", 1)], NOON)
