"""The registry in one process: order, idempotence, decisions, selections, verification."""

from __future__ import annotations

import errno
import json
import re
from collections.abc import Callable
from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path
from typing import Any, Literal

import polars as pl
import pytest
from deltalake import DeltaTable, write_deltalake

from pipeline.io import registry_exports
from pipeline.io.publish import canonical_json
from pipeline.io.registry import Registry
from pipeline.io.registry_exports import FOLDER, place_of
from pipeline.io.registry_table import MOST_FILES
from pipeline.records.errors import MachineError, UsageError
from pipeline.records.ledger import Event, Selection, Version, newest
from tests.registered import HOUR, NOON, document, version_of

HOSTILE = [
    "joint/../../etc/passwd",
    "A",
    "a",
    "O'Neil'; DROP TABLE events; --",
    'quote"double',
    "nul\x00byte",
    "line\nbreak",
    "\u202eright to left",
    "motor \U0001f600",
    " ",
    "x" * 5000,
    "con",
    "00123",
    "%41",
]


@pytest.fixture
def registry(tmp_path: Path) -> Registry:
    return Registry(str(tmp_path / "registry"))


def revisions(versions: tuple[Version, ...]) -> list[tuple[str, int]]:
    return [(version.motor_id, version.revision) for version in versions]


def test_revisions_count_the_versions_of_a_motor_in_the_order_of_commits(
    registry: Registry,
) -> None:
    registry.publish([document("b", 7), document("a", 1)], NOON)
    registry.publish([document("a", 2)], NOON - HOUR)
    registry.publish([document("a", 0), document("b", 1)], NOON)
    assert [v.version for v in registry.history("a")] == [version_of("a", n) for n in (1, 2, 0)]
    assert revisions(registry.history("a")) == [("a", 1), ("a", 2), ("a", 3)]
    assert revisions(registry.history("b")) == [("b", 1), ("b", 2)]
    assert [event.sequence for event in registry.events()] == [1, 2, 3, 4, 5]
    assert registry.history("c") == ()
    assert registry.latest("c") is None


def test_a_version_enters_once(registry: Registry, tmp_path: Path) -> None:
    """The rerun adds no row, no commit and no file, alone or beside new work."""
    first = registry.publish([document("a", 1), document("a", 1)], NOON)
    assert (len(first.added), len(first.known)) == (1, 0)
    before = sorted(path.name for path in (tmp_path / "registry").rglob("*"))
    again = registry.publish([document("a", 1)], NOON + HOUR)
    assert (len(again.added), len(again.known), again.conflicts) == (0, 1, ())
    assert again.known[0].recorded_at == NOON
    assert sorted(path.name for path in (tmp_path / "registry").rglob("*")) == before
    mixed = registry.publish([document("a", 1), document("a", 2)], NOON + HOUR)
    assert [event.revision for event in mixed.added] == [2]
    assert registry.publish([], NOON).added == ()


def test_other_content_under_a_registered_version_changes_nothing(
    registry: Registry, tmp_path: Path
) -> None:
    registry.publish([document("a", 1)], NOON)
    receipt = registry.publish([document("a", 1, r_ohm=9.0), document("a", 2)], NOON)
    assert [event.version for event in receipt.conflicts] == [version_of("a", 1)]
    assert [event.version for event in receipt.added] == [version_of("a", 2)]
    (first, _) = registry.documents(registry.history("a"))
    assert first == document("a", 1)
    assert registry.verify().faults == ()
    assert not list((tmp_path / "registry").rglob("*.pending"))


def test_content_comes_back_byte_for_byte(registry: Registry, tmp_path: Path) -> None:
    said = document("a", 1)
    registry.publish([said], NOON)
    (path,) = (tmp_path / "registry" / FOLDER).rglob("*.json")
    assert path.read_bytes() == canonical_json(said)
    (sheet,) = registry.datasheets(registry.history("a"))
    assert sheet.document() == said


