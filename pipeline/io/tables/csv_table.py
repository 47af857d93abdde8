"""Text tables in: every line has its fields, every field is a number, or the file is refused.

polars parses with an explicit schema; what it would let pass in silence (short rows, a cut last
line, packed or UTF-16 bytes, overflow to infinity) is checked on the bytes before and after.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.io.tables.csv_dialect import CONTRACT_DIALECT, CsvDialect
from pipeline.io.tables.instants import seconds_of
from pipeline.io.tables.raw_table import RawTable
from pipeline.records.errors import CaptureError
from pipeline.records.parse import ParseError, decoded, number, whole

MAX_HEAD_BYTES = 2**18
_MAX_COLUMNS = 4096
_BLOCK_BYTES = 2**22
SEPARATORS = (";", "\t", ",", "|")
_COMMENT = re.compile(r"^#\s*([^:]*?)\s*:\s?(.*?)\s*$")
_BLANKS = re.compile(rb"[ \t]+")
_EDGES = re.compile(rb"^ | (?=\n)", re.MULTILINE)
_DECIMAL_COMMA = re.compile(rb"\d,\d")
_LONG_INTEGER = re.compile(r"^-?\d{16,}$")
PACKED = (b"\x1f\x8b", b"\x28\xb5\x2f\xfd", b"\x78\x9c", b"PK\x03\x04", b"BZh", b"\xfd7zXZ")


@dataclass(frozen=True, slots=True)
class CsvTable:
    """A parsed text table: its comment lines, its rows, and whether their checksum held."""

    metadata: dict[str, str]
    table: RawTable
    verified: bool
    time_start: float | None = None
    time_increment: float | None = None


def check_text(data: bytes) -> None:
    """Refuses bytes that are no plain text table.

    Parameters
    ----------
    data
        Content of the file.

    Raises
    ------
    CaptureError
        It is packed, UTF-16 or binary, or lines end in a bare carriage return.

    """
    if data.startswith(PACKED):
        raise CaptureError("encoding", "the file is packed", "unpack it first")
    if data.startswith((b"\xff\xfe", b"\xfe\xff")) or b"\0" in data:
        raise CaptureError(
            "encoding",
            "the file is UTF-16 or binary (it holds NUL bytes)",
            "save it as UTF-8 text",
        )
    if b"\r" in data and data.count(b"\r") != data.count(b"\r\n"):
        raise CaptureError(
            "encoding", "lines end in a bare carriage return", "save it with LF or CRLF line ends"
        )


def split_comments(data: bytes) -> tuple[dict[str, str], int]:
    r"""The `# key: value` lines that begin a file.

    Parameters
    ----------
    data
        Bytes of the file, with or without the byte order mark of UTF-8.

    Returns
    -------
    values, place
        Texts by key, and where the rest begins [byte].

    Raises
    ------
    CaptureError
        A key has two values (`bad_metadata`), or a line is no UTF-8 (`encoding`).

    Examples
    --------
    >>> split_comments(b"# motor_id: M1\nt_s,ia_a\n")
    ({'motor_id': 'M1'}, 15)

    """
    metadata: dict[str, str] = {}
    at = 3 if data.startswith(b"\xef\xbb\xbf") else 0
    while data.startswith(b"#", at) and at < MAX_HEAD_BYTES:
        stop = data.find(b"\n", at)
        stop = len(data) if stop < 0 else stop + 1
        try:
            line = decoded(data[at:stop]).rstrip("\r\n")
        except ParseError as fault:
            raise CaptureError("encoding", f"a metadata line {fault}", "save it as UTF-8") from None
        match = _COMMENT.match(line)
        if match and match[1] and metadata.setdefault(match[1], match[2]) != match[2]:
            raise CaptureError(
                "bad_metadata", f"the key {match[1]!r} has two values", "keep one of the two lines"
            )
        at = stop
    return metadata, at


def read_csv(
    data: bytes,
    dialect: CsvDialect = CONTRACT_DIALECT,
    wanted: Callable[[str], bool] = bool,
    name: str = "csv",
) -> CsvTable:
    """A whole text table as numbers.

    Parameters
    ----------
    data
        Bytes of the file.
    dialect
        Separator, decimal sign, head, and words for missing values; the contract's by default.
    wanted
        Which columns, by name; the others may hold any text.
    name
        Of the table.

    Returns
    -------
    CsvTable
        Columns [rows], NaN where a field is empty; `verified` where `sha256_rows` was stated and
        holds.

    Raises
    ------
    CaptureError
        Something is amiss, with the first offending row, counted from 0: a row has more or fewer
        fields (`ragged_row`), a field is no number (`bad_number`, `infinite`), the last line is cut
        (`truncated`), the rows fail their checksum (`corrupt`), ...

    References
    ----------
    RFC 4180 (comma-separated values); quotes are taken off, and never hold a separator.

    """
    check_text(data)
    metadata, begin = split_comments(data) if dialect.comment_lines else ({}, 0)
    stated = metadata.get("sha256_rows")
    body = data[begin:].replace(b"\r\n", b"\n")
    head, rows = _split_head(body, dialect)
    if stated is None and dialect.whole_last_line:
        _check_last_line(body, rows)
    names, units = _header(head, dialect)
    _check_separator(names, rows, dialect)
    rows = _even_out(rows, dialect)
    names = _check_shape(rows, names, dialect)
    fields, clocks = _parse(rows, names, dialect, wanted)
    units += tuple((name, "s") for name in clocks)
    count = rows.count(b"\n")
    verified = stated is not None
    if stated is not None:
        _check_digest(data, begin, stated, count)
    table = RawTable(name, fields, units=units)
    before = _text(b"\n".join(head), dialect)
    return CsvTable(
        metadata,
        table,
        verified,
        _number_in(before, dialect.time_start, "start"),
        _number_in(before, dialect.time_increment, "increment"),
    )


def _check_last_line(body: bytes, rows: bytes) -> None:
    if not body.endswith(b"\n"):
        last = rows.count(b"\n")
        raise CaptureError(
            "truncated",
            "the last line does not end in a line break, so its last number may be cut",
            "copy the file again; if it is whole, end it with a line break",
            (last, last) if rows else None,
        )


def _check_digest(data: bytes, begin: int, stated: str, rows: int) -> None:
    """Hold the rows against `sha256_rows`, HEX/ROWS."""
    digest, _, counted = stated.partition("/")
    count = whole(counted)
    if not re.fullmatch(r"[0-9a-fA-F]{64}", digest) or count is None:
        raise CaptureError(
            "bad_metadata", "sha256_rows is not of the form HEX/ROWS", "write it again"
        )
    if count != rows:
        raise CaptureError(
            "truncated",
            f"the file states {count} rows and holds {rows}",
            "copy the file again",
            (min(rows, count), max(rows, count) - 1),
        )
    if hashlib.sha256(memoryview(data)[begin:]).hexdigest() != digest.lower():
        raise CaptureError(
            "corrupt",
            "the rows fail their checksum sha256_rows",
            "copy the file again; never edit a recording",
            (0, max(rows - 1, 0)),
        )


def _text(data: bytes, dialect: CsvDialect) -> str:
    try:
        return decoded(data, dialect.encoding)
    except ParseError as fault:
        raise CaptureError("encoding", f"the header {fault}", "state its `encoding`") from None


def _split_head(body: bytes, dialect: CsvDialect) -> tuple[list[bytes], bytes]:
    """Lines before the rows (the header and its followers last), and the rows."""
    if dialect.names is not None and dialect.header_match is None:
        lines = body.split(b"\n", dialect.skip_lines)
        return lines[:-1], lines[-1] if len(lines) > dialect.skip_lines else b""
    head: list[bytes] = []
    at = 0
    pattern = re.compile(dialect.header_match) if dialect.header_match else None
    while at < min(len(body), MAX_HEAD_BYTES):
        stop = body.find(b"\n", at, at + MAX_HEAD_BYTES)
        if stop < 0 and len(body) > at + MAX_HEAD_BYTES:
            words = f"the line at byte {at} is longer than {MAX_HEAD_BYTES} bytes"
            raise CaptureError("limit", words, "record fewer columns, one line a row")
        stop = len(body) if stop < 0 else stop
        head.append(body[at:stop])
        at = stop + 1
        if len(head) <= dialect.skip_lines:
            continue
        if pattern is None or pattern.match(_text(head[-1], dialect)):
            break
    else:
        raise CaptureError(
            "no_header", "there is no header line", "name the columns in the first line"
        )
    for _ in range(dialect.skip_after_header):
        stop = body.find(b"\n", at)
        stop = len(body) if stop < 0 else stop
        head.append(body[at:stop])
        at = stop + 1
    return head, body[at:]


def _header(
    head: Sequence[bytes], dialect: CsvDialect
) -> tuple[list[str], tuple[tuple[str, str], ...]]:
    """Column names and what a units row says of them."""
    if dialect.names is not None and dialect.header_match is None:
        return list(dialect.names), ()
    at = len(head) - 1 - dialect.skip_after_header
    names = _cells(head[at], dialect)
    names[0] = names[0].lstrip("#").strip()
    if dialect.names is not None:
        return list(dialect.names[: len(names)]), tuple(zip(dialect.names, names, strict=False))
    if len(names) > _MAX_COLUMNS:
        raise CaptureError(
            "limit", f"the header names {len(names)} columns", "record fewer columns"
        )
    units: tuple[tuple[str, str], ...] = ()
    if dialect.units_row:
        row = _cells(head[at + 1], dialect)
        units = tuple((name, unit) for name, unit in zip(names, row, strict=False) if name)
    return names, units


def _check_separator(names: Sequence[str], rows: bytes, dialect: CsvDialect) -> None:
    """Refuses a header that is one field by the dialect's separator and many by another."""
    used = [mark for mark in SEPARATORS if mark != dialect.separator and mark in names[0]]
    if len(names) > 1 or not used:
        return
    comma = used[0] != "," and _DECIMAL_COMMA.search(rows, 0, MAX_HEAD_BYTES)
    layout = f"separator: {used[0]!r}" + (", decimal: ','" if comma else "")
    raise CaptureError(
        "separator",
        f"the fields are separated by {used[0]!r}, where {dialect.separator!r} is expected",
        "save it with commas between fields and points as decimal signs, or write a source map "
        f"in conf/source with layout: {{{layout}}}; `inspect` starts one",
    )


