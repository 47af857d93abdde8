"""The seal of a recording: its digest in a file beside it, without which `review` opens nothing.

The viewer's own check passes changed payload bytes, and even a file that is no recording at all.
The seal is a line of sha256sum, so that `sha256sum --check NAME.rrd.sha256` reads it as well.
"""

from __future__ import annotations

import hashlib
from pathlib import Path

from pipeline.io.storage.publish import write_whole
from pipeline.records.errors import RecordingError

SEAL = ".sha256"
MAGIC = b"RRF2"
REMEDY = "run the command that wrote it again"


def write_checksummed(path: Path, content: bytes) -> None:
    """Writes a recording and its checksum, each whole or not at all.

    Parameters
    ----------
    path
        The .rrd file.
    content
        Its bytes.

    Raises
    ------
    MachineError
        The disk refuses.

    """
    write_whole(path, content)
    write_whole(seal_of(path), seal_line(path.name, hashlib.sha256(content).hexdigest()))


def seal_line(name: str, sha256: str) -> bytes:
    """The content of the checksum file of a recording.

    Parameters
    ----------
    name
        Of the recording.
    sha256
        Its digest.

    """
    return f"{sha256}  {name}\n".encode()


def seal_of(path: Path) -> Path:
    """Where the checksum file of a recording lies.

    Parameters
    ----------
    path
        The .rrd file.

    """
    return path.with_name(path.name + SEAL)


def verify(path: Path) -> None:
    """Refuses a recording that is not what was written, or cannot be known to be.

    Parameters
    ----------
    path
        The .rrd file.

    Raises
    ------
    RecordingError
        It is missing, is no recording, has no checksum file, or does not match it.

    """
    if not path.is_file():
        raise RecordingError("the recording is not there", REMEDY)
    with path.open("rb") as stream:
        magic = stream.read(len(MAGIC))
        stream.seek(0)
        sha256 = hashlib.file_digest(stream, "sha256").hexdigest()
    if magic != MAGIC:
        raise RecordingError("this is no Rerun recording", REMEDY)
    seal = seal_of(path)
    if not seal.is_file():
        raise RecordingError(f"its seal {seal.name} is missing", REMEDY)
    stated = seal.read_text(encoding="ascii", errors="replace").split(maxsplit=1)
    if not stated or stated[0] != sha256:
        raise RecordingError("truncated or changed: its digest is not the sealed one", REMEDY)
