"""Finds the effects: one file each in `effects/`, and in a user's folder."""

from __future__ import annotations

import hashlib
import importlib.util
import sys
from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from functools import cache
from importlib.machinery import SourceFileLoader
from pathlib import Path
from typing import Any, NoReturn

from pipeline.criticism.effect import Effect
from pipeline.criticism.library.user_effects import errors_of, guarded
from pipeline.plugins import discover
from pipeline.records.errors import UsageError


def effects(effects_path: str | None = None) -> dict[str, Effect]:
    """Every effect by name, sorted.

    Parameters
    ----------
    effects_path
        Folder of effects of the user's own; it is read anew every time, and files that have not
        changed give the same effects.

    Returns
    -------
    dict of Effect
        Those of this package, of other packages, and of the folder.

    Raises
    ------
    UsageError
        There is no such folder, a file cannot be run or holds no `EFFECT`, an effect cannot be
        right (`guarded`), or a name is taken twice.

    """
    return dict(_library(_user_files(effects_path)))


@cache
def _library(files: tuple[tuple[Path, str], ...]) -> Mapping[str, Effect]:
    """Our effects and those of a user's files, which are known by path and digest."""
    library = {
        one.name: one.value for one in discover("pipeline.criticism.effects", "EFFECT", Effect)
    }
    for path, digest in files:
        effect = _load(path, digest)
        if effect.name in library:
            raise UsageError(f"{path.name}: effect {effect.name} exists already", "rename it")
        library[effect.name] = effect
    return dict(sorted(library.items()))


def _user_files(effects_path: str | None) -> tuple[tuple[Path, str], ...]:
    """The files of a user's folder, each with a digest of where it is and what it says."""
    if effects_path is None:
        return ()
    folder = Path(effects_path).resolve()
    if not folder.is_dir():
        raise UsageError(f"effects_path {effects_path} is no folder", "name a folder of effects")
    paths = sorted(p for p in folder.glob("*.py") if not p.name.startswith("_"))
    return tuple((path, _digest(path)) for path in paths)


def _digest(path: Path) -> str:
    return hashlib.sha256(str(path).encode() + b"\0" + path.read_bytes()).hexdigest()[:12]


class _Anew(SourceFileLoader):
    """Compiles a file as it is now: bytecode of the same second may be of another content."""

    def path_stats(self, path: Any) -> NoReturn:
        """There is no bytecode: OSError."""
        raise OSError(f"no bytecode of {path} is wanted")


def _load(path: Path, digest: str) -> Effect:
    name = f"user_effect_{path.stem}_{digest}"
    spec = importlib.util.spec_from_file_location(name, path, loader=_Anew(name, str(path)))
    if spec is None or spec.loader is None:
        raise UsageError(f"{path.name} cannot be loaded", "is it a Python file?")
    module = importlib.util.module_from_spec(spec)
    # by its name it is known in another process too
    sys.modules[spec.name] = module
    with errors_of(path):
        spec.loader.exec_module(module)
        effect = getattr(module, "EFFECT", None)
        if not isinstance(effect, Effect):
            raise UsageError(f"{path.name} defines no EFFECT", "see docs/criticism.md")
        return guarded(effect, path, path.read_text(encoding="utf-8", errors="replace"))


def known_effects(requested: Sequence[str], effects_path: str | None = None) -> None:
    """Refuses the name of an effect that there is not, also of one to take away, or is twice.

    Parameters
    ----------
    requested
        Names; one to take away begins with `-`.
    effects_path
        Folder of a user's own effects.

    Raises
    ------
    UsageError
        A name is unknown or there twice.

    """
    names = tuple(name.removeprefix("-") for name in requested)
    chosen(names, effects_path)
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise UsageError(f"model.effects names {twice[0]} twice", "name it once")


def chosen(names: tuple[str, ...], effects_path: str | None = None) -> dict[str, Effect]:
    """The effects of some names, in their order.

    Parameters
    ----------
    names
        Names of effects.
    effects_path
        Folder of effects of the user's own.

    Raises
    ------
    UsageError
        There is no effect of a name.

    """
    library = effects(effects_path)
    unknown = [name for name in names if name not in library]
    if unknown:
        alike = [close for name in unknown for close in get_close_matches(name, library, 1)]
        hint = f"did you mean {', '.join(alike)}?" if alike else f"known are {', '.join(library)};"
        remedy = "effects_path=FOLDER holds your own"
        raise UsageError(f"unknown effect {', '.join(unknown)}", f"{hint} {remedy}")
    return {name: library[name] for name in names}
