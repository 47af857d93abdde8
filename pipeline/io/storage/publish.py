"""Writing results: whole or not at all, and the same bytes for the same content."""

from __future__ import annotations

import errno
import json
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any

from pipeline.records.errors import MachineError, UsageError
from pipeline.records.parse import whole

FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


def canonical_json(document: Any) -> bytes:
    """JSON with sorted keys, shortest round-trip numbers and a last newline: the same bytes each
    time.

    Parameters
    ----------
    document
        Plain data.

    Returns
    -------
    bytes
        UTF-8.

    Raises
    ------
    ValueError
        It holds NaN or infinity, which no output may.

    """
    text = json.dumps(document, sort_keys=True, indent=1, ensure_ascii=False, allow_nan=False)
    return (text + "\n").encode()


def write_whole(path: Path, content: bytes) -> None:
    """Writes a file under a temporary name, syncs and renames it, then syncs the folder.

    Parameters
    ----------
    path
        The file; its folder is made if need be.
    content
        Its bytes.

    Raises
    ------
    MachineError
        The disk refuses; the old content, if any, is untouched.

    """
    temporary = path.with_name(f".{path.name}.{os.getpid()}.partial")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_synced(temporary, content)
        temporary.replace(path)
        sync_folder(path.parent)
    except OSError:
        with suppress(OSError):
            temporary.unlink()
        with _refusals(path):
            raise


@contextmanager
def together(folder: Path) -> Iterator[Callable[[str, bytes], None]]:
    """Writes several files that get their names when all are on the disk, or never.

    Parameters
    ----------
    folder
        Where they are written.

    Yields
    ------
    callable
        `write(name, content)`. Files get their names in the order in which they were written, so
        that whoever finds the last one finds the others.

    Raises
    ------
    MachineError
        The disk refuses; old contents, if any, are untouched.

    """
    waiting: list[tuple[Path, Path]] = []

    def write(name: str, content: bytes) -> None:
        path = folder / name
        temporary = path.with_name(f".{path.name}.{os.getpid()}.partial")
        waiting.append((temporary, path))
        with _refusals(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            write_synced(temporary, content)

    try:
        yield write
        for temporary, path in waiting:
            with _refusals(path):
                temporary.replace(path)
        for parent in dict.fromkeys(path.parent for _, path in waiting):
            with _refusals(parent):
                sync_folder(parent)
    finally:
        for temporary, _ in waiting:
            with suppress(OSError):
                temporary.unlink()


@contextmanager
def _refusals(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise MachineError(
            f"cannot write {path.name} in {path.parent}: {error.strerror}", _remedy(error)
        ) from error


def output_folder(output: str) -> Path:
    """The output folder, made if need be; called before the work, so that none is lost.

    Parameters
    ----------
    output
        As the user wrote it.

    Raises
    ------
    UsageError
        Nothing can be written there.
    MachineError
        The disk is full.

    """
    folder, remedy = Path(output), "name a folder to write to, output=DIR"
    if folder.exists() and not folder.is_dir():
        raise UsageError(f"output={output} is a file", remedy)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with TemporaryFile(dir=folder):
            return folder
    except OSError as error:
        message = f"output={output} cannot be written: {error.strerror}"
        if error.errno in FULL:
            raise MachineError(message, _remedy(error)) from error
        raise UsageError(message, remedy) from error


def partial_owner(path: Path) -> int | None:
    """The process that was writing a file of a temporary name.

    Parameters
    ----------
    path
        The file.

    Returns
    -------
    int or None
        None where the name is no such name.

    """
    words = path.name.split(".")
    return whole(words[-2], 1, 2**31 - 1) if words[-1] == "partial" else None


def _remedy(error: OSError) -> str:
    if error.errno in FULL:
        return "free the disk and run again"
    return "name an output folder that can be written"


def write_synced(path: Path, content: bytes) -> None:
    """Writes a file and waits until the disk has it; its name in the folder may still be lost.

    Parameters
    ----------
    path
        The file.
    content
        Its bytes.

    """
    with path.open("wb") as stream:
        stream.write(content)
        stream.flush()
        os.fsync(stream.fileno())


def sync_folder(folder: Path) -> None:
    """Makes renames in a folder survive a power cut.

    Parameters
    ----------
    folder
        The folder.

    """
    sync_file(folder)


def sync_file(path: Path) -> None:
    """Makes the content of a file that another library wrote survive a power cut.

    Parameters
    ----------
    path
        The file.

    """
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
