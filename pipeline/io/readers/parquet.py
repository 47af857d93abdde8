"""Apache Parquet: every numeric column is a field, an instant one in seconds from the first."""

from __future__ import annotations

import io

import numpy as np
import polars as pl

from pipeline.io.tables.foreign import Reader
from pipeline.io.tables.raw_table import RawTable
from pipeline.records.errors import CaptureError

NANOSECOND_S = 1e-9


def read(data: bytes) -> tuple[RawTable, ...]:
    """Numeric columns of a Parquet file.

    Parameters
    ----------
    data
        Bytes of the file.

    Returns
    -------
    tuple of one RawTable
        An instant or a duration in seconds from the column's earliest; null is NaN; texts, lists
        and structs are left out.

    Raises
    ------
    CaptureError
        It is no Parquet file (`not_parquet`).

    References
    ----------
    Apache Parquet, file format, https://parquet.apache.org/docs/file-format/.

    """
    try:
        frame = pl.read_parquet(io.BytesIO(data))
    except (pl.exceptions.PolarsError, OSError, ValueError) as fault:
        raise CaptureError(
            "not_parquet", f"it is no Parquet file: {fault}", "write it anew"
        ) from fault
    columns = {name: _numbers(frame[name]) for name in frame.columns}
    fields = {name: values.to_numpy() for name, values in columns.items() if values is not None}
    return (RawTable("parquet", fields),)


def _numbers(column: pl.Series) -> pl.Series | None:
    """The column as numbers; None for one that holds none."""
    if isinstance(column.dtype, (pl.Datetime, pl.Duration)):
        count = column.dt.cast_time_unit("ns").to_physical()
        column = (count - count.min()).cast(pl.Float64) * NANOSECOND_S
    if not column.dtype.is_numeric():
        return None
    return column.cast(pl.Float64).fill_null(np.nan) if column.null_count() else column


READER = Reader("parquet", read, suffixes=(".parquet",))
