"""Constants that are products of powers of others, with the uncertainties those share."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from pipeline.estimation.protocol import Estimator, Fit
from pipeline.physics.glossary import CONSTANTS, TESTS
from pipeline.records.capture import Campaign
from pipeline.records.constants import Constants
from pipeline.records.estimate import Estimate, derived, not_identifiable

EXPERIMENT = "record the tests of the constants that this one is computed from"


@dataclass(frozen=True, slots=True)
class Formula:
    """value = evaluate(numbers of `of`); every one is a product of powers, listed in `powers`."""

    of: tuple[str, ...]
    powers: tuple[float, ...]
    evaluate: Callable[..., float]
    words: str


def estimator_of(name: str, formulas: Mapping[str, Formula]) -> Estimator:
    """The estimator of a set of formulas, each by first-order propagation.

    Sources that the inputs share cancel or add; a product of powers has the slope
    power · value / input (GUM 5.1.6). It runs whatever tests the campaign holds.

    Parameters
    ----------
    name
        Of the estimator.
    formulas
        By the name of the constant that each gives.

    Notes
    -----
    y = Π x_i^p_i has ∂y/∂x_i = p_i y / x_i.

    References
    ----------
    JCGM 100:2008, 5.1.6.

    """

    def fit(campaign: Campaign, known: Constants, options: Mapping[str, float]) -> Fit:
        del campaign, options
        return Fit(tuple(_one(name, given, formula, known) for given, formula in formulas.items()))

    return Estimator(
        name,
        tuple(formulas),
        tuple(sorted(TESTS)),
        EXPERIMENT,
        fit,
        uses=tuple(sorted({part for formula in formulas.values() for part in formula.of})),
    )


def _one(method: str, name: str, formula: Formula, known: Constants) -> Estimate:
    unit = CONSTANTS[name].unit
    sources = {part: known.best(part) for part in formula.of}
    missing = [part for part, estimate in sources.items() if estimate is None]
    if missing:
        return not_identifiable(name, unit, method, f"needs {', '.join(missing)}: {EXPERIMENT}")
    inputs = [estimate for estimate in sources.values() if estimate is not None]
    if any(estimate.number == 0.0 for estimate in inputs):
        return not_identifiable(name, unit, method, f"{formula.words}: one of these is 0")
    value = float(formula.evaluate(*(estimate.number for estimate in inputs)))
    terms = [
        (power * value / estimate.number, estimate)
        for power, estimate in zip(formula.powers, inputs, strict=True)
    ]
    at = {"temp_winding_degc": 25.0, "temp_magnet_degc": 25.0}
    return replace(derived(name, unit, value, terms, method, at), note=formula.words)
