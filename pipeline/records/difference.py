"""What changed between two datasheets of one motor, judged by their uncertainties."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from pipeline.records.estimate import Estimate
from pipeline.records.uncertainty import Budget, covariance


@dataclass(frozen=True, slots=True)
class Change:
    """One constant before and after.

    Attributes
    ----------
    name
        Name of the constant.
    before, after
        The estimates; None where a datasheet does not hold the constant.

    """

    name: str
    before: Estimate | None
    after: Estimate | None

    @property
    def unit(self) -> str:
        """The constant's unit."""
        estimate = self.after or self.before
        return "1" if estimate is None else estimate.unit

    @property
    def change(self) -> float | None:
        """After minus before [unit]; None where a value is missing."""
        if self.before is None or self.after is None:
            return None
        if not (self.before.known and self.after.known):
            return None
        return self.after.number - self.before.number

    @property
    def in_u(self) -> float | None:
        """The change over u_c = sqrt(u1^2 + u2^2): how far apart the two statements are [1]."""
        if self.before is None or self.after is None:
            return None
        return self._over(math.hypot(self.before.u, self.after.u))

    @property
    def in_u_of_difference(self) -> float | None:
        """The change over the uncertainty of the difference itself [1].

        u_d^2 = u1^2 + u2^2 - 2 cov(1, 2): what one instrument adds to both values cancels, while
        the scatter of two fits is independent. Reference: JCGM 100:2008 (GUM), 5.2.2.
        """
        if self.before is None or self.after is None:
            return None
        one, other = self.before, self.after
        shared = covariance(_systematic(one), _systematic(other))
        return self._over(math.sqrt(max(one.u**2 + other.u**2 - 2.0 * shared, 0.0)))

    def _over(self, u: float) -> float | None:
        """The change in units of u; 0 for none, infinite where u is 0, None without values."""
        change = self.change
        if change is None:
            return None
        if u == 0.0:
            return math.copysign(math.inf, change) if change else 0.0
        return change / u


def changes(before: Mapping[str, Estimate], after: Mapping[str, Estimate]) -> tuple[Change, ...]:
    """Every constant of either of two datasheets, sorted by name.

    Parameters
    ----------
    before, after
        Estimates by name.

    Returns
    -------
    tuple of Change
        One a name; a side that lacks the name is None.

    """
    return tuple(
        Change(name, before.get(name), after.get(name)) for name in sorted({*before, *after})
    )


def _systematic(estimate: Estimate) -> Budget:
    return tuple(part for part in estimate.budget if part.kind == "B")
