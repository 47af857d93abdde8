"""Which effects the captures ask for: forward steps with refits, backward checks."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence, Set
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pipeline.criticism.effect import Effect
from pipeline.criticism.operating import Array
from pipeline.criticism.regression.fit import Fit, floors, floors_grown, tolerances
from pipeline.criticism.regression.gauss_newton import first_fit, gauss_newton, rough_anew
from pipeline.criticism.regression.goodness import (
    HeldOut,
    floor_factors,
    in_common,
    leave_out,
    predicted_chi2,
    significant_groups,
)
from pipeline.criticism.regression.identifiability import (
    significantly_nonzero,
    together_nonzero,
)
from pipeline.criticism.regression.linear_system import LinearSystem, linear_system
from pipeline.criticism.regression.noise_floors import form_tolerance
from pipeline.criticism.regression.normal_equations import NormalEquations
from pipeline.criticism.selection.changed_between import with_free_shares
from pipeline.criticism.selection.choices import reconsidered
from pipeline.criticism.selection.discrimination import discriminate, renamed
from pipeline.criticism.selection.far_starts import with_starts
from pipeline.criticism.selection.linear_start import with_linear_start
from pipeline.criticism.selection.log_start import with_log_start
from pipeline.criticism.selection.other_readings import other_reading
from pipeline.criticism.selection.pruning import trimmed, with_all_terms
from pipeline.criticism.selection.score_test import (
    Score,
    candidates,
    clears,
    fall_below_floor,
    power_share,
    score_all,
    widened,
)
from pipeline.criticism.selection.sizes import material, shaped, size_of
from pipeline.criticism.selection.unusual_nuisances import with_nuisances


@dataclass(frozen=True, slots=True)
class LadderStep:
    """One step of the search.

    Attributes
    ----------
    added
        Effects that were added so far.
    system
        The fit with them, and the columns of all candidates.
    scores
        Every candidate's score on it.

    """

    added: tuple[str, ...]
    system: LinearSystem
    scores: tuple[Score, ...]

    @property
    def fit(self) -> Fit:
        """The fit that the system is around."""
        return self.system.fit


def search(fit: Fit, library: Mapping[str, Effect]) -> tuple[LadderStep, ...]:
    """Adds the best effect, refits and checks backwards, until nothing passes.

    Parameters
    ----------
    fit
        The fit of the requested model.
    library
        Effects that may be added.

    Returns
    -------
    tuple of LadderStep
        The first without any addition; `policy.selection.most_steps` at most.

    Notes
    -----
    Shares of friction or magnet left free, or another reading of a column, that explain as much as
    the best effect, within a `tie`, are taken instead; what full logs show of that effect counts
    for it.

    """
    steps: list[LadderStep] = []
    policy = fit.policy.selection
    base = len(fit.model.effects)
    for _ in range(policy.most_steps):
        offered = candidates(library, fit.model)
        wide = widened(fit, offered, steps[-1].system if steps else None)
        significant = significant_groups(wide)
        scores = score_all(wide, offered, significant)
        scores = with_nuisances(wide, offered, scores)
        scores = with_starts(wide, offered, scores, significant)
        scores = with_linear_start(wide, offered, scores, significant)
        scores = with_log_start(wide, offered, scores, significant)
        added = tuple(e.name for e in fit.model.effects[base:])
        steps.append(LadderStep(added, wide, scores))
        if len(steps) == policy.most_steps:
            break
        inside = {e.discriminator for e in fit.model.effects} - {None}
        couplings = bool(significant.any())
        passing = [s for s in scores if s.passes and _may_join(s, inside, couplings)]
        chosen = _chosen(wide, passing, fit.model.effects[base:])
        unnamed = filter(None, (with_free_shares(wide), other_reading(wide)))
        alternative = min(unnamed, key=lambda system: system.deviance, default=None)
        if alternative is not None and (
            chosen is None or alternative.deviance < _with_full_logs(chosen) + policy.tie
        ):
            fit = alternative.fit
            del steps[-1]
            continue
        if chosen is None:
            break
        chosen = renamed(chosen, chosen.fit.model.effects[-1].name, library)
        system = reconsidered(_backward(chosen, base))
        fit, effects = system.fit, system.fit.model.effects[base:]
        fit = replace(fit, tolerance=tolerances(fit, effects))
        if effects:
            fit = _floored_anew(fit, system)
        if tuple(e.name for e in effects) in {r.added for r in steps}:
            break
    return tuple(steps)


def _with_full_logs(system: LinearSystem) -> float:
    """The deviance of a fit, less what full logs say of its newest effect, which is in no row: the
    square of a twist or gap over its uncertainty.
    """
    effect = system.fit.model.effects[-1]
    shapes = [p for p in effect.parameters_of(system.fit.machine) if p.u > 0.0 and not p.amplitude]
    significance = [(system.fit.size(effect, p) / p.u) ** 2 for p in shapes]
    return system.deviance - max(significance, default=0.0)


def _may_join(score: Score, inside: Set[object], couplings: bool) -> bool:
    """Whether an effect may join those `inside`, of whose discriminators there is one each.

    Couplings need a remainder that is reported: noise of an angle's sensor runs through a drive's
    speed loop into the current, and so looks like a soft shaft in every capture.
    """
    effect = score.candidate.effect
    return effect.discriminator is None or (couplings and effect.discriminator not in inside)


def _floored_anew(fit: Fit, before: LinearSystem | None = None) -> Fit:
    """The fit by noise floors made anew, now that another effect is in; `before` by the former.

    The tolerance for its form is new, so it is refitted in any case: the next effect is judged
    against this deviance. If some floor changes by half, or something is left over them, and a
    rough fit finds another inertia, a fit is begun there as well and the better one stays. Undoing
    a sensor's lag adds noise, so does a twist derived from an angle, and so do the edges of a dead
    time. An encoder off its centre drives J to next to nothing, an unbalance to six times what it
    is, and the floors were made with that J.
    """
    policy = fit.policy.selection
    grown = np.concatenate(floors_grown(fit))
    changed = np.abs(np.log(grown)).max() >= math.log(policy.floor_ratio)
    if changed:
        floor = floors(fit.segments, fit.model, fit.values)
        fit = replace(fit, sigma=floor, near=fit.values)
    refitted = gauss_newton(fit, before=before)
    if not changed and not significant_groups(refitted).any():
        return refitted.fit
    rough = rough_anew(fit)
    lighter, heavier = sorted(fit.values["j_kgm2"] for fit in (rough, fit))
    if heavier < policy.inertia_ratio * lighter:
        return refitted.fit
    return min(refitted, first_fit(rough), key=lambda end: end.deviance).fit


def _chosen(
    wide: LinearSystem, passing: Sequence[Score], added: Sequence[Effect]
) -> LinearSystem | None:
    """The fit with the best candidate of the first few; of the next few, if none of these keeps its
    predicted fall and differs significantly from zero.

    That fit is finished with columns of its own, and without terms that are not worth their
    penalty. Where one that explains more by over a `tie` is not sure of its size, no other that
    acts there is named in its place.
    """
    policy = wide.policy.selection
    unsure: list[tuple[float, NDArray[np.bool_]]] = []
    for first in range(0, min(len(passing), policy.refit_rounds * policy.refits), policy.refits):
        batch = list(passing[first : first + policy.refits])
        while (best := _refit_best(wide, batch, added)) is not None:
            named = [effect.name for effect in best.fit.model.effects]
            finished = trimmed(gauss_newton(with_all_terms(best.fit), before=best), named)
            cost = finished.deviance + math.log(wide.size) * finished.model_columns.size
            acts = _acts(finished)
            if any(cost > least + policy.tie and np.any(acts & where) for least, where in unsure):
                return None
            if _is_determined(at_end := linear_system(finished.fit), wide):
                return at_end
            unsure.append((cost, acts))
            batch = [s for s in batch if s.candidate.effect.name != named[-1]]
    return None


def _refit_best(
    wide: LinearSystem, passing: Sequence[Score], added: Sequence[Effect]
) -> LinearSystem | None:
    """Refits candidates that are close to the best fall of deviance; the best one that passes.

    Each must pass all of:

    1. it matters at its refitted size, and as a friction drives the shaft in neither sense;
    2. the deviance falls by more than its penalty;
    3. predicted from all other captures, it falls by `held_out_penalties`, even if the forms of
       effects `added` with the same hook are a little wrong (`form_error`);
    4. evidence below the floor does so even if any form found is wrong, and beside an effect of the
       same hook by `same_hook_penalties`, since what a form leaves there is of that size;
    5. so predicted, what it mends is more than what it spoils where it acts.
    """
    policy = wide.policy.selection
    usual = _Baseline.of(wide, added)
    tests = {segment.test for segment in wide.segments}
    close = [s for s in passing if s.fall >= policy.close_share * passing[0].fall]
    best: LinearSystem | None = None
    least = 0.0
    for score in close:
        effect = score.candidate.effect
        begun = _reweighted(wide, score)
        tried = _refitted(begun, score)
        baseline = usual if begun is wide else _Baseline.of(gauss_newton(begun.fit, begun), added)
        base = baseline.wide
        # of two that tie, the one that benches have and that some capture here was made to show
        far = effect.rare or set(effect.tests).isdisjoint(tests)
        unsought = policy.tie if far else 0.0
        cost = tried.deviance - base.deviance + score.penalty + unsought
        if (
            _matters(tried, base, baseline.significant)
            and cost < least
            and baseline.is_improved_by(tried, score)
        ):
            best, least = tried, cost
    return best


@dataclass(frozen=True, slots=True)
class _Baseline:
    """The fit without a candidate, as the candidate is judged against it: with the effects `added`
    so far, what it predicts of captures held out, its `shrunk` floors and `doubts` of form [G].
    """

    wide: LinearSystem
    added: Sequence[Effect]
    held_out: HeldOut
    shrunk: Array
    doubt: Array
    significant: NDArray[np.bool_]

    @classmethod
    def of(cls, wide: LinearSystem, added: Sequence[Effect]) -> _Baseline:
        held_out, significant = leave_out(wide), significant_groups(wide)
        factors = floor_factors(wide), _form_error_factors(wide, added)
        return cls(wide, added, held_out, *factors, significant)

    def is_improved_by(self, tried: LinearSystem, score: Score) -> bool:
        """Whether a candidate predicts captures held out better, and mends more than it spoils."""
        wide, policy = self.wide, self.wide.policy.selection
        same_hook = _same_hook(score.candidate.effect, self.added)
        doubts = _form_error_factors(wide, same_hook), self.doubt
        below = policy.same_hook_penalties if same_hook else policy.held_out_penalties
        promised = policy.held_out_penalties * score.penalty, below * score.penalty
        one, other = in_common((wide, tried), (self.held_out, leave_out(tried)))
        without = predicted_chi2(wide, one) * self.shrunk
        after = predicted_chi2(tried, other) * floor_factors(tried)
        holds = _improves_held_out(wide, without, tried, after, promised, doubts)
        relief = float(wide.prior_costs().sum() - tried.prior_costs().sum())
        return holds and not spoils(tried, without, after, relief)


def _reweighted(wide: LinearSystem, score: Score) -> LinearSystem:
    """The fit by the noise floors that a candidate begins with, if it is a coupling.

    A twist derived from an angle amplifies its noise, at orders of the angle by hundreds. By the
    floors of a rigid shaft this noise would count as deviance.
    """
    if score.candidate.effect.discriminator is None:
        return wide
    begun = begin_from(wide.fit, score)
    grown = floors(begun.segments, begun.model, begun.values)
    ratio = np.concatenate(grown) / np.concatenate(wide.fit.sigma)
    if np.abs(np.log(ratio)).max() < math.log(wide.policy.selection.floor_ratio):
        return wide
    return linear_system(replace(wide.fit, sigma=grown, near=begun.values))


def _refitted(wide: LinearSystem, score: Score) -> LinearSystem:
    """The fit with a candidate, started from the step that its score predicts.

    If that fit is no better than the one without it, a second one begins with all other parameters
    where they are: the linear step overshoots where parameters are strongly correlated.
    """
    tried = gauss_newton(begin_from(wide.fit, score), before=wide)
    if tried.deviance + score.penalty < wide.deviance:
        return tried
    restarted = gauss_newton(begin_from(wide.fit, replace(score, moves={})), before=wide)
    return min(tried, restarted, key=lambda end: end.deviance)


def _matters(system: LinearSystem, before: LinearSystem, significant: NDArray[np.bool_]) -> bool:
    """Whether the newest effect of a refit is large enough to matter in use, or takes most."""
    fit, effect = system.fit, system.fit.model.effects[-1]
    return material(fit, effect) or _takes_most(system, before, significant)


def _takes_most(system: LinearSystem, before: LinearSystem, significant: NDArray[np.bool_]) -> bool:
    """Whether the newest effect takes most of what was `significant` [G] as a remainder before."""
    fit, effect = system.fit, system.fit.model.effects[-1]
    chi2 = [fitted.reduced_chi2(fitted.residual) for fitted in (before, system)]
    takes_most = effect.discriminator is None and clears(system, significant, *chi2)
    return takes_most and shaped(fit, effect)


def _is_determined(system: LinearSystem, before: LinearSystem) -> bool:
    """Whether some amplitude of the newest effect that matters differs significantly from zero:
    two standard uncertainties away, whichever capture is left out; or all of them together do. Of
    a coupling, its twist or gap must be so as well, by the fit or by full logs, and full logs must
    not exclude it.

    Counterexamples: a drag below the lowest speed of any capture can mend how friction changes
    sense at a reversal, while its own size is not known at all; and waves of the flux too small to
    matter are sure beside a large one that may be zero.
    """
    effect = system.fit.model.effects[-1]
    held_out = leave_out(system)
    sure = significantly_nonzero(system, held_out, system.policy.selection.least_u)
    parameters = effect.parameters_of(system.fit.machine)
    least, discrimination = system.policy.selection.least_u, discriminate(system.fit, effect)
    excluded = discrimination is not None and discrimination.name is None
    logged = {p.name: (system.fit.size(effect, p), p.u) for p in parameters if p.u > 0.0}
    logged |= discrimination.values if discrimination is not None else {}
    by_logs = {name for name, (size, u) in logged.items() if size > least * u}
    nonzero = [p for p in parameters if f"{effect.name}.{p.name}" in sure or p.name in by_logs]
    twists = [p for p in parameters if p.negligible > 0 and not p.amplitude]
    coupled = effect.discriminator is None or not twists or any(p in nonzero for p in twists)
    amplitudes = [p for p in parameters if p.amplitude and p.negligible > 0.0]
    names = [f"{effect.name}.{p.name}" for p in amplitudes]
    present = [p for p in amplitudes if p in nonzero]
    if not present and together_nonzero(system, held_out, names, least):
        present = amplitudes
    matters = size_of(system.fit, effect, present) >= 1.0 or (
        bool(present) and _takes_most(system, before, significant_groups(before))
    )
    return coupled and not excluded and matters


def _same_hook(effect: Effect, added: Sequence[Effect]) -> list[Effect]:
    """The found effects that act where an effect does: fluxes and drops in voltages, or drags."""
    acts = ("flux", "drop") if effect.hook in ("flux", "drop") else (effect.hook,)
    return [other for other in added if other.hook in acts and effect.hook != "sensor"]


def _form_error_factors(wide: LinearSystem, added: Sequence[Effect]) -> Array:
    """Factors [G] on χ²/n if the forms of these effects are wrong by a twentieth.

    Windage that only takes up what the formula of Stribeck friction leaves is not there.
    """
    if not added:
        return np.ones(len(wide.labels))
    model, values = wide.fit.model, wide.fit.values
    share = wide.policy.selection.form_error
    wrong = np.concatenate([form_tolerance(s, model, values, added, share) for s in wide.segments])
    noise = np.bincount(wide.group, wide.row_weight**-2, len(wide.labels)) / np.maximum(
        wide.counts, 1.0
    )
    return noise / np.maximum(noise + wrong**2, 1e-300)


def _improves_held_out(
    wide: LinearSystem,
    before: Array,
    tried: LinearSystem,
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
    same_hook, below = doubts
    cost, after_cost = (float(system.prior_costs().sum()) for system in (wide, tried))
    fall = (
        wide.deviance_of(same_hook * before)
        + cost
        - tried.deviance_of(same_hook * after)
        - after_cost
    )
    priors = cost > policy.excess and after_cost < (1.0 - policy.least_share) * cost
    helps = priors or power_share(wide, same_hook * before, same_hook * after) >= policy.least_share
    below_floor = min(fall_below_floor(wide, k * before, k * after) for k in (1.0, below))
    return fall > least[0] and (helps or below_floor > least[1])


def spoils(tried: LinearSystem, before: Array, after: Array, relief: float = 0.0) -> bool:
    """Whether the newest effect adds more power than it removes, of what other captures predict.

    Parameters
    ----------
    tried
        The fit with the effect.
    before
        χ²/n predicted without it [G].
    after
        χ²/n predicted with it [G].
    relief
        Fall of the priors' χ²: a lag of 24 usual ones was as good as the effect that names it.

    Returns
    -------
    bool
        A deviance is logarithmic: it falls where a small error is halved and a large one doubled.
        Only groups count in which the effect acts, and of these what changes by more than
        `least_share`, since any refit moves an error of another cause a little.

    """
    acts = _acts(tried)
    change = np.maximum(after, 1.0) - np.maximum(before, 1.0)
    counts = acts & (np.abs(change) > tried.policy.selection.least_share * np.maximum(before, 1.0))
    return float((tried.counts * change)[counts].sum()) > relief


def _acts(system: LinearSystem) -> NDArray[np.bool_]:
    """The groups [G] in which the newest effect acts."""
    name = f"{system.fit.model.effects[-1].name}."
    columns = [n for n, column in enumerate(system.columns) if column.name.startswith(name)]
    moved = np.any(system.matrix[:, columns], axis=1)
    return np.bincount(system.group, moved, len(system.labels)) > 0


def begin_from(fit: Fit, score: Score) -> Fit:
    """Where a refit with a candidate begins: what its score predicts.

    Parameters
    ----------
    fit
        The fit without it.
    score
        The score of the candidate.

    """
    effect = score.candidate.effect
    model = fit.model.with_effects(effect)
    moved = {name: fit.values[name] + change for name, change in score.moves.items()}
    if effect.in_place_of is not None:
        moved[effect.in_place_of[0]] = 0.0
    start = {**moved, **score.candidate.values, **score.step}
    return replace(fit, model=model).at(start)


def _backward(system: LinearSystem, base: int) -> LinearSystem:
    """Takes out effects that later ones have made superfluous."""
    factor = system.policy.selection.most_penalties
    for effect in system.fit.model.effects[base:-1]:
        penalty = effect.dof(system.fit.machine) * math.log(system.size)
        if material(system.fit, effect) and loss_without(system, (effect.name,)) > factor * penalty:
            continue
        tried = gauss_newton(system.fit.without(effect.name), before=system)
        if tried.deviance - system.deviance < penalty:
            system = tried
    return system


def loss_without(
    system: LinearSystem,
    names: Iterable[str],
    instead: NDArray[np.int64] | None = None,
    normal_equations: NormalEquations | None = None,
) -> float:
    """Rise of the deviance when effects go to zero amplitude and the rest is refitted.

    Parameters
    ----------
    system
        The fit.
    names
        The effects.
    instead
        Places of columns that are fitted in their stead.
    normal_equations
        Those of all columns, where they were computed before.

    Returns
    -------
    float
        To first order: the model is taken as linear between here and there.

    """
    stems = tuple(f"{name}." for name in names)
    fit, model_columns = system.fit, system.model_columns
    left_out = np.array(
        [n for n in model_columns if system.columns[n].name.startswith(stems)], dtype=int
    )
    stay = np.setdiff1d(model_columns, left_out)
    if instead is not None:
        stay = np.concatenate([stay, instead])
    machine = fit.machine
    amplitude = {
        f"{e.name}.{p.name}": p.amplitude
        for e in fit.model.effects
        for p in e.parameters_of(machine)
    }
    names_out = [system.columns[n].name for n in left_out]
    move = np.array([-fit.values[n] if amplitude[n] else 0.0 for n in names_out])
    equations = system.normal_equations() if normal_equations is None else normal_equations
    end = equations.moved(left_out, move).only(stay).best(*fit.policy.selection.thorough)
    return end.deviance - equations.deviance()
