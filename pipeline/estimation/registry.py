"""Finds the estimators (one file each in `estimators/`) and runs them in dependency order."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache
from graphlib import TopologicalSorter
from typing import Any, NamedTuple

import numpy as np

from pipeline.estimation.policy import changed, under
from pipeline.estimation.protocol import Estimator, Fit
from pipeline.estimation.uncertainty.agreement import SAME, outranked, reconciled
from pipeline.estimation.uncertainty.instruments import with_clock
from pipeline.numerics.identifiability import within
from pipeline.physics.glossary import CONSTANTS, Term
from pipeline.plugins import PlugIn, discover
from pipeline.records.capture import Campaign
from pipeline.records.constants import Constants
from pipeline.records.estimate import Estimate, not_identifiable
from pipeline.records.evidence import Evidence
from pipeline.records.stated import stated_constants
from pipeline.records.uncertainty import without_between

BROKEN = (ValueError, ArithmeticError, LookupError, TypeError, np.linalg.LinAlgError)
REPORT = "the other constants stand; report the capture with this line"
Recall = Callable[[Estimator, Constants, Mapping[str, float], Callable[[], Fit]], Fit]
"""Gives a fit that was kept, or does it: (estimator, the constants it uses, options, fit)."""


class Failure(NamedTuple):
    """An estimator that broke: the code, message and remedy of a finding."""

    code: str
    message: str
    remedy: str


def estimator_terms() -> dict[str, Term]:
    """Constants of the estimators' own, beside those of the glossary, by name."""
    return {term.name: term for estimator in estimators() for term in estimator.terms}


def homes() -> Mapping[str, str]:
    """The module of every estimator by the estimator's name.

    Returns
    -------
    mapping of str to str
        Dotted names of modules, of this package and of others.

    """
    return {one.name: one.module for one in _plug_ins()}


def _plug_ins() -> tuple[PlugIn, ...]:
    return discover("pipeline.estimation.estimators", "ESTIMATOR", Estimator)


@cache
def estimators() -> tuple[Estimator, ...]:
    """Every estimator, of this package and of others.

    Returns
    -------
    tuple of Estimator
        In an order in which each comes after those that it uses; by rank and name otherwise.

    """
    plug_ins: dict[str, Estimator] = {one.name: one.value for one in _plug_ins()}
    givers: dict[str, list[str]] = {}
    for estimator in plug_ins.values():
        for constant in estimator.gives:
            givers.setdefault(constant, []).append(estimator.name)
    graph = {
        e.name: sorted({g for used in e.uses for g in givers.get(used, ()) if g != e.name})
        for e in sorted(plug_ins.values(), key=lambda e: (e.rank, e.name))
    }
    return tuple(plug_ins[name] for name in TopologicalSorter(graph).static_order())


@cache
def estimators_of(constants: frozenset[str]) -> tuple[Estimator, ...]:
    """The estimators that some constants depend on, in the order of `estimators`.

    Parameters
    ----------
    constants
        Names of the constants.

    Returns
    -------
    tuple of Estimator
        Those that give one of them, or something that these use or are held against.

    """
    needed, taken = set(constants), set[str]()
    while True:
        needed |= {other for name in needed for other in SAME.get(name, ())}
        givers = [e for e in estimators() if needed.intersection(e.gives)]
        if taken == (taken := {e.name for e in givers}):
            return tuple(givers)
        needed.update(used for e in givers for used in e.uses)


def fit_all(
    campaign: Campaign,
    options: Mapping[str, Mapping[str, float]],
    recall: Recall | None = None,
    only: frozenset[str] | None = None,
) -> tuple[Constants, tuple[Evidence, ...], tuple[Failure, ...]]:
    """Runs every estimator on one motor's campaign, or recalls what it gave before.

    Parameters
    ----------
    campaign
        All captures of one motor.
    options
        By estimator; those of `policy` are numbers of judgement, by section.
    recall
        Gives a fit that was cached; None fits anew.
    only
        Names of the constants that are wanted: estimators that they do not depend on are left out.

    Returns
    -------
    constants
        All estimates in order of preference (rank, then uncertainty, then dependency order).
    evidence
        Of all fits.
    failures
        Estimators that broke on this data: their constants are then not_identifiable.

    Notes
    -----
    An estimator sees those constants alone that it declares to use. Stated constants come after all
    that is measured: they serve where nothing else is known.

    """
    with under(changed(options)) as changes:
        needed = estimators() if only is None else estimators_of(only)
        return _fit_all(needed, campaign, options, changes, recall)


def _fit_all(
    needed: Sequence[Estimator],
    campaign: Campaign,
    options: Mapping[str, Mapping[str, float]],
    changes: Mapping[str, Any],
    recall: Recall | None,
) -> tuple[Constants, tuple[Evidence, ...], tuple[Failure, ...]]:
    fits: list[tuple[int, int, Fit]] = []
    failures: list[Failure] = []
    stated = stated_constants(campaign)
    known = Constants(stated)
    for order, estimator in enumerate(needed):
        if campaign.of(*estimator.tests):
            chosen = {**estimator.options, **options.get(estimator.name, {}), **changes}
            try:
                fitted = _timed(
                    estimator, campaign, _fitted(estimator, campaign, known, chosen, recall)
                )
            except BROKEN as error:
                reason = f"{estimator.name} broke on this data: {type(error).__name__}: {error}"
                failures.append(Failure("estimator_failed", reason, REPORT))
                fitted = Fit(_missing(estimator, reason))
        else:
            fitted = Fit(_missing(estimator, estimator.experiment))
        fits.append((estimator.rank, order, _possible(estimator, fitted)))
        measured = reconciled(Constants(_preferred(fits)))
        known = Constants((*measured.estimates, *stated))
    known = Constants(tuple(_untorn(e) for e in known.estimates))
    evidence = tuple(e for _, _, fit in fits for e in fit.evidence)
    return known, evidence, tuple(failures)


