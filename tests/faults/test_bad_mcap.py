"""MCAP files that are not what they seem: every one is refused, none is read in silence."""

from __future__ import annotations

import io
import struct
import zlib

import lz4.frame
import numpy as np
import pytest
import zstandard
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, IndexType

from pipeline.io.mcap.container import MAGIC, scan
from pipeline.io.mcap.tables import read_tables
from pipeline.io.mcap.walk import walk
from pipeline.records.errors import CaptureError
from tests.unit.io.recordings import small_capture


def read(data: bytes) -> list[dict[str, bytes]]:
    """Every value that a file gives, as bytes; CaptureError is the only way out."""
    tables = read_tables(scan(data), lambda _topic, _name: True)
    return [{name: values.tobytes() for name, values in t.fields.items()} for t in tables]


def refusal(data: bytes) -> CaptureError:
    with pytest.raises(CaptureError) as refused:
        read(data)
    assert refused.value.remedy
    return refused.value


KINDS = {
    "zstd": {"compression": CompressionType.ZSTD},
    "lz4": {"compression": CompressionType.LZ4},
    "none": {"compression": CompressionType.NONE},
    "unchunked": {"use_chunking": False},
    "no index": {"index_types": IndexType.NONE},
    "no summary": {
        "index_types": IndexType.NONE,
        "repeat_channels": False,
        "repeat_schemas": False,
        "use_statistics": False,
        "use_summary_offsets": False,
    },
}


@pytest.mark.parametrize("kind", KINDS)
def test_every_way_of_writing_gives_the_same_samples(kind: str) -> None:
    (table,) = read(small_capture(**KINDS[kind]))
    assert np.frombuffer(table["iq_a"]).tolist() == [n * 0.125 - 1 for n in range(40)]


@pytest.mark.parametrize("kind", KINDS)
def test_every_cut_is_refused(kind: str) -> None:
    """Expected: at every record border and at 200 other places, `truncated` or `not_mcap`."""
    data = small_capture(**KINDS[kind])
    borders = walk(data, len(MAGIC), len(data) - len(MAGIC)).start - 9
    others = np.random.default_rng(7).integers(0, len(data), 200)
    for stop in sorted({*borders.tolist(), *others.tolist()}):
        fault = refusal(data[:stop])
        assert fault.code in ("truncated", "not_mcap"), stop
        assert stop < len(MAGIC) or fault.rows is not None


@pytest.mark.parametrize("kind", ["zstd", "lz4", "none", "unchunked"])
def test_no_bit_flip_is_silent(kind: str) -> None:
    """Expected: refused, or (an empty library name's byte, say) the very same samples.

    A flip may only go through where the file stops claiming to be covered by a checksum.
    """
    data = small_capture(**KINDS[kind])
    whole = read(data)
    accepted = 0
    for at in range(len(data)):
        flipped = bytearray(data)
        flipped[at] ^= 1 << (at % 8)
        try:
            same = read(bytes(flipped)) == whole
        except CaptureError:
            continue
        accepted += 1
        assert same and not scan(bytes(flipped)).data_crc_holds, at
    assert accepted == 0


def chunked(packed: bytes, size: int, crc: int, compression: bytes = b"zstd") -> bytes:
    """A file of one hand-made chunk."""

    def record(opcode: int, body: bytes) -> bytes:
        return struct.pack("<BQ", opcode, len(body)) + body

    name = struct.pack("<I", len(compression)) + compression
    body = struct.pack("<QQQI", 0, 0, size, crc) + name + struct.pack("<Q", len(packed)) + packed
    parts = [record(1, bytes(8)), record(6, body), record(15, bytes(4)), record(2, bytes(20))]
    return MAGIC + b"".join(parts) + MAGIC


@pytest.mark.parametrize("declared", [100, 2**26, 2**26 + 1, 2**40, 2**63])
@pytest.mark.parametrize("streamed", [True, False])
def test_a_chunk_that_unpacks_to_gigabytes_is_refused_in_little_memory(
    declared: int, streamed: bool
) -> None:
    """Expected: `limit` or `corrupt`, and no allocation of what the chunk claims."""
    import tracemalloc

    packer = zstandard.ZstdCompressor(write_content_size=not streamed)
    if streamed:
        out = io.BytesIO()
        with packer.stream_writer(out, closefd=False) as stream:
            for _ in range(256):
                stream.write(bytes(2**20))
        packed = out.getvalue()
    else:
        packed = packer.compress(bytes(2**28))
    data = chunked(packed, declared, 0)
    tracemalloc.start()
    fault = refusal(data)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert fault.code in ("limit", "corrupt")
    assert peak < 80 * 2**20


def test_a_chunk_over_the_limit_is_refused_even_if_it_tells_the_truth() -> None:
    """64 MiB and a byte, and not so small when packed that its ratio gives it away."""
    noise = np.random.default_rng(3).bytes(2**17)
    plain = noise + bytes(2**26 + 1 - len(noise))
    assert refusal(chunked(zstandard.compress(plain), len(plain), 0)).code == "limit"


