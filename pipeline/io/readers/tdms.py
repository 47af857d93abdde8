"""NI TDMS: a table a group, fields `group/channel` and the group's `time`; needs npTDMS.

The time of a waveform is `wf_start_offset + n wf_increment` [s] of its channel.
"""

from __future__ import annotations

import io
from typing import Any

import numpy as np

from pipeline.io.tables.foreign import Reader, library
from pipeline.io.tables.raw_table import RawTable
from pipeline.records.errors import CaptureError


def read(data: bytes) -> tuple[RawTable, ...]:
    """Tables by group and length; raises CaptureError for what is no TDMS file."""
    nptdms = library("nptdms", "tdms")
    found: dict[tuple[str, int, float], dict[str, np.ndarray]] = {}
    try:
        file = nptdms.TdmsFile.read(io.BytesIO(data))
        for group in file.groups():
            for channel in group.channels():
                values = np.asarray(channel[:])
                if not np.issubdtype(values.dtype, np.number) or not values.size:
                    continue
                step = float(channel.properties.get("wf_increment", 0.0))
                fields = found.setdefault((group.name, values.size, step), {})
                fields[f"{group.name}/{channel.name}"] = values
                if step > 0.0:
                    fields[f"{group.name}/time"] = _time(channel, values.size, step)
    except Exception as fault:
        raise CaptureError("not_tdms", f"it is no TDMS file: {fault}", "write it anew") from fault
    return tuple(RawTable(group, fields) for (group, _, _), fields in sorted(found.items()))


def _time(channel: Any, size: int, step_s: float) -> np.ndarray:
    start = float(channel.properties.get("wf_start_offset", 0.0))
    return np.asarray(start + step_s * np.arange(size))


READER = Reader("tdms", read, suffixes=(".tdms",))
