"""Which numbers of the policy a diagnosis reads: no other value of the rest moves anything."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import fields, replace
from typing import Any

from pipeline.criticism.policy import policy as module
from pipeline.criticism.policy.policy import Policy
from pipeline.records.capture import Campaign
from tests.benchmark.blind import product

READS = "read"
"""Key of a kept document with the full names of the numbers that were read."""
_ITSELF = "pipeline.records.policy"
"""Lists every number, for a digest: that is no reading."""


def listening_product(campaign: Campaign, model: str) -> dict[str, Any]:
    """The diagnosis by the default policy, and what it read of it."""
    with listened() as seen:
        document = product(campaign, model)
    return {**document, READS: sorted(seen)}


@contextmanager
def listened() -> Iterator[set[str]]:
    """Fills a set with the names of the numbers of the default policy that are read meanwhile."""
    plain, seen = module.DEFAULT, set[str]()
    module.DEFAULT = listening(plain, seen)
    try:
        yield seen
    finally:
        module.DEFAULT = plain


def listening(policy: Policy, seen: set[str]) -> Policy:
    """An equal policy that notes in `seen` which of its numbers are read."""
    parts = {one.name: _noting(getattr(policy, one.name), one.name, seen) for one in fields(policy)}
    return replace(policy, **parts)


def _noting(section: Any, name: str, seen: set[str]) -> Any:
    numbers = {one.name: getattr(section, one.name) for one in fields(section)}

    def read(self: Any, attribute: str) -> Any:
        if attribute in numbers and sys._getframe(1).f_globals.get("__name__") != _ITSELF:
            seen.add(f"{name}.{attribute}")
        return object.__getattribute__(self, attribute)

    kind = type(section)
    noting = type(kind.__name__, (kind,), {"__getattribute__": read, "__slots__": ()})
    made = object.__new__(noting)
    for attribute, value in numbers.items():
        object.__setattr__(made, attribute, value)
    return made
