"""Which effects the captures ask for: score, forward steps with refits, backward checks.

References: [1] Rao, Math. Proc. Camb. Phil. Soc. 44 (1948), score test; [2] Schwarz, Ann. Stat.
6 (1978), the price of a parameter; [3] Benjamini & Foster, Biometrika 109 (2022), price of a
search over candidates.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from pipeline.criticism.closer import renamed
from pipeline.criticism.descent import clipped, gauss_newton
from pipeline.criticism.effect import Array, Effect, Machine, Parameter
from pipeline.criticism.grams import Descent, Grams
from pipeline.criticism.judge import held_out_spreads
from pipeline.criticism.linearise import Column, effect_columns
from pipeline.criticism.model import zero
from pipeline.criticism.optional import trimmed
from pipeline.criticism.segment import Segment
from pipeline.criticism.system import Fitted, System, own_columns, system, tolerances

LEAST_SHARE = 0.1
TIE = 12.0
_MOST = 6
_REFITS = 3
_ROUNDS = 2
_HELD = 0.5
_CLOSE = 0.7
_WORTH = 30.0
_CLEAR = 0.5
_GLANCE = ((1.0,), 3)
_THOROUGH = ((1.0, 0.0), 20)
_PROMISING = 0.3


@dataclass(frozen=True, slots=True)
class Candidate:
    """An effect that is not in the model, its shape parameters at one of their trial values."""

    effect: Effect
    columns: tuple[Column, ...]
    values: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Score:
    """What a candidate would do, to first order.

    `fall` is the fall of misfit, `price` what its parameters and the search cost, `step` its own
    parameters, `moves` how the model's own move with it, `share` the part of the removable excess
    of the channel it helps most, `size` the largest of its amplitudes over its negligible size.
    """

    candidate: Candidate
    fall: float
    price: float
    step: Mapping[str, float]
    moves: Mapping[str, float]
    share: float
    size: float

    @property
    def passes(self) -> bool:
        """Whether it is worth its price, large enough to matter and helps enough."""
        return self.fall > self.price and self.size >= 1.0 and self.share >= LEAST_SHARE


@dataclass(frozen=True, slots=True)
class Rung:
    """One step of the ladder: the fit with these effects and every candidate's score on it."""

    added: tuple[str, ...]
    fitted: Fitted
    around: System
    scores: tuple[Score, ...]


@dataclass(frozen=True, slots=True)
class Standing:
    """How well a fit stands: misfit, χ²/n [G] of every group, cost of the priors."""

    misfit: float
    spreads: Array
    prior_cost: float

    @classmethod
    def of(cls, around: System, places: NDArray[np.int64], end: Descent) -> Standing:
        """Where a descent along `places` left the system."""
        cost = float(around.prior_costs(places, end.step).sum())
        return cls(end.misfit, end.spreads, cost)


def candidates(library: Mapping[str, Effect], fitted: Fitted) -> tuple[Candidate, ...]:
    """Every effect that is not in the model, once for each combination of trial shapes."""
    model = fitted.model
    inside = {effect.name for effect in model.effects}
    found = []
    for effect in library.values():
        if effect.name in inside:
            continue
        shapes = [p for p in effect.parameters_of(model.machine) if not p.amplitude]
        grids = [[(p.name, v * model.machine.scale(p)) for v in p.scan] for p in shapes]
        for at in product(*grids):
            columns = tuple(effect_columns(effect, model, at))
            start = zero(effect, model)
            start.update({f"{effect.name}.{name}": value for name, value in at})
            found.append(Candidate(effect, columns, start))
    return tuple(found)


def widened(
    segments: Sequence[Segment],
    fitted: Fitted,
    offered: Sequence[Candidate],
    before: System | None = None,
) -> System:
    """The system around a fit with the candidates' columns behind its own, in order."""
    columns = [c for candidate in offered for c in candidate.columns]
    return system(segments, fitted, columns, before)


