"""The good part of a file that is cut off: whole chunks and whole messages, and nothing beyond."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.io.mcap.container import MAGIC, scan
from pipeline.io.mcap.tables import read_tables
from pipeline.io.mcap.walk import walk
from pipeline.records.errors import CaptureError
from tests.faults.test_bad_mcap import KINDS
from tests.unit.io.recordings import small_capture

MESSAGE, CHUNK = 5, 6


def recovered(data: bytes) -> list[float]:
    """The currents of a cut file; CaptureError where nothing good is left."""
    layout = scan(data, recover=True)
    assert layout.cut is not None and not layout.data_crc_holds
    tables = read_tables(layout, lambda _topic, _name: True)
    return tables[0].fields["iq_a"].tolist() if tables else []


def borders(data: bytes) -> list[tuple[int, int]]:
    """(byte, messages): where a chunk, or a message outside chunks, ends, and how many precede."""
    spans = walk(data, len(MAGIC), len(data) - len(MAGIC))
    layout = scan(data)
    counts = {
        chunk.offset: sum(index.count for index in layout.message_indexes[chunk.offset])
        for chunk in layout.chunks
    }
    found, seen = [(0, 0)], 0
    for opcode, start, length in zip(spans.opcode, spans.start, spans.length, strict=True):
        if opcode == MESSAGE:
            seen += 1
        elif opcode == CHUNK:
            seen += counts[int(start) - 9]
        else:
            continue
        found.append((int(start + length), seen))
    return found


@pytest.mark.parametrize("kind", ["zstd", "lz4", "none", "unchunked"])
def test_the_good_part_ends_where_the_last_whole_chunk_does(kind: str) -> None:
    """At every border and between: the messages of whole chunks, none of the one that is cut.

    A chunk's checksum covers all of it, so that no message of a part of it can be proved.
    """
    data = small_capture(**KINDS[kind])
    whole = [n * 0.125 - 1 for n in range(40)]
    ends = borders(data)
    assert ends[-1][1] == 40 and len(ends) > 2
    around = {at + k for at, _ in ends[1:] for k in (-1, 0, 1)}
    others = np.random.default_rng(3).integers(len(MAGIC), len(data), 40).tolist()
    for stop in sorted({*around, *others}):
        expected = max(seen for at, seen in ends if at <= stop)
        try:
            found = recovered(data[:stop])
        except CaptureError as fault:
            assert fault.code == "truncated" and not expected, stop
        else:
            assert found == whole[:expected], stop


@pytest.mark.parametrize("kind", ["zstd", "lz4", "none"])
def test_a_flip_in_the_part_that_is_kept_is_refused(kind: str) -> None:
    """A cut excuses no damage: a chunk that fails its checksum refuses the file."""
    data = small_capture(**KINDS[kind])
    layout = scan(data)
    chunk = layout.chunks[0]
    stop = layout.chunks[-1].offset + 20
    for at in np.linspace(chunk.begin, chunk.end - 1, 50).astype(int):
        flipped = bytearray(data[:stop])
        flipped[at] ^= 4
        with pytest.raises(CaptureError) as refused:
            recovered(bytes(flipped))
        assert refused.value.code in ("corrupt", "limit")
