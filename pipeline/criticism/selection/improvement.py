"""By how much a change of the model improves a fit, over its noise floors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.criticism.effect import Effect
from pipeline.criticism.operating import Array, Flags, Indices
from pipeline.criticism.regression.linear_system import LinearSystem
from pipeline.criticism.regression.normal_equations import Descent, deviance_of


@dataclass(frozen=True, slots=True)
class FitQuality:
    """How well a fit explains its captures.

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
    def of(cls, system: LinearSystem, places: Indices, end: Descent) -> FitQuality:
        """Quality of a system after a descent.

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


def clears(system: LinearSystem, significant: Flags, before: Array, after: Array) -> bool:
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


def share_of(system: LinearSystem, effect: Effect, before: FitQuality, after: FitQuality) -> float:
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


def _pools(system: LinearSystem, reduced_chi2: Array) -> tuple[Indices, Flags]:
    """Which signal at which order each group [G] is of, and of which of them the excess counts."""
    numbers: dict[tuple[str, int], int] = {}
    pool = np.array([numbers.setdefault((name, k), len(numbers)) for _, name, k in system.labels])
    count = np.bincount(pool, system.counts)
    nats = np.bincount(pool, system.counts * np.log(np.maximum(reduced_chi2, 1.0)))
    policy = system.policy.selection
    return pool, nats > np.minimum(policy.excess, policy.excess_a_sample * count)


def deviance_with_full_logs(system: LinearSystem) -> float:
    """The deviance of a fit, less what full logs say of its newest effect, which is in no row: the
    square of a twist or gap over its uncertainty.

    Parameters
    ----------
    system
        The fit.

    Returns
    -------
    float
        The deviance itself where full logs say nothing of that effect.

    """
    fit = system.fit
    significance = [
        (fit.size(effect, p) / p.u) ** 2
        for effect in fit.model.effects[-1:]
        for p in effect.parameters_of(fit.machine)
        if p.u > 0.0 and not p.amplitude
    ]
    return system.deviance - max(significance, default=0.0)
