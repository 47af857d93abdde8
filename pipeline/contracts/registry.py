"""Finds the gates (one file each in `gates/`)."""

from __future__ import annotations

from functools import cache

from pipeline.contracts.protocol import Gate
from pipeline.plugins import discover


@cache
def gates() -> tuple[Gate, ...]:
    """Every gate, by name."""
    return tuple(one.value for one in discover("pipeline.contracts.gates", "GATE", Gate))
