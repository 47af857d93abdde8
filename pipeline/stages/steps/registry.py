"""The registry that a command works on, and what its keys name."""

from __future__ import annotations

import shlex
from pathlib import Path

from pipeline.io.registry.store import Registry
from pipeline.records.errors import UsageError
from pipeline.records.ledger import Version
from pipeline.settings import ExportSettings, RegistrySettings, RegressSettings, RunSettings

Keys = RunSettings | RegistrySettings | RegressSettings | ExportSettings


def opened(settings: Keys) -> Registry:
    """The registry of the key `registry`; `auto` is the one in the output folder.

    Parameters
    ----------
    settings
        The keys of the command.

    """
    place = settings.registry or "auto"
    if place == "auto":
        place = (Path(settings.output) / "registry").as_posix()
    return Registry(place, {name: str(one) for name, one in settings.registry_options.items()})


def naming(settings: Keys) -> str:
    """The keys that name the same registry in another command, but for those of the default.

    Parameters
    ----------
    settings
        The keys of the command.

    """
    places = (("output", settings.output), ("registry", settings.registry or "auto"))
    usual = {"output": RegistrySettings().output, "registry": "auto"}
    return "".join(f" {name}={shlex.quote(at)}" for name, at in places if at != usual[name])


def history_of(registry: Registry, motor_id: str) -> tuple[Version, ...]:
    """The versions of a motor, oldest first.

    Parameters
    ----------
    registry
        Where they are.
    motor_id
        The motor.

    Raises
    ------
    UsageError
        There is none.

    """
    history = registry.history(motor_id)
    if not history:
        raise unknown_motor(registry, motor_id)
    return history


def unknown_motor(registry: Registry, motor_id: str) -> UsageError:
    """What is said of a motor that a registry does not know.

    Parameters
    ----------
    registry
        The registry.
    motor_id
        The motor.

    """
    return UsageError(f"no motor {motor_id!r} in {registry.place}", "`registry list` shows all")


def revision_number(text: str, name: str = "revision") -> int:
    """A revision that was typed.

    Parameters
    ----------
    text
        What was typed.
    name
        Of the key.

    Raises
    ------
    UsageError
        It is no whole number.

    """
    if not (text.isascii() and text.isdigit() and len(text) < 19):
        raise UsageError(f"{name}={text} is no revision", "a whole number: 1, 2, ...")
    return int(text)
