"""What differs between two golden files, one line a place."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

ABSENT = "absent"


def differences(old: Any, new: Any, place: str = "") -> Iterator[str]:
    """Lines `place: old -> new`; numbers differ unless they are equal to the last bit."""
    if isinstance(old, dict) and isinstance(new, dict):
        for key in sorted(old.keys() | new.keys()):
            inner = f"{place} {key}".strip()
            yield from differences(old.get(key, ABSENT), new.get(key, ABSENT), inner)
    elif isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        for index, (one, other) in enumerate(zip(old, new, strict=True)):
            yield from differences(one, other, f"{place} {index}")
    elif old != new:
        yield f"{place}: {_text(old)} -> {_text(new)}{_share(old, new)}"


def _text(value: Any) -> str:
    text = str(value)
    return text if len(text) <= 80 else f"{text[:77]}..."


def _share(old: Any, new: Any) -> str:
    """By how much a number changed, of the old one."""
    if not (isinstance(old, float) and isinstance(new, float)) or old == 0.0:
        return ""
    return f" ({new / old - 1.0:+.2g})"