def score_all(around: System, fitted: Fitted, offered: Sequence[Candidate]) -> tuple[Score, ...]:
    """Every candidate's score, the best fall first; of one effect the best shape only."""
    own = np.arange(len(own_columns(fitted.model)))
    grams = around.grams()
    before = Standing.of(around, own, grams.along(own).best())
    price = math.log(float(around.size))
    search_price = 2.0 * math.log(max(len({c.effect.name for c in offered}), 2))
    best: dict[str, Score] = {}
    first = own.size
    for candidate in offered:
        places = np.arange(first, first + len(candidate.columns))
        first += len(candidate.columns)
        score = _score(around, grams, fitted, own, places, candidate, before, _GLANCE)
        cost = paid_for(candidate.effect, fitted.model.machine, score) * price + search_price
        if score is not None and score.fall > _PROMISING * cost:
            score = _score(around, grams, fitted, own, places, candidate, before, _THOROUGH)
        known = best.get(candidate.effect.name)
        if score is not None and (known is None or score.fall > known.fall):
            best[candidate.effect.name] = replace(score, price=cost)
    return tuple(sorted(best.values(), key=lambda s: (-s.fall, s.candidate.effect.name)))


def paid_for(effect: Effect, machine: Machine, score: Score | None) -> int:
    """How many parameters a score costs: of optional terms those that the step makes use of."""
    used = {} if score is None else score.step
    return sum(
        not p.optional or bool(used.get(f"{effect.name}.{p.name}"))
        for p in effect.parameters_of(machine)
        if not p.choice
    )


def _score(
    around: System,
    grams: Grams,
    fitted: Fitted,
    own: NDArray[np.int64],
    places: NDArray[np.int64],
    candidate: Candidate,
    before: Standing,
    effort: tuple[tuple[float, ...], int],
) -> Score | None:
    """Score of one candidate with parameters on the wrong side of a bound left at zero."""
    machine = fitted.model.machine
    known = {
        f"{candidate.effect.name}.{p.name}": (p, machine.scale(p))
        for p in candidate.effect.parameters_of(machine)
    }
    live = places
    while live.size:
        end = grams.along(np.concatenate([own, live])).best(*effort)
        mine = dict(
            zip((around.columns[n].name for n in live), end.step[own.size :].tolist(), strict=True)
        )
        wrong = [
            n
            for n in live
            if _outside(mine[around.columns[n].name], known[around.columns[n].name][0])
        ]
        if not wrong:
            break
        live = np.array([n for n in live if n not in wrong], dtype=int)
    if live.size == 0:
        return None
    sizes = [
        abs(value) / (known[name][0].negligible * known[name][1])
        for name, value in mine.items()
        if known[name][0].negligible > 0
    ]
    after = Standing.of(around, np.concatenate([own, live]), end)
    fall = before.misfit - after.misfit
    share = _share(around, candidate.effect, before, after)
    names = (around.columns[n].name for n in own)
    moves = dict(zip(names, end.step[: own.size].tolist(), strict=True))
    return Score(candidate, fall, 0.0, mine, moves, share, max(sizes, default=math.inf))


def _outside(value: float, parameter: Parameter) -> bool:
    return (value < 0 <= parameter.low) or (value > 0 >= parameter.high)


def _share(around: System, effect: Effect, before: Standing, after: Standing) -> float:
    """Largest share of the removable misfit that went away: of one recorded signal, of the
    captures of the tests that excite the effect, or of what the priors of the station cost; but of
    a signal's error no more than the share of its power, at one order, that went with it.

    An excess counts from 30 on, or from half a nat a sample where there are few. Instruments that
    wander and effects of nobody's library are misfit that many an effect can nibble at.
    """
    excess = around.counts * np.log(np.maximum(before.spreads, 1.0))
    left = around.counts * np.log(np.maximum(after.spreads, 1.0))
    channel = np.array([name for _, name, _ in around.labels])
    places = [channel == name for name in dict.fromkeys(channel.tolist())]
    places.append(np.array([around.tests[n] in effect.tests for n, _, _ in around.labels]))
    shares = [0.0]
    for place in places:
        had = float(excess[place].sum())
        if had > min(_WORTH, _CLEAR * float(around.counts[place].sum())):
            shares.append(1.0 - float(left[place].sum()) / had)
    error = min(max(shares), _power_share(around, before.spreads, after.spreads))
    cost = before.prior_cost
    return max(error, 1.0 - after.prior_cost / cost if cost > _WORTH else 0.0)


