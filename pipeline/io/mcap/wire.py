"""Bounds-checked reading of the little-endian fields of MCAP records."""

from __future__ import annotations

import struct
from collections.abc import Iterator

from pipeline.io.mcap.limits import MAX_MAP_ENTRIES
from pipeline.records.errors import CaptureError
from pipeline.records.parse import ParseError, decoded

U16 = struct.Struct("<H")
U32 = struct.Struct("<I")
U64 = struct.Struct("<Q")
RECORD_AGAIN = "record the test again, or copy the file again from the bench"


def corrupt(message: str, rows: tuple[int, int] | None = None) -> CaptureError:
    """The refusal of bytes that contradict the format or a checksum.

    Parameters
    ----------
    message
        What is wrong.
    rows
        First and last row concerned.

    """
    return CaptureError("corrupt", message, RECORD_AGAIN, rows)


def truncated(message: str, rows: tuple[int, int] | None = None) -> CaptureError:
    """The refusal of a file that ends before its structure does.

    Parameters
    ----------
    message
        What is missing.
    rows
        First and last row concerned.

    """
    return CaptureError(
        "truncated",
        message,
        "copy the file again, or close the recorder properly and record again",
        rows,
    )


def too_large(message: str) -> CaptureError:
    """The refusal of a size that no bench produces.

    Parameters
    ----------
    message
        What is too large.

    """
    return CaptureError("limit", message, "record with chunks below 64 MiB, or split the file")


class Fields:
    """Reads the fields of one record in order; running past the end is a `CaptureError`."""

    __slots__ = ("data", "end", "position", "what")

    def __init__(self, data: bytes, start: int, end: int, what: str) -> None:
        self.data = data
        self.position = start
        self.end = end
        self.what = what

    def skip(self, count: int) -> int:
        """Moves over some bytes and returns where they begin.

        Parameters
        ----------
        count
            How many.

        Raises
        ------
        CaptureError
            They run past the end of the record.

        """
        begin = self.position
        if count > self.end - begin:
            raise corrupt(f"a length in {self.what} at byte {begin} runs past the record's end")
        self.position = begin + count
        return begin

    def u8(self) -> int:
        """Next byte."""
        return self.data[self.skip(1)]

    def u16(self) -> int:
        """Next unsigned 16-bit integer."""
        return int(U16.unpack_from(self.data, self.skip(2))[0])

    def u32(self) -> int:
        """Next unsigned 32-bit integer."""
        return int(U32.unpack_from(self.data, self.skip(4))[0])

    def u64(self) -> int:
        """Next unsigned 64-bit integer."""
        return int(U64.unpack_from(self.data, self.skip(8))[0])

    def span(self, length: int) -> tuple[int, int]:
        """Where the next bytes begin and end.

        Parameters
        ----------
        length
            How many.

        """
        begin = self.skip(length)
        return begin, begin + length

    def blob(self) -> bytes:
        """Bytes with a 32-bit length before them."""
        begin, end = self.span(self.u32())
        return bytes(self.data[begin:end])

    def text(self) -> str:
        """UTF-8 text with a 32-bit length before it."""
        try:
            return decoded(self.blob())
        except ParseError as fault:
            raise corrupt(f"text in {self.what} {fault}") from None

    def inner(self) -> Fields:
        """The fields of an array or map with a 32-bit byte length before it."""
        begin, end = self.span(self.u32())
        return Fields(self.data, begin, end, self.what)

    def text_map(self) -> dict[str, str]:
        """A map of text to text; a repeated key is corrupt."""
        texts: dict[str, str] = {}
        inner = self.inner()
        while inner.position < inner.end:
            key, value = inner.text(), inner.text()
            if key in texts:
                raise corrupt(f"{self.what} holds the key {key!r} twice")
            if len(texts) >= MAX_MAP_ENTRIES:
                raise too_large(f"{self.what} holds more than {MAX_MAP_ENTRIES} keys")
            texts[key] = value
        return texts

    def counts(self) -> Iterator[tuple[int, int]]:
        """Pairs of a 16-bit key and a 64-bit number, with a 32-bit byte length before them."""
        inner = self.inner()
        while inner.position < inner.end:
            yield inner.u16(), inner.u64()
