"""Bit for bit: what the vectorised reader returns is what the public library decodes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader

from pipeline.io.ingest.capture_reader import read_capture, survey
from tests.unit.io.recordings import SHARED

CAMPAIGNS = [
    pytest.param("P0", 4, id="a quarter of P0"),
    *(pytest.param(f"P{n}", 1, id=f"P{n}", marks=pytest.mark.slow) for n in range(5)),
]
"""And of how many captures one is compared: the public library takes a message at a time."""


def public_columns(path: Path) -> dict[str, np.ndarray]:
    """Columns as the public `mcap` readers give them, one message after the other."""
    from mcap_protobuf.decoder import DecoderFactory as Protobuf
    from mcap_ros2.decoder import DecoderFactory as Ros2

    found: dict[str, list[float]] = {}
    decoders: dict[str, Any] = {}
    with path.open("rb") as stream:
        for schema, channel, message in make_reader(stream).iter_messages():
            kind = channel.message_encoding
            if kind == "json":
                row = json.loads(message.data)
            else:
                if kind not in decoders:
                    factory = (Protobuf if kind == "protobuf" else Ros2)()
                    decoders[kind] = factory.decoder_for(kind, schema)
                decoded = decoders[kind](message.data)
                if kind == "protobuf":
                    row = {f.name: getattr(decoded, f.name) for f in decoded.DESCRIPTOR.fields}
                else:
                    row = {name: getattr(decoded, name) for name in decoded.__slots__}
            for name, value in row.items():
                into = found.setdefault(name, [])
                into.append(value) if isinstance(value, float) else into.extend(value)
    return {name: np.array(values) for name, values in found.items()}


@pytest.mark.parametrize(("campaign", "every"), CAMPAIGNS)
def test_a_rig_campaign_equals_the_public_library_bit_for_bit(campaign: str, every: int) -> None:
    folder = SHARED / "rig" / campaign
    if not folder.is_dir():
        pytest.skip(f"the rig captures are not there: {folder}")
    found = survey(folder, {})
    assert len(found.entries) == 23
    assert found.findings == ()
    assert found.others == ("truth.json",)
    for entry in found.entries[::every]:
        capture = read_capture(folder, entry)
        assert capture.integrity == "verified"
        (table,) = capture.tables
        path = folder / entry.path
        if entry.form == "mcap":
            truth = public_columns(path)
        else:
            lines = [ln for ln in path.read_text().splitlines() if not ln.startswith("#")]
            rows = np.array([[float(c) for c in line.split(",")] for line in lines[1:]])
            truth = dict(zip(lines[0].split(","), rows.T, strict=True))
        assert set(table.columns) == set(truth)
        for name, values in truth.items():
            assert table[name].to_numpy().tobytes() == values.astype(np.float64).tobytes(), name
