"""Numeric datasets of an HDF5 file as raw tables; shared by HDF5 and MATLAB 7.3."""

from __future__ import annotations

import io
from typing import Any

import numpy as np

from pipeline.io.tables.foreign import library
from pipeline.io.tables.raw_table import RawTable
from pipeline.records.errors import CaptureError

MOST_BYTES = 1 << 30


def tables(data: bytes, form: str) -> tuple[RawTable, ...]:
    """Numeric vectors of an HDF5 file by their path.

    Parameters
    ----------
    data
        Bytes of the file.
    form
        Name of the file's form, for the code of a refusal.

    Returns
    -------
    tuple of RawTable
        One for each length of vectors in a group. A dataset of one dimension is a field, so is a
        matrix of one row or one column; of a table with named columns each numeric column is one.
        Units are those of the attribute `units` or `unit`.

    Raises
    ------
    CaptureError
        It is no HDF5 file (`not_FORM`), it unpacks to more than 1 GiB (`limit`), or h5py is missing
        (`missing_library`).

    Notes
    -----
    Links to other files are not followed: the file is not trusted.

    References
    ----------
    The HDF Group, HDF5 File Format Specification, version 3.0.

    """
    h5py = library("h5py", "hdf5")
    tables_by_group: dict[tuple[str, int], dict[str, np.ndarray]] = {}
    units: dict[str, str] = {}
    try:
        with h5py.File(io.BytesIO(data), "r") as file:
            datasets = _datasets(h5py, file)
            if sum(one.size * one.dtype.itemsize for one in datasets.values()) > MOST_BYTES:
                raise CaptureError("limit", "it unpacks to more than 1 GiB", "split it")
            for path, one in datasets.items():
                for name, values in _vectors(path, one).items():
                    group = path.rpartition("/")[0]
                    tables_by_group.setdefault((group, values.size), {})[name] = values
                    units[name] = _unit(one)
    except (OSError, ValueError, KeyError, RuntimeError, TypeError) as fault:
        raise CaptureError(
            f"not_{form}", f"it cannot be read as HDF5: {fault}", "write it anew"
        ) from fault
    return tuple(
        RawTable(group or form, fields, units=tuple((n, units[n]) for n in fields if units[n]))
        for (group, _), fields in sorted(tables_by_group.items())
    )


def _unit(one: Any) -> str:
    """The unit that a dataset's attribute `units` or `unit` states, or nothing."""
    for key in ("units", "unit"):
        stated = one.attrs.get(key)
        if isinstance(stated, bytes | str):
            return stated.decode("utf-8", "replace") if isinstance(stated, bytes) else stated
    return ""


def _datasets(h5py: Any, file: Any) -> dict[str, Any]:
    """Datasets by path; `visititems` follows no soft or external link."""
    datasets: dict[str, Any] = {}

    def keep(path: str, one: Any) -> None:
        if isinstance(one, h5py.Dataset) and not path.startswith("#refs#"):
            datasets[path] = one

    file.visititems(keep)
    return datasets


def _vectors(path: str, one: Any) -> dict[str, np.ndarray]:
    """The numeric vectors of a dataset by name; empty for texts, references and whole tables."""
    if one.dtype.names is not None:
        numeric = [n for n in one.dtype.names if np.issubdtype(one.dtype[n], np.number)]
        return {f"{path}/{name}": np.ravel(one[name]) for name in numeric}
    vector = one.ndim > 0 and max(one.shape, default=0) == one.size > 0
    if not vector or not np.issubdtype(one.dtype, np.number):
        return {}
    return {path: np.ravel(one[()])}
