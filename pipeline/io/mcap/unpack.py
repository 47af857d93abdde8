"""One chunk unpacked: never more bytes than it declares, and its checksum held against them."""

from __future__ import annotations

from isal.isal_zlib import crc32

from pipeline.io.mcap.records import Chunk
from pipeline.io.mcap.wire import corrupt
from pipeline.records.errors import CaptureError

_ZSTD_MAX_WINDOW_BYTES = 128 * 2**20


def unpack(data: bytes, chunk: Chunk, first_message: int = 0) -> bytes:
    """The records of a chunk, exactly as many bytes as declared.

    Parameters
    ----------
    data
        Bytes of the file.
    chunk
        Where the chunk lies, how it is packed, its size and checksum.
    first_message
        Number of its first message in the file, for the refusal.

    Returns
    -------
    bytes
        Unpacked records.

    Raises
    ------
    CaptureError
        It is packed otherwise than by lz4 or zstd (`unsupported`), unpacks to another size, or
        fails its checksum (`corrupt`).
    MemoryError
        The limits of this process are below what a sound chunk takes.

    References
    ----------
    RFC 8878 (zstd); LZ4 Frame Format Description.

    """
    packed = memoryview(data)[chunk.begin : chunk.end]
    if chunk.compression == "":
        unpacked = bytes(packed)
    elif chunk.compression == "zstd":
        unpacked = _unzstd(packed, chunk)
    elif chunk.compression == "lz4":
        unpacked = _unlz4(packed, chunk)
    else:
        raise CaptureError(
            "unsupported",
            f"a chunk is packed with {chunk.compression!r}",
            "record with lz4, zstd or no compression",
        )
    if len(unpacked) != chunk.size:
        raise corrupt(f"{_where(chunk)} unpacks to another size than declared")
    if chunk.crc and crc32(unpacked) != chunk.crc:
        raise corrupt(f"{_where(chunk)} fails its checksum", (first_message, first_message))
    return unpacked


def _where(chunk: Chunk) -> str:
    return f"the chunk at byte {chunk.offset}"


def _unzstd(packed: memoryview, chunk: Chunk) -> bytes:
    import zstandard

    try:
        frame = zstandard.get_frame_parameters(packed)
        known = chunk.size and frame.content_size == chunk.size
        if known and frame.window_size <= _ZSTD_MAX_WINDOW_BYTES:
            return zstandard.ZstdDecompressor().decompress(packed, allow_extra_data=False)
        reader = zstandard.ZstdDecompressor(max_window_size=_ZSTD_MAX_WINDOW_BYTES).stream_reader(
            packed, read_across_frames=True
        )
        unpacked = reader.read(chunk.size + 1)
    except zstandard.ZstdError as fault:
        raise corrupt(f"{_where(chunk)} does not unpack: {fault}") from None
    return unpacked


def _unlz4(packed: memoryview, chunk: Chunk) -> bytes:
    import lz4.frame

    unpacker = lz4.frame.LZ4FrameDecompressor()
    try:
        unpacked: bytes = unpacker.decompress(packed, max_length=chunk.size + 1)
    except (RuntimeError, EOFError) as fault:
        raise corrupt(f"{_where(chunk)} does not unpack: {fault}") from None
    if not unpacker.eof or unpacker.unused_data:
        raise corrupt(f"{_where(chunk)} unpacks to another size than declared")
    return unpacked
