"""JSON payloads: polars parses a whole batch at once, and only if that is proved to be exact.

The first message is the template. The batch went through the template's schema without loss if
polars took every line, all quotes are those of the template's keys and texts, and every null was
written as one. Anything else (keys that come and go, NaN, nested lists) takes the careful way.
"""

from __future__ import annotations

import io
import json
from typing import Any

import numpy as np

from pipeline.io.mcap.leaf import Leaf, Wanted
from pipeline.io.mcap.limits import MAX_DEPTH, MAX_FIELDS, MAX_JSON_BYTES
from pipeline.io.mcap.messages import Batch
from pipeline.records.errors import CaptureError
from pipeline.records.parse import ParseError, json_value

_EXACT_INTEGER = 2**53
_BREAKS = bytes.maketrans(b"\r\n", b"  ")


def _bad(what: str) -> CaptureError:
    return CaptureError(
        "bad_message", f"a JSON message {what}", "write each message as one JSON object"
    )


class JsonDecoder:
    """Decodes messages that are JSON objects of numbers or arrays of numbers."""

    def decode(self, batch: Batch, wanted: Wanted) -> dict[str, Leaf]:
        """Numeric fields of JSON messages.

        Parameters
        ----------
        batch
            Messages of one channel.
        wanted
            Which fields, by dotted name.

        Returns
        -------
        dict
            Leaves by dotted name; null and absent are NaN.

        Raises
        ------
        CaptureError
            A message is no object (`bad_message`), or too large (`limit`).

        References
        ----------
        RFC 8259 (JSON).

        """
        if batch.start.size == 0:
            return {}
        if int(batch.length.max()) > MAX_JSON_BYTES:
            raise CaptureError(
                "limit", "a JSON message is larger than 16 MiB", "write shorter blocks"
            )
        buffer = batch.buffer
        payloads = [
            buffer[at : at + n]
            for at, n in zip(batch.start.tolist(), batch.length.tolist(), strict=True)
        ]
        template = _object(payloads[0])
        fast = _all_at_once(payloads, template, wanted)
        return _one_by_one(payloads, wanted) if fast is None else fast


def _object(payload: bytes) -> dict[str, Any]:
    try:
        value = json_value(payload, unique_keys=True)
    except ParseError as fault:
        raise _bad(str(fault)) from None
    if not isinstance(value, dict):
        raise _bad("is no object")
    return value


def _all_at_once(
    payloads: list[bytes], template: dict[str, Any], wanted: Wanted
) -> dict[str, Leaf] | None:
    """The leaves by one pass of polars, or None where that would not be provably exact."""
    import polars as pl

    quotes = _quotes(template)
    joined = b"\n".join(payloads)
    if joined.count(b"\n") != len(payloads) - 1:
        joined = b"\n".join([payload.translate(_BREAKS) for payload in payloads])
    if quotes is None or joined.count(b'"') != quotes * len(payloads):
        return None
    schema = {name: _dtype(value) for name, value in template.items()}
    if any(dtype is None for dtype in schema.values()):
        return None
    try:
        table = pl.read_ndjson(io.BytesIO(joined), schema=schema)
    except pl.exceptions.PolarsError:
        return None
    if table.height != len(payloads):
        return None
    leaves, nulls = _leaves(table, wanted)
    return leaves if nulls == joined.count(b"null") else None


def _quotes(value: Any) -> int | None:
    """Quotation marks that a value of this shape is written with."""
    if isinstance(value, str):
        return 2 if '"' not in json.dumps(value, ensure_ascii=False)[1:-1] else None
    if isinstance(value, list):
        return None if {str, dict, list} & set(map(type, value)) else 0
    if not isinstance(value, dict):
        return 0
    parts = [_quotes(part) for part in value.values()]
    if None in parts or any('"' in key for key in value):
        return None
    return 2 * len(parts) + sum(part or 0 for part in parts)


def _dtype(value: Any) -> Any:
    """The polars type for a template value, or None where there is no exact one."""
    import polars as pl

    if isinstance(value, bool):
        return pl.Boolean
    if isinstance(value, int):
        return pl.Int64 if abs(value) > _EXACT_INTEGER else pl.Float64
    if value is None or isinstance(value, float):
        return pl.Float64
    if isinstance(value, str):
        return pl.String
    if isinstance(value, list):
        kinds = set(map(type, value))
        large = int in kinds and any(type(n) is int and abs(n) > _EXACT_INTEGER for n in value)
        return pl.List(pl.Int64 if large else pl.Float64)
    parts = {key: _dtype(part) for key, part in value.items()}
    return None if not parts or None in parts.values() else pl.Struct(parts)