@pytest.mark.parametrize("scheme", ["", "file://"])
def test_hostile_serial_numbers(tmp_path: Path, scheme: str) -> None:
    """Each has its own history and file inside the folder; none is a path, a query or a number."""
    root = tmp_path / "registry"
    registry = Registry(f"{scheme}{root}")
    registry.publish([document(motor, 1) for motor in HOSTILE], NOON)
    registry.publish([document(motor, 2) for motor in HOSTILE], NOON)
    for motor in HOSTILE:
        history = registry.history(motor)
        assert revisions(history) == [(motor, 1), (motor, 2)]
        assert registry.documents(history)[1]["motor_id"] == motor
        assert (root / place_of(history[1].key)).is_file()
    files = [path for path in tmp_path.rglob("*.json") if "_delta_log" not in path.parts]
    assert len(files) == 2 * len(HOSTILE)
    assert all(path.is_relative_to(root / FOLDER) for path in files)
    assert registry.verify().faults == ()
    assert registry.verify().versions == 2 * len(HOSTILE)


def test_text_that_is_no_unicode_is_refused(registry: Registry) -> None:
    with pytest.raises(UsageError, match="not Unicode"):
        registry.publish([document("\ud800", 1)], NOON)
    with pytest.raises(UsageError, match="no registry"):
        registry.events()


@pytest.mark.parametrize("version", ["../../x", "", "A" * 64, "f" * 63, 7])
def test_a_version_that_is_no_digest_is_refused(registry: Registry, version: object) -> None:
    with pytest.raises(UsageError, match="no sha256"):
        registry.publish([document("a", 1) | {"version": version}], NOON)


@pytest.mark.parametrize("name", ["a%41", "x[1]", "back\\slash", "star*"])
def test_a_folder_that_delta_cannot_open_is_refused_before_any_work(
    tmp_path: Path, name: str
) -> None:
    """Version 1.6 of deltalake panics there, or writes elsewhere."""
    with pytest.raises(UsageError, match="folder"):
        Registry(str(tmp_path / name / "registry"))


def test_an_odd_but_possible_folder(tmp_path: Path) -> None:
    place = tmp_path / "k\u00f6 pie #1 ? 100% ~" / "registry"
    registry = Registry(str(place))
    registry.publish([document("a", 1)], NOON)
    assert registry.verify().faults == ()
    assert (place / "_delta_log").is_dir()


def test_times_and_numbers_survive_delta_exactly(registry: Registry, tmp_path: Path) -> None:
    """Microseconds and signed 64 bits by schema, never inferred: ns and unsigned would change."""
    early = datetime(1969, 12, 31, 23, 59, 59, 999999, tzinfo=UTC)
    late = datetime(2262, 4, 12, 0, 0, 0, 1, tzinfo=UTC)  # beyond the range of nanoseconds
    abroad = NOON.astimezone(timezone(timedelta(hours=5, minutes=45)))
    for number, moment in enumerate((early, late, abroad)):
        registry.publish([document("a", number)], moment)
    assert [v.published.recorded_at for v in registry.history("a")] == [early, late, NOON]
    frame = pl.read_delta(str(tmp_path / "registry"))
    schema = frame.schema
    assert schema["recorded_at"] == pl.Datetime("us", "UTC")
    assert (schema["sequence"], schema["revision"]) == (pl.Int64(), pl.Int64())
    assert set(schema.dtypes()) == {
        pl.Datetime("us", "UTC"),
        pl.Int64(),
        pl.String(),
        pl.List(pl.String()),
    }
    with pytest.raises(ValueError, match="time zone"):
        registry.publish([document("a", 9)], NOON.replace(tzinfo=None))


def test_delta_itself_travels_in_time_and_never_cleans_a_version_away(
    registry: Registry, tmp_path: Path
) -> None:
    place = str(tmp_path / "registry")
    for number in (1, 2, 3):
        registry.publish([document("a", number)], NOON)
    assert pl.read_delta(place, version=2)["revision"].to_list() in ([1, 2], [2, 1])
    table = DeltaTable(place)
    doomed = table.vacuum(0, enforce_retention_duration=False, dry_run=True, full=True)
    assert not [name for name in doomed if FOLDER in name]
    with pytest.raises(Exception, match="append"):
        table.delete("revision = 1")


