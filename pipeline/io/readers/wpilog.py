"""WPILib data logs, as SysId records them: a table an entry, fields `timestamp` and its name.

Form: "WPILOG", version, a header text, then records: a byte of field lengths, entry, payload size,
time [µs], payload. Entry 0 holds control records that begin and end entries. Reference: WPILib Data
Log File Format Specification, version 1.0 (wpilibsuite/allwpilib, datalog.adoc).
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from pipeline.io.tables.foreign import Reader
from pipeline.io.tables.raw_table import RawTable
from pipeline.records.errors import CaptureError
from pipeline.records.parse import ParseError, decoded

MARK = b"WPILOG"
SCALARS = {"double": "<d", "float": "<f", "int64": "<q", "boolean": "<?"}
ARRAYS = {"double[]": ("<f8", 8), "float[]": ("<f4", 4), "int64[]": ("<i8", 8)}
MICROSECOND_S = 1e-6
START, FINISH = 0, 1


@dataclass(slots=True)
class _Entry:
    name: str
    kind: str
    unit: str = ""
    times_us: list[int] = field(default_factory=list)
    payloads: list[bytes] = field(default_factory=list)


def read(data: bytes) -> tuple[RawTable, ...]:
    """Numeric entries of a WPILib data log.

    Parameters
    ----------
    data
        Bytes of the file.

    Returns
    -------
    tuple of RawTable
        One an entry: `timestamp` [s] and its name; an array's elements are `NAME.0`, `NAME.1`, ...
        Its metadata, where SysId writes the unit, is the unit of its fields.
        An array that changes its length is left out, and so are texts.

    Raises
    ------
    CaptureError
        It does not begin as such a log, or is cut off (`not_wpilog`).

    References
    ----------
    WPILib, Data Log File Format Specification, version 1.0 (wpilibsuite/allwpilib, datalog.adoc).

    """
    try:
        entries = _entries(data)
        tables = [table for entry in entries if (table := _table(entry)) is not None]
    except (struct.error, IndexError, ParseError) as fault:
        raise CaptureError(
            "not_wpilog", f"its records do not add up: {fault}", "copy the log again"
        ) from fault
    return tuple(tables)


def _entries(data: bytes) -> list[_Entry]:
    if data[:6] != MARK:
        raise CaptureError("not_wpilog", "it does not begin as a data log", "copy the log again")
    (extra,) = struct.unpack_from("<I", data, 8)
    open_, finished = dict[int, _Entry](), list[_Entry]()
    for number, time_us, payload in _records(data, 12 + extra):
        if number == 0:
            _control(payload, open_, finished)
        elif number in open_:
            open_[number].times_us.append(time_us)
            open_[number].payloads.append(payload)
    return finished


def _control(payload: bytes, open_: dict[int, _Entry], finished: list[_Entry]) -> None:
    kind, number = struct.unpack_from("<BI", payload)
    if kind == START:
        name, at = _text(payload, 5)
        form, at = _text(payload, at)
        unit, _ = _text(payload, at)
        open_[number] = _Entry(name, form, unit)
        finished.append(open_[number])
    elif kind == FINISH:
        open_.pop(number, None)


def _text(payload: bytes, at: int) -> tuple[str, int]:
    (size,) = struct.unpack_from("<I", payload, at)
    end = at + 4 + size
    if end > len(payload):
        raise IndexError("a name is longer than its record")
    return decoded(payload[at + 4 : end]), end


def _records(data: bytes, at: int) -> Iterator[tuple[int, int, bytes]]:
    """Entry, time [µs] and payload of each record."""
    while at < len(data):
        lengths = data[at]
        numbers = []
        at += 1
        for size in ((lengths & 3) + 1, (lengths >> 2 & 3) + 1, (lengths >> 4 & 7) + 1):
            if at + size > len(data):
                raise IndexError(f"a record is cut off at byte {at}")
            numbers.append(int.from_bytes(data[at : at + size], "little"))
            at += size
        entry, size, time_us = numbers
        if at + size > len(data):
            raise IndexError(f"a record is cut off at byte {at}")
        yield entry, time_us, data[at : at + size]
        at += size


def _table(entry: _Entry) -> RawTable | None:
    """The entry as numbers; None for one of texts or without any record."""
    if not entry.payloads:
        return None
    times = np.array(entry.times_us, dtype=np.float64) * MICROSECOND_S
    if entry.kind in SCALARS:
        values = [struct.unpack(SCALARS[entry.kind], one)[0] for one in entry.payloads]
        fields = {entry.name: np.array(values, dtype=np.float64)}
    elif entry.kind in ARRAYS:
        dtype, size = ARRAYS[entry.kind]
        width = len(entry.payloads[0]) // size
        if not width or any(len(one) != width * size for one in entry.payloads):
            return None
        rows = np.frombuffer(b"".join(entry.payloads), dtype).reshape(-1, width)
        fields = {f"{entry.name}.{n}": rows[:, n] for n in range(width)}
    else:
        return None
    units = dict.fromkeys(fields, entry.unit) if entry.unit else {}
    stated = (("timestamp", "s"), *units.items())
    return RawTable(entry.name, {"timestamp": times, **fields}, units=stated)


READER = Reader("wpilog", read, suffixes=(".wpilog",))
