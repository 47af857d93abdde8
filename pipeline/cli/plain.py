"""Records as plain data, for `json=true`."""

from __future__ import annotations

from collections.abc import Mapping, Set
from dataclasses import fields, is_dataclass
from datetime import date
from pathlib import Path
from typing import Any


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