def _power_share(around: System, before: Array, after: Array) -> float:
    """Largest share of the power over the noise floor, of one signal at one order, that went away
    between two sets of χ²/n [G].
    """
    numbers: dict[tuple[str, int], int] = {}
    pool = [numbers.setdefault((name, k), len(numbers)) for _, name, k in around.labels]
    count = np.bincount(pool, around.counts)
    nats = np.bincount(pool, around.counts * np.log(np.maximum(before, 1.0)))
    had, has = (
        np.bincount(pool, around.counts * np.maximum(spreads - 1.0, 0.0))
        for spreads in (before, after)
    )
    worth = nats > np.minimum(_WORTH, _CLEAR * count)
    return float((1.0 - has[worth] / had[worth]).max(initial=0.0))


def search(
    segments: Sequence[Segment], fitted: Fitted, library: Mapping[str, Effect]
) -> tuple[Rung, ...]:
    """The ladder: adds the best effect, refits, checks backwards, until nothing passes."""
    rungs: list[Rung] = []
    base = len(fitted.model.effects)
    for _ in range(_MOST):
        offered = candidates(library, fitted)
        wide = widened(segments, fitted, offered, rungs[-1].around if rungs else None)
        scores = score_all(wide, fitted, offered)
        added = tuple(e.name for e in fitted.model.effects[base:])
        rungs.append(Rung(added, fitted, wide, scores))
        if len(rungs) == _MOST:
            break
        inside = {e.closer for e in fitted.model.effects} - {None}
        passing = [s for s in scores if s.passes and s.candidate.effect.closer not in inside]
        chosen = _chosen(segments, fitted, passing, wide)
        if chosen is None:
            break
        newest = chosen[0].model.effects[-1].name
        chosen = renamed(segments, chosen, newest, library)
        fitted, _ = _backward(segments, *chosen, base)
        found = fitted.model.effects[base:]
        fitted = replace(fitted, tolerance=tolerances(segments, fitted, found))
        if tuple(e.name for e in found) in {r.added for r in rungs}:
            break
    return tuple(rungs)


def _chosen(
    segments: Sequence[Segment], fitted: Fitted, passing: Sequence[Score], wide: System
) -> tuple[Fitted, System] | None:
    """The first few candidates refitted, the next few where none of these keeps its promise.

    The fit that stays is finished with columns of its own.
    """
    for first in range(0, min(len(passing), _ROUNDS * _REFITS), _REFITS):
        best = _refit_best(segments, fitted, passing[first : first + _REFITS], wide)
        if best is not None:
            named = [effect.name for effect in best[0].model.effects]
            return trimmed(segments, *gauss_newton(segments, best[0]), named)
    return None


def _refit_best(
    segments: Sequence[Segment], fitted: Fitted, passing: Sequence[Score], wide: System
) -> tuple[Fitted, System] | None:
    """Refits with the best candidates, those close to the best fall, and takes the best.

    A candidate must keep the promise of its score: the misfit falls by more than its price, and
    with captures predicted from all the others by half of it at least.
    """
    own = len(own_columns(fitted.model))
    before = held_out_spreads(wide, own, segments)
    close = [s for s in passing if s.fall >= _CLOSE * passing[0].fall]
    best: tuple[Fitted, System] | None = None
    least = math.inf
    for score in close:
        effect = score.candidate.effect
        tried = gauss_newton(segments, begun(fitted, score), before=wide)
        # of two that tie, the one that some capture here was made to show
        unsought = TIE if set(effect.tests).isdisjoint(wide.tests) else 0.0
        cost = tried[1].misfit + score.price + unsought
        if not material(tried[0], effect) or cost >= min(least, wide.misfit):
            continue
        if _holds(wide, before, tried[1], segments, _HELD * score.price):
            best, least = tried, cost
    return best


