"""What candidates would do for a fit, to first order.

References: [1] Rao, Math. Proc. Camb. Phil. Soc. 44 (1948), score test; [2] Schwarz, Ann. Stat.
6 (1978), the penalty of a parameter; [3] Chen & Chen, Biometrika 95 (2008),
doi:10.1093/biomet/asn034, penalty of a search over candidates.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from pipeline.criticism.effect import Effect
from pipeline.criticism.machine.model import Model, zero
from pipeline.criticism.operating import Array
from pipeline.criticism.parameter import Machine, Parameter
from pipeline.criticism.policy.selection import Selection
from pipeline.criticism.regression.columns import Column, effect_columns
from pipeline.criticism.regression.fit import Fit
from pipeline.criticism.regression.linear_system import LinearSystem, linear_system, model_columns
from pipeline.criticism.regression.normal_equations import Descent, NormalEquations, deviance_of


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


@dataclass(frozen=True, slots=True)
class Score:
    """What a candidate would do for a fit, to first order.

    Attributes
    ----------
    candidate
        The candidate.
    fall
        Fall of the deviance.
    penalty
        What its parameters and the search over candidates cost.
    step
        Its own parameters, by full name.
    moves
        Changes of the model's own parameters.
    share
        Part that it removes of the removable excess, of the channel that it helps most [1].
    size
        Largest of its amplitudes over its negligible size [1].
    below_floor
        Part of the fall in signals that have nothing over their floor.
    clears
        Whether it removes most of what would be reported as a remainder, and so matters at any
        size; never for a coupling, which noise of an encoder in a speed loop looks like.
    confounder
        An effect that explains the same better, but is too small to matter.
    policy
        Constants of judgement.

    """

    candidate: Candidate
    fall: float
    penalty: float
    step: Mapping[str, float]
    moves: Mapping[str, float]
    share: float
    size: float
    below_floor: float = 0.0
    clears: bool = False
    confounder: str | None = None
    policy: Selection = field(kw_only=True)

    @property
    def matters(self) -> bool:
        """Whether it is large enough to matter in use, or what would be left without it is."""
        return self.size >= 1.0 or self.clears

    @property
    def passes(self) -> bool:
        """Whether it is worth its penalty, large enough to matter and helps enough.

        Below the floor only what the machine itself does is named. A sensor's error is a common
        factor of which any form that is a little wrong elsewhere asks for some; and an effect of a
        discriminator is not discriminated from noise of the angle's sensor, which runs through a
        drive's speed loop and so is in torque and angle alike.
        """
        effect = self.candidate.effect
        below = self._below_floor and effect.hook != "sensor" and effect.discriminator is None
        helps = self.share >= self.policy.least_share or below
        return self.fall > self.penalty and self.matters and helps and self.confounder is None

    @property
    def _below_floor(self) -> bool:
        return self.below_floor > self.policy.below_floor_penalties * self.penalty

    @property
    def shortfall(self) -> str:
        """What it lacks to be named; of one that passes, that a refit did not bear it out."""
        if self.fall <= self.penalty:
            return "not worth its parameters"
        if not self.matters:
            return f"seen, at {self.size:.2g} of the least size that matters"
        if self.confounder is not None:
            return f"{self.confounder} explains it as well, and is too small to matter"
        if self.passes:
            return "refitted, it does not hold on captures held out, or may be zero"
        if self._below_floor:
            return "what it would explain lies below the noise floor"
        return "takes too small a share of what is over the noise floor"


@dataclass(frozen=True, slots=True)
class Standing:
    """How well a fit stands.

    Attributes
    ----------
    deviance
        −2 log likelihood with the cost of the priors.
    reduced_chi2
        χ²/n of every group [G].
    prior_cost
        Cost of the priors alone.

    """

    deviance: float
    reduced_chi2: Array
    prior_cost: float

    @classmethod
    def of(cls, system: LinearSystem, places: NDArray[np.int64], end: Descent) -> Standing:
        """How well a system stands after a descent.

        Parameters
        ----------
        system
            The system.
        places
            Columns that moved.
        end
            Where the descent ended.

        """
        cost = float(system.prior_costs(places, end.step).sum())
        return cls(end.deviance, end.reduced_chi2, cost)


def candidates(library: Mapping[str, Effect], model: Model) -> tuple[Candidate, ...]:
    """Every effect that is not in the model, once for each combination of trial shapes.

    Parameters
    ----------
    library
        Every effect by name.
    model
        The model; effects whose wave of the angle no capture goes through are left out.

    """
    inside = {effect.name for effect in model.effects}
    candidates = []
    for effect in library.values():
        if effect.name in inside or not effect.gone_through(model.machine):
            continue
        shapes = [p for p in effect.parameters_of(model.machine) if not p.amplitude]
        grids = [[(p.name, v * model.machine.scale(p)) for v in p.scan] for p in shapes]
        for at in product(*grids):
            columns = tuple(effect_columns(effect, model, at))
            start = zero(effect, model)
            start.update({f"{effect.name}.{name}": value for name, value in at})
            candidates.append(Candidate(effect, columns, start))
    return tuple(candidates)


def widened(
    fit: Fit, offered: Sequence[Candidate], before: LinearSystem | None = None
) -> LinearSystem:
    """The system around a fit with the candidates' columns behind its own, in order.

    The candidates' may stay as they were in `before`. Its own are made anew: what the station's
    priors alone hold apart, such as a gain and the effect of that name, columns that are made in
    two places would seem to discriminate.

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


