"""All estimates of one motor, with the preferred one of each name."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from pipeline.records.estimate import Estimate


@dataclass(frozen=True, slots=True)
class Constants:
    """Estimates in order of preference: for each name the first one with a value is `best`."""

    estimates: tuple[Estimate, ...] = ()

    def adding(self, estimates: Iterable[Estimate]) -> Constants:
        """These constants and further, less preferred ones.

        Parameters
        ----------
        estimates
            In order of preference.

        """
        return Constants(self.estimates + tuple(estimates))

    def only(self, names: Iterable[str]) -> Constants:
        """The estimates of some constants, in the same order.

        Parameters
        ----------
        names
            Names of constants.

        """
        kept = frozenset(names)
        return Constants(tuple(e for e in self.estimates if e.name in kept))

    def best(self, name: str) -> Estimate | None:
        """The preferred estimate of a constant that has a value.

        Parameters
        ----------
        name
            Name of the constant.

        Returns
        -------
        Estimate or None
            None where no estimate of that name has a value.

        """
        return next((e for e in self.estimates if e.name == name and e.known), None)

    def by(self, method: str, name: str) -> Estimate | None:
        """What one method found for a constant.

        Parameters
        ----------
        method
            Name of an estimator.
        name
            Name of the constant.

        Returns
        -------
        Estimate or None
            None where that method gave no value.

        """
        estimates = (e for e in self.estimates if e.name == name and e.method == method and e.known)
        return next(estimates, None)

    def all_of(self, name: str) -> tuple[Estimate, ...]:
        """Every estimate of a constant, with a value or without, in order of preference.

        Parameters
        ----------
        name
            Name of the constant.

        """
        return tuple(e for e in self.estimates if e.name == name)

    def chosen(self) -> dict[str, Estimate]:
        """One estimate a name: the best, or the first reason why there is none."""
        names = dict.fromkeys(e.name for e in self.estimates)
        return {name: self.best(name) or self.all_of(name)[0] for name in names}

    def rest(self) -> tuple[Estimate, ...]:
        """The known estimates that were not chosen: the same constant by another method."""
        chosen = self.chosen()
        return tuple(e for e in self.estimates if e.known and chosen[e.name] is not e)
