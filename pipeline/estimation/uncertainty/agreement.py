"""Whether several methods find one value of a constant, and what it means for u where they do not.

The same constant from a second test with other equations is the strongest check of the first. What
both share (a gain, a torque constant) cancels in their difference; what is left is judged by the
generalised chi-square, and what goes beyond chance belongs to the uncertainty of each.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from pipeline.estimation.policy import policy
from pipeline.numerics.random_effects import Between, between
from pipeline.records.constants import Constants
from pipeline.records.estimate import Estimate
from pipeline.records.uncertainty import METHODS, Contribution, covariance

# One coupling: torque per ampere is 1.5 p psi at small current, whatever the motor.
KT, DRAG, TORQUE = "kt_peak_nm_a", "torque_coulomb_nm", "torque@"
SAME = {KT: ("kt_from_ke_nm_a",)}


def reconciled(constants: Constants) -> Constants:
    """The constants, each with the scatter between methods in its budget where they disagree.

    A measured value is judged by the other methods that hold for like conditions and are precise
    enough to say something of it, or exclude it though they are rough. What they scatter beyond
    chance joins its budget with k - 1 degrees of freedom, and its note names methods and values.
    What is read off a torque transducer takes its share of what torque and flux disagree on.

    Parameters
    ----------
    constants
        All estimates so far.

    References
    ----------
    Particle Data Group, Review of Particle Physics, 2024, 5.2.2 (scale factors).

    """
    judged = [
        _beyond_speed(_widened(e, judges(constants, e)), constants) if _measured(e) else e
        for e in constants.estimates
    ]
    return Constants(tuple(_by_transducer(e, judged) if _measured(e) else e for e in judged))


def outranked(estimate: Estimate, others: Iterable[Estimate]) -> bool:
    """Whether another method knows the same constant so much better that it comes first.

    Parameters
    ----------
    estimate
        Of any constant.
    others
        Estimates, itself among them.

    Returns
    -------
    bool
        The order of methods is that of their assumptions, as long as they say something.

    """
    if not _measured(estimate):
        return False
    least = estimate.u / policy().agreement.outranked
    same = (e for e in others if e.name == estimate.name and _measured(e))
    return any(0.0 < e.u < least and _alike(e, estimate) for e in same)


def _measured(estimate: Estimate) -> bool:
    return estimate.known and estimate.status == "measured"


def judges(constants: Constants, estimate: Estimate) -> list[Estimate]:
    """Other methods' estimates of the same constant that can be held against this one: those that
    are about as precise, and rougher ones that contradict it.

    Parameters
    ----------
    constants
        All estimates so far.
    estimate
        The one that is judged.

    """
    names = (estimate.name, *SAME.get(estimate.name, ()))
    judging: list[Estimate] = []
    for one in (e for name in names for e in constants.all_of(name)):
        new = one.method not in {estimate.method, *(e.method for e in judging)}
        if one.known and one.status in ("measured", "derived") and new and _alike(one, estimate):
            judging.append(one)
    limit = policy().agreement.precise * np.sqrt(len(judging) + 1.0) * estimate.u
    return [e for e in judging if e.u <= limit or _contradicts(e, estimate)]


def _contradicts(rough: Estimate, estimate: Estimate) -> bool:
    """Whether a rough method's own interval excludes a precise value."""
    return _between([rough, estimate]).p_value < policy().agreement.contradiction


def _alike(estimate: Estimate, other: Estimate) -> bool:
    """Whether two estimates hold for speeds of one order of magnitude, as far as they say."""
    speeds = [e.at.get("omega_mech_rad_s") for e in (estimate, other)]
    known = [abs(float(s)) for s in speeds if isinstance(s, int | float) and s != 0]
    return len(known) < 2 or max(known) <= policy().agreement.speed_ratio * min(known)


def _beyond_speed(estimate: Estimate, constants: Constants) -> Estimate:
    """A drag read at creep speed, with what it differs by from the drag at speed.

    T_c is the drag of any speed; at creep speed Stribeck's excess is in it, which nothing but the
    drag at speed shows. So it counts whether or not chance would explain it.
    """
    if estimate.name != DRAG:
        return estimate
    faster = [e for e in constants.all_of(DRAG) if _measured(e) and _faster(e, estimate)]
    if not faster:
        return estimate
    nearest = min(faster, key=lambda e: e.u)
    excess = abs(estimate.number - nearest.number)
    note = f"differs by {excess:.2g} {estimate.unit} from the drag at speed ({nearest.method})"
    return _with(estimate, Contribution(f"{METHODS}{DRAG}", excess, "A", 1.0), note)


def _faster(one: Estimate, estimate: Estimate) -> bool:
    """Whether an estimate is of speeds that are another quantity's (`policy.agreement`)."""
    fast, slow = (e.at.get("omega_mech_rad_s") for e in (one, estimate))
    if not isinstance(fast, int | float) or not isinstance(slow, int | float):
        return False
    return abs(fast) > policy().agreement.speed_ratio * abs(slow)


def _by_transducer(estimate: Estimate, judged: Sequence[Estimate]) -> Estimate:
    """An estimate with what torque and flux disagree on, as far as it is read off that transducer.

    The transducer's gain is in Kt and in any torque; what Kt differs by from 1.5 p psi may be that
    gain, and scales with its share of either budget.
    """
    for kt in (e for e in judged if e.name == KT != estimate.name):
        parts = {part.source: part for part in kt.budget}
        between = parts.get(f"{METHODS}{KT}")
        for gain in (p for p in estimate.budget if p.source.startswith(TORQUE)):
            share = parts.get(gain.source)
            if between is None or share is None or share.u == 0.0:
                continue
            part = replace(between, u=gain.u / share.u * between.u)
            note = "torque and flux disagree on the torque constant, so the transducer is in doubt"
            return _with(estimate, part, note)
    return estimate


def _with(estimate: Estimate, part: Contribution, note: str) -> Estimate:
    """An estimate with one more part of its budget, instead of one of the same source."""
    others = tuple(p for p in estimate.budget if p.source != part.source)
    notes = "; ".join(words for words in (note, estimate.note) if words)
    return replace(estimate, budget=(*others, part), note=notes)


def _between(methods: Sequence[Estimate]) -> Between:
    """How far methods are apart, with the degrees of freedom of the sum of their variances (JCGM
    100:2008, G.4): those of a narrow estimate say nothing of a difference that a wide one has made.
    """
    values = np.array([e.number for e in methods])
    matrix = np.array([[covariance(a.budget, b.budget) for b in methods] for a in methods])
    power, dof = np.array([e.u**2 for e in methods]), np.array([e.dof for e in methods])
    total = float(np.sum(power**2 / dof))
    return between(values, matrix, float(power.sum()) ** 2 / total if total > 0.0 else np.inf)


def _widened(estimate: Estimate, judging: Sequence[Estimate]) -> Estimate:
    methods = [estimate, *judging]
    if estimate.u == 0.0 or not judging:
        return estimate
    spread = _between(methods)
    if spread.p_value >= policy().agreement.level or spread.sd == 0.0:
        return estimate
    # two that agree with each other say nothing for a third
    nearest = min(_between([estimate, other]).sd for other in judging)
    each = ", ".join(f"{e.method} {e.number:.5g} ± {e.u:.2g}" for e in methods)
    words = f"methods disagree beyond chance ({each} {estimate.unit})"
    sd = max(spread.sd, nearest)
    part = Contribution(f"{METHODS}{estimate.name}", sd, "A", spread.dof)
    return _with(estimate, part, words)
