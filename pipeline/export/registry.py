"""Finds the exporters, one file each in `exporters/`."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Mapping
from functools import cache

from pipeline.export import exporters as exporters_room
from pipeline.export.protocol import Exporter


@cache
def exporters() -> Mapping[str, Exporter]:
    """Every exporter of the room by the name of its format."""
    names = sorted(module.name for module in pkgutil.iter_modules(exporters_room.__path__))
    modules = [importlib.import_module(f"{exporters_room.__name__}.{name}") for name in names]
    return {module.EXPORTER.name: module.EXPORTER for module in modules}
