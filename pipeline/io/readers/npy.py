"""One numpy array: a structured one has named fields, the columns of a plain one are `0`, `1`..."""

from __future__ import annotations

import io

import numpy as np

from pipeline.io.readers.npz import BROKEN
from pipeline.io.tables.foreign import Reader
from pipeline.io.tables.raw_table import RawTable
from pipeline.records.errors import CaptureError

REMEDY = "save it with numpy.save, a row a sample"


def read(data: bytes) -> tuple[RawTable, ...]:
    """One numpy array as a table.

    Parameters
    ----------
    data
        Bytes of the file; objects are never unpickled.

    Returns
    -------
    tuple of one RawTable
        Numeric fields of a structured array, or columns `0`, `1`, ... of one with one or two
        dimensions, a row a sample.

    Raises
    ------
    CaptureError
        It is no numpy array of plain numbers (`not_npy`), or none that is a table (`not_a_table`).

    References
    ----------
    NumPy Enhancement Proposal 1, A simple file format for NumPy arrays.

    """
    try:
        array = np.load(io.BytesIO(data), allow_pickle=False)
    except BROKEN as fault:
        raise CaptureError("not_npy", f"it is no numpy array: {fault}", REMEDY) from fault
    if not isinstance(array, np.ndarray):
        raise CaptureError("not_npy", "it holds several arrays", "map it with `reader: npz`")
    if array.dtype.names is not None and array.ndim == 1:
        names = [n for n in array.dtype.names if np.issubdtype(array.dtype[n], np.number)]
        return (RawTable("npy", {name: array[name] for name in names}),)
    if not np.issubdtype(array.dtype, np.number) or array.ndim not in (1, 2):
        shape = f"an array of {array.dtype} with {array.ndim} dimensions"
        raise CaptureError("not_a_table", f"it is {shape}, no table", REMEDY)
    columns = array.reshape(array.shape[0], -1)
    return (RawTable("npy", {str(n): columns[:, n] for n in range(columns.shape[1])}),)


READER = Reader("npy", read, suffixes=(".npy",))
