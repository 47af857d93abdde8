"""Hydra, kept at arm's length: `conf/` and overrides in, one settings object out.

Text keys are taken as typed, because an override grammar would turn serial number 00123 into 83
(YAML 1.1 octal) and `${...}` into a look-up. No resolver and no `_target_` is ever evaluated.
"""

from __future__ import annotations

import shlex
import typing
from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

from pipeline.cli.commands import Command, program
from pipeline.cli.overrides import check_override, is_group, refused, unknown_key, unquoted
from pipeline.records.errors import UsageError
from pipeline.settings import Settings, configuration_folder


def load_settings(
    command: Command, words: Sequence[str], config_dir: str | None = None
) -> Settings:
    """The settings of a command from its defaults, `conf/command/NAME.yaml` and the overrides.

    Files of the folder `config_dir` come before those of the package.

    Parameters
    ----------
    command
        The command.
    words
        The words of the command line after the command.
    config_dir
        Folder of configuration files that come before those of the package.

    Raises
    ------
    UsageError
        An unknown key, a value of the wrong type or a word that is no override, and for a
        `config_dir` that is no folder.

    """
    kinds = typing.get_type_hints(command.settings)
    named = _with_names(command, words)
    stated = [word.partition("=")[2] for word in named if word.startswith("config_dir=")]
    config_dir = str(Path(stated[-1]).expanduser()) if stated else config_dir
    texts: dict[str, str | None] = {}
    free: dict[str, str] = {}
    rest: list[str] = []
    for word in named:
        key, _, value = word.partition("=")
        if f"{key}_" in kinds:
            key = f"{key}_"  # the key is a word of Python, such as `from`
        if _is_text(kinds.get(key)):
            texts[key] = _text(command, key, unquoted(value), kinds[key])
        elif command.free and key not in kinds:
            free[key] = unquoted(value)
        else:
            if key.lstrip("+").split(".")[0] not in kinds:
                raise unknown_key(command, key.lstrip("+"))
            check_override(command, key.lstrip("+"), value, config_dir)
            nested = typing.get_origin(kinds.get(key.split(".")[0])) is dict and not is_group(key)
            rest.append(f"++{word}" if nested else word)
    texts["config_dir"] = config_dir
    if config_dir is not None and not Path(config_dir).is_dir():
        raise UsageError(f"config_dir={config_dir} is no folder", "name a folder like conf/")
    settings = _composed(command, rest, config_dir)
    for key, text in texts.items():
        setattr(settings, key, text)
    if command.free:
        setattr(settings, command.free, free)
    return settings


def _text(command: Command, key: str, text: str, kind: Any) -> str | None:
    """The value of a text key; raises UsageError for one that it cannot take."""
    setting = f"{command.name}: {key.rstrip('_')}={text}"
    about = next(f.metadata for f in fields(command.settings) if f.name == key)
    if text == "null":
        if kind is str:
            raise UsageError(f"{setting} is nothing", f"it takes {about['words']}")
        return None
    if about["one_of"] and text not in about["one_of"]:
        raise UsageError(f"{setting} is unknown", f"it is {' or '.join(about['one_of'])}")
    if not about["place"]:
        return text
    if not text.strip():
        here = "; `.` is the current folder" if key in ("input", "output") else ""
        raise UsageError(f"{setting} is empty", f"it takes {about['words']}{here}")
    # a shell expands no ~ after `=`
    return str(Path(text).expanduser()) if text == "~" or text.startswith("~/") else text


def settings_text(settings: Settings) -> str:
    """Settings as the YAML that `--cfg job` prints.

    Parameters
    ----------
    settings
        The keys of the command.

    """
    from omegaconf import OmegaConf

    return OmegaConf.to_yaml(OmegaConf.structured(settings))


def origin_text(command: Command, settings: Settings) -> str:
    """Where settings come from, the nearest first, as `--info` prints it.

    Parameters
    ----------
    command
        The command.
    settings
        The keys of the command.

    """
    places = [settings.config_dir, str(configuration_folder())]
    files = [
        f"  {path}" + ("" if path.is_file() else "  (not there)")
        for place in places
        if place is not None
        for path in [Path(place) / "command" / f"{command.name}.yaml"]
    ]
    defaults = f"  {command.settings.__module__}.{command.settings.__name__}"
    return "\n".join([f"{command.name}: the first of these that names a key", *files, defaults])


def _with_names(command: Command, words: Sequence[str]) -> list[str]:
    """Words without `=` take the positional names in their order."""
    free = list(command.positional)
    named = []
    for word in words:
        if "=" in word and word.split("=", 1)[0].lstrip("+~").replace(".", "_").isidentifier():
            named.append(word)
        elif free:
            named.append(f"{free.pop(0)}={word}")
        else:
            raise UsageError(
                f"{command.name}: {word!r} is no key=value",
                f"`{program()} {command.name} --help` lists the keys",
            )
    return named


def _composed(command: Command, overrides: list[str], config_dir: str | None) -> Settings:
    from hydra import compose, initialize_config_dir
    from hydra.core.config_store import ConfigStore
    from hydra.errors import HydraException
    from omegaconf import OmegaConf
    from omegaconf.errors import OmegaConfBaseException
    from yaml import YAMLError

    if any("${" in word for word in overrides):
        raise UsageError("overrides hold no ${...}", "write the value itself")
    store = ConfigStore.instance()
    store.store(group="schema", name=command.name, node=command.settings, package="_global_")
    folder = configuration_folder()
    # A primary config would be looked for before there is a search path: the command is a group.
    overrides = [f"+command={command.name}", *overrides]
    if config_dir is not None:
        package = f"file://{folder}".replace("'", "\\'")
        overrides, folder = [*overrides, f"hydra.searchpath=['{package}']"], Path(config_dir)
    try:
        with initialize_config_dir(str(folder.resolve()), version_base="1.3"):
            config = compose(None, overrides=overrides)
        if "${" in repr(OmegaConf.to_container(config, resolve=False)):
            raise UsageError(f"{config_dir} holds ${{...}}", "write the value itself")
        settings: Settings = typing.cast(Settings, OmegaConf.to_object(config))
    except (HydraException, OmegaConfBaseException, YAMLError) as error:
        raise refused(command, error, config_dir) from error
    return settings


def _is_text(kind: Any) -> bool:
    return kind is str or kind == str | None


def with_source(command: str, settings: Settings) -> str:
    """A command that reads captures, with the source map that this one read them by.

    Parameters
    ----------
    command
        Command and keys, as printed after a command.
    settings
        Of the command that was given.

    """
    source = getattr(settings, "source", "auto")
    if source == "auto" or " input=" not in command:
        return command
    return f"{command} source={shlex.quote(source)}"
