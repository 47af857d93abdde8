"""Words and files that Hydra would refuse without saying what to write instead."""

from __future__ import annotations

import re
import typing
from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass
from difflib import get_close_matches
from typing import Any

from pipeline.cli.commands import Command, program
from pipeline.records.errors import UsageError
from pipeline.settings import named_file

_BOOL = re.compile("true|false|yes|no|on|off|0|1", re.IGNORECASE)
_INT = re.compile("[+-]?[0-9]+")
_FLOAT = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)(e[+-]?[0-9]+)?|[+-]?(inf|nan)", re.IGNORECASE)
_KINDS: dict[Any, tuple[re.Pattern[str], str, str]] = {
    bool: (_BOOL, "neither true nor false", "true or false"),
    int: (_INT, "no whole number", "a whole number"),
    float: (_FLOAT, "no number", "a number"),
}


@dataclass(frozen=True, slots=True)
class _Key:
    """A key of the settings: its dotted name, type, and what its field says of it."""

    name: str
    kind: Any
    about: Mapping[str, Any]

    @property
    def plain(self) -> Any:
        """The type of a value that is there."""
        given = [kind for kind in typing.get_args(self.kind) if kind is not type(None)]
        optional = type(None) in typing.get_args(self.kind)
        return given[0] if optional else self.kind

    @property
    def has_keys(self) -> bool:
        """Whether keys may stand below it."""
        return typing.get_origin(self.kind) is dict or is_dataclass(self.kind)

    def takes(self, value: str) -> bool:
        """Whether a text is a value of the key."""
        if self.plain in _KINDS:
            return bool(_KINDS[self.plain][0].fullmatch(unquoted(value)))
        one_of = self.about.get("one_of")
        return bool(value.strip()) and (not one_of or value in one_of)


def check_override(command: Command, key: str, value: str, config_dir: str | None) -> None:
    """Refuses a word of the command line that Hydra would refuse, or misread.

    Parameters
    ----------
    command
        The command.
    key, value
        The two sides of the word.
    config_dir
        Folder of configuration files that come before those of the package.

    Raises
    ------
    UsageError
        There is no such key, or it takes no such value.

    """
    found = _key(command, key)
    if found.name != key and not found.has_keys:
        raise UsageError(
            f"{command.name}: {key}={value}: {found.name} has no keys below it",
            _instead(found, key.removeprefix(f"{found.name}."), value),
        )
    if found.name == key:
        if is_group(key) or key == "model":
            _known_name(command, key, value, config_dir)
        elif found.has_keys and value[:1] != "{":
            problem = f"{command.name}: {key}={value}: {key} is a group of keys"
            raise UsageError(problem, _below(found))
        _fitting(command, found, value)
    _parsed(command, key, value)


def _fitting(command: Command, key: _Key, value: str) -> None:
    """Refuses a value of another type than that of its key."""
    setting = f"{command.name}: {key.name}={value}"
    if value == "null" and key.plain != key.kind:
        return
    if key.plain in _KINDS and not key.takes(value):
        _, wrong, right = _KINDS[key.plain]
        raise UsageError(f"{setting} is {wrong}", f"write {key.name}= and {right}")
    if key.kind is str and value == "null":
        raise UsageError(f"{setting} is nothing", f"write {key.name}= and a name")
    if typing.get_origin(key.kind) is list and not (value[:1] == "[" and value[-1:] == "]"):
        listed = f"[{value.strip('[]')}]"
        raise UsageError(f"{setting} is no list", f"write {key.name}={listed}")


def unknown_key(command: Command, key: str) -> UsageError:
    """What is said of a key that there is not.

    Parameters
    ----------
    command
        The command.
    key
        What was typed.

    """
    known = [kind.rstrip("_") for kind in typing.get_type_hints(command.settings)]
    near = get_close_matches(key, known, 1)
    mean = f"did you mean {near[0]}? " if near else ""
    return UsageError(f"{command.name}: no key {key!r}", mean + _list_of(command))


