"""A line on the terminal that says what a command is at and for how long; silent elsewhere."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TextIO

AFTER_S = 0.3
"""A command that is done sooner shows no line."""
EVERY_S = 0.2
_CLEAR = "\r\x1b[K"


@dataclass(slots=True)
class Waiting:
    """The line; `say` changes what stands in it."""

    label: str
    stream: TextIO
    started_s: float = field(default_factory=time.monotonic)

    def say(self, label: str) -> None:
        """From now on the line says `label`.

        Parameters
        ----------
        label
            What is going on, in a few words.

        """
        self.label = label

    def _show(self, ended: threading.Event) -> None:
        if ended.wait(AFTER_S):
            return
        while True:
            elapsed = time.monotonic() - self.started_s
            self.stream.write(f"{_CLEAR}{self.label}, {elapsed:.0f} s")
            self.stream.flush()
            if ended.wait(EVERY_S):
                break
        self.stream.write(_CLEAR)
        self.stream.flush()


@contextmanager
def waiting(label: str, stream: TextIO | None = None) -> Iterator[Waiting]:
    """Shows `label` and the seconds since the start on a terminal, until the block ends.

    Nothing is shown without a label, or where `stream` (standard error) is no terminal.

    Parameters
    ----------
    label
        What is going on, in a few words.
    stream
        Where the line is shown; None for standard error.

    """
    stream = sys.stderr if stream is None else stream
    line, ended = Waiting(label, stream), threading.Event()
    if not label or not stream.isatty():
        yield line
        return
    thread = threading.Thread(target=line._show, args=(ended,), daemon=True)
    thread.start()
    try:
        yield line
    finally:
        ended.set()
        thread.join()
