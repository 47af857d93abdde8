"""ASAM MDF 4 (and 3): a table a channel group, its master channel as `time`; needs asammdf."""

from __future__ import annotations

import io

import numpy as np

from pipeline.io.tables.foreign import Reader, library
from pipeline.io.tables.raw_table import RawTable
from pipeline.records.errors import CaptureError

MARK = b"MDF"
REMEDY = "export it again as MDF 4.10"


def read(data: bytes) -> tuple[RawTable, ...]:
    """Tables of physical values of an ASAM measurement file.

    Parameters
    ----------
    data
        Bytes of the file: MDF 3 or 4.

    Returns
    -------
    tuple of RawTable
        One a channel group: its master channel as `time` [s], then the numeric channels with the
        units that the file states. A channel whose name is there twice in a group counts once.

    Raises
    ------
    CaptureError
        It is no MDF file (`not_mdf`), or asammdf is missing (`missing_library`).

    References
    ----------
    ASAM MDF, Measurement Data Format, version 4.2.

    """
    asammdf = library("asammdf", "mdf")
    if not data.startswith(MARK):
        raise CaptureError("not_mdf", "it does not begin as an MDF file", REMEDY)
    groups = []
    try:
        with asammdf.MDF(io.BytesIO(data)) as file:
            for number, group in enumerate(file.virtual_groups):
                fields: dict[str, np.ndarray] = {}
                units: dict[str, str] = {}
                for signal in file.select(
                    [
                        (None, g, c)
                        for g, cs in file.included_channels(group)[group].items()
                        for c in cs
                    ]
                ):
                    values = np.asarray(signal.samples)
                    if values.ndim == 1 and np.issubdtype(values.dtype, np.number):
                        fields.setdefault("time", np.asarray(signal.timestamps))
                        fields.setdefault(signal.name, values)
                        units.setdefault(signal.name, signal.unit or "")
                if fields:
                    stated = tuple((name, unit) for name, unit in units.items() if unit)
                    groups.append(
                        RawTable(f"group {number}", fields, units=(("time", "s"), *stated))
                    )
    except CaptureError:
        raise
    except Exception as fault:
        raise CaptureError("not_mdf", f"it is no MDF file: {fault}", REMEDY) from fault
    return tuple(groups)


READER = Reader("mdf4", read, suffixes=(".mf4", ".mdf"))
