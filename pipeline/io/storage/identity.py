"""Which files have not changed since they were last read, so that they need not be hashed again.

A file is the same while its device, inode, size, time of change of content and time of change of
status are: nobody sets the last one but the system. A file that changed in the same instant in
which it was noted could have changed once more unseen, so it is not believed (git calls it racy).
The notes lie with the user and not beside the results, which hold no clock; without them every
file is read, and nothing else is different.
"""

from __future__ import annotations

import hashlib
import os
import time
from contextlib import suppress
from pathlib import Path

from pipeline.io.storage.checksummed import keep_checksummed, read_checksummed

Identity = tuple[int, int, int, int, int]
_FINE_NS = 50_000_000
_COARSE_NS = 2_500_000_000
_MOST_FOLDERS = 200


def identity(path: Path | str) -> Identity | None:
    """What changes when a file does.

    Parameters
    ----------
    path
        The file.

    Returns
    -------
    tuple or None
        Device, inode, size [bytes], times of content and of status [ns]; None where it is gone.

    """
    try:
        s = os.stat(path)  # noqa: PTH116 - a Path a file would cost most of the time
    except OSError:
        return None
    return s.st_dev, s.st_ino, s.st_size, s.st_mtime_ns, s.st_ctime_ns


def notes_folder() -> Path | None:
    """Where notes of identities lie; None where the user has no home."""
    named = os.environ.get("XDG_CACHE_HOME", "")
    if named and Path(named).is_absolute():
        return Path(named) / "motor-datasheets"
    with suppress(RuntimeError):
        return Path.home() / ".cache" / "motor-datasheets"
    return None


class Identities:
    """The known sha256 of the files of one folder, by relative path.

    Parameters
    ----------
    folder
        The folder.
    notes
        Where they are kept between runs; None keeps none.

    """

    def __init__(self, folder: Path, notes: Path | None) -> None:
        self.folder = folder
        self._prefix = os.path.join(folder, "")  # noqa: PTH118
        self._path: Path | None = None
        self._known: dict[str, tuple[Identity, str]] = {}
        if notes is not None:
            name = hashlib.sha256(os.fsencode(folder.resolve())).hexdigest()[:32]
            self._path = notes / f"{name}.json"
            content = read_checksummed(self._path)
            files = content.get("files", {}) if isinstance(content, dict) else {}
            self._known = {file: (_identity(noted[0]), noted[1]) for file, noted in files.items()}
        self._changed = False

    def sha256(self, file: str) -> str | None:
        """The digest of a file, if it is known to have kept its bytes.

        Parameters
        ----------
        file
            Relative path.

        """
        known = self._known.get(file)
        return known[1] if known is not None and known[0] == self.identity(file) else None

    def identity(self, file: str) -> Identity | None:
        """What changes when a file of the folder does; None where it is gone.

        Parameters
        ----------
        file
            Relative path.

        """
        return identity(self._prefix + file)

    def note(self, file: str, identity: Identity | None, sha256: str) -> None:
        """Notes the digest of a file.

        Parameters
        ----------
        file
            Relative path.
        identity
            Its identity before and after it was read; None notes nothing.
        sha256
            Its digest.

        """
        if identity is None or self._known.get(file) == (identity, sha256):
            return
        self._known[file] = (identity, sha256)
        self._changed = True

    def holds(self, file: str, sha256: str) -> bool:
        """Whether a file has a digest; it is read where that is not known.

        Parameters
        ----------
        file
            Relative path.
        sha256
            The digest.

        """
        if (known := self.sha256(file)) is not None:
            return known == sha256
        path = self.folder / file
        before = identity(path)
        if before is None or not path.is_file():
            return False
        digest = hashlib.sha256()
        with path.open("rb") as stream:
            while block := stream.read(2**20):
                digest.update(block)
        if identity(path) == before:
            self.note(file, before, digest.hexdigest())
        return digest.hexdigest() == sha256

    def save(self) -> None:
        """Keeps the notes for the next run, but for files that changed a moment ago."""
        if self._path is None or not self._changed:
            return
        now = time.time_ns()
        files = {
            file: [list(identity), sha256]
            for file, (identity, sha256) in self._known.items()
            if now - max(identity[3], identity[4]) > _instant_ns(identity)
        }
        keep_checksummed(self._path, {"files": files})
        _prune(self._path.parent)


def _identity(noted: list[int]) -> Identity:
    return noted[0], noted[1], noted[2], noted[3], noted[4]


def _instant_ns(seen: Identity) -> int:
    """How long ago a change must be; some file systems count in seconds."""
    return _COARSE_NS if seen[4] % 1_000_000 == 0 else _FINE_NS


def _prune(folder: Path) -> None:
    """Forgets the folders that have not been noted for longest."""
    with suppress(OSError):
        files = sorted(folder.glob("*.json"), key=lambda path: path.stat().st_mtime_ns)
        for path in files[:-_MOST_FOLDERS]:
            path.unlink(missing_ok=True)
