"""Which message is at fault, where a decoder has refused a batch of them."""

from __future__ import annotations

from collections.abc import Callable

from pipeline.io.mcap.messages import Batch
from pipeline.records.errors import CaptureError

NANOSECOND_S = 1e-9


def of_first_message(
    fault: CaptureError, batch: Batch, decode: Callable[[Batch], object], before: int, first_ns: int
) -> CaptureError:
    """The fault of the first message that is refused, with its number and time.

    Parameters
    ----------
    fault
        Of the batch.
    batch
        Messages [n] of one stream that cannot be decoded together.
    decode
        Decodes messages, or raises CaptureError.
    before
        Messages of the stream before this batch.
    first_ns
        Log time of the file's first message [ns].

    Returns
    -------
    CaptureError
        `rows` is the message's number in its stream, from 0.

    """
    sound, refused = 0, batch.start.size
    while refused - sound > 1:
        middle = (sound + refused) // 2
        try:
            decode(batch.rows(slice(middle)))
        except CaptureError as earlier:
            refused, fault = middle, earlier
        else:
            sound = middle
    number = before + sound
    seconds = (int(batch.log_time[sound]) - first_ns) * NANOSECOND_S
    message = f"{fault.message} (message {number}, {seconds:.9g} s after the first of the file)"
    return CaptureError(fault.code, message, fault.remedy, (number, number))
