"""Which effects the captures ask for: forward steps with refits, backward checks."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pipeline.criticism.data.segment import Segment
from pipeline.criticism.effect import Array, Effect, Machine
from pipeline.criticism.regression.gauss_newton import clipped, first_fit, gauss_newton, rough_anew
from pipeline.criticism.regression.goodness import (
    HeldOut,
    in_common,
    leave_out,
    predicted_spreads,
    told_groups,
)
from pipeline.criticism.regression.identifiability import surely_there
from pipeline.criticism.regression.linear_system import (
    Fitted,
    System,
    floors,
    floors_grown,
    own_columns,
    system,
    tolerances,
)
from pipeline.criticism.regression.noise_floors import form_tolerance
from pipeline.criticism.regression.normal_equations import Grams
from pipeline.criticism.selection.choices import reconsidered
from pipeline.criticism.selection.discrimination import renamed
from pipeline.criticism.selection.far_starts import with_starts
from pipeline.criticism.selection.pruning import trimmed, whole
from pipeline.criticism.selection.score_test import (
    Score,
    candidates,
    clears,
    power_share,
    quiet_fall,
    score_all,
    widened,
)


@dataclass(frozen=True, slots=True)
class Rung:
    """One step of the ladder: the fit with these effects and every candidate's score on it."""

    added: tuple[str, ...]
    fitted: Fitted
    around: System
    scores: tuple[Score, ...]


def search(
    segments: Sequence[Segment], fitted: Fitted, library: Mapping[str, Effect]
) -> tuple[Rung, ...]:
    """The ladder: adds the best effect, refits, checks backwards, until nothing passes or five
    effects are in.
    """
    rungs: list[Rung] = []
    policy = fitted.policy.selection
    base = len(fitted.model.effects)
    for _ in range(policy.most_steps):
        offered = candidates(library, fitted)
        wide = widened(segments, fitted, offered, rungs[-1].around if rungs else None)
        told = told_groups(wide, segments)
        scores = score_all(wide, fitted, offered, told)
        scores = with_starts(segments, wide, fitted, offered, scores, told)
        added = tuple(e.name for e in fitted.model.effects[base:])
        rungs.append(Rung(added, fitted, wide, scores))
        if len(rungs) == policy.most_steps:
            break
        inside = {e.closer for e in fitted.model.effects} - {None}
        passing = [s for s in scores if s.passes and s.candidate.effect.closer not in inside]
        chosen = _chosen(segments, fitted, passing, wide, fitted.model.effects[base:])
        if chosen is None:
            break
        newest = chosen[0].model.effects[-1].name
        chosen = renamed(segments, chosen, newest, library)
        fitted, _ = reconsidered(segments, *_backward(segments, *chosen, base))
        found = fitted.model.effects[base:]
        fitted = replace(fitted, tolerance=tolerances(segments, fitted, found))
        if found and (found[-1].hook == "sensor" or found[-1].closer is not None):
            fitted = _floored_anew(segments, fitted)
        if tuple(e.name for e in found) in {r.added for r in rungs}:
            break
    return tuple(rungs)


def _floored_anew(segments: Sequence[Segment], fitted: Fitted) -> Fitted:
    """The fit by noise floors made anew, now that an effect of a sensor or a coupling is found.

    If no floor changes by half and nothing is left over them, the fit stays as it is. If a rough
    fit finds another inertia, a fit is begun there as well and the better one stays. Undoing a
    sensor's lag adds noise, and so does a twist told by an angle. An encoder off its centre drives
    J to next to nothing, and the floors were computed with that J.
    """
    policy = fitted.policy.selection
    floor = floors(segments, fitted.model, fitted.values)
    ratio = np.concatenate(floor) / np.concatenate(fitted.sigma)
    if np.abs(np.log(ratio)).max() >= math.log(policy.floor_ratio):
        fitted = replace(fitted, sigma=floor, near=fitted.values)
        ended = gauss_newton(segments, fitted)
    else:
        ended = fitted, system(segments, fitted)
        if not told_groups(ended[1], segments).any():
            return fitted
    near = rough_anew(segments, fitted)
    lighter, heavier = sorted(fit.values["j_kgm2"] for fit in (near, fitted))
    if heavier < policy.inertia_ratio * lighter:
        return ended[0]
    return min(ended, first_fit(segments, near), key=lambda end: end[1].misfit)[0]