def _cells(line: bytes, dialect: CsvDialect) -> list[str]:
    text = _text(line, dialect)
    cells = text.split() if dialect.separator == " " else text.split(dialect.separator)
    return [cell.strip().strip('"').strip() for cell in cells]


def _even_out(rows: bytes, dialect: CsvDialect) -> bytes:
    """Rows with one line break each, no blanks around fields and a point as decimal sign."""
    rows = rows.rstrip(b"\n")
    if not rows:
        return rows
    rows += b"\n"
    if dialect.row_end:
        rows = rows.replace(dialect.row_end.encode() + b"\n", b"\n")
    mark = dialect.separator.encode()
    if dialect.separator == " ":
        rows = _EDGES.sub(b"", _BLANKS.sub(b" ", rows))
    blanks = (b" ",) if dialect.separator == "\t" else (b" ", b"\t")
    for blank in blanks if dialect.separator != " " else ():
        for edge in (mark, b"\n"):
            while blank + edge in rows:
                rows = rows.replace(blank + edge, edge)
            while edge + blank in rows:
                rows = rows.replace(edge + blank, edge)
        rows = rows.lstrip(blank)
    if dialect.decimal != ".":
        rows = rows.replace(dialect.decimal.encode(), b".")
    return rows.replace(b'"', b"")