def _preferred(fits: Sequence[tuple[int, int, Fit]]) -> tuple[Estimate, ...]:
    """All estimates by rank, then as they were fitted; of one constant and equal rank the one that
    is known best comes first. What another method knows far better (`agreement.outranked`) comes
    last.
    """
    ranked = sorted(fits, key=lambda item: item[:2])
    alike: dict[tuple[int, str], list[Estimate]] = {}
    for rank, _, fit in ranked:
        for estimate in fit.estimates:
            alike.setdefault((rank, estimate.name), []).append(estimate)
    ordered = [e for same in alike.values() for e in sorted(same, key=lambda e: e.u)]
    return tuple(sorted(ordered, key=lambda e: outranked(e, ordered)))


def _fitted(
    estimator: Estimator,
    campaign: Campaign,
    known: Constants,
    options: Mapping[str, float],
    recall: Recall | None,
) -> Fit:
    used = known.only(estimator.uses)
    if recall is None:
        return estimator.fit(campaign, used, options)
    return recall(estimator, used, options, lambda: estimator.fit(campaign, used, options))


def _timed(estimator: Estimator, campaign: Campaign, result: Fit) -> Fit:
    """The result with the uncertainty of the time bases in its budgets."""
    if not estimator.clock_powers:
        return result
    timed = []
    for estimate in result.estimates:
        power = estimator.clock_powers.get(estimate.name, 0)
        used = [c for c in campaign.captures if c.path in estimate.captures]
        known = power and estimate.known
        timed.append(with_clock(estimate, power, used) if known else estimate)
    return replace(result, estimates=tuple(timed))


def _missing(estimator: Estimator, note: str) -> tuple[Estimate, ...]:
    return tuple(
        not_identifiable(name, _unit(estimator, name), estimator.name, note)
        for name in estimator.gives
    )


def _possible(estimator: Estimator, result: Fit) -> Fit:
    """The result with what is not finite, out of range or of no known size not identifiable."""
    terms = {term.name: term for term in estimator.terms}
    return Fit(
        tuple(
            _possible_estimate(e, terms.get(e.name) or CONSTANTS.get(e.name))
            for e in result.estimates
        ),
        result.evidence,
    )


def _possible_estimate(estimate: Estimate, term: Term | None) -> Estimate:
    if not estimate.known:
        return estimate
    if not estimate.finite:
        wrong = f"came out as {estimate.number:.4g} {estimate.unit} with no finite uncertainty"
    elif term is not None and not _in_range(estimate.number, term):
        low, high = ("any" if end is None else f"{end:g}" for end in (term.low, term.high))
        wrong = f"came out as {estimate.number:.4g} {estimate.unit}, outside {low} to {high}"
    elif term is not None and _unknown_size(estimate, term):
        wrong = (
            f"came out as {estimate.number:.3g} ± {estimate.u:.2g} {estimate.unit}, no known size"
        )
    else:
        return estimate
    note = f"{wrong}: look at clock, signs and units of {', '.join(estimate.captures[:3])}"
    withheld = not_identifiable(estimate.name, estimate.unit, estimate.method, note)
    return replace(withheld, impossible=_beyond(estimate, term))


def _beyond(estimate: Estimate, term: Term | None) -> bool:
    """Whether a value is out of its range by more than three of its own standard uncertainties."""
    if term is None or not estimate.finite:
        return False
    three = 3.0 * estimate.u
    return not any(_in_range(estimate.number + part, term) for part in (-three, 0.0, three))


def _untorn(estimate: Estimate) -> Estimate:
    """The estimate, or the reason why what disagrees leaves no use in it."""
    if not estimate.known or not _torn(estimate):
        return estimate
    note = (
        f"came out as {estimate.number:.4g} {estimate.unit}, and what it rests on disagrees beyond "
        f"use: {estimate.note}; diagnose tells what the model lacks"
    )
    return not_identifiable(estimate.name, estimate.unit, estimate.method, note)


def _torn(estimate: Estimate) -> bool:
    """Whether disagreement alone makes the 95 % interval span more than a factor of two.

    The ends of value (1 ± 1/3) are a factor of two apart: not even the first digit is known then.
    """
    beyond = abs(estimate.number) / 3.0
    without = replace(estimate, budget=without_between(estimate.budget))
    wide, narrow = (e.interval()[1] - e.number for e in (estimate, without))
    return wide > beyond >= narrow


def _unknown_size(estimate: Estimate, term: Term) -> bool:
    """Whether the 95 % interval of what no motor is without holds zero; zero friction is found."""
    if term.low is None or term.low <= 0.0:
        return False
    return not within(np.array(estimate.u), np.array(abs(estimate.number)))


def _in_range(value: float, term: Term) -> bool:
    return (term.low is None or value >= term.low) and (term.high is None or value <= term.high)


def _unit(estimator: Estimator, name: str) -> str:
    terms = {term.name: term for term in estimator.terms}
    return (terms.get(name) or CONSTANTS[name]).unit