def score_all(
    system: LinearSystem,
    offered: Sequence[Candidate],
    significant: NDArray[np.bool_] | None = None,
) -> tuple[Score, ...]:
    """The score of every candidate, of each effect its best shape.

    Parameters
    ----------
    system
        The fit with the columns of all candidates.
    offered
        The candidates.
    significant
        Groups [G] that would be reported as a remainder if nothing were added.

    Returns
    -------
    tuple of Score
        The largest fall first.

    """
    scoring, policy = _Scoring.of(system, significant), system.policy.selection
    penalty = math.log(float(system.size))
    searched_of = {c.effect.name: searched(offered, c.effect) for c in offered}
    best: dict[str, tuple[Score, NDArray[np.int64]]] = {}
    for candidate, places in placed(system, offered):
        score = scoring.score(candidate, places, policy.quick)
        cost = paid_for(candidate.effect, system.fit.machine, score) * penalty
        cost += searched_of[candidate.effect.name]
        if score is not None and score.fall > policy.quick_penalties * cost:
            score = scoring.score(candidate, places, policy.thorough)
        known = best.get(candidate.effect.name)
        if score is not None and (known is None or score.fall > known[0].fall):
            best[candidate.effect.name] = replace(score, penalty=cost), places
    scores = [replace(one, confounder=scoring.confounder(one, best)) for one, _ in best.values()]
    return tuple(sorted(scores, key=lambda s: (-s.fall, s.candidate.effect.name)))