def _leaves(table: Any, wanted: Wanted) -> tuple[dict[str, Leaf], int]:
    """The leaves of a table, and how many nulls it holds.

    Arrays of one length in each message, as blocks have them, are unpacked together.
    """
    import polars as pl

    if all(dtype == pl.List(pl.Float64) for dtype in table.dtypes):
        lengths = table.select(pl.all().list.len()).to_numpy()  # NaN, unequal to all, for a null
        if (lengths == lengths[:, :1]).all():
            counts = lengths[:, 0].astype(np.int64)
            flat = table.select(pl.all().explode(empty_as_null=False, keep_nulls=False))
            columns = [series for series in flat.get_columns() if wanted(series.name)]
            leaves = {series.name: Leaf(series.to_numpy(), counts) for series in columns}
            return leaves, sum(series.null_count() for series in flat.get_columns())
    leaves = {}
    columns = table.get_columns()
    return leaves, sum(_collect(series, series.name, wanted, leaves) for series in columns)


def _collect(series: Any, name: str, wanted: Wanted, leaves: dict[str, Leaf]) -> int:
    """Add the leaves of a column, and return how many nulls it holds."""
    import polars as pl

    nulls = int(series.null_count())
    if isinstance(series.dtype, pl.Struct):
        parts = (_collect(part, f"{name}.{part.name}", wanted, leaves) for part in series.struct)
        return sum(parts)
    counts = None
    if isinstance(series.dtype, pl.List):
        counts = series.list.len().fill_null(0).to_numpy().astype(np.int64)
        series = series.explode(empty_as_null=False, keep_nulls=False)
        nulls += int(series.null_count())
    if series.dtype in (pl.Float64, pl.Int64) and wanted(name):
        values = series.to_numpy()
        leaves[name] = Leaf(values, counts)
    return nulls


def _one_by_one(payloads: list[bytes], wanted: Wanted) -> dict[str, Leaf]:
    """The leaves by reading each message on its own."""
    rows: list[dict[str, Any]] = []
    keys: dict[str, None] = {}
    for payload in payloads:
        flat: dict[str, Any] = {}
        _flatten(_object(payload), "", flat, 0)
        rows.append(flat)
        keys.update(dict.fromkeys(flat))
        if len(keys) > MAX_FIELDS:
            raise _bad(f"stream has more than {MAX_FIELDS} fields")
    names = [name for name in keys if wanted(name)]
    return {name: _leaf(name, [flat.get(name) for flat in rows]) for name in names}


def _flatten(value: dict[str, Any], prefix: str, flat: dict[str, Any], depth: int) -> None:
    if depth > MAX_DEPTH:
        raise _bad("nests too deep")
    for key, part in value.items():
        name = prefix + key
        if isinstance(part, dict):
            _flatten(part, f"{name}.", flat, depth + 1)
        elif isinstance(part, list) and part and all(isinstance(item, dict) for item in part):
            for item in part:
                inner: dict[str, Any] = {}
                _flatten(item, f"{name}.", inner, depth + 1)
                for leaf, number in inner.items():
                    flat.setdefault(leaf, []).append(number)
        elif part is None or isinstance(part, (int, float, list)):
            flat[name] = part


def _leaf(name: str, values: list[Any]) -> Leaf:
    if any(isinstance(value, list) for value in values):
        lists = [[] if value is None else value for value in values]
        if not all(isinstance(value, list) for value in lists):
            raise _bad(f"has {name!r} as a number and as an array")
        counts = np.array([len(value) for value in lists], np.int64)
        return Leaf(_numbers(name, [n for value in lists for n in value]), counts)
    return Leaf(_numbers(name, values))


def _numbers(name: str, values: list[Any]) -> Any:
    try:
        if all(type(value) is int for value in values) and values:
            exact = np.array(values, np.int64)
            return exact if np.abs(exact).max() > _EXACT_INTEGER else exact.astype(np.float64)
        numbers = np.array([np.nan if v is None else float(v) for v in values], np.float64)
    except (TypeError, ValueError, OverflowError):
        raise _bad(f"has something other than numbers in {name!r}") from None
    infinite = np.flatnonzero(np.isinf(numbers))
    if infinite.size:
        raise _bad(f"has an infinite number in {name!r}")
    return numbers
