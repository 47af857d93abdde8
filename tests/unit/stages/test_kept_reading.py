"""Captures that are read otherwise are other captures to every key, whatever they are read with.

The world is a folder with a log in a bench's own form, a recording that is cut off, a sidecar, a
manifest, a source map and the options of the gates. One thing in it is changed at a time: either
the captures are read as they were, or the kept fits and the datasheet's version are others.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline.contracts.registry import gates
from pipeline.contracts.validate import validate
from pipeline.execution.jobs import MotorJob
from pipeline.io.ingest.capture_reader import read_capture
from pipeline.io.ingest.metadata import capture_meta
from pipeline.io.ingest.survey import survey
from pipeline.io.maps.source_map import FieldMap, SourceMap
from pipeline.io.maps.units import FOREIGN_UNITS
from pipeline.io.tables.csv_dialect import CsvDialect
from pipeline.physics.glossary import COLUMNS, METADATA
from pipeline.records.capture import Campaign, Capture
from pipeline.records.content import content_digest
from pipeline.records.errors import CaptureError, UsageError
from pipeline.stages.steps import motor
from tests.changes import changes
from tests.unit.io.recordings import json_messages, mcap_file

HALL = SourceMap(
    "hall",
    header="^Time",
    layout=CsvDialect(separator=";", whole_last_line=False),
    fields=(
        FieldMap("Time", "t_s", "ms"),
        FieldMap("RPM", "omega_mech_rad_s", "rpm"),
        FieldMap("Iq", "iq_a", None, -1.0, 2.0, 0.5),
        FieldMap("Uq", "vq_v"),
        FieldMap("Turns", "theta_mech_rad", "rev"),
    ),
    metadata=(("test", "drive"), ("station", "hall")),
    per_file=(("log*", (("lot", "7"),)),),
)
TEXTS = ("ab", "wye", "commanded", "held", "spin_down", "2026-03-01T00:00:00Z", "0.5", "3")
BOUND = {"sha256_rows", "motor_id", "contract"}
"""Keys whose other values refuse the file or give it to another motor."""


def log() -> str:
    """Some rows of a shaft that turns under current, two without a current among them."""
    rng, rows = np.random.default_rng(5), ["Time;RPM;Iq;Uq;Turns"]
    for n in range(200):
        rpm = 300.0 + 30.0 * np.sin(n / 50.0) + rng.normal(0.0, 0.1)
        iq_a = "" if n in (100, 101) else f"{1.0 + np.sin(n / 40.0) + rng.normal(0.0, 0.01):.5f}"
        uq_v = 0.3 + 0.05 * rpm + rng.normal(0.0, 0.01)
        rows.append(f"{n:.1f};{rpm:.4f};{iq_a};{uq_v:.4f};{300.0 / 60.0 * n / 1000.0:.6f}")
    return "\n".join(rows) + "\n"


def cut() -> bytes:
    """A recording that ends in the middle of a chunk."""
    rows = [
        {"t_s": n / 1000, "iq_a": n * 0.125 - 1, "vq_v": 2.0 + n % 3, "theta_mech_rad": n * 0.01}
        for n in range(40)
    ]
    said = {"contract": "1", "motor_id": "m", "test": "drive"}
    whole = mcap_file(json_messages(rows), ("S", "jsonschema", b"{}"), metadata=said)
    return whole[: len(whole) * 2 // 3]


@dataclass(frozen=True)
class World:
    """All that decides what is read."""

    text: str
    source: SourceMap = HALL
    sidecar: Mapping[str, str] = field(default_factory=lambda: {"motor_id": "m"})
    manifest: Mapping[str, str] = field(default_factory=lambda: {"operator": "A. Smith"})
    gates: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    recover: bool | None = None
    """None where there is no recording that is cut off."""

    def written(self, folder: Path) -> Path:
        """The folder, with its files written anew."""
        folder.mkdir(exist_ok=True)
        (folder / "log.txt").write_text(self.text)
        if self.recover is not None:
            (folder / "cut.mcap").write_bytes(cut())
        said = "".join(f"{key}: {value!r}\n" for key, value in self.sidecar.items())
        (folder / "log.meta.yaml").write_text(said)
        table = (["file", *self.manifest], ["log.txt", *self.manifest.values()])
        (folder / "manifest.csv").write_text("".join(",".join(row) + "\n" for row in table))
        return folder

    def read(self, folder: Path) -> Campaign:
        """The captures as read and judged; refused ones are not among them."""
        sources, made = {self.source.name: self.source}, []
        self.written(folder)
        try:
            entries = survey(folder, sources, recover=bool(self.recover)).entries
        except UsageError:
            entries = ()  # a map whose reader there is not
        for entry in entries:
            try:
                made.append(validate(read_capture(folder, entry), self.gates)[0])
            except (CaptureError, LookupError):
                continue  # LookupError: a map that no YAML file could say
        return Campaign("m", tuple(sorted(made, key=lambda capture: capture.path)))


def others(world: World) -> Iterator[tuple[str, World]]:
    """The worlds that differ in one thing, each with its name."""
    for where, source in changes(world.source):
        yield f"source.{where}", replace(world, source=source)
    for at, part in enumerate(HALL.fields):
        for unit in list(FOREIGN_UNITS[COLUMNS[part.column].unit])[1:3]:
            mapped = [*HALL.fields[:at], replace(part, unit=unit), *HALL.fields[at + 1 :]]
            source = replace(HALL, fields=tuple(mapped))
            yield f"source.fields.{at}.unit", replace(world, source=source)
    for name in ("sidecar", "manifest"):
        own = getattr(world, name)
        for key in METADATA:
            for text in islice(filter(partial(_allowed, key), TEXTS), 2):
                yield f"{name}.{key}", replace(world, **{name: {**own, key: text}})
        yield f"{name}.extra", replace(world, **{name: {**own, "kv_rpm_v": "90"}})
    for gate in (one for one in gates() if "drive" in one.tests):
        for option, value in gate.settings().items():
            chosen = {gate.name: {option: 1000.0 * value if option != "enabled" else 0.0}}
            yield f"gates.{gate.name}.{option}", replace(world, gates=chosen)
    yield "text", replace(world, text=world.text.replace("300.", "301.", 1))
    yield "spaces", replace(world, text=world.text.replace("Time;RPM", "Time; RPM", 1))


def _allowed(key: str, text: str) -> bool:
    """Whether a text can be the value of a metadata key."""
    try:
        capture_meta({"contract": "1", "motor_id": "m", "test": "drive", key: text})
    except CaptureError:
        return False
    return True


def same(one: Campaign, other: Campaign) -> bool:
    """Whether an estimator is handed the same, by comparison and without digests."""
    return len(one.captures) == len(other.captures) and all(
        _same(a, b) for a, b in zip(one.captures, other.captures, strict=True)
    )


def _same(one: Capture, other: Capture) -> bool:
    def plain(capture: Capture) -> Any:
        return replace(capture, tables=(), masks=())

    return (
        plain(one) == plain(other)
        and len(one.tables) == len(other.tables)
        and all(a.equals(b) for a, b in zip(one.tables, other.tables, strict=True))
        and [(m.gate, m.table, m.keep.tolist()) for m in one.masks]
        == [(m.gate, m.table, m.keep.tolist()) for m in other.masks]
    )


Key = Callable[[Campaign], str]


def by_reading(campaign: Campaign) -> str:
    return motor.stamp_of(JOB, campaign).version


def by_files(campaign: Campaign) -> str:
    """The key of before: digests of files, metadata, and how many rows were set aside."""
    return content_digest(
        [
            [c.path, c.sha256, c.integrity, c.meta, [m.dropped for m in c.masks]]
            for c in campaign.captures
        ]
    )


JOB = MotorJob("m", (), "in", "out", "d" * 64, (), "manual", report=False, recordings=False)


@pytest.fixture(scope="module")
def read(tmp_path_factory: pytest.TempPathFactory) -> list[tuple[str, Campaign]]:
    """What is read of the world as it is, and of every other one."""
    folder, world = tmp_path_factory.mktemp("world") / "in", World(log())
    named = [("as it is", world), *others(world)]
    return [(name, one.read(folder)) for name, one in named]


def unseen(read: list[tuple[str, Campaign]], key: Key) -> set[str]:
    """What reads the captures otherwise without another key."""
    base = read[0][1]
    return {name for name, one in read[1:] if not same(one, base) and key(one) == key(base)}


def test_what_is_read_otherwise_has_another_key(read: list[tuple[str, Campaign]]) -> None:
    assert unseen(read, by_reading) == set()


def test_the_worlds_are_read_otherwise(read: list[tuple[str, Campaign]]) -> None:
    """Or the test above would ask nothing: of each kind of change, many change what is read."""
    base = read[0][1]
    assert [c.path for c in base.captures] == ["log.txt"]
    changed = {name for name, one in read[1:] if not same(one, base)}
    for key in set(METADATA) - BOUND:
        assert f"sidecar.{key}" in changed
        assert f"manifest.{key}" in changed or key == "operator"
    fields = {name for name in changed if name.startswith("source.fields")}
    assert {f"source.fields.2.{part}" for part in ("unit", "sign", "scale", "offset")} <= fields
    assert {"text", "sidecar.extra", "source.metadata.1.1"} <= changed
    assert any(name.startswith("gates.") and name.endswith(".enabled") for name in changed)


def test_digests_of_files_do_not_tell_readings_apart(read: list[tuple[str, Campaign]]) -> None:
    """The fault that published Kt 748: units, signs and factors were no part of the key."""
    missed = unseen(read, by_files)
    assert {"source.fields.2.unit", "source.fields.2.scale", "source.fields.1.unit"} <= missed


def test_a_recovered_recording_is_another_reading(tmp_path: Path) -> None:
    one, other = (World(log(), recover=r).read(tmp_path / "in") for r in (True, False))
    assert [c.path for c in one.captures] == ["cut.mcap", "log.txt"]
    assert not same(one, other)
    assert by_reading(one) != by_reading(other)
