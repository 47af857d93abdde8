"""Finds the gates (one file each in `gates/`)."""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache

from pipeline.contracts import gates as gates_room
from pipeline.contracts.protocol import Gate


@cache
def gates() -> tuple[Gate, ...]:
    """Every gate of the room, by name."""
    names = sorted(module.name for module in pkgutil.iter_modules(gates_room.__path__))
    modules = [importlib.import_module(f"{gates_room.__name__}.{name}") for name in names]
    return tuple(sorted((module.GATE for module in modules), key=lambda gate: gate.name))
