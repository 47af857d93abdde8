"""A lock between processes of one machine, for work that only one of them should do."""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


@contextmanager
def one_at_a_time(path: Path) -> Iterator[None]:
    """Waits until no other process is inside a block of the same file.

    The system ends the lock of a process that dies. Where there are no such locks, or the file
    cannot be written, nobody waits: the lock saves time, and no result depends on it.

    Parameters
    ----------
    path
        The file that is locked; it is there while somebody is inside.

    """
    try:
        fcntl = importlib.import_module("fcntl")
        path.parent.mkdir(parents=True, exist_ok=True)
        file = path.open("ab")
    except (ImportError, OSError):
        yield
        return
    with file:
        with suppress(OSError):
            fcntl.flock(file, fcntl.LOCK_EX)
        try:
            yield
        finally:
            with suppress(OSError):
                path.unlink()
