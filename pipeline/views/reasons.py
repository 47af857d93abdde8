"""Reasons that several motors or constants have, each stated once."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

SHARED = 2
"""Members from which on a reason is stated once for all of them."""


@dataclass(frozen=True, slots=True)
class Reason:
    """A reason, and the motors or constants that it holds for."""

    text: str
    members: tuple[str, ...]


def shared_reasons(reasons: Iterable[tuple[str, str]]) -> tuple[Reason, ...]:
    """Reasons of two members or more, the commonest first, of (member, reason) pairs.

    Parameters
    ----------
    reasons
        Pairs of member and reason.

    """
    members: dict[str, dict[str, None]] = {}
    for member, text in reasons:
        members.setdefault(text, {})[member] = None
    shared = [Reason(text, tuple(own)) for text, own in members.items() if len(own) >= SHARED]
    return tuple(sorted(shared, key=lambda reason: (-len(reason.members), reason.text)))
