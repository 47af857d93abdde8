"""The commands: their stages, their keys and what they say of themselves."""

from __future__ import annotations

import re
import sys
import textwrap
from dataclasses import MISSING, Field, dataclass, fields, is_dataclass
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from typing import Any

from pipeline import settings as s
from pipeline.cli.flags import FLAGS

INDENT = " " * 6


@dataclass(frozen=True, slots=True)
class Command:
    """A module of `stages/` with `main(settings)`, and `words`, its one-line description.

    `positional` are keys that may be given without their name, in this order; `free` is the key
    that collects, as text, every name=value that is no key of the command. `common` are the keys
    that `--help` lists first, `examples` what may stand after the program's name.
    `shows_progress` is True of a command that shows on a terminal by itself how far it is. `stage`
    is the module's name where that is not the command's.
    """

    name: str
    settings: type[s.Settings]
    words: str
    positional: tuple[str, ...] = ()
    free: str | None = None
    common: tuple[str, ...] = ()
    examples: tuple[str, ...] = ()
    shows_progress: bool = False
    stage: str = ""


def program() -> str:
    """What a user types before the command: the installed program, or the module."""
    installed = Path(sys.argv[0]).stem == "motor-datasheets"
    return "motor-datasheets" if installed else "python -m pipeline"


def _index(*commands: Command) -> dict[str, Command]:
    return {command.name: command for command in commands}


COMMANDS = _index(
    Command(
        "run",
        s.RunSettings,
        "captures in; datasheets, checks, report, recordings out",
        common=("input", "output", "source", "model", "limits", "release"),
        examples=(
            "run input=data/demo output=reports/demo",
            "run input=captures output=reports/mine 'model.effects=[cogging]' release=auto",
            "run input=captures constants.kt_peak_nm_a=0.118 constants.u_kt_peak_nm_a=0.001",
        ),
        shows_progress=True,
    ),
    Command(
        "compare",
        s.CompareSettings,
        "model against held-out measurements, signal by signal: where it is off",
        common=("input", "output", "motor", "model"),
        examples=(
            "compare input=data/demo motor=G52-0601",
            "compare input=data/demo motor=G52-0601 'model.effects=[cogging]'",
            "compare input=data/demo motor=G52-0601 model=ideal,standard --multirun",
        ),
        shows_progress=True,
    ),
    Command(
        "diagnose",
        s.DiagnoseSettings,
        "which physical effect the model lacks, how sure that is, what else it could be",
        common=("input", "output", "motor", "model"),
        examples=(
            "diagnose input=data/demo motor=G52-0601",
            "diagnose input=data/demo motor=G52-0601 effects_path=my_effects",
        ),
        shows_progress=True,
    ),
    Command(
        "inspect",
        s.InspectSettings,
        "what a file or folder holds, which columns it knows, a source map that reads it",
        positional=("file",),
        common=("file", "map", "check"),
        examples=(
            "inspect log.csv",
            "inspect captures map=bench.yaml check=true pole_pairs=7 unit.Moment=mNm",
        ),
        free="answers",
        stage="inspect_file",
    ),
    Command(
        "plan",
        s.PlanSettings,
        "which test to record next, for which constant or doubt",
        positional=("motor",),
        common=("motor", "output", "input"),
        examples=("plan G52-0601 output=reports/demo", "plan input=captures"),
    ),
    Command(
        "regress",
        s.RegressSettings,
        "lot against lots, or code against code: the same, or what changed",
        common=("baseline", "candidate", "limits", "output"),
        examples=(
            "regress baseline=lot:2026-W06 candidate=lot:2026-W14 output=reports/demo",
            "regress limits=conf/limits/default.yaml lint=true",
        ),
    ),
    Command(
        "export",
        s.ExportSettings,
        "a released datasheet for a controller or simulator, conventions converted",
        positional=("format", "motor"),
        common=("format", "motor", "output"),
        examples=(
            "export moteus G52-0601 output=reports/demo",
            "export c-header G52-0601 revision=1",
            "export mujoco G52-0601 output=reports/demo",
        ),
    ),
    Command(
        "registry",
        s.RegistrySettings,
        "every datasheet version: list, show, diff, at, verify, approve, revoke, tag",
        positional=("action", "motor"),
        common=("action", "motor", "output"),
        examples=(
            "registry list output=reports/demo",
            "registry approve G52-0601 revision=1 by=ada why='seen on the bench'",
            "registry diff G52-0601 from=1 to=2",
            "registry at 2026-03-01",
        ),
    ),
    Command(
        "review",
        s.ReviewSettings,
        "recordings in the Rerun viewer: fleet, motor, ladder, lot against lot",
        common=("output", "motor", "lot", "web"),
        examples=("review output=reports/demo", "review motor=G52-0601 web=true"),
    ),
    Command(
        "simulate",
        s.SimulateSettings,
        "captures of a simulated motor, and truth",
        common=("output", "motor", "effects", "seed"),
        examples=(
            "simulate output=captures motor=gimbal-5208 'effects=[stribeck]' seed=3",
            "simulate output=captures fleet=demo",
        ),
    ),
    Command(
        "schemas",
        s.Settings,
        "JSON Schemas and glossary, built into the checkout",
        examples=("schemas",),
    ),
    Command(
        "calc",
        s.CalcSettings,
        "a conversion between conventions, with its formula",
        positional=("kind",),
        free="values",
        common=("kind",),
        examples=("calc kv kv=340", "calc ke-kt kt_peak_nm_a=0.074 pole_pairs=7"),
    ),
)


