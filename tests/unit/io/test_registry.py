"""The registry in one process: order, idempotence, decisions, selections, verification."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path
from typing import Any, Literal

import polars as pl
import pytest
from deltalake import DeltaTable

from pipeline.io.registry.exports import FOLDER, place_of
from pipeline.io.registry.store import Registry
from pipeline.io.registry.table import MOST_FILES
from pipeline.io.storage.publish import canonical_json
from pipeline.records.errors import MachineError, UsageError
from pipeline.records.ledger import Event, Selection, Version, in_force, newest
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


def test_what_was_published_and_is_still_there_need_not_be_again(
    registry: Registry, tmp_path: Path
) -> None:
    """Where a file, the table or all of it was taken away, or the content is another, it must."""
    folder, keys = tmp_path / "registry", [(name, version_of(name, 1)) for name in "ab"]
    receipt = registry.publish([document("a", 1), document("b", 1)], NOON)
    contents = {event.key: str(event.content_sha256) for event in receipt.added}
    assert sorted(contents) == keys
    assert registry.unsettled(contents) == set()
    assert Registry(str(folder)).unsettled(contents) == set(keys), "another object knows nothing"
    assert registry.unsettled({keys[0]: "0" * 64}) == {keys[0]}
    assert registry.unsettled({("c", "0" * 64): "0" * 64}) == {("c", "0" * 64)}
    (folder / place_of(keys[0])).unlink()
    assert registry.unsettled(contents) == {keys[0]}
    registry.publish([document("a", 1)], NOON)
    assert registry.unsettled(contents) == set()
    shutil.rmtree(folder / "_delta_log")
    assert registry.unsettled(contents) == set(keys)


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


FOLDERS = (
    *("out[1]", "a b", "50%", "100%25", "a%41", "a#b", "a?b", "m\u00fcnchen \u03a9", "it's", 'q"q'),
    *("-lead", "line\nbreak", "tab\tt", "x{y}", "a|b", "back\\slash", "star*", "<x>", "c^d", "`t`"),
    *("k\u00f6 pie #1 ? 100% ~", "a:b", "c=d", "$HOME", "\U0001f642"),
)


@pytest.mark.parametrize("name", FOLDERS)
def test_a_folder_of_any_name_keeps_a_registry(tmp_path: Path, name: str) -> None:
    """`out[1]` was refused: version 1.6 of deltalake panics there, at `%41` it writes elsewhere."""
    place = tmp_path / name / "registry"
    Registry(str(place)).publish([document("a", 1)], NOON)
    again = Registry(str(place))
    again.publish([document("a", 2), document("b", 1)], NOON)
    assert revisions(again.history("a")) == [("a", 1), ("a", 2)]
    assert again.documents(again.history("a"))[1]["motor_id"] == "a"
    assert again.verify().faults == ()
    assert again.verify().versions == 3
    assert len(list((place / "_delta_log").glob("*.json"))) == 3
    assert sorted(p.name for p in tmp_path.iterdir()) == [name]


@pytest.mark.parametrize("name", ["out", "out[1]"])
def test_the_slower_of_two_writers_decides_again_in_any_folder(tmp_path: Path, name: str) -> None:
    """Both see no version; the second is told of the first's before it adds its own."""
    place = str(tmp_path / name)
    slow = Registry(place)
    seen: list[int] = []

    def decide(events: Sequence[Event]) -> list[Any]:
        seen.append(len(events))
        if len(seen) == 1:
            Registry(place).publish([document("a", 1)], NOON)
        return [(replace(first, sequence=len(events) + 7), None)]

    Registry(place).publish([document("z", 1)], NOON)
    first = slow._table.events()[0]  # type: ignore[index]
    slow._table.append(decide)
    assert seen == [1, 2]


def test_temporary_files_below_such_a_folder_are_wrong_usage(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "t[1]").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "t[1]"))
    with pytest.raises(UsageError, match="TMPDIR"):
        Registry(str(tmp_path / "out[1]"))


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
    assert in_force(registry.history("a")) is None
    assert decide(registry, "approve", 1) == "released"
    assert in_force(registry.history("a")) == registry.history("a")[-1]
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
    with pytest.raises(UsageError, match=r"not ready for approval: unverified: x\.csv"):
        decide(registry, "approve", 2)
    assert registry.events() == before
    assert decide(registry, "revoke", 2) == "revoked"
    assert decide(registry, "revoke", 1) == "revoked"
    with pytest.raises(UsageError, match="kt_vs_ke failed"):
        decide(registry, "approve", 1)


def test_revocations_are_those_in_force_with_their_first_reason(registry: Registry) -> None:
    assert registry.revocations() == {}
    registry.publish([document("a", 1), document("a", 2), document("b", 1)], NOON)
    assert registry.revocations() == {}
    decide(registry, "revoke", 2)
    wanted = Selection(motor_id="a", revision=2)
    registry.decide("revoke", wanted, "B", "said again", NOON + HOUR)
    ((motor, (found,)),) = registry.revocations().items()
    own = registry.history("a")[1].published
    first = registry.history("a")[1].decisions[0]
    assert (motor, found.version, found.content_sha256) == ("a", own.version, own.content_sha256)
    assert (found.by, found.why) == (first.by, first.why)
    decide(registry, "approve", 2)
    assert registry.revocations() == {}


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
    valid = in_force(registry.history("a"))
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


def test_the_bytes_of_a_file_are_kept_as_they_are(registry: Registry, tmp_path: Path) -> None:
    """A document and the file that a run made of it are one version; other text is none."""
    content = canonical_json(document("a", 1))
    registry.publish([content], NOON)
    assert len(registry.publish([document("a", 1)], NOON).known) == 1
    assert (tmp_path / "registry" / place_of(("a", version_of("a", 1)))).read_bytes() == content
    for other in (b"", b"{", b"[]", b"{}", b"\xff\xfe", b'{"motor_id": "a"}'):
        with pytest.raises(UsageError, match="no datasheet"):
            registry.publish([other], NOON)


def test_a_registry_that_cannot_be_written_is_told_before_the_commit(
    registry: Registry, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The library panics over it, with a backtrace. Root may write everywhere, so it is told no."""
    registry.publish([document("a", 1)], NOON)
    monkeypatch.setattr("pipeline.io.registry.table.os.access", lambda *_: False)
    monkeypatch.setattr("pipeline.io.registry.table.EventTable._committed", None)
    with pytest.raises(MachineError, match="cannot be written; is it open to you"):
        registry.tag("tag", registry.history("a"), "t", "me", NOON)
    assert registry.publish([document("a", 1)], NOON).added == ()
