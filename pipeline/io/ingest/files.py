"""Which files a folder holds, and their bytes: only regular files inside the folder are opened.

Files are read whole and not mapped: the hash is of exactly the bytes that are decoded, and a file
that shrinks under a map would end the process.
"""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from pipeline.io.mcap.limits import MAX_FILE_BYTES
from pipeline.records.errors import CaptureError, MachineError, UsageError
from pipeline.records.finding import Finding
from pipeline.records.naming import printable

_REMEDIES = {
    errno.EACCES: "check its permissions",
    errno.EPERM: "check its permissions",
    errno.ENOENT: "put it back, or run again",
    errno.ELOOP: "remove the link",
}


@dataclass(frozen=True, slots=True)
class Listing:
    """Relative paths with forward slashes, sorted; and the names that cannot be used."""

    paths: tuple[str, ...]
    findings: tuple[Finding, ...]


def input_folder(name: str) -> Path:
    """The folder of captures.

    Parameters
    ----------
    name
        As the user wrote it.

    Raises
    ------
    UsageError
        It is no folder.

    """
    if not Path(name).is_dir():
        raise UsageError(f"input={name} is no folder", "name the folder of captures")
    return Path(name)


def list_files(folder: Path) -> Listing:
    """All regular files below a folder.

    Parameters
    ----------
    folder
        The folder; hidden files and folders in it are left out.

    Returns
    -------
    Listing
        Relative paths, sorted. What cannot be used, such as a link that leaves the folder or a
        subfolder that cannot be listed, is a finding.

    Raises
    ------
    UsageError
        There is no such folder.
    MachineError
        The folder itself cannot be listed.

    """
    if not folder.is_dir():
        raise UsageError(f"there is no folder {folder}", "give input= a folder of captures")
    paths: list[str] = []
    findings: list[Finding] = []
    root = folder.resolve()

    def unreadable(fault: OSError) -> None:
        findings.append(_not_listed(folder, fault))

    for where, folders, names in os.walk(folder, onerror=unreadable):
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        links = [name for name in folders if _is_link(Path(where, name))]
        for name in sorted(names) + links:
            if name.startswith("."):
                continue
            path = Path(where, name)
            relative = path.relative_to(folder).as_posix()
            fault = _fault(path, root, relative)
            if fault is not None:
                findings.append(Finding.refusal(printable(relative), fault))
            elif name not in links:
                paths.append(relative)
    return Listing(tuple(sorted(paths)), tuple(sorted(findings, key=lambda f: f.file)))


def _is_link(path: Path) -> bool:
    """Whether it is a symbolic link; False where the system is silent, which `_fault` says."""
    try:
        return path.is_symlink()
    except OSError:
        return False


def _not_listed(folder: Path, fault: OSError) -> Finding:
    """The finding for a folder below; raises MachineError where it is the folder itself."""
    if fault.filename is None or Path(fault.filename) == folder:
        words = f"a folder cannot be listed: {fault}"
        raise MachineError(words, "check its permissions") from fault
    name = Path(fault.filename).relative_to(folder).as_posix()
    words = f"the folder cannot be listed, so nothing in it is used: {fault.strerror}"
    error = CaptureError("unreadable", words, "check its permissions")
    return Finding.refusal(printable(name), error)


def _fault(path: Path, root: Path, relative: str) -> CaptureError | None:
    """Why a directory entry cannot be used, or None."""
    if printable(relative) != relative:
        return CaptureError(
            "file_name", "the name holds bytes that are no printable text", "rename the file"
        )
    try:
        if path.is_symlink() and not path.resolve(strict=True).is_relative_to(root):
            return CaptureError(
                "not_a_file", "it is a link to outside the folder", "copy the file itself here"
            )
        mode = path.stat().st_mode
    except PermissionError as fault:
        words = f"it cannot be read: {fault.strerror}"
        return CaptureError("unreadable", words, "check the permissions of its folder")
    except (OSError, RuntimeError):
        return CaptureError("not_a_file", "it is a link to nothing", "remove it")
    if stat.S_ISREG(mode) or stat.S_ISDIR(mode):
        return None
    return CaptureError(
        "not_a_file", "it is a pipe, socket or device and no file", "save the data to a file"
    )


def size_bytes(path: Path) -> int:
    """The size of a file.

    Parameters
    ----------
    path
        The file.

    Returns
    -------
    int
        In bytes; 0 where it is gone, which reading it will report.

    """
    try:
        return path.stat().st_size
    except OSError:
        return 0


def read_whole(path: Path, most_bytes: int = MAX_FILE_BYTES) -> bytes:
    """All bytes of a regular file.

    Parameters
    ----------
    path
        The file.
    most_bytes
        Largest size that is read.

    Raises
    ------
    CaptureError
        It is no regular file, is larger, or cannot be read.

    """
    with _opened(path) as stream:
        size = os.fstat(stream.fileno()).st_size
        if size > most_bytes:
            words = f"the file has {size} bytes, where {most_bytes} are the most"
            raise CaptureError("limit", words, "split it")
        try:
            return stream.read(size)
        except OSError as fault:
            raise _not_readable(fault) from None


def read_head(path: Path, count: int) -> bytes:
    """The first bytes of a regular file.

    Parameters
    ----------
    path
        The file.
    count
        How many at most.

    Raises
    ------
    CaptureError
        It is no regular file, or cannot be read.

    """
    with _opened(path) as stream:
        try:
            return stream.read(count)
        except OSError as fault:
            raise _not_readable(fault) from None


@contextmanager
def _opened(path: Path) -> Iterator[BinaryIO]:
    """A regular file, opened so that a pipe that took its place cannot block."""
    try:
        handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0))
    except OSError as fault:
        raise _not_readable(fault) from None
    with os.fdopen(handle, "rb") as stream:
        if not stat.S_ISREG(os.fstat(stream.fileno()).st_mode):
            raise CaptureError("not_a_file", "it is no regular file", "save the data to a file")
        yield stream


def _not_readable(fault: OSError) -> CaptureError:
    remedy = _REMEDIES.get(fault.errno or 0, "check the disk")
    return CaptureError("unreadable", f"it cannot be read: {fault.strerror}", remedy)
