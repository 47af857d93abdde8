"""Flags: words that begin with `-`. They are Hydra's own, and mean here what they mean there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any

from pipeline.records.errors import UsageError

FLAGS = {
    "--help": "this text; after a command, its keys",
    "--version": "the version of the package",
    "--cfg job": "print the configuration that the command would get, and end",
    "--info": "print where that configuration comes from, and end",
    "--config-dir DIR": "a conf/ of your own; its files come before those of the package",
    "--multirun": "one run for each value of a key with several: model=ideal,standard",
    "--shell-completion install=SHELL": "print what `eval` takes; bash, zsh or fish",
}
_SHORT = {"-h": "--help", "-c": "--cfg", "-cd": "--config-dir", "-m": "--multirun"} | {
    "-sc": "--shell-completion"
}
_TAKES = {
    "--cfg": ("job",),
    "--config-dir": (),
    "--shell-completion": tuple(
        f"{act}={shell}" for act in ("install", "query") for shell in ("bash", "zsh", "fish")
    ),
}
"""Flags that take a value, and the values that there are; none where any will do."""


@dataclass(frozen=True, slots=True)
class Flags:
    """What the flags of a command line ask for."""

    help: bool = False
    version: bool = False
    cfg: str | None = None
    info: bool = False
    config_dir: str | None = None
    multirun: bool = False
    shell_completion: str | None = None


def split_flags(arguments: Sequence[str]) -> tuple[Flags, list[str]]:
    """Separates flags from the other words, wherever they stand.

    Parameters
    ----------
    arguments : sequence of str
        The command line without the program. `--flag=value` and `--flag value` are the same.

    Returns
    -------
    Flags, list of str
        The flags, and the other words in their order.

    Raises
    ------
    UsageError
        For a flag that there is not, and for one whose value is missing or unknown.

    """
    flags: dict[str, Any] = {}
    rest: list[str] = []
    words = list(arguments)
    while words:
        word = words.pop(0)
        if not word.startswith("-") or word == "-":
            rest.append(word)
            continue
        typed, equals, value = word.partition("=")
        name = _SHORT.get(typed, typed)
        field = name.removeprefix("--").replace("-", "_")
        if not name.startswith("--") or field not in Flags.__dataclass_fields__:
            raise UsageError(f"no flag {typed}", _known(typed))
        if name not in _TAKES:
            flags[field] = True
            continue
        if not equals:
            value = words.pop(0) if words else ""
        if not value or (_TAKES[name] and value not in _TAKES[name]):
            takes = " or ".join(_TAKES[name]) or "a folder"
            raise UsageError(f"{typed} {value}".rstrip() + " is none", f"{typed} takes {takes}")
        flags[field] = value
    return Flags(**flags), rest


def _known(typed: str) -> str:
    names = [flag.split()[0] for flag in FLAGS]
    near = get_close_matches(typed, names, 1)
    return f"did you mean {near[0]}?" if near else f"known are {', '.join(names)}"


def asks_for_json(words: Sequence[str]) -> bool:
    """Whether a command line asks for JSON, well formed or not otherwise.

    Parameters
    ----------
    words
        The command line without the program.

    """
    stated = [word.partition("=")[2] for word in words if word.startswith("json=")]
    return bool(stated) and stated[-1].lower() in ("true", "yes", "on", "1")