def test_small_files_are_merged_and_nothing_is_lost(registry: Registry, tmp_path: Path) -> None:
    count = MOST_FILES + 4
    for number in range(1, count + 1):
        registry.publish([document("a", number)], NOON)
    assert len(DeltaTable(str(tmp_path / "registry")).file_uris()) <= MOST_FILES
    assert [v.revision for v in registry.history("a")] == list(range(1, count + 1))
    found = registry.verify()
    assert (found.versions, found.faults) == (count, ())


# Decisions


def decide(
    registry: Registry,
    kind: Literal["approve", "revoke"],
    revision: int,
    hours: int = 1,
    why: str = "seen",
) -> str:
    """The status of a revision of motor `a` after the decision."""
    wanted = Selection(motor_id="a", revision=revision)
    return registry.decide(kind, wanted, "A. Smith", why, NOON + hours * HOUR)[0].status


def test_an_approval_releases_and_a_revocation_takes_back(registry: Registry) -> None:
    """The registry's status moves; content, digest and file stay as they were published."""
    registry.publish([document("a", 1), document("b", 1)], NOON)
    before = registry.documents(registry.history("a"))
    assert registry.latest("a", released=True) is None
    assert decide(registry, "approve", 1) == "released"
    assert registry.latest("a", released=True) == registry.latest("a")
    assert decide(registry, "revoke", 1, 2) == "revoked"
    assert decide(registry, "approve", 1, 3, "calibrated again") == "released"
    (version,) = registry.history("a")
    assert [(e.kind, e.by, e.why) for e in version.decisions] == [
        ("approve", "A. Smith", "seen"),
        ("revoke", "A. Smith", "seen"),
        ("approve", "A. Smith", "calibrated again"),
    ]
    assert registry.documents([version]) == before
    assert before[0]["status"] == "provisional"
    (other,) = registry.history("b")
    assert (other.status, other.decisions) == ("provisional", ())
    assert registry.verify().faults == ()


def test_a_decision_repeated_is_not_new(registry: Registry) -> None:
    registry.publish([document("a", 1)], NOON)
    wanted = Selection(motor_id="a", revision=1)
    assert registry.decide("approve", wanted, "A", "seen", NOON)[1]
    assert not registry.decide("approve", wanted, "A", "seen", NOON + HOUR)[1]
    assert registry.decide("approve", wanted, "B", "seen", NOON + HOUR)[1]
    assert len(registry.history("a")[0].decisions) == 2


def test_what_no_approval_heals(registry: Registry) -> None:
    """A failed check, a missing constant, an unverified file: named, and nothing is written."""
    failed = "check kt_vs_ke failed: Kt over 1.5 p psi"
    lacking = ("unverified: x.csv", *document("a", 0)["why"])
    registry.publish([document("a", 1, status="refused", why=[failed])], NOON)
    registry.publish([document("a", 2, why=lacking)], NOON)
    before = registry.events()
    with pytest.raises(UsageError, match="kt_vs_ke failed"):
        decide(registry, "approve", 1)
    with pytest.raises(UsageError, match="refused"):
        decide(registry, "revoke", 1)
    with pytest.raises(UsageError, match=r"not ready for approval: unverified: x\.csv"):
        decide(registry, "approve", 2)
    assert registry.events() == before
    assert decide(registry, "revoke", 2) == "revoked"


