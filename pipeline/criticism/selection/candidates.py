"""Candidates: effects that a model lacks, at their trial shapes, as columns beside its own."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product

import numpy as np

from pipeline.criticism.effect import Effect
from pipeline.criticism.machine.model import Model, zero
from pipeline.criticism.operating import Indices
from pipeline.criticism.regression.columns import Column, effect_columns
from pipeline.criticism.regression.fit import Fit
from pipeline.criticism.regression.linear_system import LinearSystem, linear_system, model_columns


@dataclass(frozen=True, slots=True)
class Candidate:
    """An effect that is not in the model, its shape parameters at one of their trial values.

    Attributes
    ----------
    effect
        The effect.
    columns
        One a parameter that is fitted.
    values
        Its parameters by full name, amplitudes zero.

    """

    effect: Effect
    columns: tuple[Column, ...]
    values: Mapping[str, float] = field(default_factory=dict)


def candidates(library: Mapping[str, Effect], model: Model) -> tuple[Candidate, ...]:
    """Every effect that is not in the model, once for each combination of trial shapes; those of
    an optional term are tried when the effect is in (`pruning.reshaped`).

    Parameters
    ----------
    library
        Every effect by name.
    model
        The model; effects whose wave of the angle no capture goes through are left out, as are
        those of the phases where nothing gives the pole pairs.

    """
    inside = {effect.name for effect in model.effects}
    candidates = []
    for effect in library.values():
        unknown = effect.of_phases and not model.machine.pairs_known
        if effect.name in inside or unknown or not effect.gone_through(model.machine):
            continue
        shapes = [p for p in effect.parameters_of(model.machine) if not p.amplitude]
        tried = [(p, p.scan[:1] if p.optional else p.scan) for p in shapes]
        grids = [[(p.name, v * model.machine.scale(p)) for v in scan] for p, scan in tried]
        for at in product(*grids):
            columns = tuple(effect_columns(effect, model, at))
            start = zero(effect, model)
            start.update({f"{effect.name}.{name}": value for name, value in at})
            candidates.append(Candidate(effect, columns, start))
    return tuple(candidates)


def first_of_each(offered: Sequence[Candidate]) -> dict[str, Candidate]:
    """The first candidate of every effect, by the effect's name.

    Parameters
    ----------
    offered
        All candidates.

    """
    return {c.effect.name: c for c in reversed(offered)}


def widened(
    fit: Fit, offered: Sequence[Candidate], before: LinearSystem | None = None
) -> LinearSystem:
    """The system around a fit with the candidates' columns behind its own, in order.

    Parameters
    ----------
    fit
        The fit.
    offered
        The candidates.
    before
        An earlier system whose columns of candidates may be used again.

    Returns
    -------
    LinearSystem
        The model's own columns are computed anew: what only priors of the station separate, such as
        a gain and the effect of that name, would seem to be separated by columns computed at two
        places.

    """
    columns = [c for candidate in offered for c in candidate.columns]
    if before is not None:
        present = {column.key for column in model_columns(fit.model)}
        before = before.only(
            np.array([n for n, c in enumerate(before.columns) if c.key not in present], dtype=int)
        )
    return linear_system(fit, columns, before)


def placed(wide: LinearSystem, offered: Sequence[Candidate]) -> Iterator[tuple[Candidate, Indices]]:
    """Every candidate of a widened system with the places of its columns.

    Parameters
    ----------
    wide
        The system.
    offered
        The candidates, as `widened` had them.

    Yields
    ------
    tuple of Candidate and array
        Indices into `wide.columns`. A candidate that the system was not widened with is left out.

    """
    names = [column.name for column in wide.columns]
    first = wide.model_columns.size
    for candidate in offered:
        end = first + len(candidate.columns)
        if names[first:end] == [column.name for column in candidate.columns]:
            yield candidate, np.arange(first, end)
            first = end


def searched(offered: Sequence[Candidate], effect: Effect) -> float:
    """What the search over candidates costs the score of one.

    Parameters
    ----------
    offered
        All candidates; one effect at several trial shapes counts once.
    effect
        The effect of the candidate.

    Returns
    -------
    float
        2 log (p c) [deviance] of p effects, at least two, and c choices that the effect has: the
        best of seven recorders whose clock may be off has had seven chances.

    References
    ----------
    Chen and Chen, Biometrika 95(3), 2008, 759 (extended Bayesian information criterion: 2 log of
    the number of models of a size, here of one further effect), doi:10.1093/biomet/asn034.

    """
    choices = {f"{effect.name}.{p.name}" for p in effect.parameters if p.choice}
    chances = {
        tuple(sorted((name, c.values[name]) for name in choices & c.values.keys()))
        for c in offered
        if c.effect.name == effect.name
    }
    effects = max(len({c.effect.name for c in offered}), 2)
    return 2.0 * math.log(effects * max(len(chances), 1))
