"""What a refit with one more effect must show before the effect is accepted."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from pipeline.criticism.effect import Effect
from pipeline.criticism.operating import Array, Flags
from pipeline.criticism.parameter import Parameter
from pipeline.criticism.regression.columns import Column
from pipeline.criticism.regression.cross_validation import (
    HeldOut,
    in_common,
    leave_out,
    predicted_chi2,
)
from pipeline.criticism.regression.goodness import floor_factors, significant_groups
from pipeline.criticism.regression.identifiability import (
    least_of_several,
    product_nonzero,
    significantly_nonzero,
    together_nonzero,
)
from pipeline.criticism.regression.linear_system import LinearSystem
from pipeline.criticism.regression.noise_floors import form_tolerance
from pipeline.criticism.selection.discrimination import discriminate
from pipeline.criticism.selection.improvement import clears, fall_below_floor, power_share
from pipeline.criticism.selection.score_test import Score
from pipeline.criticism.selection.sizes import driving_friction, material, shaped, size_of


@dataclass(frozen=True, slots=True)
class Baseline:
    """The fit without a candidate, as the candidate is judged against it: with the effects `added`
    so far, what it predicts of captures held out, its `shrunk` floors and `doubt` of form [G].
    """

    wide: LinearSystem
    added: Sequence[Effect]
    held_out: HeldOut
    shrunk: Array
    doubt: Array
    significant: Flags

    @classmethod
    def of(cls, wide: LinearSystem, added: Sequence[Effect]) -> Baseline:
        """A fit as a baseline.

        Parameters
        ----------
        wide
            The fit.
        added
            Effects that the search added to it.

        """
        held_out, significant = leave_out(wide), significant_groups(wide)
        factors = floor_factors(wide), _form_error_factors(wide, added)
        return cls(wide, added, held_out, *factors, significant)

    def is_improved_by(self, tried: LinearSystem, score: Score) -> bool:
        """Whether a candidate predicts captures held out better, and mends more than it spoils; of
        one that may be hidden in the fit, by what it takes over the floor of these captures alone.

        Parameters
        ----------
        tried
            The fit with the candidate.
        score
            Its score.

        """
        wide, policy = self.wide, self.wide.policy.selection
        same_hook = _same_hook(score.candidate.effect, self.added)
        doubts = _form_error_factors(wide, same_hook), self.doubt
        below = policy.same_hook_penalties if same_hook else policy.held_out_penalties
        below = math.inf if score.may_be_hidden else below
        least = policy.held_out_penalties * score.penalty, below * score.penalty
        one, other = in_common((wide, tried), (self.held_out, leave_out(tried)))
        without = predicted_chi2(wide, one) * self.shrunk
        after = predicted_chi2(tried, other) * floor_factors(tried)
        holds = _improves_held_out(wide, without, tried, after, least, doubts)
        relief = float(wide.prior_costs().sum() - tried.prior_costs().sum())
        return holds and not spoils(tried, without, after, relief)


def matters(
    system: LinearSystem,
    before: LinearSystem,
    significant: Flags,
    effect: Effect | None = None,
) -> bool:
    """Whether an effect of a refit is large enough to matter in use, or takes most.

    Parameters
    ----------
    system
        The refit.
    before
        The fit without the effect.
    significant
        Groups [G] that `before` leaves over their floor.
    effect
        The effect; the newest where not given.

    Returns
    -------
    bool
        False for an effect that is no torque and makes viscous friction drive the shaft.

    Notes
    -----
    A speed that gives way under load follows the torque as the torque's sensor may follow the
    current: a lag in place of the inertia explains the same where friction is free to drive.

    """
    fit = system.fit
    effect = effect or fit.model.effects[-1]
    if effect.hook != "torque" and driving_friction(system) and not driving_friction(before):
        return False
    return material(fit, effect) or _takes_most(system, before, significant, effect)


def _takes_most(
    system: LinearSystem, before: LinearSystem, significant: Flags, effect: Effect
) -> bool:
    """Whether an effect takes most of what was `significant` [G] as a remainder before."""
    fit = system.fit
    chi2 = [fitted.reduced_chi2(fitted.residual) for fitted in (before, system)]
    takes_most = effect.discriminator is None and clears(system, significant, *chi2)
    return takes_most and shaped(fit, effect)


def is_determined(system: LinearSystem, before: LinearSystem, effect: Effect | None = None) -> bool:
    """Whether some amplitude of an effect that matters differs significantly from zero.

    Parameters
    ----------
    system
        The fit with the effect.
    before
        The fit without it.
    effect
        The effect; the newest where not given.

    Returns
    -------
    bool
        Whether one is `least_u` away from zero, whichever capture is left out, or all of them
        together are. Of a coupling, its twist or gap must be so as well, by the fit or
        by full logs, and full logs must not exclude it.

    Notes
    -----
    Of one that takes most of what is over the floor an optional term with a shape will do: what a
    compensation gives back may be nearly all that a dead time takes at large current.
    Counterexamples: a drag below the lowest speed of any capture can mend how friction changes
    sense at a reversal, while its own size is not known at all; and waves of the flux too small to
    matter are sure beside a large one that may be zero.

    """
    effect, held_out = effect or system.fit.model.effects[-1], leave_out(system)
    if size_of(system.fit, effect, sure_amplitudes(system, held_out, effect)) >= 1.0:
        return True
    takes_most = _takes_most(system, before, significant_groups(before), effect)
    return takes_most and bool(sure_amplitudes(system, held_out, effect, terms=True))


def sure_amplitudes(
    system: LinearSystem,
    held_out: HeldOut,
    effect: Effect,
    terms: bool = False,
) -> list[Parameter]:
    """The amplitudes of an effect that differ significantly from zero beside all that is fitted.

    Parameters
    ----------
    system
        The fit with the effect.
    held_out
        What leaving out captures moves.
    effect
        The effect.
    terms
        Whether those of optional terms with a shape of their own are asked for too, which may be
        there without what is usual of the effect.

    Returns
    -------
    list of Parameter
        As `is_determined` asks it of them, each as one of several; none of a coupling without a
        twist that is sure, nor of one that full logs exclude.

    Notes
    -----
    Shapes that refine a form stay as they are fitted: a bump of drag at low speed is there whatever
    its exponent is, though the exponent makes its height at standstill unsure.

    """
    parameters = effect.parameters_of(system.fit.machine)
    refining = {f"{effect.name}.{p.name}" for p in parameters if p.refines}
    kept = [n for n, column in enumerate(system.columns) if column.name not in refining]
    if len(kept) < len(system.columns):
        system = system.only(np.array(kept, dtype=int))
        held_out = leave_out(system)
    least, discrimination = system.policy.selection.least_u, discriminate(system.fit, effect)
    shaped_terms = {p.optional for p in parameters if terms and p.optional and p.scan}
    amplitudes = [
        p for p in parameters if p.amplitude and (p.negligible > 0.0 or p.optional in shaped_terms)
    ]
    sure = significantly_nonzero(system, held_out, least_of_several(least, len(amplitudes)))
    twists = [p for p in parameters if p.negligible > 0 and not p.amplitude]
    for pair in product(amplitudes, twists):
        names = f"{effect.name}.{pair[0].name}", f"{effect.name}.{pair[1].name}"
        sure |= set(names) if product_nonzero(system, held_out, names, least) else set()
    excluded = discrimination is not None and discrimination.name is None
    logged = {p.name: (system.fit.size(effect, p), p.u) for p in parameters if p.u > 0.0}
    logged |= discrimination.values if discrimination is not None else {}
    by_logs = {name for name, (size, u) in logged.items() if size > least * u}
    nonzero = [p for p in parameters if f"{effect.name}.{p.name}" in sure or p.name in by_logs]
    coupled = effect.discriminator is None or not twists or any(p in nonzero for p in twists)
    present = [p for p in amplitudes if p in nonzero]
    if not present and together_nonzero(
        system, held_out, [f"{effect.name}.{p.name}" for p in amplitudes], least
    ):
        present = amplitudes
    return present if coupled and not excluded else []


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
    or of what the priors cost, or the deviance of signals below their floor must fall by the second
    of `least`. Constants that differ are no evidence where no model fits: a share of the priors'
    cost counts where some signal in which the candidate acts is left at its floor. `before` and
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
    relieved = cost > policy.excess and after_cost < (1.0 - policy.least_share) * cost
    priors = relieved and _leaves_a_signal_at_its_floor(tried)
    helps = priors or power_share(wide, same_hook * before, same_hook * after) >= policy.least_share
    below_floor = min(fall_below_floor(wide, k * before, k * after) for k in (1.0, below))
    return fall > least[0] and (helps or below_floor > least[1])


def _leaves_a_signal_at_its_floor(tried: LinearSystem) -> bool:
    """Whether of the signals in which the newest effect acts one has no group over its floor."""
    acts, over = acts_in(tried), significant_groups(tried)
    signals = [channel for _, channel, _ in tried.labels]
    acted, missed = ({signals[n] for n in np.flatnonzero(where)} for where in (acts, acts & over))
    return bool(acted - missed)


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
    acts = acts_in(tried)
    change = np.maximum(after, 1.0) - np.maximum(before, 1.0)
    counts = acts & (np.abs(change) > tried.policy.selection.least_share * np.maximum(before, 1.0))
    return float((tried.counts * change)[counts].sum()) > relief


def acts_in(system: LinearSystem, columns: Sequence[Column] = ()) -> Flags:
    """The groups in which an effect acts.

    Parameters
    ----------
    system
        With the columns of the effect.
    columns
        They; without any, those of the newest effect of the model.

    Returns
    -------
    array [G] of bool

    """
    if not columns:
        name = f"{system.fit.model.effects[-1].name}."
        columns = [column for column in system.columns if column.name.startswith(name)]
    keys = {column.key for column in columns}
    places = [n for n, column in enumerate(system.columns) if column.key in keys]
    moved = np.any(system.matrix[:, places], axis=1)
    return np.bincount(system.group, moved, len(system.labels)) > 0
