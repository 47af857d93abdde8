"""Notes that the project keeps for itself between runs: believed only where their digest holds."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

from pipeline.io.storage.publish import write_whole
from pipeline.records.errors import PipelineError

_MAX_BYTES = 2**28


def write_checksummed(path: Path, document: Any) -> None:
    """Writes a document under its sha256, whole or not at all.

    Parameters
    ----------
    path
        The file.
    document
        Plain data.

    Raises
    ------
    MachineError
        The disk refuses.

    """
    # without indent: the encoder in C takes a tenth of the time
    text = json.dumps(document, sort_keys=True, separators=(",", ":"), allow_nan=False)
    body = text.encode()
    write_whole(path, hashlib.sha256(body).hexdigest().encode() + b"\n" + body)


def read_checksummed(path: Path) -> Any:
    """The document, or None where there is none that is whole.

    Parameters
    ----------
    path
        The file.

    Returns
    -------
    object or None
        None where there is none that is whole.

    """
    try:
        if path.stat().st_size > _MAX_BYTES:
            return None
        digest, _, body = path.read_bytes().partition(b"\n")
    except OSError:
        return None
    if hashlib.sha256(body).hexdigest().encode() != digest:
        return None
    try:
        return json.loads(body)
    except (ValueError, RecursionError):
        return None


def keep_checksummed(path: Path, document: Any) -> None:
    """Writes a document that only saves time: a place that cannot be written is no failure.

    Parameters
    ----------
    path
        The file.
    document
        Plain data.

    """
    try:
        write_checksummed(path, document)
    except PipelineError:
        return
