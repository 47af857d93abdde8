"""Errors a user can act on; each carries what happened and what to do about it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from difflib import get_close_matches

MOST_CHARS = 1500
"""Most characters of a message on one file, which may quote it."""


class PipelineError(Exception):
    """Base of every error this project raises on purpose; `exit_code` is the command's, `file` the
    path of the file that it is about, where it ends a command.
    """

    exit_code = 5
    file: str | None = None

    def __init__(self, message: str, remedy: str = "") -> None:
        super().__init__(message)
        self.message = message
        self.remedy = remedy

    def __str__(self) -> str:
        return f"{self.message}; {self.remedy}" if self.remedy else self.message


class UsageError(PipelineError):
    """A wrong command, key or configuration file."""

    exit_code = 2


def meant(typed: str, known: Iterable[str]) -> str:
    """A remedy for a name that there is not: the nearest one, and all.

    Parameters
    ----------
    typed
        What the user wrote.
    known
        The names that there are.

    Returns
    -------
    str
        `did you mean X? known are ...`, without the question where none is near.

    """
    names = list(known)
    near = get_close_matches(typed, names, 1)
    shown = f"known are {', '.join(names)}" if names else "there is none"
    return f"did you mean {near[0]}? {shown}" if near else shown


class MachineError(PipelineError):
    """The disk, a worker or the operating system failed."""

    exit_code = 5


class CaptureError(PipelineError):
    """One capture cannot be used; the rest of the batch goes on.

    Parameters
    ----------
    code
        Short stable identifier, such as `truncated` or `missing_column`.
    message
        What is wrong; what is longer than `MOST_CHARS` is cut.
    remedy
        What the user can do about it.
    rows
        First and last offending row counted from 0; None where the fault is not in rows.

    """

    exit_code = 3

    def __init__(
        self, code: str, message: str, remedy: str, rows: tuple[int, int] | None = None
    ) -> None:
        if len(message) > MOST_CHARS:
            message = message[: MOST_CHARS - 4] + " ..."
        super().__init__(message, remedy)
        self.code = code
        self.rows = rows

    def __reduce__(self) -> tuple[type[CaptureError], tuple[object, ...]]:
        """Cross a process border with every field (exceptions pickle their `args` only)."""
        return type(self), (self.code, self.message, self.remedy, self.rows)


class RecordingError(PipelineError):
    """A recording for the viewer cannot be verified; it is refused as a capture would be."""

    exit_code = 3


def merged(faults: Sequence[CaptureError]) -> CaptureError:
    """One error that reports several faults of a capture.

    Parameters
    ----------
    faults
        At least one; the first gives code, rows and remedy.

    Returns
    -------
    CaptureError
        The further faults stand in its message, each with code, rows and remedy; a remedy that is
        the first one's is not repeated.

    """
    first, rest = faults[0], faults[1:]
    others = "".join(f"; also {_beside(fault, first.remedy)}" for fault in rest)
    return CaptureError(first.code, first.message + others, first.remedy, first.rows)


def _beside(fault: CaptureError, remedy: str) -> str:
    more = [] if fault.rows is None else [f"rows {fault.rows[0]}-{fault.rows[1]}"]
    more += [fault.remedy] if fault.remedy != remedy else []
    return f"[{fault.code}] {fault.message}" + (f" ({'; '.join(more)})" if more else "")
