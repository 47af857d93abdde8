"""Finds the exporters, one file each in `exporters/`."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

from pipeline.export.protocol import Exporter
from pipeline.plugins import discover


@cache
def exporters() -> Mapping[str, Exporter]:
    """Every exporter by the name of its format."""
    plug_ins = discover("pipeline.export.exporters", "EXPORTER", Exporter)
    return {one.name: one.value for one in plug_ins}
