"""Notes that the project keeps for itself between runs: believed only where their digest holds."""

from __future__ import annotations

import hashlib
import json
from contextlib import suppress
from pathlib import Path
from typing import Any

from pipeline.io.storage.publish import write_whole
from pipeline.records.errors import PipelineError

_MAX_BYTES = 2**28


def keep_body(path: Path, body: bytes) -> None:
    """Writes bytes under their sha256, whole or not at all.

    They only save time: a place that cannot be written is no failure.

    Parameters
    ----------
    path
        The file.
    body
        The bytes.

    """
    with suppress(PipelineError):
        write_whole(path, hashlib.sha256(body).hexdigest().encode() + b"\n" + body)


def read_body(path: Path, most: int) -> bytes | None:
    """The bytes below their sha256, or None where there are none that are whole.

    Parameters
    ----------
    path
        The file.
    most
        Bytes of the largest file that is read.

    """
    try:
        if path.stat().st_size > most:
            return None
        digest, _, body = path.read_bytes().partition(b"\n")
    except OSError:
        return None
    return body if hashlib.sha256(body).hexdigest().encode() == digest else None


def keep_checksummed(path: Path, document: Any) -> None:
    """Writes a document that only saves time: a place that cannot be written is no failure.

    Parameters
    ----------
    path
        The file.
    document
        Plain data.

    """
    # without indent: the encoder in C takes a tenth of the time
    text = json.dumps(document, sort_keys=True, separators=(",", ":"), allow_nan=False)
    keep_body(path, text.encode())


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
    body = read_body(path, _MAX_BYTES)
    try:
        return None if body is None else json.loads(body)
    except (ValueError, RecursionError):
        return None
