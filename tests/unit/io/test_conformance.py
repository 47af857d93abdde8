"""The 416 conformance files: every one accepted, with the content of its JSON twin."""

from __future__ import annotations

import json
from typing import Any

import pytest

from pipeline.io.mcap.container import scan
from pipeline.io.mcap.messages import batches
from tests.unit.io.recordings import SHARED

FOLDER = SHARED / "mcap-conformance"


def twin(path: Any) -> dict[str, list[dict[str, Any]]]:
    """Records of the twin by type, fields as texts."""
    found: dict[str, list[dict[str, Any]]] = {}
    for record in json.loads(path.with_suffix(".json").read_text())["records"]:
        found.setdefault(record["type"], []).append(dict(record["fields"]))
    return found


def test_every_conformance_file_reads_as_its_twin_says() -> None:
    if not FOLDER.is_dir():
        pytest.skip(f"the conformance files are not there: {FOLDER}")
    paths = sorted(FOLDER.glob("*/*.mcap"))
    assert len(paths) == 416
    for path in paths:
        layout = scan(path.read_bytes())
        got = [
            (int(c), int(t), batch.buffer[s : s + n])
            for batch in batches(layout)
            for c, t, s, n in zip(
                batch.channel, batch.log_time, batch.start, batch.length, strict=True
            )
        ]
        said = twin(path)
        expected = [
            (int(m["channel_id"]), int(m["log_time"]), bytes(map(int, m["data"])))
            for m in said.get("Message", [])
        ]
        assert got == expected, path.name
        topics = {int(c["id"]): (c["topic"], dict(c["metadata"])) for c in said.get("Channel", [])}
        channels = layout.definitions.channels
        assert {n: (c.topic, dict(c.metadata)) for n, c in channels.items()} == topics
        schemas = {int(s["id"]): bytes(map(int, s["data"])) for s in said.get("Schema", [])}
        assert {n: s.data for n, s in layout.definitions.schemas.items()} == schemas
        metadata = [(m["name"], m["metadata"]) for m in said.get("Metadata", [])]
        assert [(m.name, dict(m.entries)) for m in layout.metadata] == metadata
        assert len(layout.attachments) == len(said.get("Attachment", []))
