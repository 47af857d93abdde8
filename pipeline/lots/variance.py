"""How much of the spread is lot, station, motor, capture.

Nested analysis of variance with unequal numbers, by expected mean squares; no component below 0.
Reference: S. R. Searle, G. Casella, C. E. McCulloch, Variance Components, 1992, 3.6.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.records.lot_constant import Component


@dataclass(frozen=True, slots=True)
class Nested:
    """Variances [unit²] between groups and within them, with degrees of freedom.

    `within` is None where no group has two members; `between` then too, and for fewer than two
    groups.
    """

    between: float | None
    within: float | None
    dof_between: int
    dof_within: int


def nested(groups: Sequence[Sequence[float]]) -> Nested:
    """Variances between and within groups of unequal numbers, by expected mean squares.

    Parameters
    ----------
    groups
        Values of each group [unit]; empty groups are left out.

    Returns
    -------
    Nested
        No variance below zero.

    Notes
    -----
    σ²_within = MSW, σ²_between = (MSB − MSW)/n₀ with n₀ = (N − Σn²/N)/(k − 1).

    References
    ----------
    Searle, Casella and McCulloch, Variance Components, Wiley, 1992, 3.6.

    Examples
    --------
    MSW = 2 and MSB = 2 · 2 · 5² = 100, with two in each group:

    >>> found = nested([[9.0, 11.0], [19.0, 21.0]])
    >>> found.within, found.between
    (2.0, 49.0)

    """
    filled = [np.asarray(group, float) for group in groups if len(group)]
    sizes = np.array([group.size for group in filled], float)
    total, count = float(sizes.sum()), len(filled)
    dof_within = int(total) - count
    within = None
    if dof_within > 0:
        within = sum(float(np.sum((g - g.mean()) ** 2)) for g in filled) / dof_within
    if count < 2:
        return Nested(None, within, 0, dof_within)
    means = np.array([group.mean() for group in filled])
    grand = float(np.sum(sizes * means)) / total
    ms = float(np.sum(sizes * (means - grand) ** 2)) / (count - 1)
    each = (total - float(np.sum(sizes**2)) / total) / (count - 1)
    between = None if within is None else max(0.0, (ms - within) / each)
    return Nested(between, within, count - 1, dof_within)


def variance_components(
    lots: Mapping[str, Sequence[float]],
    repeats: Sequence[Sequence[float]],
    u_a: Sequence[float],
    biases: Sequence[float],
) -> tuple[Component, ...]:
    """The spread of motors by lot, station, motor and capture.

    Parameters
    ----------
    lots
        Motors' values by lot [unit].
    repeats
        Values of one motor each from captures of their own [unit].
    u_a
        Scatter that each fit states [unit], in place of repeats.
    biases
        Of linked stations [unit].

    Returns
    -------
    tuple of Component
        Standard deviations [unit] and shares of the sum of variances [1].

    Notes
    -----
    The capture's variance comes from the repeats, or else is the mean square of `u_a`; it is taken
    off the variance of motors within their lot. The station's is the variance of the biases.

    """
    among = nested(list(lots.values()))
    again = nested([group for group in repeats if len(group) > 1])
    if again.within is not None:
        capture, note, dof = again.within, "from motors measured again", again.dof_within
    elif u_a:
        capture, note, dof = float(np.mean(np.square(u_a))), "from the scatter of each fit", None
    else:
        capture, note, dof = None, "no repeats and no scatter stated", None
    motor = among.within
    if motor is not None and capture is not None:
        motor = max(0.0, motor - capture)
    station = float(np.var(biases, ddof=1)) if len(biases) > 1 else None
    needs = "needs two motors in a lot" * (among.within is None)
    origin = "from linked stations" if station is not None else "one station, or none linked"
    sized = (
        ("lot", among.between, among.dof_between, "needs two lots" if len(lots) < 2 else needs),
        ("station", station, max(len(biases) - 1, 0), origin),
        ("motor", motor, among.dof_within, needs),
        ("capture", capture, dof, note),
    )
    total = sum(variance for _, variance, _, _ in sized if variance is not None)
    return tuple(
        Component(
            name,  # type: ignore[arg-type]
            None if variance is None else math.sqrt(variance),
            None if variance is None or total == 0.0 else variance / total,
            None if variance is None or dof is None else float(dof),
            words,
        )
        for name, variance, dof, words in sized
    )
