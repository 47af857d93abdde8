"""What every reader hands on: named arrays of one clock, before units, signs and glossary names."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

_STAMPS = (("sec", "nanosec"), ("secs", "nsecs"), ("sec", "nsec"), ("seconds", "nanos"))
"""Whole seconds and nanoseconds: of ROS 2, of ROS 1, of Foxglove and of protobuf."""


def is_of_stamp(name: str) -> bool:
    """Whether a field may be a part of the time that a sender wrote into a message.

    Parameters
    ----------
    name
        Such as `header.stamp.nanosec`.

    """
    return any(name.rpartition(".")[2] in pair for pair in _STAMPS)


@dataclass(frozen=True, slots=True)
class RawTable:
    """What a reader hands on: named arrays of one clock, before units, signs and glossary names.

    Attributes
    ----------
    name
        Of the table or topic.
    fields
        Columns by their own names [rows].
    log_ns
        Log clock from the capture's first message on [messages]; None where the file has none.
    blocks
        Whether messages are blocks of rows.
    joint_state
        Whether it is a ROS JointState.
    units
        What a units row stated, by field.
    rows_each
        Rows of each message [messages]; None for one.

    """

    name: str
    fields: dict[str, NDArray[Any]]
    log_ns: NDArray[np.uint64] | None = None
    blocks: bool = False
    joint_state: bool = False
    units: tuple[tuple[str, str], ...] = ()
    rows_each: NDArray[np.int64] | None = None

    @property
    def log_time_ns(self) -> NDArray[np.uint64] | None:
        """Log clock [rows], which rows of one message share."""
        if self.log_ns is None or self.rows_each is None:
            return self.log_ns
        return np.repeat(self.log_ns, self.rows_each)

    @property
    def stamp_fields(self) -> tuple[str, str] | None:
        """Fields of the seconds and nanoseconds of the sender's time, the first ones of several."""
        for name in self.fields:
            stem, dot, last = name.rpartition(".")
            for seconds, nanoseconds in _STAMPS:
                other = f"{stem}{dot}{nanoseconds}"
                if last == seconds and other in self.fields:
                    return name, other
        return None

    @property
    def stamp_ns(self) -> NDArray[np.int64] | None:
        """Time by the sender's stamps, of its own epoch [rows]; None where there is none."""
        if self.stamp_fields is None:
            return None
        seconds, nanoseconds = (self.fields[one].astype(np.int64) for one in self.stamp_fields)
        whole: NDArray[np.int64] = 1_000_000_000 * seconds + nanoseconds
        return whole

    @property
    def rows(self) -> int:
        """How many rows there are."""
        return next((int(values.size) for values in self.fields.values()), 0)
