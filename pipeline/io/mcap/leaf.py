"""What a decoder hands out: one field of many messages, still with the field's own name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from pipeline.io.mcap.messages import Batch
from pipeline.io.mcap.walk import Integers, view_at_every_byte

Wanted = Callable[[str], bool]
"""Whether a field, by its dotted name, is worth decoding."""
_SLICES_FROM = 32
"""Numbers a run on average, from which on slices are faster than places."""


@dataclass(frozen=True, slots=True)
class Leaf:
    """Values of one field of many messages.

    Attributes
    ----------
    values
        In the order of messages; [messages, count] where all counts are equal. May be a view of the
        batch's buffer.
    counts
        Items of each message [messages]; None for scalars.
    places
        Whether it marks texts, whose values are where each begins and how long it is [n, 2].

    """

    values: NDArray[Any]
    counts: Integers | None = None
    places: bool = False


class Decoder(Protocol):
    """Decodes the payloads of one channel; raises CaptureError for payloads that do not fit."""

    def decode(self, batch: Batch, wanted: Wanted) -> dict[str, Leaf]:
        """Numeric fields by dotted name.

        Parameters
        ----------
        batch
            The messages.
        wanted
            Which fields are needed, by dotted name.

        """
        ...


def by_message(
    whose: Integers, values: NDArray[Any], messages: int, *, places: bool = False
) -> Leaf:
    """The items of an array field, put in message order.

    Parameters
    ----------
    whose
        Number of each item's message [items].
    values
        The items.
    messages
        How many messages there are.
    places
        Whether the items are places of strings.

    """
    if np.any(whose[1:] < whose[:-1]):
        order = np.argsort(whose, kind="stable")
        whose, values = whose[order], values[order]
    return Leaf(values, np.bincount(whose, minlength=messages).astype(np.int64), places)


def runs_of(buffer: bytes, dtype: str, start: Integers, count: Integers) -> NDArray[Any]:
    """The numbers of runs of bytes, one run after the other.

    Parameters
    ----------
    buffer
        All bytes.
    dtype
        Of the numbers.
    start
        First byte of each run [runs].
    count
        Numbers in each run [runs].

    """
    if count.sum() < _SLICES_FROM * max(count.size, 1):
        width = np.dtype(dtype).itemsize
        return view_at_every_byte(buffer, dtype)[spread(start, count, width)]
    runs = zip(count.tolist(), start.tolist(), strict=True)
    return np.concatenate([np.frombuffer(buffer, dtype, n, at) for n, at in runs if n])


def spread(start: Integers, count: Integers, width: int) -> Integers:
    """Byte positions of consecutive items.

    Parameters
    ----------
    start
        Where each run begins [n].
    count
        Items of each run [n].
    width
        Bytes an item.

    Returns
    -------
    array [sum of count]
        In the order of the runs.

    """
    total = int(count.sum())
    first = np.repeat(start - width * (np.cumsum(count) - count), count)
    return first + width * np.arange(total, dtype=np.int64)
