"""Finds the effects: one file each in `effects/`, and in a user's folder."""

from __future__ import annotations

import importlib
import importlib.util
import pkgutil
import sys
from difflib import get_close_matches
from functools import cache
from pathlib import Path

from pipeline.criticism import effects as effects_room
from pipeline.criticism.effect import Effect
from pipeline.records.errors import UsageError


@cache
def effects(effects_path: str | None = None) -> dict[str, Effect]:
    """Every effect by name, sorted; a user's file may not take the name of one of ours.

    Raises UsageError for a folder that is not there, a file without `EFFECT`, a name taken twice.
    """
    found: dict[str, Effect] = {}
    for name in sorted(m.name for m in pkgutil.iter_modules(effects_room.__path__)):
        effect = importlib.import_module(f"{effects_room.__name__}.{name}").EFFECT
        found[effect.name] = effect
    for path in _user_files(effects_path):
        effect = _load(path)
        if effect.name in found:
            raise UsageError(f"{path.name}: effect {effect.name} exists already", "rename it")
        found[effect.name] = effect
    return dict(sorted(found.items()))


def _user_files(effects_path: str | None) -> list[Path]:
    if effects_path is None:
        return []
    folder = Path(effects_path)
    if not folder.is_dir():
        raise UsageError(f"effects_path {effects_path} is no folder", "name a folder of effects")
    return sorted(p for p in folder.glob("*.py") if not p.name.startswith("_"))


def _load(path: Path) -> Effect:
    spec = importlib.util.spec_from_file_location(f"user_effect_{path.stem}", path)
    if spec is None or spec.loader is None:
        raise UsageError(f"{path.name} cannot be loaded", "is it a Python file?")
    module = importlib.util.module_from_spec(spec)
    # by its name it is known in another process too
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    effect = getattr(module, "EFFECT", None)
    if not isinstance(effect, Effect):
        raise UsageError(f"{path.name} defines no EFFECT", "see docs/criticism.md")
    return effect


def chosen(names: tuple[str, ...], effects_path: str | None = None) -> dict[str, Effect]:
    """The effects of these names, in this order. Raises UsageError for an unknown name."""
    library = effects(effects_path)
    unknown = [name for name in names if name not in library]
    if unknown:
        near = [close for name in unknown for close in get_close_matches(name, library, 1)]
        hint = f"did you mean {', '.join(near)}?" if near else f"known are {', '.join(library)};"
        own = "effects_path=FOLDER holds your own"
        raise UsageError(f"unknown effect {', '.join(unknown)}", f"{hint} {own}")
    return {name: library[name] for name in names}
