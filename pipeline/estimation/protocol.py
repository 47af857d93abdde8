"""What an estimator is: one file, one `ESTIMATOR`, found by the registry."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from pipeline.physics.glossary import Term
from pipeline.records.capture import Campaign
from pipeline.records.constants import Constants
from pipeline.records.estimate import Estimate
from pipeline.records.evidence import Evidence


@dataclass(frozen=True, slots=True)
class Fit:
    """The result of an estimator.

    Attributes
    ----------
    estimates
        In order of preference.
    evidence
        Plots of what was measured beside what was fitted.

    """

    estimates: tuple[Estimate, ...]
    evidence: tuple[Evidence, ...] = ()


FitFunction = Callable[[Campaign, Constants, Mapping[str, float]], Fit]


@dataclass(frozen=True, slots=True)
class Estimator:
    """What an estimator gives, what it needs, and its pure function `fit(campaign, known,
    options)`.

    Attributes
    ----------
    name
        Name of the method.
    gives
        Constants (glossary names); every call returns all of them, measured or not_identifiable.
    tests
        Captures that it can use. Without any of them it is not called, and all that it gives is
        not_identifiable with `experiment` as the note.
    experiment
        The test to record where a constant is missing.
    fit
        Pure function of the captures, of the constants known so far, and of the options.
    uses
        Constants of other estimators that it takes from `known` where they are there; it runs after
        all estimators that give them.
    either
        Those of `uses` of which one is enough.
    aids
        Those of `uses` that refine the result and are not needed; a plan does not propose to record
        them for that.
    rank
        Preference among estimators of one constant; the lowest is published, among equals the one
        that is known best.
    terms
        Glossary entries of constants that `contract/outputs.md` does not name.
    clock_powers
        By constant, the power p of a relative error of the clock in it: 2 for an inertia, 0 for a
        torque over a current. What comes with `known` constants is in their budgets.
    options
        Settings with defaults; `fit.NAME.KEY=` overrides one.

    """

    name: str
    gives: tuple[str, ...]
    tests: tuple[str, ...]
    experiment: str
    fit: FitFunction
    uses: tuple[str, ...] = ()
    either: tuple[str, ...] = ()
    aids: tuple[str, ...] = ()
    rank: int = 0
    terms: tuple[Term, ...] = ()
    clock_powers: Mapping[str, int] = field(default_factory=dict)
    options: Mapping[str, float] = field(default_factory=dict)
