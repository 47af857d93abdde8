"""Fields of many batches put together as they come: each value goes to its last place once."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.io.mcap.leaf import Leaf
from pipeline.records.errors import CaptureError

_SLACK = 1.05


class Column:
    """One field of a stream. Room that was not needed is never touched, so it costs no memory."""

    def __init__(self, name: str, topic: str) -> None:
        self.name = name
        self.topic = topic
        self.array: bool | None = None
        self._buffer: NDArray[Any] = np.empty(0)
        self._size = 0
        self._dtype: np.dtype[Any] | None = None
        self._counts: list[NDArray[np.int64]] = []

    def add(self, leaf: Leaf, batches: int) -> None:
        """Takes a batch's values.

        Parameters
        ----------
        leaf
            Of the batch.
        batches
            How many of them may come in all.

        Raises
        ------
        CaptureError
            The field is a number in one message and an array in another (`bad_message`).

        """
        array = leaf.counts is not None
        if self.array not in (None, array):
            raise CaptureError(
                "bad_message",
                f"the field {self.name!r} of {self.topic} is a number here and an array there",
                "write one sample, or one block, in every message",
            )
        self.array = array
        if leaf.counts is not None:
            self._counts.append(leaf.counts)
        self._append(leaf.values, batches)

    def skip(self, messages: int) -> None:
        """Takes in messages that do not hold the field: NaN, or no items.

        Parameters
        ----------
        messages
            How many.

        """
        if self.array:
            self._counts.append(np.zeros(messages, np.int64))
            self._append(np.empty(0), 1)
        else:
            self._append(np.full(messages, np.nan), 1)

    def _append(self, values: NDArray[Any], batches: int) -> None:
        stop = self._size + values.size
        dtype = values.dtype.newbyteorder("=")
        if self._dtype is not None:
            dtype = np.result_type(self._dtype, dtype)
        if dtype != self._dtype or stop > self._buffer.size:
            capacity = max(int(_SLACK * values.size * batches), 2 * self._size, stop)
            moved = np.empty(capacity, dtype)
            moved[: self._size] = self._buffer[: self._size]
            self._buffer, self._dtype = moved, dtype
        self._buffer[self._size : stop].reshape(values.shape)[...] = values
        self._size = stop

    def whole(self) -> Leaf:
        """All that was taken."""
        counts = np.concatenate(self._counts) if self.array else None
        return Leaf(self._buffer[: self._size], counts)


class Gathered:
    """The fields of one stream over all batches so far, and the log times of its messages [ns]."""

    def __init__(self, topic: str) -> None:
        self.topic = topic
        self.messages = 0
        self._columns: dict[str, Column] = {}
        self._times = Column("log_time", topic)

    def add(self, leaves: dict[str, Leaf], times: NDArray[np.uint64], batches: int) -> None:
        """Takes in one batch of messages.

        Parameters
        ----------
        leaves
            Its fields by name.
        times
            Log times of its messages [ns].
        batches
            How many batches may come in all, to reserve room.

        """
        for name, leaf in leaves.items():
            if name not in self._columns:
                column = Column(name, self.topic)
                column.array = leaf.counts is not None
                if self.messages:
                    column.skip(self.messages)
                self._columns[name] = column
            self._columns[name].add(leaf, batches)
        for name in self._columns.keys() - leaves.keys():
            self._columns[name].skip(times.size)
        self._times.add(Leaf(times), batches)
        self.messages += times.size

    def leaves(self) -> dict[str, Leaf]:
        """Every field that some batch held, NaN or empty where a batch did not."""
        return {name: column.whole() for name, column in self._columns.items()}

    def log_time(self) -> NDArray[np.uint64]:
        """Log times [messages] in ns."""
        return self._times.whole().values