def _check_shape(rows: bytes, names: list[str], dialect: CsvDialect) -> list[str]:
    """The names of the fields that every row has; a row with fewer or more is refused."""
    per_row = _fields_a_row(rows, dialect.separator)
    expected = len(names) - 1
    if per_row.size and dialect.fewer_columns and per_row[0] < expected:
        expected = int(per_row[0])
    wrong = np.flatnonzero(per_row != expected)
    if wrong.size:
        row = int(wrong[0])
        raise CaptureError(
            "ragged_row",
            f"a row has {int(per_row[row]) + 1} fields where the header names {expected + 1}",
            "copy the file again, or check the separator",
            (row, int(wrong[-1])),
        )
    names = names[: expected + 1]
    twice = {name for name in names if name and names.count(name) > 1}
    if twice:
        raise CaptureError(
            "duplicate_column", f"the column {min(twice)!r} is there twice", "rename one of them"
        )
    return names


def _fields_a_row(rows: bytes, separator: str) -> NDArray[np.int64]:
    """Separators in each row [rows], counted a few megabytes at a time."""
    counts: list[NDArray[np.int64]] = []
    begin = 0
    while begin < len(rows):
        stop = rows.rfind(b"\n", begin, begin + _BLOCK_BYTES) + 1
        if stop == 0:
            row = sum(part.size for part in counts)
            words = f"a line is longer than {_BLOCK_BYTES} bytes"
            raise CaptureError("limit", words, "record one line a row", (row, row))
        raw = np.frombuffer(rows, np.uint8, stop - begin, begin)
        ends, marks = np.flatnonzero(raw == ord("\n")), np.flatnonzero(raw == ord(separator))
        counts.append(np.diff(np.searchsorted(marks, ends), prepend=0).astype(np.int64))
        begin = stop
    return np.concatenate(counts) if counts else np.empty(0, np.int64)


