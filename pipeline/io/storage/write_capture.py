"""Captures onto disk in the contract's own encodings: MCAP and CSV, the same bytes every time.

Written with the public `mcap` and `protobuf` libraries, so that what the readers of this project
decode was encoded by somebody else's code.
"""

from __future__ import annotations

import hashlib
import io
import json
import math
import struct
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from pipeline.io.storage.publish import write_whole

Table = Mapping[str, NDArray[np.float64]]
Encoding = Literal["json", "protobuf", "cdr", "csv"]
Compression = Literal["none", "lz4", "zstd"]
LIBRARY = "motor-datasheets"
CDR_HEADER = b"\x00\x01\x00\x00"
NANOSECONDS = 1_000_000_000
Payloads = Iterator[tuple[int, bytes]]
"""First row and encoded bytes of each message."""


@dataclass(frozen=True, slots=True)
class Format:
    """How a capture is encoded; `block_rows` None is one sample a message. CSV ignores the rest."""

    encoding: Encoding
    block_rows: int | None = 500
    compression: Compression = "zstd"
    chunk_bytes: int = 1 << 20


def write_capture(
    folder: Path, stem: str, meta: Mapping[str, str], tables: Sequence[Table], form: Format
) -> Path:
    """Writes one capture in an encoding of the contract.

    Parameters
    ----------
    folder
        Where it is written.
    stem
        File name without extension.
    meta
        Metadata as texts.
    tables
        Columns by name [n each]; an MCAP topic each, a CSV holds one.
    form
        Encoding, compression and blocks.

    Returns
    -------
    Path
        The file; every byte of samples and metadata is under a checksum.

    Raises
    ------
    ValueError
        A CSV is to hold several tables, or columns are of unequal length.

    """
    for table in tables:
        if len({column.size for column in table.values()}) != 1:
            raise ValueError(f"{stem}: columns of unequal length")
    if form.encoding == "csv":
        if len(tables) != 1:
            raise ValueError(f"{stem}: a CSV holds one table")
        path, content = folder / f"{stem}.csv", csv_bytes(meta, tables[0])
    else:
        path, content = folder / f"{stem}.mcap", mcap_bytes(meta, tables, form)
    write_whole(path, content)
    return path


def csv_bytes(meta: Mapping[str, str], table: Table) -> bytes:
    """Metadata lines, header and rows; NaN is an empty field, `sha256_rows` covers the rest.

    Parameters
    ----------
    meta
        Metadata as texts.
    table
        Columns by name [n each]; NaN is an empty field.

    Returns
    -------
    bytes
        `sha256_rows` covers header and rows.

    """
    columns = [column.tolist() for column in table.values()]
    rows = [",".join(table)]
    rows += [
        ",".join("" if math.isnan(value) else repr(value) for value in row)
        for row in zip(*columns, strict=True)
    ]
    body = ("\n".join(rows) + "\n").encode()
    digest = f"{hashlib.sha256(body).hexdigest()}/{len(rows) - 1}"
    words = {**meta, "sha256_rows": digest}
    head = "".join(f"# {key}: {value}\n" for key, value in words.items())
    return head.encode() + body


def mcap_bytes(meta: Mapping[str, str], tables: Sequence[Table], form: Format) -> bytes:
    """One MCAP file with the metadata record `capture` and all checksums the format has.

    Parameters
    ----------
    meta
        Metadata as texts.
    tables
        Columns by name [n each].
    form
        Encoding, compression and blocks.

    """
    from mcap.writer import CompressionType, Writer

    stream = io.BytesIO()
    writer: Any = Writer(
        stream,
        chunk_size=form.chunk_bytes,
        compression=CompressionType[form.compression.upper()],
        enable_crcs=True,
        enable_data_crcs=True,
    )
    writer.start(profile="", library=LIBRARY)
    writer.add_metadata("capture", dict(meta))
    start_ns = _start_ns(meta)
    for number, table in enumerate(tables):
        _write_table(writer, number, table, start_ns, form)
    writer.finish()
    return stream.getvalue()


