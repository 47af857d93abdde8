"""Limits around the reading of one untrusted file, and a progress file for the driver.

A file that drives a parser out of memory or into an endless loop must cost that one file. Memory
is bounded by the kernel (RLIMIT_DATA, Linux), time by a thread of C that needs no interpreter lock
and ends the process. The process writes what it is reading to its progress file, which the
driver reads after a crash.
"""

from __future__ import annotations

import faulthandler
import os
import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from pipeline.records.errors import CaptureError, PipelineError, UsageError
from pipeline.records.naming import printable

READER_FAILED = "reader_failed"
PANIC = "PanicException"
LONGEST_REASON = 200
_MB = 2**20
_TIMEOUT = b"Timeout"
LEAST_MB = 80
"""Memory without which the libraries can read no file, however small: their threads ask for 8 MB at
a time, and on a busy machine 68 were seen to be taken."""
MOST = 1e9
"""Seconds and megabytes beyond which the system counts no more."""


@dataclass(frozen=True, slots=True)
class ReadLimits:
    """What reading one file may take: `seconds` plus one a MB, `memory_mb` plus 16 times its size.

    A capture of numbers unpacks to some four times its packed size, and is held about three times
    while it is decoded.
    """

    seconds: float = 60.0
    memory_mb: int = 1024

    def __post_init__(self) -> None:
        """Refuses limits that no file could keep.

        Raises
        ------
        UsageError
            The time is not above zero, or the memory too little for any file.

        """
        if not 0.0 < self.seconds <= MOST:
            words = f"no time above 0 and up to {MOST:g} s"
            raise UsageError(f"read_seconds={self.seconds} is {words}", "60 is usual")
        if self.memory_mb < LEAST_MB:
            raise UsageError(
                f"read_memory_mb={self.memory_mb} is too little to read anything with",
                f"{LEAST_MB} at least; 1024 is usual",
            )
        if self.memory_mb > MOST:
            message = f"read_memory_mb={self.memory_mb} is more than there can be"
            raise UsageError(message, "1024 is usual")

    def time_s(self, size_bytes: int) -> float:
        """Longest time that reading a file may take.

        Parameters
        ----------
        size_bytes
            Size of the file.

        Returns
        -------
        float
            `seconds`, and one second a MB [s].

        """
        return self.seconds + size_bytes / _MB

    def memory_bytes(self, size_bytes: int) -> int:
        """Most memory that reading a file may take.

        Parameters
        ----------
        size_bytes
            Size of the file.

        Returns
        -------
        int
            `memory_mb`, and 16 times the size [bytes].

        """
        return self.memory_mb * _MB + 16 * size_bytes


@dataclass(slots=True)
class _Progress:
    """The progress file of this process, which names what it is reading; None outside a pool."""

    descriptor: int | None = None


_PROGRESS = _Progress()


@contextmanager
def progress_file(path: Path | None) -> Iterator[None]:
    """Writes to a file what is being read inside the block.

    Parameters
    ----------
    path
        The file; None writes none. A normal end removes it, so one that is left names what killed
        the process.

    """
    if path is None:
        yield
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    _PROGRESS.descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
    try:
        yield
    finally:
        os.close(_PROGRESS.descriptor)
        _PROGRESS.descriptor = None
        path.unlink(missing_ok=True)


@contextmanager
def reading(path: str, size_bytes: int, limits: ReadLimits) -> Iterator[None]:
    """Bounds the memory, and with a progress file the time, of reading one file inside the block.

    Parameters
    ----------
    path
        The file, as findings name it.
    size_bytes
        Its size.
    limits
        Time and memory.

    Raises
    ------
    CaptureError
        Python runs out of memory, or the bytes make a reader raise. Beyond the limits of the
        operating system the process ends.

    """
    progress = _PROGRESS.descriptor
    if sys.platform.startswith("linux"):
        _begin_libraries()
    if progress is not None:
        os.pwrite(progress, path.encode("utf-8", "surrogatepass") + b"\n", 0)
        os.lseek(progress, 0, os.SEEK_END)
        faulthandler.dump_traceback_later(limits.time_s(size_bytes), exit=True, file=progress)
    try:
        with _memory(limits.memory_bytes(size_bytes)), refusing():
            yield
    except MemoryError:
        most = limits.memory_bytes(size_bytes) // _MB
        raise CaptureError(
            "limit",
            f"reading it takes more than {most} MB of memory",
            "split the recording, or raise read_memory_mb",
        ) from None
    finally:
        if progress is not None:
            faulthandler.cancel_dump_traceback_later()
            os.ftruncate(progress, 0)
            os.lseek(progress, 0, os.SEEK_SET)


