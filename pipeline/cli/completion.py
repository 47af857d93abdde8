"""Tab completion: a few lines for the shell, and the words that may come next."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable
from dataclasses import fields, is_dataclass
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from typing import Any

from pipeline.cli.commands import COMMANDS
from pipeline.cli.flags import FLAGS
from pipeline.settings import configuration_folder

_INSTALL = {
    "bash": """_motor_datasheets() {{
  mapfile -t COMPREPLY < <(COMP_WORD="${{COMP_LINE:0:COMP_POINT}}" {program} -sc query=bash)
  [[ ${{COMPREPLY[0]}} == *= ]] && compopt -o nospace
}}
complete -o default -o nosort -F _motor_datasheets motor-datasheets
COMP_WORDBREAKS=${{COMP_WORDBREAKS//=/}}""",
    "zsh": """_motor_datasheets() {{
  local -a found
  found=("${{(@f)$(COMP_WORD="$LBUFFER" {program} -sc query=zsh)}}")
  compadd -S '' -- $found || _files
}}
compdef _motor_datasheets motor-datasheets""",
    "fish": """complete -c motor-datasheets -a \
'(COMP_WORD=(commandline -cp) {program} -sc query=fish)'""",
}


def completed(request: str) -> str:
    """What `--shell-completion` prints: `install=SHELL` the lines, `query=SHELL` the words.

    The line so far is in the environment's COMP_WORD, up to the cursor.

    Parameters
    ----------
    request
        `install=SHELL` or `query=SHELL`.

    """
    act, _, shell = request.partition("=")
    if act == "install":
        program = f"{sys.executable} -m pipeline"
        return _INSTALL[shell].format(program=program)
    return "\n".join(candidates(os.environ.get("COMP_WORD", "")))


def candidates(line: str) -> list[str]:
    """The words that may stand where a line ends, in their order.

    Of a key that takes a file or folder there is none: the shell completes its own.

    Parameters
    ----------
    line
        The command line up to the cursor.

    """
    words = line.split(" ")[1:]
    last = words[-1] if words else ""
    typed = [word for word in words[:-1] if word and not word.startswith("-")]
    if last.startswith("-"):
        return _beginning(last, (flag.split()[0] for flag in FLAGS))
    if not typed:
        return _beginning(last, COMMANDS)
    command = COMMANDS.get(typed[0])
    if command is None:
        return []
    keys = dict(_keys(command.settings, ""))
    name, equals, _ = last.partition("=")
    if equals:
        return _beginning(last, (f"{name}={value}" for value in keys.get(name, ())))
    return _beginning(last, (f"{key}=" for key in keys))


def _beginning(start: str, words: Iterable[str]) -> list[str]:
    return [word for word in words if word.startswith(start)]


def _keys(settings: type[Any], group: str) -> Iterable[tuple[str, tuple[str, ...]]]:
    """Each key and the values that it may have, as far as they can be listed."""
    for field in fields(settings):
        nested = field.default_factory() if callable(field.default_factory) else None
        name = f"{group}{field.name.rstrip('_')}"
        about = field.metadata
        if is_dataclass(nested):
            yield name, _files(name)
            yield from _keys(type(nested), f"{name}.")
        elif about.get("package"):
            modules = iter_modules(import_module(about["package"]).__path__)
            yield name, tuple(f"[{module.name}]" for module in modules)
        elif field.type in ("bool", bool):
            yield name, ("true", "false")
        else:
            yield name, tuple(about.get("one_of", ())) or _files(name)


def _files(group: str) -> tuple[str, ...]:
    """Names of the files of a group in `conf/`."""
    folder = configuration_folder() / Path(group)
    return tuple(sorted(path.stem for path in folder.glob("*.yaml")))