def _parse(
    rows: bytes, names: list[str], dialect: CsvDialect, wanted: Callable[[str], bool]
) -> tuple[dict[str, Any], list[str]]:
    """Wanted columns as numbers [rows], and which were date and time; an empty field is NaN."""
    import polars as pl

    keep = {at: name for at, name in enumerate(names) if name and wanted(name)}
    if not rows:
        return {name: np.empty(0) for name in keep.values()}, []
    first = rows[: rows.find(b"\n")].decode("utf-8", "replace").split(dialect.separator)
    schema = {
        f"c{at}": (
            pl.String
            if at not in keep or (dialect.instant and number(first[at]) is None and first[at])
            else pl.Int64
            if _LONG_INTEGER.match(first[at])
            else pl.Float64
        )
        for at in range(len(names))
    }
    try:
        frame = _frame(rows, schema, dialect)
    except pl.exceptions.PolarsError:
        raise _locate(rows, schema, keep, dialect) from None
    columns: dict[str, Any] = {}
    clocks: list[str] = []
    for at, name in keep.items():
        values = frame[f"c{at}"]
        if values.dtype == pl.String:
            columns[name] = seconds_of(values, name, dialect.instant or "")
            clocks.append(name)
            continue
        columns[name] = values.to_numpy() if values.null_count() == 0 else _with_nan(values)
        infinite = np.flatnonzero(np.isinf(columns[name]))
        if infinite.size:
            raise CaptureError(
                "infinite",
                f"the column {name!r} holds an infinite number",
                "leave the field empty where nothing was measured",
                (int(infinite[0]), int(infinite[-1])),
            )
    return columns, clocks


def _frame(rows: bytes, schema: dict[str, Any], dialect: CsvDialect) -> Any:
    import polars as pl

    return pl.read_csv(
        rows,
        has_header=False,
        schema=schema,
        separator=dialect.separator,
        quote_char=None,
        null_values=list(dialect.missing) or None,
        encoding="utf8-lossy",
        glob=False,
    )


def _with_nan(values: Any) -> Any:
    import polars as pl

    return values.cast(pl.Float64).fill_null(float("nan")).to_numpy()


def _locate(
    rows: bytes, schema: dict[str, Any], keep: dict[int, str], dialect: CsvDialect
) -> CaptureError:
    """Which field was no number: read everything as text and try column by column."""
    import polars as pl

    frame = _frame(rows, dict.fromkeys(schema, pl.String), dialect)
    for at, name in keep.items():
        text = frame[f"c{at}"]
        number = text.cast(schema[f"c{at}"], strict=False)
        wrong = np.flatnonzero((number.is_null() & text.is_not_null()).to_numpy())
        if wrong.size:
            row = int(wrong[0])
            return CaptureError(
                "bad_number",
                f"the column {name!r} holds {str(text[row])[:40]!r}, which is no number",
                "leave the field empty where nothing was measured; check the units row",
                (row, int(wrong[-1])),
            )
    return CaptureError("bad_number", "a field is no number", "check the rows")


def _number_in(text: str, pattern: str | None, what: str) -> float | None:
    if pattern is None:
        return None
    match = re.search(pattern, text, re.MULTILINE)
    value = number(match[1] or "") if match and match.re.groups else None
    if value is None:
        raise CaptureError(
            "no_header",
            f"the time {what} is not where the source map says",
            "check `time` in the source map against the file's first lines",
        )
    return value
