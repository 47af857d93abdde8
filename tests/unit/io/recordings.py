"""Small MCAP files written by the public library, which shares no code with the reader."""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from google.protobuf.descriptor_pb2 import FileDescriptorProto, FileDescriptorSet
from mcap.writer import CompressionType, IndexType, Writer

SHARED = Path(__file__).resolve().parents[4] / "shared" / "data"
START_NS = 1_760_000_000_000_000_000
META = {"contract": "1", "motor_id": "000123", "test": "drive"}


def mcap_file(
    messages: Iterable[tuple[str, int, bytes]],
    schema: tuple[str, str, bytes] | None = None,
    encoding: str = "json",
    metadata: Mapping[str, str] | None = None,
    compression: CompressionType = CompressionType.ZSTD,
    chunk_size: int = 2000,
    **options: Any,
) -> bytes:
    """An MCAP of (topic, log time [ns], payload); all checksums on unless `options` differ."""
    stream = io.BytesIO()
    options = {"enable_data_crcs": True, "index_types": IndexType.ALL} | options
    writer = Writer(stream, chunk_size=chunk_size, compression=compression, **options)
    writer.start(profile="", library="test")
    writer.add_metadata("capture", dict(META if metadata is None else metadata))
    schema_id = writer.register_schema(*schema) if schema else 0
    channels: dict[str, int] = {}
    for sequence, (topic, time, payload) in enumerate(messages):
        if topic not in channels:
            channels[topic] = writer.register_channel(topic, encoding, schema_id)
        writer.add_message(channels[topic], time, payload, time, sequence)
    writer.finish()
    return stream.getvalue()


def json_messages(rows: Iterable[Mapping[str, Any]], topic: str = "/s") -> list[Any]:
    """One JSON message a row, a millisecond apart."""
    return [
        (topic, START_NS + 1_000_000 * number, json.dumps(row).encode())
        for number, row in enumerate(rows)
    ]


def small_capture(**options: Any) -> bytes:
    """Forty JSON samples of q current and angle in several chunks."""
    rows = [{"t_s": n / 1000, "iq_a": n * 0.125 - 1, "theta_mech_rad": n * 0.01} for n in range(40)]
    return mcap_file(json_messages(rows), ("S", "jsonschema", b"{}"), **options)


def protobuf_schema(fill: Callable[[FileDescriptorProto], None]) -> tuple[bytes, Any]:
    """A FileDescriptorSet [bytes] and the message class of `p.M`, from a filled-in descriptor."""
    from google.protobuf import descriptor_pool, message_factory

    file = FileDescriptorProto(name="m.proto", package="p", syntax="proto3")
    fill(file)
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    described = pool.FindMessageTypeByName("p.M")
    files = FileDescriptorSet(file=[file])
    return files.SerializeToString(), message_factory.GetMessageClass(described)
