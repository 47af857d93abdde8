"""What else it could be: each found effect swapped for another, and what would part the two."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from pipeline.criticism.effect import Effect
from pipeline.criticism.regression.gauss_newton import gauss_newton
from pipeline.criticism.regression.linear_system import LinearSystem
from pipeline.criticism.selection.candidates import Candidate, placed
from pipeline.criticism.selection.discrimination import discriminate, sharing_discriminator
from pipeline.criticism.selection.pruning import loss_without
from pipeline.criticism.selection.sizes import shaped


def alternatives_to(
    name: str,
    wide: LinearSystem,
    offered: Sequence[Candidate],
    passed_over: Sequence[Candidate] = (),
) -> tuple[str, ...]:
    """Effects that explain the captures as well as one that was found.

    Parameters
    ----------
    name
        The effect that was found.
    wide
        The fit with the columns of all candidates.
    offered
        The candidates.
    passed_over
        Candidates that were close when the effect was added.

    Returns
    -------
    tuple of str
        Sorted names of effects with which, in its place, the deviance and its part over noise
        floors and priors both rise by less than `policy.selection.tie`. Effects that share its
        discriminator are among them where full logs do not discriminate.

    Notes
    -----
    Refitted in its place are those that to first order keep a share of what it explains
    (`alternative_share`), and those that were passed over for it.

    """
    policy, effect = wide.policy.selection, wide.fit.effect(name)
    alike = sharing_discriminator(effect, {one.effect.name: one.effect for one in offered})
    ties = [] if discriminate(wide.fit, effect) else list(alike)
    normal_equations = wide.normal_equations()
    most = policy.alternative_share * loss_without(wide, (name,), normal_equations=normal_equations)
    close: dict[str, tuple[float, Candidate]] = {}
    for candidate, places in placed(wide, offered):
        if candidate.effect.name in alike or not _meet(effect, candidate.effect):
            continue
        rise = loss_without(wide, (name,), places, normal_equations)
        other = candidate.effect.name
        if rise < most and rise < close.get(other, (np.inf, candidate))[0]:
            close[other] = rise, candidate
    for candidate in passed_over:
        if candidate.effect.name in alike:
            continue
        close.setdefault(candidate.effect.name, (most, candidate))
    nearest = sorted(close.values(), key=lambda pair: (pair[0], pair[1].effect.name))
    for _, candidate in nearest[: policy.most_alternatives]:
        swapped = _refitted(name, candidate, wide)
        if (
            swapped is not None
            and swapped.deviance < wide.deviance + policy.tie
            and swapped.excess < wide.excess + policy.tie
        ):
            ties.append(candidate.effect.name)
    return tuple(sorted(ties))


def _refitted(name: str, candidate: Candidate, wide: LinearSystem) -> LinearSystem | None:
    """The system with a candidate in an effect's place; None without a shape to speak of."""
    without = wide.fit.without(name)
    model = without.model.with_effects(candidate.effect)
    start = replace(without, model=model, values={**without.values, **candidate.values})
    swapped = gauss_newton(start, before=wide)
    return swapped if shaped(swapped.fit, candidate.effect) else None


def experiment_for(effect: Effect, confused: Sequence[str], library: Mapping[str, Effect]) -> str:
    """The test or calibration that separates an effect from what it is confused with.

    Parameters
    ----------
    effect
        The effect.
    confused
        Names of its alternatives.
    library
        Every effect by name.

    Returns
    -------
    str
        One remedy an alternative; the effect's own experiment where it has none.

    """
    tests = [f"against {name}: {one}" for name, one in remedies(effect, confused, library).items()]
    return "; ".join(tests) if tests else effect.experiment


def remedies(
    effect: Effect, confused: Sequence[str], library: Mapping[str, Effect]
) -> dict[str, str]:
    """What effects themselves declare to separate them from each other.

    Parameters
    ----------
    effect
        The effect.
    confused
        Names of its alternatives.
    library
        Every effect by name.

    Returns
    -------
    dict of str
        By alternative: what `effect` declares, else what the other one does, else the other one's
        experiment.

    """
    return {
        other: effect.alternatives.get(other)
        or library[other].alternatives.get(effect.name)
        or library[other].experiment
        for other in confused
    }


def detectable(effect: Effect, wide: LinearSystem, offered: Sequence[Candidate]) -> float:
    """Signal-to-noise ratio that the captures give an effect of typical size.

    Parameters
    ----------
    effect
        The effect.
    wide
        The fit with the columns of all candidates.
    offered
        The candidates.

    Returns
    -------
    float
        Typical amplitude over its standard deviation when fitted with all else; the best shape and
        amplitude count. 0 where nothing observes it.

    """
    model_columns, machine = wide.model_columns, wide.fit.machine
    sizes = {name: p.typical * machine.scale(p) for name, p in effect.named(machine).items()}
    best = 0.0
    for candidate, places in placed(wide, offered):
        if candidate.effect.name != effect.name:
            continue
        covariance = wide.covariance(np.concatenate([model_columns, places]))
        spread = np.sqrt(np.maximum(np.diag(covariance)[model_columns.size :], 0.0))
        for place, one in zip(places, spread, strict=True):
            if one > 0 and np.any(wide.matrix[:, place]):
                best = max(best, sizes[wide.columns[place].name] / float(one))
    return best


def _meet(effect: Effect, other: Effect) -> bool:
    """Whether two effects can reach one signal: drops and drags cannot stand for each other."""
    return {effect.hook, other.hook} != {"drop", "torque"}