def placed(
    wide: LinearSystem, offered: Sequence[Candidate]
) -> Iterator[tuple[Candidate, NDArray[np.int64]]]:
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
        Indices into `wide.columns`.

    """
    first = wide.model_columns.size
    for candidate in offered:
        yield candidate, np.arange(first, first + len(candidate.columns))
        first += len(candidate.columns)


def paid_for(effect: Effect, machine: Machine, score: Score | None) -> int:
    """How many parameters a score costs.

    Parameters
    ----------
    effect
        The effect.
    machine
        Determines which parameters there are.
    score
        Of optional terms those that its step uses are counted; None counts none.

    """
    used = {} if score is None else score.step
    return sum(
        not p.optional or bool(used.get(f"{effect.name}.{p.name}"))
        for p in effect.parameters_of(machine)
        if not p.choice
    )


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


@dataclass(frozen=True, slots=True)
class _Scoring:
    """What every candidate is held against: a system, the model's own columns in it and how these
    alone fit, groups [G] that are then reported as a remainder.
    """

    system: LinearSystem
    normal_equations: NormalEquations
    model_columns: NDArray[np.int64]
    before: Standing
    significant: NDArray[np.bool_]

    @classmethod
    def of(cls, system: LinearSystem, significant: NDArray[np.bool_] | None) -> _Scoring:
        model_columns, normal_equations = system.model_columns, system.normal_equations()
        before = Standing.of(system, model_columns, normal_equations.only(model_columns).best())
        remaining = np.zeros(len(system.labels), dtype=bool) if significant is None else significant
        return cls(system, normal_equations, model_columns, before, remaining)

    def score(
        self,
        candidate: Candidate,
        places: NDArray[np.int64],
        effort: tuple[tuple[float, ...], int],
    ) -> Score | None:
        """Score of one candidate with parameters on the wrong side of a bound left at zero."""
        system, machine = self.system, self.system.fit.machine
        parameters = {
            f"{candidate.effect.name}.{p.name}": p for p in candidate.effect.parameters_of(machine)
        }
        best = self._inside(places, parameters, effort)
        if best is None:
            return None
        live, end = best
        step = dict(
            zip(self._names(live), end.step[self.model_columns.size :].tolist(), strict=True)
        )
        sizes = [
            abs(value) / (parameters[name].negligible * machine.scale(parameters[name]))
            for name, value in step.items()
            if parameters[name].negligible > 0
        ]
        after = Standing.of(system, np.concatenate([self.model_columns, live]), end)
        names = self._names(self.model_columns)
        return Score(
            candidate,
            self.before.deviance - after.deviance,
            0.0,
            step,
            dict(zip(names, end.step[: self.model_columns.size].tolist(), strict=True)),
            share_of(system, candidate.effect, self.before, after),
            max(sizes, default=math.inf),
            fall_below_floor(system, self.before.reduced_chi2, after.reduced_chi2),
            candidate.effect.discriminator is None
            and clears(system, self.significant, self.before.reduced_chi2, after.reduced_chi2),
            policy=system.policy.selection,
        )

    def _names(self, places: NDArray[np.int64]) -> list[str]:
        return [self.system.columns[n].name for n in places]

    def _inside(
        self,
        places: NDArray[np.int64],
        known: Mapping[str, Parameter],
        effort: tuple[tuple[float, ...], int],
    ) -> tuple[NDArray[np.int64], Descent] | None:
        """The places along which no parameter is on the wrong side of its bound, and the best fit
        along them and the model's own; None where there are none.
        """
        live = places
        while live.size:
            end = self.normal_equations.only(np.concatenate([self.model_columns, live])).best(
                *effort
            )
            steps = zip(
                self._names(live), end.step[self.model_columns.size :].tolist(), strict=True
            )
            keep = np.array([not _outside(step, known[name]) for name, step in steps])
            if keep.all():
                return live, end
            live = live[keep]
        return None

    def confounder(
        self, score: Score, best: Mapping[str, tuple[Score, NDArray[np.int64]]]
    ) -> str | None:
        """The clearest effect that explains what a candidate does as well, at a size too small to
        matter, and beside which the candidate is not worth its penalty.

        A loss that is too small to be reported must not be reported under a wrong name.
        """
        if not score.passes:
            return None
        small = [
            (other, places)
            for other, places in best.values()
            if not other.matters
            and other.fall > other.penalty
            and other.fall > score.fall - score.policy.tie
            and other.candidate.effect.discriminator is None
        ]
        if not small:
            return None
        clearest, beside = max(small, key=lambda pair: pair[0].fall)
        thorough = self.system.policy.selection.thorough
        _, shrunk = best[score.candidate.effect.name]
        without = self.normal_equations.only(np.concatenate([self.model_columns, beside])).best(
            *thorough
        )
        with_both = self.normal_equations.only(
            np.concatenate([self.model_columns, beside, shrunk])
        ).best(*thorough)
        worth = without.deviance - with_both.deviance > score.penalty
        return None if worth else clearest.candidate.effect.name


def clears(
    system: LinearSystem, significant: NDArray[np.bool_], before: Array, after: Array
) -> bool:
    """Whether most of the power over the floor goes, of the groups that count as a remainder.

    Parameters
    ----------
    system
        The fit.
    significant
        Groups that count [G].
    before
        χ²/n without the candidate [G].
    after
        χ²/n with it [G].

    Returns
    -------
    bool
        False where no group counts.

    """
    excess, remaining = (system.counts * np.maximum(q - 1.0, 0.0) for q in (before, after))
    allowed = system.policy.selection.clears_share * float(excess[significant].sum())
    return bool(significant.any()) and float(remaining[significant].sum()) < allowed


def _outside(value: float, parameter: Parameter) -> bool:
    return (value < 0 <= parameter.low) or (value > 0 >= parameter.high)


def share_of(system: LinearSystem, effect: Effect, before: Standing, after: Standing) -> float:
    """Largest share of the removable deviance that an effect removes.

    Parameters
    ----------
    system
        The fit.
    effect
        The effect.
    before
        The fit without it.
    after
        The fit with it.

    Returns
    -------
    float
        From 0 to 1: of one recorded signal, of the captures of the tests that excite the effect, or
        of what the priors of the station cost; of a signal's error no more than the share of its
        power, at one order.

    Notes
    -----
    Small excesses do not count (`excess`, `excess_a_sample`): drift and unmodelled effects are
    deviance that many candidates partly absorb.

    """
    policy = system.policy.selection
    excess = system.counts * np.log(np.maximum(before.reduced_chi2, 1.0))
    remaining = system.counts * np.log(np.maximum(after.reduced_chi2, 1.0))
    channel = np.array([name for _, name, _ in system.labels])
    groups = [channel == name for name in dict.fromkeys(channel.tolist())]
    groups.append(np.array([system.segments[n].test in effect.tests for n, _, _ in system.labels]))
    shares = [0.0]
    for group in groups:
        had = float(excess[group].sum())
        if had > min(policy.excess, policy.excess_a_sample * float(system.counts[group].sum())):
            shares.append(1.0 - float(remaining[group].sum()) / had)
    error = min(max(shares), power_share(system, before.reduced_chi2, after.reduced_chi2))
    cost = before.prior_cost
    return max(error, 1.0 - after.prior_cost / cost if cost > policy.excess else 0.0)


def fall_below_floor(system: LinearSystem, before: Array, after: Array) -> float:
    """Fall of the deviance in signals that at some order have no excess that counts.

    There an allowance for a bench's and a model's errors counts as one error of a group, whatever
    its shape, and not as noise that windows average.

    Parameters
    ----------
    system
        The fit.
    before
        χ²/n without the candidate [G].
    after
        χ²/n with it [G].

    """
    pool, worth = _pools(system, before)
    below = ~worth[pool]
    counts = system.independent_counts[below]
    return deviance_of(counts, before[below]) - deviance_of(counts, after[below])


def power_share(system: LinearSystem, before: Array, after: Array) -> float:
    """Largest share of the power over the noise floor that is removed, of one signal at one order.

    Parameters
    ----------
    system
        The fit.
    before
        χ²/n without the candidate [G].
    after
        χ²/n with it [G].

    Returns
    -------
    float
        From 0 to 1; 0 where no signal has an excess that counts.

    """
    pool, worth = _pools(system, before)
    had, has = (
        np.bincount(pool, system.counts * np.maximum(reduced_chi2 - 1.0, 0.0))
        for reduced_chi2 in (before, after)
    )
    return float((1.0 - has[worth] / had[worth]).max(initial=0.0))


def _pools(
    system: LinearSystem, reduced_chi2: Array
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Which signal at which order each group [G] is of, and of which of them the excess counts."""
    numbers: dict[tuple[str, int], int] = {}
    pool = np.array([numbers.setdefault((name, k), len(numbers)) for _, name, k in system.labels])
    count = np.bincount(pool, system.counts)
    nats = np.bincount(pool, system.counts * np.log(np.maximum(reduced_chi2, 1.0)))
    policy = system.policy.selection
    return pool, nats > np.minimum(policy.excess, policy.excess_a_sample * count)