def test_a_chunk_is_held_against_its_own_checksum() -> None:
    """A file without a checksum of its whole data section, as many writers make them."""
    plain = b"\x80" + struct.pack("<Q", 5) + b"12345"
    packed, crc = zstandard.compress(plain), zlib.crc32(plain)
    assert "checksum" in str(refusal(chunked(packed, len(plain), crc ^ 1)))
    assert read(chunked(packed, len(plain), crc)) == []


def test_an_lz4_bomb_is_refused() -> None:
    packed = lz4.frame.compress(bytes(2**26))
    assert refusal(chunked(packed, 1000, 0, b"lz4")).code == "corrupt"


@pytest.mark.parametrize("compression", [b"brotli", b"ZSTD", b"\xff"])
def test_an_unknown_compression_is_refused(compression: bytes) -> None:
    assert refusal(chunked(b"1234", 4, 0, compression)).code in ("unsupported", "corrupt")


def test_trailing_bytes_behind_a_packed_chunk_are_refused() -> None:
    plain = b""
    packed = zstandard.compress(plain) + b"more"
    assert refusal(chunked(packed, 0, zlib.crc32(plain))).code == "corrupt"


def test_text_named_mcap_is_named_for_what_it_is() -> None:
    assert refusal(b"t_s,iq_a\n0,1\n").code == "not_mcap"
    assert refusal(b"").code == "not_mcap"


def records_of(data: bytes) -> list[tuple[int, bytes]]:
    spans = walk(data, len(MAGIC), len(data) - len(MAGIC))
    return [
        (int(op), data[s - 9 : s + n])
        for op, s, n in zip(spans.opcode, spans.start.tolist(), spans.length.tolist(), strict=True)
    ]


UNCOVERED = {"enable_data_crcs": False, "enable_crcs": False}


def test_a_chunk_that_the_index_leaves_out_is_noticed() -> None:
    """The public seeking reader would drop its messages in silence."""
    data = small_capture(**UNCOVERED)
    parts = records_of(data)
    index = next(n for n, (op, _) in enumerate(parts) if op == 8)
    kept = [part for n, (_, part) in enumerate(parts) if n != index]
    assert refusal(MAGIC + b"".join(kept) + MAGIC).code == "corrupt"


def test_a_chunk_that_is_there_twice_is_noticed() -> None:
    """The statistics and the index disagree with it."""
    data = small_capture(**UNCOVERED)
    parts = records_of(data)
    chunk = next(n for n, (op, _) in enumerate(parts) if op == 6)
    doubled = [part for _, part in parts]
    doubled[chunk:chunk] = doubled[chunk : chunk + 2]
    assert refusal(MAGIC + b"".join(doubled) + MAGIC).code == "corrupt"


@pytest.mark.parametrize("offset", [0, 8])
def test_a_message_index_that_points_elsewhere_is_noticed(offset: int) -> None:
    """Times and places of the index are held against the messages themselves."""
    data = bytearray(small_capture(**UNCOVERED))
    spans = walk(bytes(data), len(MAGIC), len(data) - len(MAGIC))
    at = int(spans.start[np.flatnonzero(spans.opcode == 7)[0]]) + 6 + 16 * 3 + offset
    data[at] ^= 1
    assert refusal(bytes(data)).code == "corrupt"


def test_an_id_that_changes_its_meaning_is_noticed() -> None:
    data = small_capture(use_chunking=False, **UNCOVERED)
    parts = records_of(data)
    place = next(n for n, (op, _) in enumerate(parts) if op == 4)
    other = parts[place][1].replace(b"/s", b"/t")
    body = [part for _, part in parts]
    body.insert(place + 5, other)
    fault = refusal(MAGIC + b"".join(body) + MAGIC)
    assert fault.code == "corrupt" and "defined twice" in fault.message


def test_any_bytes_behind_the_magic_end_in_a_refusal() -> None:
    """Random records of every opcode: nothing but CaptureError comes out."""
    generator = np.random.default_rng(11)
    for _ in range(400):
        parts = [struct.pack("<BQ", 1, 8) + bytes(8)]
        for _ in range(generator.integers(1, 6)):
            body = generator.integers(0, 4, generator.integers(0, 60)).astype(np.uint8).tobytes()
            parts.append(struct.pack("<BQ", generator.integers(1, 17), len(body)) + body)
        parts += [struct.pack("<BQ", 15, 4) + bytes(4), struct.pack("<BQ", 2, 20) + bytes(20)]
        try:
            read(MAGIC + b"".join(parts) + MAGIC)
        except CaptureError as fault:
            assert fault.code


def test_the_files_above_are_whole_to_the_public_reader() -> None:
    """Guards the makers: an untouched file reads with the public library as well."""
    for options in KINDS.values():
        reader = StreamReader(io.BytesIO(small_capture(**options)), validate_crcs=True)
        assert len(list(reader.records)) > 5
