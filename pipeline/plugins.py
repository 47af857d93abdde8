"""Plug-ins, one file each: those of a room of this package, and those that other packages name.

Another package offers one by an entry point of the group `motor_datasheets.KIND` whose object is
the plug-in: `[project.entry-points."motor_datasheets.effects"] seal_drag = "seals.drag:EFFECT"`.
"""

from __future__ import annotations

import pkgutil
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
from typing import Any

from pipeline.records.errors import UsageError

GROUP = "motor_datasheets"


@dataclass(frozen=True, slots=True)
class PlugIn:
    """A plug-in and the module that holds it."""

    name: str
    module: str
    value: Any


def discover(room: str, attribute: str, kind: type) -> tuple[PlugIn, ...]:
    """Every plug-in by name: `attribute` of each module of the package `room`, and outside ones.

    The group of the entry points is the last part of `room`. Raises UsageError for an outside
    plug-in that cannot be loaded, is no `kind`, or takes a name that there is.
    """
    found: dict[str, PlugIn] = {}
    for name in sorted(m.name for m in pkgutil.iter_modules(import_module(room).__path__)):
        module = f"{room}.{name}"
        value = getattr(import_module(module), attribute)
        found[value.name] = PlugIn(value.name, module, value)
    group = f"{GROUP}.{room.rpartition('.')[2]}"
    for point in sorted(_outside().select(group=group), key=lambda one: one.name):
        value = _loaded(point, kind)
        if value.name in found:
            other = found[value.name].module
            raise UsageError(f"{point.value}: {value.name} is in {other} already", "rename one")
        found[value.name] = PlugIn(value.name, point.module, value)
    return tuple(found[name] for name in sorted(found))


@cache
def _outside() -> Any:
    """The entry points of all installed packages, read once a process."""
    return entry_points()


def _loaded(point: Any, kind: type) -> Any:
    """The object of an entry point; a package that breaks is named, whatever it raised."""
    remedy = f"mend or remove {point.dist.name if point.dist else point.module}"
    try:
        value = point.load()
    except Exception as error:
        said = f"{type(error).__name__}: {error}"
        raise UsageError(f"the plug-in {point.value} cannot be loaded: {said}", remedy) from error
    if not isinstance(value, kind):
        raise UsageError(f"the plug-in {point.value} is no {kind.__name__}", remedy)
    return value
