"""MATLAB files: every numeric vector is a field, one of a struct as `struct.name`.

Version 5 is read by scipy, version 7.3, which is HDF5, by h5py (the extra `hdf5`); there a field of
a struct is `struct/name`.
"""

from __future__ import annotations

import io
from collections.abc import Iterator
from typing import Any

import numpy as np

from pipeline.io.tables.foreign import Reader
from pipeline.io.tables.hdf5_tables import tables
from pipeline.io.tables.raw_table import RawTable
from pipeline.records.errors import CaptureError

HDF5_AT = 512
HDF5_MARK = b"\x89HDF\r\n\x1a\n"
DEEPEST = 8


def read(data: bytes) -> tuple[RawTable, ...]:
    """Numeric vectors of a MATLAB file.

    Parameters
    ----------
    data
        Bytes of the file: version 5, or 7.3, which is HDF5.

    Returns
    -------
    tuple of RawTable
        One for each length of vectors; fields by name, those of a struct as `struct.name` (7.3:
        `struct/name`), a complex one as `NAME.real` and `NAME.imag` (version 5).

    Raises
    ------
    CaptureError
        It is no MATLAB file (`not_mat`), or h5py is missing (`missing_library`).

    References
    ----------
    MathWorks, MAT-File Format (version 5).

    """
    if HDF5_MARK in (data[:8], data[HDF5_AT : HDF5_AT + 8]):
        return tables(data, form="mat")
    from scipy.io import loadmat

    try:
        content = loadmat(io.BytesIO(data), squeeze_me=False, struct_as_record=True)
    except Exception as fault:
        raise CaptureError(
            "not_mat", f"it is no MATLAB file: {fault}", "save it with `save -v7`"
        ) from fault
    arrays: dict[int, dict[str, np.ndarray]] = {}
    for name, value in sorted(content.items()):
        if not name.startswith("__"):
            for path, vector in _vectors(name, value, DEEPEST):
                arrays.setdefault(vector.size, {})[path] = vector
    return tuple(RawTable(f"mat of {size}", fields) for size, fields in sorted(arrays.items()))


def _vectors(path: str, value: Any, depth: int) -> Iterator[tuple[str, np.ndarray]]:
    """Numeric vectors of a variable, those of single structs within it by their path."""
    if not isinstance(value, np.ndarray) or not depth:
        return
    if value.dtype.names is not None:
        if value.size == 1:
            for name in value.dtype.names:
                yield from _vectors(f"{path}.{name}", value[name].flat[0], depth - 1)
    elif (
        np.issubdtype(value.dtype, np.number) and value.size > 1 and max(value.shape) == value.size
    ):
        if np.iscomplexobj(value):
            yield f"{path}.real", value.real.ravel()
            yield f"{path}.imag", value.imag.ravel()
        else:
            yield path, value.ravel()


READER = Reader("mat", read, suffixes=(".mat",))