def refused(command: Command, error: Exception, config_dir: str | None) -> UsageError:
    """What is said of a configuration that cannot be composed.

    Parameters
    ----------
    command
        The command.
    error
        Of Hydra, OmegaConf or the reader of YAML.
    config_dir
        Folder of configuration files that come before those of the package.

    """
    # Hydra's first line names the file, OmegaConf's next one the fault, and one the key.
    lines = [line.strip() for line in str(error.__cause__ or error).splitlines()]
    named = [line.partition(": ")[2] for line in lines if line.startswith("full_key: ")]
    file = re.match("In '(.+?)'.*:$", lines[0])
    reason = (lines[1] if file else " ".join(lines) if not named else lines[0]).rstrip(".")
    where = f"{config_dir}/{file[1]}.yaml" if file and config_dir else command.name
    if not named:
        return UsageError(f"{where}: {reason}", _list_of(command))
    try:
        key = _key(command, named[0])
    except UsageError as unknown:
        return UsageError(f"{where}: {unknown.message.partition(': ')[2]}", unknown.remedy)
    if key.has_keys:
        return UsageError(f"{where}: {key.name} is a group of keys", _below(key))
    fault = (
        f"is {_KINDS[key.plain][1]}" if key.plain in _KINDS else "is one value: no list, no keys"
    )
    if typing.get_origin(key.kind) is list:
        fault = "is no list of texts"
    return UsageError(f"{where}: {key.name} {fault}", _takes(key))


def is_group(key: str) -> bool:
    """Whether a key takes the name of a file of `conf/KEY/` and has no fields of its own.

    Parameters
    ----------
    key
        The key.

    """
    return key == "policy"


def unquoted(value: str) -> str:
    """A value without the quotes around it.

    Parameters
    ----------
    value
        As typed.

    """
    quoted = len(value) >= 2 and value[0] == value[-1] and value[0] in "'\""
    return value[1:-1] if quoted else value


def _key(command: Command, name: str) -> _Key:
    """The key of a dotted name, or the one that the name goes on below; raises UsageError."""
    kind: Any = command.settings
    about: Mapping[str, Any] = {}
    for depth, part in enumerate(parts := name.split(".")):
        group = ".".join(parts[:depth])
        if not is_dataclass(kind) and all(parts):
            return _Key(group, kind, about)
        kinds = typing.get_type_hints(kind) if is_dataclass(kind) else {}
        if part not in kinds:
            if not kinds or not group:
                raise unknown_key(command, name)
            has = ", ".join(f"{group}.{known}" for known in kinds)
            raise UsageError(f"{command.name}: no key {name!r}", f"{group} has {has}")
        about = next(field.metadata for field in fields(kind) if field.name == part)
        kind = kinds[part]
    return _Key(name, kind, about)


def _instead(key: _Key, rest: str, value: str) -> str:
    """What to write instead of `KEY.REST=VALUE`, where nothing can stand below KEY."""
    if typing.get_origin(key.kind) is list:
        return f"write {key.name}=[{rest}]"
    meant = rest if rest in key.about.get("one_of", ()) else value
    mean = f"did you mean {key.name}={meant}? " if key.takes(meant) else ""
    return f"{mean}{_takes(key)}"


def _takes(key: _Key) -> str:
    words = key.about.get("words", "a value").split("; ")[0]
    return (
        f"it takes {_KINDS[key.plain][2]}: {words}" if key.plain in _KINDS else f"it takes {words}"
    )


def _below(key: _Key) -> str:
    if is_dataclass(key.kind):
        has = ", ".join(f"{key.name}.{field.name}" for field in fields(key.kind))
        return f"it has {has}"
    return f"write {key.name}.NAME=value ({key.about['words']})"


def _parsed(command: Command, key: str, value: str) -> None:
    """Refuses what Hydra's grammar cannot read."""
    from hydra.core.override_parser.overrides_parser import OverridesParser
    from hydra.errors import HydraException

    try:
        OverridesParser.create().parse_override(f"{key}={value}")
    except HydraException as error:
        remedy = f"close its brackets and quotes, or write '{key}=\"...\"' for a text"
        raise UsageError(f"{command.name}: {key}={value} cannot be read", remedy) from error


def _list_of(command: Command) -> str:
    return f"`{program()} {command.name} --help` lists the keys"


def _known_name(command: Command, key: str, value: str, config_dir: str | None) -> None:
    try:
        named_file(key, value, config_dir)
    except UsageError as error:
        raise UsageError(f"{command.name}: {error.message}", error.remedy) from error
