"""What code made a result, without asking git: a release wheel has no history."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable
from functools import cache
from pathlib import Path

import pipeline

# `from x import a, b` and `import x`, names in brackets over several lines; a whole parse of
# every source would cost more than many a fit
_HOME = rf"{pipeline.__name__}[\w.]*"
_IMPORT = re.compile(
    rf"^\s*(?:from ({_HOME}) import (\([^)]*\)|[^\n#]*)|import ({_HOME}))", re.MULTILINE
)


@cache
def code_version() -> str:
    """The release and a digest of every Python source of the package, e.g. `0.1.0+1a2b3c4d5e6f`."""
    root = Path(pipeline.__file__).parent
    digest = hashlib.sha256()
    for source in sorted(root.rglob("*.py"), key=lambda path: path.relative_to(root).as_posix()):
        digest.update(source.relative_to(root).as_posix().encode() + b"\0")
        digest.update(source.read_bytes() + b"\0")
    return f"{pipeline.__version__}+{digest.hexdigest()[:12]}"


@cache
def rooms_digest(rooms: tuple[str, ...]) -> str:
    """sha256 of every source of some rooms of the package."""
    root = Path(pipeline.__file__).parent
    return _digest(path for room in rooms for path in sorted((root / room).rglob("*.py")))


@cache
def closure_digest(module: str) -> str:
    """sha256 of a module's source and of all of the package that it imports, directly or not."""
    root = Path(pipeline.__file__).parent
    left, found = [module], set[Path]()
    while left:
        path = _source(root, left.pop())
        if path is not None and path not in found:
            found.add(path)
            left += _imported(path)
    return _digest(sorted(found))


def _digest(sources: Iterable[Path]) -> str:
    digest = hashlib.sha256()
    for source in sources:
        digest.update(
            source.relative_to(Path(pipeline.__file__).parent).as_posix().encode()
            + b"\0"
            + source.read_bytes()
            + b"\0"
        )
    return digest.hexdigest()


def _source(root: Path, module: str) -> Path | None:
    """The file of a module of the package; None where the name is none."""
    parts = module.split(".")
    if parts[0] != pipeline.__name__:
        return None
    place = root.joinpath(*parts[1:])
    for path in (place / "__init__.py", place.with_suffix(".py")):
        if path.is_file():
            return path
    return None


@cache
def _imported(path: Path) -> tuple[str, ...]:
    """Names that may be modules: of every import, and of every name that is taken from one."""
    names = []
    for home, taken, plain in _IMPORT.findall(path.read_text(encoding="utf-8")):
        names.append(home or plain)
        names += [f"{home}.{name}" for name in re.findall(r"\w+", taken)]
    return tuple(names)
