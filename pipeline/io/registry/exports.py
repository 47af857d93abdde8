"""One immutable JSON file a datasheet version, beside the registry's table.

`_versions/MOTOR/VERSION.json`: a folder that Delta's own clean-up passes over, because its name
begins with an underscore. A file is written whole under a pending name before the commit and takes
its name after it. So a file without a row means that the table lost one, and a row without a file
is either an interrupted writer's, whose pending file is there, or a lost file.
"""

from __future__ import annotations

import hashlib
import re
import threading
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from typing import Any

from pipeline.io.storage.identity import Identity, identity
from pipeline.io.storage.publish import sync_folder, write_synced
from pipeline.records.errors import MachineError
from pipeline.records.naming import file_stem

FOLDER = "_versions"
PENDING = ".pending"
AT_ONCE = 8
TREE = re.compile("\x1b\\[[0-9;]*m|\u21b3")
LONGEST_REASON = 160
Key = tuple[str, str]


class Exports:
    """The files of a registry in a folder or at an object-store URL."""

    def __init__(self, place: str, options: Mapping[str, str] | None = None) -> None:
        self.place = place
        self.options = dict(options or {})
        self.folder = None if "://" in place else Path(place)

    def prepare_all(self, contents: Mapping[Key, bytes]) -> None:
        """Writes contents under pending names; an object store needs no such step.

        Parameters
        ----------
        contents
            Bytes of each version.

        """
        if self.folder is not None and contents:
            owner = threading.get_native_id()
            _each(lambda key: self._prepare(key, contents[key], owner), contents)

    def settle_all(self, contents: Mapping[Key, bytes]) -> None:
        """Gives versions their files, unless they are there: each is written once, never again.

        What other writers have pending of such a version goes, be they interrupted or not.

        Parameters
        ----------
        contents
            Bytes of each version.

        """
        owner = threading.get_native_id()
        _each(lambda key: self._settle(key, contents[key], owner), contents)

    def _prepare(self, key: Key, content: bytes, owner: int) -> None:
        pending = self._pending(key, owner)
        try:
            new = not pending.parent.is_dir()
            pending.parent.mkdir(parents=True, exist_ok=True)
            write_synced(pending, content)
            if new:
                sync_folder(pending.parent.parent)
        except OSError as error:
            with suppress(OSError):
                pending.unlink()
            raise _failure(self.place, error) from error

    def _settle(self, key: Key, content: bytes, owner: int) -> None:
        try:
            if self.folder is None:
                if self.read(key) is None:
                    self._put(key, content)
                return
            final, pending = self.folder / place_of(key), self._pending(key, owner)
            if not final.exists():
                if not pending.exists():
                    self._prepare(key, content, owner)
                try:
                    pending.replace(final)
                except FileNotFoundError:
                    if not final.exists():
                        raise
                sync_folder(final.parent)
            for left in _pending_of(final):
                left.unlink(missing_ok=True)
        except OSError as error:
            raise _failure(self.place, error) from error

    def discard(self, key: Key) -> None:
        """Removes the pending file of this writer.

        Parameters
        ----------
        key
            Motor and version.

        """
        if self.folder is not None:
            with suppress(OSError):
                self._pending(key, threading.get_native_id()).unlink()

    def finish(self, key: Key, sha256: str) -> bool:
        """Gives the pending file of an interrupted writer its name.

        Parameters
        ----------
        key
            Motor and version.
        sha256
            Digest that it must have.

        Returns
        -------
        bool
            Whether there was one with that digest.

        """
        if self.folder is None:
            return False
        final = self.folder / place_of(key)
        for pending in _pending_of(final):
            if hashlib.sha256(pending.read_bytes()).hexdigest() == sha256:
                pending.replace(final)
                sync_folder(final.parent)
                return True
        return False

    def read(self, key: Key) -> bytes | None:
        """The bytes of a version's file.

        Parameters
        ----------
        key
            Motor and version.

        Returns
        -------
        bytes or None
            None where there is none.

        """
        try:
            if self.folder is not None:
                return (self.folder / place_of(key)).read_bytes()
            stream = self._store().open_input_file(place_of(key))
            content: bytes = stream.read()
        except FileNotFoundError:
            return None
        return content

    def identity(self, key: Key) -> Identity | None:
        """What changes when the file of a version does; None where there is none on a disk.

        Parameters
        ----------
        key
            Motor and version.

        """
        return None if self.folder is None else identity(self.folder / place_of(key))

    def names(self) -> list[str]:
        """Every file's place below the registry, sorted; of a disk only."""
        root = None if self.folder is None else self.folder / FOLDER
        if root is None or not root.is_dir():
            return []
        files = (path.relative_to(root.parent).as_posix() for path in root.rglob("*.json"))
        return sorted(files)

    def pending(self) -> int:
        """How many files have no name yet, of a disk only."""
        if self.folder is None:
            return 0
        return sum(1 for _ in (self.folder / FOLDER).glob(f"*/.*{PENDING}"))

    def _put(self, key: Key, content: bytes) -> None:
        stream = self._store().open_output_stream(place_of(key))
        stream.write(content)
        stream.close()

    def _store(self) -> Any:
        from deltalake._internal import DeltaFileSystemHandler

        return DeltaFileSystemHandler(self.place, self.options or None)

    def _pending(self, key: Key, owner: int) -> Path:
        """A name of the thread that publishes."""
        assert self.folder is not None
        final = self.folder / place_of(key)
        return final.with_name(f".{key[1]}.{owner}{PENDING}")


def _pending_of(final: Path) -> list[Path]:
    """What writers have pending of a version, by the file that it is to be."""
    return sorted(final.parent.glob(f".{final.stem}.*{PENDING}"))


def _each(work: Callable[[Key], None], keys: Iterable[Key]) -> None:
    """Does something for every key, several at once: it is mostly waiting for the disk.

    Raises what the first that failed raised, when the others have ended.
    """
    with ThreadPoolExecutor(AT_ONCE) as threads:
        for future in [threads.submit(work, key) for key in keys]:
            future.result()


def place_of(key: Key) -> str:
    """Where the file of a version is, below the registry: an escaped motor, then the version.

    Parameters
    ----------
    key
        Motor and version.

    """
    motor_id, version = key
    return f"{FOLDER}/{file_stem(motor_id)}/{version}.json"


def _failure(place: str, error: OSError) -> MachineError:
    remedy = "is it whole, and open to you?" if "://" in place else "free the disk"
    return MachineError(f"registry {place}: {error.strerror or one_line(error)}", remedy)


def one_line(error: Exception) -> str:
    """One line of an error that object stores print as a coloured tree: its root and its cause.

    Parameters
    ----------
    error
        The error.

    """
    lines = [TREE.sub("", line).strip() for line in str(error).strip().splitlines()]
    reasons = dict.fromkeys([lines[0], lines[-1]]) if lines else [type(error).__name__]
    return ": ".join(line[:LONGEST_REASON] for line in reasons)
