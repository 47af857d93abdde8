"""What code made a result, without asking git: a release wheel has no history."""

from __future__ import annotations

import hashlib
from functools import cache
from pathlib import Path

import pipeline


@cache
def code_version() -> str:
    """The release and a digest of every Python source of the package, e.g. `0.1.0+1a2b3c4d5e6f`."""
    root = Path(pipeline.__file__).parent
    digest = hashlib.sha256()
    for source in sorted(root.rglob("*.py"), key=lambda path: path.relative_to(root).as_posix()):
        digest.update(source.relative_to(root).as_posix().encode() + b"\0")
        digest.update(source.read_bytes() + b"\0")
    return f"{pipeline.__version__}+{digest.hexdigest()[:12]}"
