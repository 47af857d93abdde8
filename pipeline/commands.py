"""The commands: their stages, their keys and what they say of themselves."""

from __future__ import annotations

import textwrap
from dataclasses import MISSING, Field, dataclass, fields, is_dataclass
from importlib import import_module
from pkgutil import iter_modules
from typing import Any

from pipeline import settings as s

INDENT = " " * 6


@dataclass(frozen=True, slots=True)
class Command:
    """`stage` is a module of `stages/` with `main(settings)`; `words` its one-line description.

    `positional` are keys that may be given without their name, in this order; `free` is the key
    that collects, as text, every name=value that is no key of the command.
    """

    name: str
    stage: str
    settings: type[s.Settings]
    words: str
    positional: tuple[str, ...] = ()
    free: str | None = None


def _index(*commands: Command) -> dict[str, Command]:
    return {command.name: command for command in commands}


COMMANDS = _index(
    Command("run", "run", s.RunSettings, "captures in; datasheets, checks, report, recordings out"),
    Command(
        "compare",
        "compare",
        s.CompareSettings,
        "model against held-out measurements, signal by signal: where it is off",
    ),
    Command(
        "diagnose",
        "diagnose",
        s.DiagnoseSettings,
        "which physical effect the model lacks, how sure that is, what else it could be",
    ),
    Command(
        "inspect",
        "inspect_file",
        s.InspectSettings,
        "what a file holds, which columns it knows, a source map to start from",
        positional=("file",),
    ),
    Command(
        "plan",
        "plan",
        s.PlanSettings,
        "which test to record next, for which constant or doubt",
        positional=("motor",),
    ),
    Command(
        "regress",
        "regress",
        s.RegressSettings,
        "lot against lots, or code against code: the same, or what changed",
    ),
    Command(
        "export",
        "export",
        s.ExportSettings,
        "a released datasheet as a controller's configuration, conventions converted",
        positional=("format", "motor"),
    ),
    Command(
        "registry",
        "registry",
        s.RegistrySettings,
        "every datasheet version: list, show, diff, at, verify, approve, revoke, tag",
        positional=("action", "motor"),
    ),
    Command(
        "review",
        "review",
        s.ReviewSettings,
        "recordings in the Rerun viewer: fleet, motor, ladder, lot against lot",
    ),
    Command("simulate", "simulate", s.SimulateSettings, "captures of a simulated motor, and truth"),
    Command("schemas", "schemas", s.Settings, "JSON Schemas and glossary, built into the checkout"),
    Command(
        "calc",
        "calc",
        s.CalcSettings,
        "a conversion between conventions, with its formula",
        positional=("kind",),
        free="values",
    ),
)


def overview() -> str:
    """What `python -m pipeline` prints: the commands and where to go on."""
    lines = ["usage: python -m pipeline COMMAND key=value ...", "", "commands"]
    lines += [f"  {c.name:<10} {c.words}" for c in COMMANDS.values()]
    lines += ["", "python -m pipeline COMMAND --help lists the keys of a command."]
    return "\n".join(lines)


def usage(command: Command) -> str:
    """What `--help` prints: every key with its default and its meaning."""
    places = "".join(f" {name.upper()}" for name in command.positional)
    lines = [f"usage: python -m pipeline {command.name}{places} key=value ...", ""]
    lines += [command.words, "", "keys"]
    lines += _keys(command.settings, "")
    return "\n".join(lines)


def _keys(settings: type[Any], group: str) -> list[str]:
    """Two lines or more a key; a group of keys as `group.key`."""
    lines = []
    for key in fields(settings):
        made = None if key.default_factory is MISSING else key.default_factory()
        if is_dataclass(made):
            lines += _keys(type(made), f"{key.name}.")
            continue
        lines.append(f"  {group}{key.name.rstrip('_')}={_default(key)}")
        if words := key.metadata.get("words"):
            lines.append(f"      {words}")
        if package := key.metadata.get("package"):
            names = sorted(module.name for module in iter_modules(import_module(package).__path__))
            lines += textwrap.wrap(
                ", ".join(names), 92, initial_indent=INDENT, subsequent_indent=INDENT
            )
    return lines


def _default(key: Field[Any]) -> str:
    if key.default is not MISSING:
        return "null" if key.default is None else _lower(key.default)
    if key.default_factory is not MISSING:
        made = key.default_factory()
        return "{}" if made == {} else str(made).replace("'", "")
    return "..."


def _lower(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)