def _holds(
    wide: System, before: Array, tried: System, segments: Sequence[Segment], least: float
) -> bool:
    """Whether the misfit of captures predicted from all the others falls by `least`, and with it a
    share of some signal's power; `before` are their χ²/n without the candidate.
    """
    after = held_out_spreads(tried, len(tried.columns), segments)
    cost, left = (float(one.prior_costs().sum()) for one in (wide, tried))
    fall = wide.misfit_of(before) + cost - tried.misfit_of(after) - left
    priors = cost > _WORTH and left < (1.0 - LEAST_SHARE) * cost
    return fall > least and (priors or _power_share(wide, before, after) >= LEAST_SHARE)


def begun(fitted: Fitted, score: Score) -> Fitted:
    """Where a refit with a candidate begins: what its score foresees."""
    model = fitted.model.with_effects(score.candidate.effect)
    moved = {name: fitted.values[name] + change for name, change in score.moves.items()}
    start = {**fitted.values, **moved, **score.candidate.values, **score.step}
    return replace(fitted, model=model, values=clipped(model, start))


def material(fitted: Fitted, effect: Effect) -> bool:
    """Whether some amplitude of an effect is over its negligible size, and every shape that has
    one over its own.
    """
    machine = fitted.model.machine
    shapes = [
        abs(fitted.values[f"{effect.name}.{p.name}"]) >= p.negligible * machine.scale(p)
        for p in effect.parameters_of(machine)
        if not p.amplitude
    ]
    return all(shapes) and size_of(fitted, effect, "negligible") >= 1.0


def size_of(fitted: Fitted, effect: Effect, unit: str) -> float:
    """The largest amplitude of an effect over its `negligible` or `typical` size."""
    machine: Machine = fitted.model.machine
    sizes = [
        abs(fitted.values[f"{effect.name}.{p.name}"]) / (getattr(p, unit) * machine.scale(p))
        for p in effect.parameters_of(machine)
        if p.amplitude and getattr(p, unit) > 0
    ]
    return max(sizes, default=0.0)


def _backward(
    segments: Sequence[Segment], fitted: Fitted, around: System, base: int
) -> tuple[Fitted, System]:
    """Takes out effects that later ones have made superfluous."""
    for effect in fitted.model.effects[base:-1]:
        price = effect.dof(fitted.model.machine) * math.log(around.size)
        if material(fitted, effect) and loss_without(around, fitted, (effect.name,)) > 4 * price:
            continue
        kept = {k: v for k, v in fitted.values.items() if not k.startswith(f"{effect.name}.")}
        model = fitted.model.without(effect.name)
        tried = gauss_newton(segments, replace(fitted, model=model, values=kept), before=around)
        if tried[1].misfit - around.misfit < price:
            fitted, around = tried
    return fitted, around


def loss_without(
    around: System,
    fitted: Fitted,
    names: Iterable[str],
    instead: NDArray[np.int64] | None = None,
    grams: Grams | None = None,
) -> float:
    """Rise of misfit when effects go to zero amplitude and the rest, with `instead`, refits.

    The model is taken as linear between here and there. `grams` are those of all columns, where
    they are there already.
    """
    gone = tuple(f"{name}." for name in names)
    own = np.arange(len(own_columns(fitted.model)))
    out = np.array([n for n in own if around.columns[n].name.startswith(gone)], dtype=int)
    stay = np.setdiff1d(own, out)
    if instead is not None:
        stay = np.concatenate([stay, instead])
    machine = fitted.model.machine
    amplitude = {
        f"{e.name}.{p.name}": p.amplitude
        for e in fitted.model.effects
        for p in e.parameters_of(machine)
    }
    names_out = [around.columns[n].name for n in out]
    move = np.array([-fitted.values[n] if amplitude[n] else 0.0 for n in names_out])
    known = around.grams() if grams is None else grams
    return known.moved(out, move).along(stay).best(*_THOROUGH).misfit - known.misfit()
