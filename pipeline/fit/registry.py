"""Finds the estimators (one file each in `estimators/`) and runs them in dependency order."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Mapping
from functools import cache
from graphlib import TopologicalSorter

from pipeline.fit import estimators as estimators_room
from pipeline.fit.protocol import Estimator, Fit
from pipeline.physics.glossary import CONSTANTS
from pipeline.records.capture import Campaign
from pipeline.records.constants import Constants
from pipeline.records.estimate import Estimate, not_identifiable
from pipeline.records.evidence import Evidence


@cache
def estimators() -> tuple[Estimator, ...]:
    """Every estimator of the room, ordered so that each comes after those it uses."""
    names = sorted(m.name for m in pkgutil.iter_modules(estimators_room.__path__))
    modules = [importlib.import_module(f"{estimators_room.__name__}.{name}") for name in names]
    found = {module.ESTIMATOR.name: module.ESTIMATOR for module in modules}
    givers: dict[str, list[str]] = {}
    for estimator in found.values():
        for constant in estimator.gives:
            givers.setdefault(constant, []).append(estimator.name)
    graph = {
        e.name: sorted({g for used in e.uses for g in givers.get(used, ()) if g != e.name})
        for e in sorted(found.values(), key=lambda e: (e.rank, e.name))
    }
    return tuple(found[name] for name in TopologicalSorter(graph).static_order())


def fit_all(
    campaign: Campaign, options: Mapping[str, Mapping[str, float]]
) -> tuple[Constants, tuple[Evidence, ...]]:
    """Runs every estimator on one motor's campaign.

    Returns all estimates in order of preference (rank, then dependency order) and the evidence.
    """
    found: list[tuple[int, int, Fit]] = []
    known = Constants()
    for order, estimator in enumerate(estimators()):
        if campaign.of(*estimator.tests):
            chosen = {**estimator.options, **options.get(estimator.name, {})}
            result = estimator.fit(campaign, known, chosen)
        else:
            result = Fit(_missing(estimator))
        found.append((estimator.rank, order, result))
        ranked = sorted(found, key=lambda item: item[:2])
        known = Constants(tuple(e for _, _, fit in ranked for e in fit.estimates))
    evidence = tuple(e for _, _, fit in found for e in fit.evidence)
    return known, evidence


def _missing(estimator: Estimator) -> tuple[Estimate, ...]:
    return tuple(
        not_identifiable(name, _unit(estimator, name), estimator.name, estimator.experiment)
        for name in estimator.gives
    )


def _unit(estimator: Estimator, name: str) -> str:
    own = {term.name: term for term in estimator.terms}
    return (own.get(name) or CONSTANTS[name]).unit