def overview() -> str:
    """What `python -m pipeline` prints: the commands and where to go on."""
    lines = [f"usage: {program()} COMMAND key=value ...", "", "commands"]
    for command in COMMANDS.values():
        lines += _wrapped(command.words, f"  {command.name:<10} ")
    lines += ["", "flags"]
    for flag, meaning in FLAGS.items():
        lines += [f"  {flag}", *_wrapped(meaning, INDENT)]
    lines += ["", f"{program()} COMMAND --help shows examples and lists the keys."]
    return "\n".join(lines)


def usage(command: Command) -> str:
    """What `--help` prints: every key with its default and its meaning.

    Parameters
    ----------
    command
        The command.

    """
    places = "".join(f" {name.upper()}" for name in command.positional)
    lines = [f"usage: {program()} {command.name}{places} key=value ...", ""]
    lines += [command.words, "", "examples"]
    lines += [line for example in command.examples for line in _example(example)]
    keys = _keys(command.settings, "")
    first = [key for name in command.common for key in keys if key.of == name]
    rest = [key for key in keys if key not in first]
    for heading, listed in (("keys", first), ("further keys", rest)):
        if listed:
            lines += ["", heading, *(line for key in listed for line in key.lines)]
    return "\n".join(lines)


@dataclass(frozen=True, slots=True)
class _Key:
    """Lines on a key; `of` is the key of the command that it is, or that it is in."""

    of: str
    lines: tuple[str, ...]


def _keys(settings: type[Any], group: str) -> list[_Key]:
    """Two lines or more a key; a group of keys as `group.key`."""
    keys = []
    for key in fields(settings):
        default = None if key.default_factory is MISSING else key.default_factory()
        if is_dataclass(default):
            keys += _keys(type(default), f"{key.name}.")
            continue
        lines = [f"  {group}{key.name.rstrip('_')}={_default(key)}"]
        if words := key.metadata.get("words"):
            lines += _wrapped(words, INDENT)
        if package := key.metadata.get("package"):
            names = sorted(module.name for module in iter_modules(import_module(package).__path__))
            lines += _wrapped(", ".join(names), INDENT)
        keys.append(_Key(group.rstrip(".") or key.name.rstrip("_"), tuple(lines)))
    return keys


def _wrapped(text: str, first: str) -> list[str]:
    """A text in lines that a terminal of 80 columns shows whole; `first` begins the first one."""
    return textwrap.wrap(
        text, 80, initial_indent=first, subsequent_indent=" " * len(first), break_long_words=False
    )


def _example(words: str) -> list[str]:
    """A command in lines that fit a terminal and can be copied as they are."""
    lines = [f"  {program()}"]
    for word in re.findall(r"(?:'[^']*'|\S)+", words):
        if len(lines[-1]) + len(word) + 3 > 80:
            lines[-1] += " \\"
            lines.append(f"{INDENT}{word}")
        else:
            lines[-1] += f" {word}"
    return lines


def _default(key: Field[Any]) -> str:
    if key.default is not MISSING:
        if isinstance(key.default, bool):
            return str(key.default).lower()
        return "null" if key.default is None else str(key.default)
    if key.default_factory is not MISSING:
        default = key.default_factory()
        return "{}" if default == {} else str(default).replace("'", "")
    return "..."
