"""Records as plain data, for `json=true`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Set
from dataclasses import fields, is_dataclass
from datetime import date
from pathlib import Path
from typing import Any


def finite(value: Any) -> Any:
    """The value as plain data in which a number that is not finite is null, as in every output.

    Parameters
    ----------
    value
        Records, mappings and sequences of what `plain` takes.

    Raises
    ------
    TypeError
        Something in it has no form in JSON.

    """
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, str | int):
        return value
    if isinstance(value, Mapping):
        return {name: finite(one) for name, one in value.items()}
    if isinstance(value, list | tuple):
        return [finite(one) for one in value]
    return finite(plain(value))


def plain(value: Any) -> Any:
    """What JSON has no form for as something that it has: the `default` of `json.dumps`.

    A record becomes an object of its fields, a time ISO 8601 text, a set a sorted list.

    Parameters
    ----------
    value
        The value.

    Raises
    ------
    TypeError
        Anything else.

    """
    if is_dataclass(value) and not isinstance(value, type):
        return {field.name: getattr(value, field.name) for field in fields(value)}
    if isinstance(value, date):
        return value.isoformat()
    if isinstance(value, Path):
        return value.as_posix()
    if isinstance(value, Mapping):
        return dict(value)
    if isinstance(value, Set):
        return sorted(plain(one) if isinstance(one, Path) else one for one in value)
    raise TypeError(f"{type(value).__name__} has no form in JSON")