def _write_table(writer: Any, number: int, table: Table, start_ns: int, form: Format) -> None:
    block = form.block_rows
    names = list(table)
    if form.encoding == "json":
        kind, schema, payloads = "jsonschema", _json_schema(names, block), _json(table, block)
    elif form.encoding == "protobuf":
        kind, schema, payloads = "protobuf", _descriptor(names, block), _protobuf(table, block)
    else:
        kind, schema, payloads = "ros2msg", _ros_message(names, block), _cdr(table, block)
    title = "bench/msg/Samples" if form.encoding == "cdr" else "bench.Samples"
    schema_id = writer.register_schema(title, kind, schema)
    topic = "/samples" if number == 0 else f"/samples_{number}"
    channel = writer.register_channel(topic, form.encoding, schema_id)
    clock = table.get("t_s")
    for order, (row, payload) in enumerate(payloads):
        seconds = 0.0 if clock is None else float(clock[row])
        at = start_ns + round(seconds * NANOSECONDS)
        writer.add_message(channel, log_time=at, data=payload, publish_time=at, sequence=order)


def _start_ns(meta: Mapping[str, str]) -> int:
    stated = meta.get("started_at")
    if stated is None:
        return 0
    moment = datetime.fromisoformat(stated)
    in_utc = moment if moment.tzinfo is not None else moment.replace(tzinfo=UTC)
    return round(in_utc.timestamp()) * NANOSECONDS


def _blocks(table: Table, rows: int) -> Iterator[tuple[int, dict[str, NDArray[np.float64]]]]:
    height = next(iter(table.values())).size
    for first in range(0, height, rows):
        yield first, {name: column[first : first + rows] for name, column in table.items()}


def _json_schema(names: list[str], block: int | None) -> bytes:
    number: dict[str, Any] = {"type": ["number", "null"]}
    kind = number if block is None else {"type": "array", "items": number}
    properties = dict.fromkeys(names, kind)
    return json.dumps({"type": "object", "properties": properties}).encode()


def _json(table: Table, block: int | None) -> Payloads:
    """JSON has no NaN: missing values are null."""
    names = list(table)
    if block is not None:
        for first, part in _blocks(table, block):
            lists = {name: _nullable(column) for name, column in part.items()}
            yield first, json.dumps(lists, separators=(",", ":")).encode()
        return
    for row, values in enumerate(zip(*map(_nullable, table.values()), strict=True)):
        sample = dict(zip(names, values, strict=True))
        yield row, json.dumps(sample, separators=(",", ":")).encode()


def _nullable(column: NDArray[np.float64]) -> list[float | None]:
    return [None if math.isnan(value) else value for value in column.tolist()]


def _ros_message(names: list[str], block: int | None) -> bytes:
    kind = "float64" if block is None else "float64[]"
    return "\n".join(f"{kind} {name}" for name in names).encode()


def _cdr(table: Table, block: int | None) -> Payloads:
    """Little-endian CDR; arrays are a 32-bit length, padding to 8 and the doubles."""
    if block is None:
        rows = np.ascontiguousarray(np.column_stack(list(table.values())), dtype="<f8")
        for row in range(rows.shape[0]):
            yield row, CDR_HEADER + rows[row].tobytes()
        return
    for first, part in _blocks(table, block):
        body = b""
        for column in part.values():
            body += struct.pack("<I", column.size)
            body += b"\0" * (-len(body) % 8) + column.astype("<f8").tobytes()
        yield first, CDR_HEADER + body


def _file_descriptor(names: list[str], block: int | None) -> Any:
    from google.protobuf import descriptor_pb2

    file = descriptor_pb2.FileDescriptorProto(name="bench.proto", package="bench", syntax="proto3")
    message = file.message_type.add(name="Samples")
    proto = descriptor_pb2.FieldDescriptorProto
    label = proto.LABEL_OPTIONAL if block is None else proto.LABEL_REPEATED
    for number, name in enumerate(names, start=1):
        message.field.add(name=name, number=number, type=proto.TYPE_DOUBLE, label=label)
    return file


def _descriptor(names: list[str], block: int | None) -> bytes:
    from google.protobuf import descriptor_pb2

    files = descriptor_pb2.FileDescriptorSet(file=[_file_descriptor(names, block)])
    return files.SerializeToString(deterministic=True)


def _protobuf(table: Table, block: int | None) -> Payloads:
    from google.protobuf import descriptor_pool, message_factory

    names = list(table)
    pool = descriptor_pool.DescriptorPool()
    pool.Add(_file_descriptor(names, block))
    kind = message_factory.GetMessageClass(pool.FindMessageTypeByName("bench.Samples"))
    if block is None:
        lists = [column.tolist() for column in table.values()]
        for row, values in enumerate(zip(*lists, strict=True)):
            sample = kind(**dict(zip(names, values, strict=True)))
            yield row, sample.SerializeToString(deterministic=True)
        return
    for first, part in _blocks(table, block):
        message = kind(**{name: column.tolist() for name, column in part.items()})
        yield first, message.SerializeToString(deterministic=True)
