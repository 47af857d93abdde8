"""What every estimator says, in one form: measured constants, refusals, plots."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.estimation.protocol import Fit
from pipeline.estimation.uncertainty.instruments import budget_of
from pipeline.numerics.plateaus import decimated
from pipeline.physics.glossary import CONSTANTS, Term
from pipeline.records.capture import Array, Capture, Indices
from pipeline.records.estimate import Conditions, Estimate, not_identifiable, not_there
from pipeline.records.evidence import Evidence, PlotKind, Series
from pipeline.records.uncertainty import Contribution


@dataclass(frozen=True, slots=True)
class Method:
    """An estimator as the author of results: its name, and the terms that it adds to the glossary.

    Examples
    --------
    >>> Method("resistance").missing("r_phase_ohm", "record a resistance").note
    'record a resistance'

    """

    name: str
    terms: tuple[Term, ...] = ()

    def unit(self, constant: str) -> str:
        """The unit of a constant, by this estimator's own terms, else by the glossary.

        Parameters
        ----------
        constant
            Name of the constant.

        Returns
        -------
        str
            Such as `N·m/A`.

        Raises
        ------
        KeyError
            Neither knows the constant.

        """
        declared = next((term for term in self.terms if term.name == constant), None)
        return (declared or CONSTANTS[constant]).unit

    def scatter(self, of: str, u: float, dof: float = math.inf) -> Contribution:
        """The scatter of something that this method fits.

        Parameters
        ----------
        of
            What.
        u
            Its standard uncertainty [its unit].
        dof
            Degrees of freedom.

        Returns
        -------
        Contribution
            Of type A, from a source that no other fit shares.

        """
        return Contribution(f"scatter:{self.name}:{of}", u, "A", dof)

    def measured(
        self,
        constant: str,
        value: float,
        parts: Iterable[Contribution] = (),
        captures: Iterable[Capture | str] = (),
        at: Conditions | None = None,
        notes: str | Iterable[str] = (),
    ) -> Estimate:
        """A measured constant.

        Parameters
        ----------
        constant
            Its name.
        value
            In the constant's unit, as all `parts` are.
        parts
            Contributions to its uncertainty; those of one source add with their signs.
        captures
            What it rests on, or the paths of it.
        at
            The conditions it holds for.
        notes
            Empty ones are left out.

        """
        paths = tuple(c if isinstance(c, str) else c.path for c in captures)
        note = notes if isinstance(notes, str) else "; ".join(words for words in notes if words)
        return Estimate(
            constant, value, self.unit(constant), "measured", self.name,
            budget_of(parts), at or {}, paths, note,
        )  # fmt: skip

    def missing(self, constant: str, note: str) -> Estimate:
        """A constant that the captures do not determine; `note` names the test that would.

        Parameters
        ----------
        constant
            Its name.
        note
            The test that would determine it.

        """
        return not_identifiable(constant, self.unit(constant), self.name, note)

    def absent(self, constant: str, note: str) -> Estimate:
        """A constant that was looked for and is not there; `note` says down to what size.

        Parameters
        ----------
        constant
            Its name.
        note
            Down to what size it was searched for.

        """
        return not_there(constant, self.unit(constant), self.name, note)

    def nothing(self, constants: Iterable[str], note: str) -> Fit:
        """The result of an estimator that cannot determine any of its constants.

        Parameters
        ----------
        constants
            Their names.
        note
            The test that would determine them.

        """
        return Fit(tuple(self.missing(constant, note) for constant in constants))

    def plot(
        self,
        title: str,
        axes: tuple[str, str],
        kind: PlotKind,
        series: Iterable[Series],
        caption: str = "",
        capture: str | None = None,
    ) -> Evidence:
        """A plot of what this method looked at.

        Parameters
        ----------
        title
            Of the plot.
        axes
            Glossary names of x and y.
        kind
            Line, scatter, ...
        series
            What is drawn.
        caption
            Below the plot.
        capture
            Path of the capture that it is of, where it is of one.

        Returns
        -------
        Evidence

        """
        return Evidence(self.name, title, *axes, kind, tuple(series), capture, caption)

    def traces(
        self,
        captures: Sequence[Capture],
        titles: str | Sequence[str],
        column: str,
        rows: tuple[Indices, Array, Array, Array],
        caption: str,
    ) -> list[Evidence]:
        """A plot over time a capture, thinned, of regression rows of several captures.

        Parameters
        ----------
        captures
            By number.
        titles
            One a capture, or one for all.
        column
            The name of what was measured.
        rows
            Number of the capture, time [s], measured and fitted value of each row, all [n].
        caption
            Of all plots.

        """
        number, t_s, measured, fitted = rows
        titles = [titles] * len(captures) if isinstance(titles, str) else titles
        plots = []
        for index, (capture, title) in enumerate(zip(captures, titles, strict=True)):
            chosen = np.flatnonzero(number == index)
            chosen = chosen[decimated(chosen.size)]
            series = Series(capture.path, t_s[chosen], measured[chosen], fitted[chosen])
            plots.append(
                self.plot(title, ("t_s", column), "line", (series,), caption, capture.path)
            )
        return plots


def over_x(label: str, x: Array, measured: Array, fitted: Array) -> Series:
    """A series of points [n], sorted by x.

    Parameters
    ----------
    label
        Distinguishes the series of one plot.
    x, measured, fitted : array [n]
        In the units of the plot's axes.

    """
    order = np.argsort(x, kind="stable")
    return Series(label, x[order], measured[order], fitted[order])