def _chosen(
    segments: Sequence[Segment],
    fitted: Fitted,
    passing: Sequence[Score],
    wide: System,
    found: Sequence[Effect],
) -> tuple[Fitted, System] | None:
    """The fit with the best candidate of the first few; of the next few, if none of these keeps its
    promise and is surely there.

    That fit is finished with columns of its own, and without terms that do not pay.
    """
    policy = fitted.policy.selection
    for first in range(0, min(len(passing), policy.refit_rounds * policy.refits), policy.refits):
        batch = list(passing[first : first + policy.refits])
        while (best := _refit_best(segments, fitted, batch, wide, found)) is not None:
            named = [effect.name for effect in best[0].model.effects]
            near = gauss_newton(segments, whole(best[0]), before=best[1])
            finished = trimmed(segments, *near, named)
            anew = system(segments, finished[0])
            if _sure(finished[0], anew, leave_out(anew, len(anew.columns), segments)):
                return finished
            batch = [s for s in batch if s.candidate.effect.name != named[-1]]
    return None


def _refit_best(
    segments: Sequence[Segment],
    fitted: Fitted,
    passing: Sequence[Score],
    wide: System,
    found: Sequence[Effect],
) -> tuple[Fitted, System] | None:
    """Refits candidates that are close to the best fall of deviance; the best one that passes.

    Each must pass all of:

    1. it matters at its refitted size;
    2. the deviance falls by more than its penalty;
    3. predicted from all other captures, it falls by `held_out_penalties`, even if the forms of
       effects `found` with the same hook are a little wrong (`form_error`);
    4. evidence below the floor does so even if any form found is wrong, and beside an effect of the
       same hook by `same_hook_penalties`, since what a form leaves there is of that size.
    """
    policy, own = fitted.policy.selection, len(own_columns(fitted.model))
    before, shrunk = leave_out(wide, own, segments), _shrunk(segments, wide)
    any_wrong, told = _doubt(segments, fitted, wide, found), told_groups(wide, segments)
    close = [s for s in passing if s.fall >= policy.close_share * passing[0].fall]
    best: tuple[Fitted, System] | None = None
    least = math.inf
    for score in close:
        effect = score.candidate.effect
        tried = _refitted(segments, fitted, score, wide)
        # of two that tie, the one that some capture here was made to show
        unsought = policy.tie if set(effect.tests).isdisjoint(wide.tests) else 0.0
        cost = tried[1].misfit + score.price + unsought
        if not _matters(*tried, wide, told) or cost >= min(least, wide.misfit):
            continue
        kin = _kin(effect, found)
        doubts = _doubt(segments, fitted, wide, kin), any_wrong
        below = policy.same_hook_penalties if kin else policy.held_out_penalties
        promised = policy.held_out_penalties * score.price, below * score.price
        held = leave_out(tried[1], len(tried[1].columns), segments)
        one, other = in_common((wide, tried[1]), (before, held))
        without = predicted_spreads(wide, one) * shrunk
        after = predicted_spreads(tried[1], other) * _shrunk(segments, tried[1])
        if _holds(wide, without, tried[1], after, promised, doubts):
            best, least = tried, cost
    return best


def _refitted(
    segments: Sequence[Segment], fitted: Fitted, score: Score, wide: System
) -> tuple[Fitted, System]:
    """The fit with a candidate, begun from what its score foresees.

    If that fit is no better than the one without it, a second one begins with all other parameters
    where they are: along a bent valley the tangent goes astray.
    """
    tried = gauss_newton(segments, begun(fitted, score), before=wide)
    if tried[1].misfit + score.price < wide.misfit:
        return tried
    again = gauss_newton(segments, begun(fitted, replace(score, moves={})), before=wide)
    return min(tried, again, key=lambda end: end[1].misfit)


def _matters(fitted: Fitted, around: System, before: System, told: NDArray[np.bool_]) -> bool:
    """Whether the newest effect of a refit is as large as anybody would act on, or takes most of
    what was `told` [G] as a remainder before.
    """
    effect = fitted.model.effects[-1]
    if material(fitted, effect):
        return True
    was, now = before.spreads(before.residual), around.spreads(around.residual)
    most = effect.closer is None and clears(around, told, was, now)
    return most and shaped(fitted, effect)


