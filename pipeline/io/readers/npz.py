"""numpy archives: every numeric array is a field, a complex one two, in row order."""

from __future__ import annotations

import io
import tokenize
import zipfile
import zlib
from collections.abc import Mapping

import numpy as np

from pipeline.io.tables.foreign import Reader
from pipeline.io.tables.raw_table import RawTable
from pipeline.records.errors import CaptureError

_MOST_BYTES = 1 << 30
# An array's head is a literal of Python, read by its own tokenizer and parser; its shape is
# allocated before it is read.
BROKEN = (
    *(ValueError, TypeError, LookupError, ArithmeticError, EOFError, OSError, RuntimeError),
    *(SyntaxError, tokenize.TokenError, MemoryError, zipfile.BadZipFile, zlib.error),
)


def read(data: bytes) -> tuple[RawTable, ...]:
    """Arrays of a numpy archive as the fields of one table.

    Parameters
    ----------
    data
        Bytes of the file; objects are never unpickled.

    Returns
    -------
    tuple of one RawTable
        Fields `NAME`, or `NAME.real` and `NAME.imag`; an array of several dimensions is laid out
        row after row.

    Raises
    ------
    CaptureError
        It is no archive of plain arrays (`not_npz`), they differ in length (`lengths`), or it
        unpacks to more than 1 GiB (`limit`).

    References
    ----------
    NumPy Enhancement Proposal 1, A simple file format for NumPy arrays.

    """
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            if sum(member.file_size for member in archive.infolist()) > _MOST_BYTES:
                raise CaptureError("limit", "it unpacks to more than 1 GiB", "split it")
        with np.load(io.BytesIO(data), allow_pickle=False) as arrays:
            fields = _fields({name: arrays[name] for name in sorted(arrays.files)})
    except BROKEN as fault:
        raise CaptureError(
            "not_npz",
            f"it is no numpy archive of plain arrays: {fault}"[:200],
            "save it with numpy.savez",
        ) from fault
    if len({values.size for values in fields.values()}) > 1:
        raise CaptureError(
            "lengths", "its arrays differ in length", "save arrays of one length together"
        )
    return (RawTable("npz", fields),)


def _fields(arrays: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    fields: dict[str, np.ndarray] = {}
    for name, values in arrays.items():
        if np.iscomplexobj(values):
            fields[f"{name}.real"] = values.real.ravel()
            fields[f"{name}.imag"] = values.imag.ravel()
        elif np.issubdtype(values.dtype, np.number):
            fields[name] = values.ravel()
    return fields


READER = Reader("npz", read, suffixes=(".npz",))
