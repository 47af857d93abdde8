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
    """What an estimator found: estimates in order of preference, and what it looked at."""

    estimates: tuple[Estimate, ...]
    evidence: tuple[Evidence, ...] = ()


FitFunction = Callable[[Campaign, Constants, Mapping[str, float]], Fit]


@dataclass(frozen=True, slots=True)
class Estimator:
    """Declares what it gives and needs; `fit(campaign, known, options)` is pure.

    `gives`: constants (glossary names), all returned by every call, measured or not_identifiable.
    `tests`: captures it can use; with none of them in the campaign it is not called and every
        name it gives is not_identifiable with `experiment` as the note.
    `uses`: constants of other estimators it reads from `known` where they are there; it runs
        after all estimators that give them.
    `either`: those of `uses` of which one is enough. `aids`: those of `uses` that refine its result
        and that it does without; a plan sends nobody to record them for its sake.
    `rank`: preference among estimators that give the same constant; the lowest is published.
    `experiment`: the test to record, in words, when the constant is missing.
    `terms`: glossary entries for constants of its own that `contract/outputs.md` does not name.
    `clock_powers`: by constant, the power p of a clock that is wrong by a factor in what the
        captures themselves say of it: an inertia is seen as (1 + gain)² of itself, a torque over a
        current as it is (0, not in it). What comes with `known` constants is in their budgets.
    `options`: its settings with defaults; `fit.NAME.KEY=` in the configuration overrides.
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