def _sure(fitted: Fitted, around: System, held: HeldOut) -> bool:
    """Whether some amplitude of the newest effect is surely not zero: two standard uncertainties
    away, whichever capture is left out. Of a coupling, its twist or gap must be so as well.

    A counterexample: a drag below the lowest speed of any capture can mend how friction changes
    sense at a reversal, while its own size is not known at all.
    """
    effect = fitted.model.effects[-1]
    sure = surely_there(around, held, fitted.policy.selection.least_u)
    known = effect.parameters_of(fitted.model.machine)
    told = [p for p in known if f"{effect.name}.{p.name}" in sure]
    twists = [p for p in known if p.negligible > 0 and not p.amplitude]
    coupled = effect.closer is None or not twists or any(p in told for p in twists)
    return coupled and any(p.amplitude for p in told)


def _kin(effect: Effect, found: Sequence[Effect]) -> list[Effect]:
    """The found effects of an effect's own kind: flux, drop or drag."""
    return [one for one in found if one.hook == effect.hook != "sensor"]


def _doubt(
    segments: Sequence[Segment], fitted: Fitted, wide: System, found: Sequence[Effect]
) -> Array:
    """Factors [G] on χ²/n if the forms of these effects are wrong by a twentieth.

    Windage that only takes up what the formula of Stribeck friction leaves is not there.
    """
    if not found:
        return np.ones(len(wide.labels))
    model, values = fitted.model, fitted.values
    share = fitted.policy.selection.form_error
    wrong = np.concatenate([form_tolerance(s, model, values, found, share) for s in segments])
    noise = np.bincount(wide.group, wide.whiten**-2, len(wide.labels)) / np.maximum(
        wide.counts, 1.0
    )
    left: Array = noise / np.maximum(noise + wrong**2, 1e-300)
    return left


def _holds(
    wide: System,
    before: Array,
    tried: System,
    after: Array,
    least: tuple[float, float],
    doubts: tuple[Array, Array],
) -> bool:
    """Whether a candidate helps where captures are predicted from all the others.

    Their deviance must fall by the first of `least`. A share of some signal's power must go too,
    or the deviance of signals below their floor must fall by the second of `least`. `before` and
    `after` are χ²/n [G] without and with the candidate. They are multiplied by the first of the
    `doubts` [G]; below the floor, the smaller fall with and without the second counts.
    """
    policy = wide.policy.selection
    kin, below = doubts
    cost, left = (float(one.prior_costs().sum()) for one in (wide, tried))
    fall = wide.misfit_of(kin * before) + cost - tried.misfit_of(kin * after) - left
    priors = cost > policy.excess and left < (1.0 - policy.least_share) * cost
    helps = priors or power_share(wide, kin * before, kin * after) >= policy.least_share
    quiet = min(quiet_fall(wide, some * before, some * after) for some in (1.0, below))
    return fall > least[0] and (helps or quiet > least[1])


def _shrunk(segments: Sequence[Segment], tried: System) -> Array:
    """Factors [G] that turn χ²/n by the floors a fit was made with into χ²/n by those at its end.

    The equations hold the noise of a current times R and L: a fit that makes these smaller makes
    the residual smaller as well. Reference: Fuller, Measurement Error Models (1987), section 1.3.
    """
    was = np.concatenate(tried.around.sigma)[tried.group]
    now = was * np.concatenate(floors_grown(segments, tried.around))[tried.group]
    power = tried.whiten**-2
    by_end = np.bincount(tried.group, power + now**2 - was**2, len(tried.labels))
    factors: Array = np.bincount(tried.group, power, len(tried.labels)) / np.maximum(by_end, 1e-300)
    return np.where(tried.counts > 0, factors, 1.0)


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
    return shaped(fitted, effect) and size_of(fitted, effect, "negligible") >= 1.0


def shaped(fitted: Fitted, effect: Effect) -> bool:
    """Whether every shape of an effect is over its negligible size, if it has one."""
    machine = fitted.model.machine
    return all(
        abs(fitted.values[f"{effect.name}.{p.name}"]) >= p.negligible * machine.scale(p)
        for p in effect.parameters_of(machine)
        if not p.amplitude
    )


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
    most = fitted.policy.selection.most_penalties
    for effect in fitted.model.effects[base:-1]:
        price = effect.dof(fitted.model.machine) * math.log(around.size)
        if material(fitted, effect) and loss_without(around, fitted, (effect.name,)) > most * price:
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
    """Rise of deviance when effects go to zero amplitude and the rest, with `instead`, refits.

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
    end = known.moved(out, move).along(stay).best(*fitted.policy.selection.thorough)
    return end.misfit - known.misfit()
