"""A measured constant put together: what every estimator says of one, in one form."""

from __future__ import annotations

from collections.abc import Iterable

from pipeline.estimation.uncertainty.instruments import budget_of
from pipeline.records.capture import Capture
from pipeline.records.estimate import Conditions, Estimate
from pipeline.records.uncertainty import Contribution


def measured(
    method: str,
    name: str,
    unit: str,
    value: float,
    parts: Iterable[Contribution],
    captures: Iterable[Capture],
    at: Conditions,
    notes: Iterable[str],
) -> Estimate:
    """The estimate of a constant [unit]: one part a source, empty notes left out."""
    paths = tuple(capture.path for capture in captures)
    note = "; ".join(words for words in notes if words)
    return Estimate(name, value, unit, "measured", method, budget_of(parts), at, paths, note)
