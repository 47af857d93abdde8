"""Files of recorders and tools whose names, kinds, shapes and numbers are drawn."""

from __future__ import annotations

import io
import random
import struct
from collections.abc import Callable
from typing import Any, Protocol

import numpy as np

from pipeline.io.maps.source_map import FieldMap, SourceMap
from pipeline.io.tables.foreign import readers

ROWS = 40
FIELDS = ("time", "speed", "iq", "vq")
KINDS = ("f8", "f4", "i8", "u1", "?", "U5", "M8[us]", "m8[ms]", "c16", "S3", "f2", "O")
EDGES = (b"\0" * 8, b"\xff" * 8, b"\x7f" + b"\xff" * 7, b"\x80" + b"\0" * 7, b"\x01" + b"\0" * 7)
COLUMNS = {"time": "t_s", "speed": "omega_mech_rad_s", "iq": "iq_a", "vq": "vq_v"}
Arrays = dict[str, np.ndarray[Any, Any]]


class Drawn(Protocol):
    """What `grammar.Draw` gives."""

    random: random.Random

    def text(self, sound: str) -> str:
        """A text, which may be hostile."""

    def integer(self, sound: int, bits: int) -> int:
        """A whole number, which may be hostile."""


def maps() -> dict[str, SourceMap]:
    """A map for each reader whose files are known by their suffix."""
    fields = (FieldMap("timestamp", "t_s"), FieldMap("time", "t_s"))
    fields += tuple(FieldMap(f"*{name}*", column) for name, column in COLUMNS.items())
    said = (("motor_id", "fuzz"), ("test", "drive"), ("pole_pairs", "7"))
    return {
        f"fuzz_{one.name}": SourceMap(
            f"fuzz_{one.name}",
            files=tuple(f"fuzz*{suffix}" for suffix in one.suffixes),
            reader=one.name,
            fields=fields,
            metadata=said,
        )
        for one in readers().values()
        if one.suffixes
    }


def arrays(draw: Drawn) -> Arrays:
    """Fields of one clock; a hostile one has another kind, length, shape or name."""
    time = np.arange(ROWS) * 0.01
    sound = {"time": time, "speed": 50 + np.sin(time), "iq": np.cos(time), "vq": 2 * np.cos(time)}
    found: Arrays = {}
    for name in FIELDS:
        values = sound[name]
        if draw.integer(5, 8) != 5:
            values = values.astype(draw.random.choice(KINDS))
        size = draw.integer(ROWS, 6) % 50
        values = values if size >= ROWS else values[:size]
        if draw.integer(1, 3) != 1 and values.dtype.kind in "fiub":
            values = values[:, None] * np.ones(draw.random.choice((0, 1, 3)), dtype=bool)
        if draw.integer(1, 3) != 1 and values.dtype.kind == "f" and values.size:
            values = values.copy()
            with np.errstate(over="ignore"):
                values.flat[0] = draw.random.choice((np.nan, np.inf, -np.inf, 1e308, 5e-324))
        found[draw.text(name)] = values
    return found


