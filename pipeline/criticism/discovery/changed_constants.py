"""A constant that changed between captures: a magnet that lost flux, a lead that was replaced.

No state of the machine predicts such a change, so no effect and no generic input shows it. Each
constant is given a value of its own in every capture, to first order. In the order of these values
the captures are then cut in two, and the cut that removes most of the deviance is kept.

Reference: Fisher, J. Am. Stat. Assoc. 53 (1958) 789, doi:10.1080/01621459.1958.10501479, groups
that are contiguous in the ordered values.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import compress

import numpy as np

from pipeline.criticism.machine.model import BASE, ENCODER_ZERO, PHYSICAL
from pipeline.criticism.operating import Array
from pipeline.criticism.regression.gauss_newton import gauss_newton
from pipeline.criticism.regression.goodness import significant_groups
from pipeline.criticism.regression.linear_system import LinearSystem
from pipeline.criticism.regression.normal_equations import NormalEquations, Prior, pseudo_inverse
from pipeline.criticism.selection.improvement import clears
from pipeline.numerics.identifiability import REACH
from pipeline.physics.notation import number_text


@dataclass(frozen=True, slots=True)
class Change:
    """A constant with one value in most captures, and another in `captures`, as a difference with
    its standard uncertainty [unit]; `gain` is the deviance that it takes, its penalty paid.

    Attributes
    ----------
    name, unit
        Full name of the parameter, and its unit.
    value
        In most captures.
    difference, u
        In `captures` less `value`, with its standard uncertainty.
    captures
        Captures with the other value.
    gain
        Fall of the deviance beyond its penalty.

    """

    name: str
    unit: str
    value: float
    difference: float
    u: float
    captures: tuple[str, ...]
    gain: float

    @property
    def words(self) -> str:
        """What changed, by how much and where, in a sentence."""
        alone = "; only one capture says so" if len(self.captures) == 1 else ""
        by = by_words(self.value, self.difference, self.u, self.unit)
        return (
            f"{self.name} is {by} in {', '.join(self.captures)} than in the "
            f"other captures: it changed between them, with no state of the machine{alone}"
        )


def by_words(value: float, difference: float, u: float, unit: str) -> str:
    """By how much a constant is higher or lower: `5 % lower (by 0.47 ± 0.02 mWb)`; of one that is
    next to none elsewhere without a share.
    """
    sense = "higher" if difference * value > 0.0 else "lower"
    share = abs(difference / value) if value else math.inf
    by = f"{100.0 * share:.3g} % " if share <= 1.0 else ""
    return f"{by}{sense} (by {number_text(abs(difference), u, unit)})"


def unit_of(system: LinearSystem, name: str) -> str:
    """Unit of a constant of the base, or of a parameter of an effect in the model."""
    units = {constant.name: constant.unit for constant in BASE}
    units |= {full: p.unit for full, (_, p) in system.fit.model.parameters().items()}
    return units[name]


def changed_constant(system: LinearSystem) -> Change | None:
    """The constant whose change between captures explains most of what is over the floor.

    Parameters
    ----------
    system
        Around a fit that leaves something over the floor.

    Returns
    -------
    Change or None
        None where no change takes half of the power over the floor and is worth its penalty.

    """
    tried = list(_changes(system))
    best = max(tried, key=lambda change: change.gain, default=None)
    return None if best is None else _refitted(system, best)


def _refitted(system: LinearSystem, change: Change) -> Change:
    """The change by a fit of either part of the captures: a large one is not of first order, as the
    residual of a free shaft goes with 1/J. As it was, where a part alone does not determine it, and
    of an encoder's zero: its prior, of a drive's own alignment, holds it in a fit.
    """
    if change.name == ENCODER_ZERO:
        return change
    fit, values, u = system.fit, [], []
    for inside in (False, True):
        part = [(segment.capture in change.captures) == inside for segment in fit.segments]
        own = gauss_newton(
            replace(
                fit,
                segments=tuple(compress(fit.segments, part)),
                sigma=tuple(compress(fit.sigma, part)),
                tolerance=tuple(compress(fit.tolerance, part)),
            )
        )
        place = [own.columns[n].name for n in own.model_columns].index(change.name)
        values.append(own.fit.values[change.name])
        u.append(math.sqrt(own.covariance(own.model_columns)[place, place]))
    difference, u_difference = values[1] - values[0], math.hypot(*u)
    # what a part does not observe has no u there
    known = min(u) > 0.0 and abs(difference) >= REACH * u_difference
    if not known or difference * change.difference <= 0.0:
        return change
    return replace(change, value=values[0], difference=difference, u=u_difference)


def _changes(system: LinearSystem) -> Iterator[Change]:
    """The best change of every constant that passes."""
    significant = significant_groups(system)
    candidates = [
        n for n in system.model_columns.tolist() if may_change(system, system.columns[n].name)
    ]
    before = End.of(system, np.empty((system.size, 0)))
    for place in candidates:
        name = system.columns[place].name
        splits = list(_cuts(system, place))
        ends = [End.of(system, mask[:, None] * system.matrix[:, [place]]) for _, mask in splits]
        if not ends:
            continue
        best = min(range(len(ends)), key=lambda n: ends[n].deviance)
        end, (captures, _) = ends[best], splits[best]
        penalty = math.log(system.size) + 2.0 * math.log(len(splits) * len(candidates))
        gain = before.deviance - end.deviance - penalty
        most = clears(system, significant, before.reduced_chi2, end.reduced_chi2)
        if gain > system.policy.selection.tie and most:
            change = float(end.step[place])
            value = system.fit.values[name] + change
            difference, u = float(end.step[-1]), end.u
            yield Change(name, unit_of(system, name), value, difference, u, captures, gain)


def may_change(system: LinearSystem, name: str) -> bool:
    """Constants of the machine, the zero of the drive's encoder, and amplitudes without a usual
    value.
    """
    known = system.fit.model.parameters()
    if name not in known:
        return name in PHYSICAL or name == ENCODER_ZERO
    _, parameter = known[name]
    return parameter.amplitude and parameter.usual is None


def _cuts(system: LinearSystem, place: int) -> Iterator[tuple[tuple[str, ...], Array]]:
    """Captures [the fewer] in which a constant may be another, and their rows [R]."""
    paths = np.array([segment.capture for segment in system.segments])[system.segment]
    column = system.matrix[:, place]
    captures = [name for name in dict.fromkeys(paths.tolist()) if np.any(column[paths == name])]
    if len(captures) < system.policy.discovery.change_captures:
        return
    columns = np.stack([np.where(paths == name, column, 0.0) for name in captures[1:]], axis=1)
    differences = End.of(system, columns).step[system.model_column_count :]
    order = np.argsort(np.concatenate([[0.0], differences]), kind="stable")
    for cut in range(1, len(captures)):
        both = [tuple(captures[n] for n in part) for part in (order[:cut], order[cut:])]
        fewer = min(both, key=len)
        yield tuple(sorted(fewer)), np.isin(paths, fewer).astype(float)


@dataclass(frozen=True, slots=True)
class End:
    """Where a fit ends along a system's own columns and further ones."""

    deviance: float
    reduced_chi2: Array
    step: Array
    u: float

    @classmethod
    def of(cls, system: LinearSystem, further: Array) -> End:
        """The best end with further columns [R, k], and the uncertainty of the last of them."""
        matrix = np.column_stack([system.matrix[:, system.model_columns], further])
        free = np.zeros(further.shape[1])
        prior = Prior(
            np.concatenate([system.prior_precision[system.model_columns], free]),
            np.concatenate([system.prior_gradient[system.model_columns], free]),
        )
        rows = np.column_stack([system.residual, matrix])
        groups = len(system.labels)
        known = NormalEquations.of(rows, system.group, groups, prior, system.policy.fit)
        end = known.best(*system.policy.selection.thorough)
        weight = system.weights(end.reduced_chi2)
        normal = (matrix * weight[:, None]).T @ matrix + np.diag(prior.precision)
        u = math.sqrt(max(float(pseudo_inverse(normal)[-1, -1]), 0.0))
        return cls(end.deviance, end.reduced_chi2, end.step, u)