@contextmanager
def refusing(what: str = "its reader") -> Iterator[None]:
    """Turns what a reader raises on bytes that it was not made for into the refusal of the file.

    Parameters
    ----------
    what
        What was reading, for the message.

    Raises
    ------
    CaptureError
        In place of any error but the project's own, those of the operating system and interrupts.

    Notes
    -----
    Every conversion of `records.parse` reports itself what is wrong; this is the border behind
    them, so that one file costs itself and not its batch. The refusal names the error and its
    place, since it is a fault of the reader too.

    """
    try:
        yield
    except (PipelineError, OSError, MemoryError, KeyboardInterrupt, SystemExit, GeneratorExit):
        raise
    except BaseException as error:
        # Rust's libraries panic with a class that is no Exception
        if not isinstance(error, Exception) and type(error).__name__ != PANIC:
            raise
        raise _broken(what, error) from error


def _broken(what: str, error: BaseException) -> CaptureError:
    frames = traceback.extract_tb(error.__traceback__)
    place = f" in {Path(frames[-1].filename).name}, line {frames[-1].lineno}" if frames else ""
    reason = printable(str(error)[:LONGEST_REASON])
    return CaptureError(
        READER_FAILED,
        f"{what} broke on it: {type(error).__name__}{place}: {reason}",
        "leave the file out, and report it with this line",
    )


@contextmanager
def _memory(most_bytes: int) -> Iterator[None]:
    """At most so many bytes of private memory beyond what the process holds already (Linux)."""
    if not sys.platform.startswith("linux"):
        yield
        return
    import resource

    soft, hard = resource.getrlimit(resource.RLIMIT_DATA)
    pages = int(Path("/proc/self/statm").read_bytes().split()[5])
    limit = pages * resource.getpagesize() + most_bytes
    for stated in (soft, hard):
        limit = limit if stated == resource.RLIM_INFINITY else min(limit, stated)
    resource.setrlimit(resource.RLIMIT_DATA, (limit, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_DATA, (soft, hard))


@cache
def _begin_libraries() -> None:
    """Starts the threads that reading needs: one that cannot be started under the limit may leave
    the others waiting for it until the time is up, and their memory and time are no file's.
    """
    import polars as pl

    pl.read_csv(b"t_s\n0\n")


@dataclass(frozen=True, slots=True)
class CrashReport:
    """What a process was doing when it died: the file it was reading, and whether it timed out.

    `path` is None where it was reading none; `begun` False where it had not begun at all.
    """

    begun: bool
    path: str | None = None
    timed_out: bool = False


def crash_report(path: Path) -> CrashReport:
    """Reads and removes the progress file of a dead process.

    Parameters
    ----------
    path
        Its progress file.

    Returns
    -------
    CrashReport
        What it was reading; not begun where there is no such file.

    """
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        return CrashReport(begun=False)
    path.unlink(missing_ok=True)
    name, _, rest = content.partition(b"\n")
    if not name:
        return CrashReport(begun=True)
    return CrashReport(True, name.decode("utf-8", "surrogatepass"), rest.startswith(_TIMEOUT))


def died(reason: str) -> CaptureError:
    """The refusal of a file that kills whoever reads it.

    Parameters
    ----------
    reason
        How the process ended.

    """
    return CaptureError(
        "reader_died", reason, "leave the file out and report it; a sound recording does not do so"
    )
