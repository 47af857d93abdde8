"""An estimated constant: value, uncertainty, conditions and where it came from."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Annotated, Any, Literal

from pipeline.records.field_kinds import Count, Extension, Keyword, Name, Spread
from pipeline.records.uncertainty import Budget, effective_dof, propagate, standard_uncertainty

Status = Literal["measured", "derived", "assumed", "stated", "not_identifiable"]
Conditions = Mapping[str, float | int | str]
MOST = 1e150


@dataclass(frozen=True, slots=True)
class Order:
    """One order a turn that was found.

    Attributes
    ----------
    order
        Cycles a mechanical turn.
    amplitude, u
        With its standard uncertainty [unit of the estimate].
    phase_rad
        Of its cosine.

    """

    order: Count
    amplitude: Spread
    u: Spread
    phase_rad: float


@dataclass(frozen=True, slots=True)
class Estimate:
    """One constant of one motor.

    Attributes
    ----------
    name, unit
        Names of the glossary.
    value
        None exactly when `status` is `not_identifiable`.
    status
        `measured`, `derived` from other constants, `assumed`, `stated`, or `not_identifiable`.
    method
        Name of the estimator.
    budget
        Contributions to the standard uncertainty [unit].
    at
        Conditions that the value holds for; names of the glossary, unit last.
    captures
        Paths of the captures that were used.
    note
        Remark for people.
    bounds
        Range that was searched [unit].
    at_bound
        Whether the value lies at an end of that range.
    orders
        The spectrum that the value was taken from.
    impossible
        The value lies where no motor is, by more than its uncertainty explains: a clock, a sign or
        a unit of `captures` is wrong.
    settled
        It was searched for and is absent, down to the size in the note.

    Raises
    ------
    ValueError
        The value is not finite, or is None with another status than `not_identifiable`.

    """

    name: Name
    value: float | int | None
    unit: Name
    status: Status
    method: str
    budget: Extension[Budget] = ()
    at: Conditions = field(default_factory=dict)
    captures: tuple[Name, ...] = ()
    note: str = ""
    bounds: Extension[tuple[float, float] | None] = None
    at_bound: Extension[bool] = False
    orders: Extension[tuple[Order, ...]] = ()
    impossible: bool = False
    settled: Extension[Annotated[bool, Keyword("const", True)]] = False

    def __post_init__(self) -> None:
        if (self.value is None) != (self.status == "not_identifiable"):
            raise ValueError(f"{self.name}: a value is None exactly when not identifiable")
        if self.value is not None and not math.isfinite(self.value):
            raise ValueError(f"{self.name}: value {self.value} is not finite")

    @property
    def known(self) -> bool:
        """Whether there is a value."""
        return self.value is not None

    @property
    def finite(self) -> bool:
        """Whether every number is one that a document can hold and that can be squared."""
        numbers: list[float] = [part.u for part in self.budget]
        numbers += [x for x in self.at.values() if not isinstance(x, str)]
        numbers += self.bounds or ()
        numbers += [x for one in self.orders for x in (one.amplitude, one.u, one.phase_rad)]
        return all(abs(x) < MOST for x in numbers)

    @property
    def number(self) -> float:
        """The value, for callers that have checked `known`; else a ValueError."""
        if self.value is None:
            raise ValueError(f"{self.name} is not identifiable: {self.note}")
        return float(self.value)

    @property
    def u(self) -> Spread:
        """Combined standard uncertainty (k=1) [unit]."""
        return standard_uncertainty(self.budget)

    @property
    def u_a(self) -> Spread:
        """Standard uncertainty from scatter, type A [unit]."""
        return standard_uncertainty(self.budget, "A")

    @property
    def u_b(self) -> Spread:
        """Standard uncertainty from instruments and assumptions, type B [unit]."""
        return standard_uncertainty(self.budget, "B")

    @property
    def dof(self) -> Spread:
        """Effective degrees of freedom of `u`."""
        return effective_dof(self.budget)

    def interval(self, level: float = 0.95) -> tuple[float, float]:
        """Coverage interval of the value.

        Parameters
        ----------
        level
            Coverage probability [1].

        Returns
        -------
        low, high
            [unit], by Student's t with the effective degrees of freedom.

        """
        from scipy.special import stdtrit

        dof = min(self.dof, 1e9)
        half = float(stdtrit(dof, 0.5 + level / 2)) * self.u
        return self.number - half, self.number + half

    def document(self) -> dict[str, Any]:
        """The JSON form of `contract/outputs.md`; infinite degrees of freedom become null."""
        known = self.known
        more: dict[str, Any] = {"settled": True} if self.settled else {}
        if self.orders:
            more["orders"] = [asdict(one) for one in self.orders]
        return more | {
            "value": self.value,
            "unit": self.unit,
            "u": self.u if known else None,
            "u_a": self.u_a if known else None,
            "u_b": self.u_b if known else None,
            "dof": self.dof if known and math.isfinite(self.dof) else None,
            "at": dict(sorted(self.at.items())),
            "method": self.method,
            "status": self.status,
            "captures": list(self.captures),
            "note": self.note,
            "bounds": None if self.bounds is None else list(self.bounds),
            "at_bound": self.at_bound,
            "budget": [
                {
                    "source": part.source,
                    "u": part.u,
                    "kind": part.kind,
                    "dof": part.dof if math.isfinite(part.dof) else None,
                }
                for part in self.budget
                if known
            ],
        }


def not_identifiable(name: str, unit: str, method: str, note: str) -> Estimate:
    """The result that says which experiment is missing; `note` names it.

    Parameters
    ----------
    name, unit
        Names of the glossary.
    method
        Name of the estimator.
    note
        Which experiment is missing.

    """
    return Estimate(name, None, unit, "not_identifiable", method, note=note)


def not_there(name: str, unit: str, method: str, note: str) -> Estimate:
    """The result that says that it was looked for and not found; `note` names down to what size.

    Parameters
    ----------
    name, unit
        Names of the glossary.
    method
        Name of the estimator.
    note
        Down to what size it was searched for.

    """
    return replace(not_identifiable(name, unit, method, note), settled=True)


def derived(
    name: str,
    unit: str,
    value: float,
    terms: list[tuple[float, Estimate]],
    method: str,
    at: Conditions | None = None,
) -> Estimate:
    """A constant that is computed from others.

    Parameters
    ----------
    name
        Of the constant.
    unit
        As in the glossary.
    value
        [unit]
    terms
        Pairs of the partial derivative by an estimate [unit over its unit] and the estimate.
    method
        What computes it.
    at
        Conditions that it holds at.

    Returns
    -------
    Estimate
        Of status `derived`, on all captures of its inputs; sources that they share cancel or add.

    """
    captures = sorted({path for _, source in terms for path in source.captures})
    budget = propagate((slope, source.budget) for slope, source in terms)
    return Estimate(name, value, unit, "derived", method, budget, at or {}, tuple(captures))
