"""NI TDMS: a table a group, fields `group/channel` and the group's `time`; needs npTDMS.

The time of a waveform is `wf_start_offset + n wf_increment` [s] of its channel.
"""

from __future__ import annotations

import io
import logging
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from pipeline.io.tables.foreign import Reader, library
from pipeline.io.tables.raw_table import RawTable
from pipeline.records.errors import CaptureError


def read(data: bytes) -> tuple[RawTable, ...]:
    """Tables of an NI TDMS file.

    Parameters
    ----------
    data
        Bytes of the file.

    Returns
    -------
    tuple of RawTable
        One a group, length of channels and sampling interval: fields `group/channel` with the
        units that `unit_string` states, and `group/time` [s] of waveforms, wf_start_offset +
        n wf_increment.

    Raises
    ------
    CaptureError
        It is no TDMS file (`not_tdms`), or one that is cut off (`truncated`), or npTDMS is missing
        (`missing_library`).

    References
    ----------
    NI, TDMS File Format Internal Structure.

    """
    nptdms = library("nptdms", "tdms")
    channels: dict[tuple[str, int, float], dict[str, np.ndarray]] = {}
    units: dict[str, str] = {}
    try:
        with _warnings_of("nptdms") as warnings:
            file = nptdms.TdmsFile.read(io.BytesIO(data))
        if warnings:
            raise _cut_off(file, warnings[0])
        for group in file.groups():
            for channel in group.channels():
                values = np.asarray(channel[:])
                if not np.issubdtype(values.dtype, np.number) or not values.size:
                    continue
                step = float(channel.properties.get("wf_increment", 0.0))
                fields = channels.setdefault((group.name, values.size, step), {})
                name = f"{group.name}/{channel.name}"
                fields[name] = values
                units[name] = str(channel.properties.get("unit_string", ""))
                if step > 0.0:
                    fields[f"{group.name}/time"] = _time(channel, values.size, step)
                    units[f"{group.name}/time"] = "s"
    except CaptureError:
        raise
    except Exception as fault:
        raise CaptureError("not_tdms", f"it is no TDMS file: {fault}", "write it anew") from fault
    return tuple(
        RawTable(group, fields, units=tuple((n, units[n]) for n in fields if units[n]))
        for (group, _, _), fields in sorted(channels.items())
    )


def _cut_off(file: Any, warning: str) -> CaptureError:
    """What is said of a file that ends early: how many samples of each channel there are."""
    channels = [channel for group in file.groups() for channel in group.channels()]
    whole = min((len(channel) for channel in channels), default=0)
    step = max((float(c.properties.get("wf_increment", 0.0)) for c in channels), default=0.0)
    time = f", {whole * step:.9g} s" if step > 0.0 else ""
    words = f"it is cut off: {whole} samples of each channel are whole{time} ({warning})"
    remedy = "copy it again, once the recording has ended"
    return CaptureError("truncated", words, remedy, (whole, whole))


@contextmanager
def _warnings_of(name: str) -> Iterator[list[str]]:
    """What a library logs as a warning meanwhile, which for a file that is cut off is all it does.

    npTDMS reads such a file as far as it goes.
    """
    warnings: list[str] = []

    class Keeper(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            warnings.append(record.getMessage())

    logger, keeper = logging.getLogger(name), Keeper(logging.WARNING)
    children = [one for one in logging.root.manager.loggerDict if one.startswith(f"{name}.")]
    loggers = [logger, *map(logging.getLogger, children)]
    before = [(one.propagate, list(one.handlers)) for one in loggers]
    for one in loggers:
        one.propagate, one.handlers = False, [keeper]
    try:
        yield warnings
    finally:
        for one, (propagate, handlers) in zip(loggers, before, strict=True):
            one.propagate, one.handlers = propagate, handlers


def _time(channel: Any, size: int, step_s: float) -> np.ndarray:
    start = float(channel.properties.get("wf_start_offset", 0.0))
    return np.asarray(start + step_s * np.arange(size))


READER = Reader("tdms", read, suffixes=(".tdms",))