def test_a_decision_needs_exactly_one_version(registry: Registry, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no registry"):
        decide(registry, "approve", 1)
    assert not (tmp_path / "registry").exists()
    registry.publish([document("a", 1), document("a", 2)], NOON)
    for wanted in (
        Selection(motor_id="a", revision=3),
        Selection(motor_id="a", revision=0),
        Selection(motor_id="b", revision=1),
        Selection(motor_id="a"),
    ):
        with pytest.raises(UsageError, match=r"registry list|revision="):
            registry.decide("approve", wanted, "A", "seen", NOON)
    prefix = Selection(motor_id="a", version=version_of("a", 2)[:10])
    assert registry.decide("approve", prefix, "A", "seen", NOON)[0].revision == 2


def test_what_was_valid_then(registry: Registry) -> None:
    """Published at 0 h and 1 h, approved at 2 h and 3 h, the newer one revoked at 4 h."""
    registry.publish([document("a", 1)], NOON)
    registry.publish([document("a", 2)], NOON + HOUR)
    decide(registry, "approve", 1, 2)
    decide(registry, "approve", 2, 3)
    decide(registry, "revoke", 2, 4)

    def statuses(hours: float) -> list[str]:
        return [v.status for v in registry.history("a", NOON + hours * HOUR)]

    assert statuses(-1) == []
    assert statuses(0) == ["provisional"]
    assert statuses(1.5) == ["provisional", "provisional"]
    assert statuses(2) == ["released", "provisional"]
    assert statuses(3.5) == ["released", "released"]
    assert statuses(9) == ["released", "revoked"]
    valid = registry.latest("a", released=True)
    assert valid is not None
    assert valid.revision == 1


def test_selections(registry: Registry) -> None:
    registry.publish(
        [
            document("a", 1, lot="A", stations=("rig-1", "rig-2")),
            document("b", 1, lot="B", stations=("rig-2", None)),
            document("c", 1, lot=None, motor_type=None, stations=()),
        ],
        NOON,
    )
    registry.publish([document("a", 2, lot="A", status="released", why=())], NOON + HOUR)

    def chosen(**wanted: Any) -> list[tuple[str, int]]:
        return revisions(registry.select(Selection(**wanted)))

    assert chosen() == [("a", 1), ("a", 2), ("b", 1), ("c", 1)]
    assert chosen(lot="A") == [("a", 1), ("a", 2)]
    assert chosen(motor_type="gimbal", station="rig-2") == [("a", 1), ("b", 1)]
    assert chosen(station="rig") == []
    assert chosen(since=NOON + HOUR) == [("a", 2)]
    assert chosen(until=NOON) == [("a", 1), ("b", 1), ("c", 1)]
    assert chosen(status="released") == [("a", 2)]
    assert chosen(version=version_of("b", 1)[:6]) == [("b", 1)]
    assert revisions(newest(registry.select(Selection(lot="A")))) == [("a", 2)]


# Verification


@pytest.fixture
def kept(registry: Registry, tmp_path: Path) -> Path:
    """A registry of two versions of `a` and an approval, in commits 1, 2 and 3."""
    registry.publish([document("a", 1)], NOON)
    registry.publish([document("a", 2)], NOON)
    decide(registry, "approve", 1)
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


def test_a_place_that_is_a_file(tmp_path: Path) -> None:
    (tmp_path / "registry").write_text("not a folder")
    registry = Registry(str(tmp_path / "registry"))
    with pytest.raises(MachineError):
        registry.publish([document("a", 1)], NOON)


def test_events_are_chained() -> None:
    """The link depends on every field and on the row before."""
    event = Event(1, NOON, "publish", "a", "f" * 64, 1)
    link = event.linked("0" * 64).chain
    assert link == event.linked("0" * 64).chain
    others = [
        Event(2, NOON, "publish", "a", "f" * 64, 1),
        Event(1, NOON + timedelta(microseconds=1), "publish", "a", "f" * 64, 1),
        Event(1, NOON, "approve", "a", "f" * 64, 1),
        Event(1, NOON, "publish", "b", "f" * 64, 1),
        Event(1, NOON, "publish", "a", "e" * 64, 1),
        Event(1, NOON, "publish", "a", "f" * 64, 2),
        Event(1, NOON, "publish", "a", "f" * 64, 1, by="a"),
        Event(1, NOON, "publish", "a", "f" * 64, 1, why="a"),
        Event(1, NOON, "publish", "a", "f" * 64, 1, stations=("a",)),
    ]
    links = {other.linked("0" * 64).chain for other in others} | {event.linked(link).chain}
    assert len(links | {link}) == len(others) + 2
