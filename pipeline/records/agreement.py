"""Captures of one motor that are, or are not, of one motor: nouns of that test."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.records.uncertainty import Budget

Way = tuple[str, ...]
"""What two captures share that measure a quantity alike: test, place and method."""


@dataclass(frozen=True, slots=True)
class Reading:
    """One quantity of the motor from one capture alone.

    `value` is positive [unit]; the parts of `budget` that other captures share have sources of
    one name. `u_rel_model` is the systematic error of the method from one capture to the next, as a
    relative standard uncertainty. Readings of different ways may differ by a convention.

    Attributes
    ----------
    quantity
        Name of what is read, such as `psi_pm_wb`.
    way
        Test, place and method: what captures that measure it alike share.
    path
        The capture.
    value, unit
        Positive, in the unit.
    budget
        Contributions [unit]; those that other captures share bear one source name.
    u_rel_model
        Relative standard uncertainty [1] of the method from one capture to the next.

    """

    quantity: str
    way: Way
    path: str
    value: float
    unit: str
    budget: Budget
    u_rel_model: float


@dataclass(frozen=True, slots=True)
class Group:
    """Captures that agree with each other on a quantity: weighted mean and its u [unit]."""

    paths: tuple[str, ...]
    mean: float
    u: float


@dataclass(frozen=True, slots=True)
class Disagreement:
    """Groups of captures that differ in one quantity; `usual` is the larger, `odd` the others.

    `tied` where the two largest are of one size, so that neither is the odd one.

    Attributes
    ----------
    quantity, unit
        What the groups differ in.
    usual
        The largest group.
    odd
        The other groups.
    p_value
        Chance of groups this far apart where all are of one value.
    tied
        Whether the two largest groups are of one size.

    """

    quantity: str
    unit: str
    usual: Group
    odd: tuple[Group, ...]
    p_value: float
    tied: bool

    @property
    def odd_paths(self) -> tuple[str, ...]:
        """The captures outside the largest group."""
        return tuple(sorted(path for group in self.odd for path in group.paths))

    @property
    def paths(self) -> tuple[str, ...]:
        """Every capture of the groups."""
        return tuple(sorted({*self.usual.paths, *self.odd_paths}))