def patched(draw: Drawn, data: bytes) -> bytes:
    """The bytes with up to three words at the edges of their range, or cut."""
    changed = bytearray(data)
    for _ in range(3):
        if draw.integer(1, 3) == 1 or not changed:
            continue
        at, size = draw.random.randrange(len(changed)), draw.random.choice((1, 2, 4, 8))
        changed[at : at + size] = draw.random.choice(EDGES)[:size][: len(changed) - at]
    cut = draw.integer(255, 8)
    return bytes(changed if cut == 255 else changed[: len(changed) * cut // 255])


def parquet(draw: Drawn) -> bytes:
    import polars as pl

    columns: list[pl.Series] = []
    rows = None
    for name, values in arrays(draw).items():
        try:
            series = pl.Series(name, values)
            if series.dtype == pl.Object:
                series = series.cast(pl.String)
            name.encode()
        except Exception:  # noqa: BLE001 (a kind or a name that the form cannot hold)
            name, series = "x", pl.Series("x", ["x"] * len(values))  # noqa: PLW2901
        if rows in (None, len(series)) and name not in {one.name for one in columns}:
            rows = len(series)
            columns.append(series)
    stream = io.BytesIO()
    pl.DataFrame(columns).write_parquet(stream)
    return stream.getvalue()


def npy(draw: Drawn) -> bytes:
    found = arrays(draw)
    size = min(len(values) for values in found.values())
    kinds = [(n or "x", v.dtype, v.shape[1:]) for n, v in found.items()]
    stream = io.BytesIO()
    try:
        table = np.zeros(size, dtype=kinds)
    except (ValueError, TypeError):
        table = np.zeros((size, 3))
    np.save(stream, table, allow_pickle=True)
    return stream.getvalue()


def npz(draw: Drawn) -> bytes:
    stream = io.BytesIO()
    names = {
        name.replace("\0", "").encode("utf-8", "replace").decode() or "x": values
        for name, values in arrays(draw).items()
    }
    np.savez(stream, **{name.replace("/", "_")[:200]: v for name, v in names.items()})
    return stream.getvalue()


def mat(draw: Drawn) -> bytes:
    from scipy.io import savemat

    stream = io.BytesIO()
    log = {
        "".join(c for c in name if c.isascii() and c.isalnum())[:30] or "x": values
        for name, values in arrays(draw).items()
        if values.dtype.kind not in "mM"
    }
    log = {f"v{name}" if name[0].isdigit() else name: values for name, values in log.items()}
    savemat(stream, {"log": log} if draw.integer(1, 2) == 1 else log)
    return stream.getvalue()


def hdf5(draw: Drawn) -> bytes:
    import h5py

    stream = io.BytesIO()
    with h5py.File(stream, "w") as file:
        for name, values in arrays(draw).items():
            try:
                file[f"log/{name}"] = values
            except (TypeError, ValueError, OSError, UnicodeError, RuntimeError):
                file[f"log/x{len(file)}"] = np.arange(3.0)
        if draw.integer(1, 2) != 1:
            file["log/self"] = h5py.SoftLink("/log")
    return stream.getvalue()


def tdms(draw: Drawn) -> bytes:
    from nptdms import ChannelObject, TdmsWriter

    stream = io.BytesIO()
    with TdmsWriter(stream) as writer:
        for name, values in arrays(draw).items():
            clock = {"wf_increment": 0.01 * draw.integer(1, 8), "wf_start_offset": 0.0}
            try:
                writer.write_segment([ChannelObject("log", name, values, properties=clock)])
            except (TypeError, ValueError, UnicodeError, KeyError, struct.error):
                continue
    return stream.getvalue()


def mdf4(draw: Drawn) -> bytes:
    """The head of an MDF file and noise; asammdf, which writes whole ones, is no dependency."""
    head = b"MDF     4.10    fuzz    " + struct.pack("<HHHH", 0, 0, draw.integer(410, 16), 0)
    return head.ljust(64, b"\0") + b"##HD" + draw.random.randbytes(400)


def wpilog(draw: Drawn) -> bytes:
    parts = [b"WPILOG", struct.pack("<HI", draw.integer(0x0100, 16), draw.integer(3, 32)), b"bot"]

    def record(entry: int, time_us: int, payload: bytes) -> None:
        head = (0b0110100, entry & 255, draw.integer(len(payload), 16) & 0xFFFF)
        parts.append(struct.pack("<BBHI", *head, draw.integer(time_us, 32)) + payload)

    kinds = ("double", "float", "int64", "boolean", "string", "double[]", "float[]", "raw", "x")
    for entry, name in enumerate(FIELDS, start=1):
        kind = "double" if draw.integer(1, 3) == 1 else draw.random.choice(kinds)
        texts = (draw.text(name), kind, "")
        coded = [one.encode("utf-8", "surrogatepass") for one in texts]
        said = b"".join(struct.pack("<I", draw.integer(len(one), 32)) + one for one in coded)
        record(0, 0, struct.pack("<BI", draw.integer(0, 8), entry) + said)
    for n in range(ROWS):
        for entry in range(1, len(FIELDS) + 1):
            record(entry, n * 10_000, struct.pack("<d", n * 0.5))
    return b"".join(parts)


WRITERS: dict[str, Callable[[Drawn], bytes]] = {
    ".parquet": parquet,
    ".npy": npy,
    ".npz": npz,
    ".mat": mat,
    ".h5": hdf5,
    ".tdms": tdms,
    ".mf4": mdf4,
    ".wpilog": wpilog,
}


def written(suffix: str, draw: Drawn) -> dict[str, bytes]:
    """A folder with one file of a form."""
    return {f"fuzz{suffix}": patched(draw, WRITERS[suffix](draw))}
