"""Plug-ins, one file each: those of this package, and those that other packages name.

Another package offers one by an entry point of the group `motor_datasheets.KIND` whose object is
the plug-in: `[project.entry-points."motor_datasheets.effects"] seal_drag = "seals.drag:EFFECT"`.
"""

from __future__ import annotations

import hashlib
import pkgutil
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from pipeline.records.errors import UsageError

PREFIX = "motor_datasheets"
GROUPS = ("readers", "gates", "estimators", "rules", "exporters", "effects", "equations")


@dataclass(frozen=True, slots=True)
class PlugIn:
    """A plug-in and the module that holds it."""

    name: str
    module: str
    value: Any


def discover(package: str, attribute: str, kind: type) -> tuple[PlugIn, ...]:
    """Every plug-in by name: `attribute` of each module of `package`, and outside ones.

    The group of the entry points is the last part of the name of `package`. Raises UsageError for
    an outside plug-in that cannot be loaded, is no `kind`, or takes a name that there is.
    """
    plug_ins: dict[str, PlugIn] = {}
    for name in sorted(m.name for m in pkgutil.iter_modules(import_module(package).__path__)):
        module = f"{package}.{name}"
        value = getattr(import_module(module), attribute)
        plug_ins[value.name] = PlugIn(value.name, module, value)
    for point in _outside()[package.rpartition(".")[2]]:
        value = _loaded(point, kind)
        if value.name in plug_ins:
            other = plug_ins[value.name].module
            raise UsageError(f"{point.value}: {value.name} is in {other} already", "rename one")
        plug_ins[value.name] = PlugIn(value.name, point.module, value)
    return tuple(plug_ins[name] for name in sorted(plug_ins))


@cache
def outside_version() -> str:
    """The outside plug-ins: names, versions, digest of their sources.

    Empty where there are none. A result depends on them as on the code of this package.
    """
    points = [point for group in _outside().values() for point in group]
    names = sorted({f"{p.group} {p.value} {p.dist.version if p.dist else ''}" for p in points})
    digest = hashlib.sha256()
    for home in sorted({p.module.partition(".")[0] for p in points}):
        for source in _sources(home):
            digest.update(source.name.encode() + b"\0" + source.read_bytes() + b"\0")
    return "; ".join([*names, digest.hexdigest()]) if names else ""


def _sources(home: str) -> list[Path]:
    """The Python files of an installed package or module, sorted; none where it is not there."""
    spec = find_spec(home)
    if spec is None or spec.origin is None:
        return []
    places = [Path(place) for place in spec.submodule_search_locations or ()]
    return sorted(p for place in places for p in place.rglob("*.py")) or [Path(spec.origin)]


@cache
def _outside() -> dict[str, list[EntryPoint]]:
    """The entry points of each group by name, read once a process."""
    named = {name: entry_points(group=f"{PREFIX}.{name}") for name in GROUPS}
    return {name: sorted(points, key=lambda point: point.name) for name, points in named.items()}


def _loaded(point: EntryPoint, kind: type) -> Any:
    """The object of an entry point; a package that breaks is named, whatever it raised."""
    remedy = f"mend or remove {point.dist.name if point.dist else point.module}"
    try:
        value = point.load()
    except Exception as error:
        cause = f"{type(error).__name__}: {error}"
        raise UsageError(f"the plug-in {point.value} cannot be loaded: {cause}", remedy) from error
    if not isinstance(value, kind):
        raise UsageError(f"the plug-in {point.value} is no {kind.__name__}", remedy)
    return value
