"""The shape of `conf/`: plain dataclasses that Hydra merges the YAML files into."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any


@dataclass(kw_only=True)
class Settings:
    """Keys that every command shares; a command's own are in its subclass."""

    command: str = "run"
    timings: bool = False


@dataclass(kw_only=True)
class RunSettings(Settings):
    """`run`: captures in, datasheets, checks, report and recordings out."""

    input: str = "data/demo"
    output: str = "reports/demo"
    workers: int = 1
    source: str = "contract"
    release: str = "manual"
    limits: str | None = None
    recordings: bool = True
    report: bool = True
    gates: dict[str, Any] = field(default_factory=dict)
    fit: dict[str, Any] = field(default_factory=dict)
    crosscheck: dict[str, Any] = field(default_factory=dict)
