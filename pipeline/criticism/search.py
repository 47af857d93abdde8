"""The search for missing effects in the captures of one motor.

`search_ladder` adds effects to the requested model step by step (`selection.stepwise`), drops
unsupported steps, and describes what no effect explains. No effect can explain an order of the
angle that no equation observes, or an instrument that drifts. Where either is found, the search is
repeated with it in the model, and the last result is reported. So it is with torque read at the
other place, where that leaves nothing.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.criticism.discovery.changed_constants import Change, changed_constant
from pipeline.criticism.discovery.changed_within import ChangeWithin, changed_within
from pipeline.criticism.discovery.unknown_structure import is_part_of_a_curve, unknown_structure
from pipeline.criticism.effect import Effect
from pipeline.criticism.library.named_models import model_of
from pipeline.criticism.operating import Array
from pipeline.criticism.parameter import Machine
from pipeline.criticism.policy.policy import policy_of
from pipeline.criticism.regression.cross_validation import HeldOut, in_common, leave_out
from pipeline.criticism.regression.gauss_newton import gauss_newton
from pipeline.criticism.regression.goodness import remainder, significant_groups
from pipeline.criticism.regression.linear_system import LinearSystem
from pipeline.criticism.regression.normal_equations import deviances_of
from pipeline.criticism.residuals.segments import segments
from pipeline.criticism.selection.drift import drifting_segments
from pipeline.criticism.selection.free_shares import friction_notes, share_notes
from pipeline.criticism.selection.one_capture import rests_on
from pipeline.criticism.selection.order_scan import orders_left
from pipeline.criticism.selection.other_readings import at_other_place
from pipeline.criticism.selection.requested_model import BaseFit, fit_of
from pipeline.criticism.selection.stepwise import LadderStep, search
from pipeline.criticism.selection.truncation import SHAFT, contradiction, explained, truncated
from pipeline.records.capture import Campaign
from pipeline.records.comparison import ModelSpec
from pipeline.records.diagnosis import Remainder, UnknownStructure

_DRIFT = "instruments drift slowly, by some {:g} times their noise at most: taken as noise"
_SMALLER = (
    "the sketch is of {}; {} misses by more, {:.3g} noise floors in {}, and no state of the "
    "machine predicts that"
)
_ALONE = (
    "{} would help {} alone: predicted from the others, the other captures that it moves do not "
    "gain with it; record that test once more"
)
_PART = (
    "{} would take a part of what is left; a curve of one state of the machine explains it better "
    "alone"
)
_WITHIN = (
    "the sketch of what is left was held out a twelfth of a capture at a time, since no other "
    "capture shows it: whatever changes as slowly looks the same; record that test once more"
)


@dataclass(frozen=True, slots=True)
class Ladder:
    """The steps of a search as far as they are supported.

    Attributes
    ----------
    base
        Where the search began.
    steps
        The steps.
    held_out
        Their held-out errors.
    remainders
        What is over the floor at their end.
    cut
        Every effect that would remove some of that and was dropped, with a note where captures
        contradict it or it is part of a curve, an empty one where it would be unsupported.

    """

    base: BaseFit
    steps: tuple[LadderStep, ...]
    held_out: list[HeldOut]
    remainders: tuple[Remainder, ...]
    cut: dict[str, str]

    def explains(self, remainders: Sequence[Remainder]) -> bool:
        """Whether its effects explain what the captures show.

        Parameters
        ----------
        remainders
            What is over the floor and may have another cause.

        """
        return explained(self.steps, self.held_out, remainders)

    def leaves_something(self) -> bool:
        """Whether its effects explain less than what is over the floor, or leave more of the
        held-out error than a floor may be wrong by.
        """
        over = self.steps[-1].fit.policy.goodness.over
        return self.held_out[-1].total ** 2 > 1.0 + over or not self.explains(self.remainders)

    def large(self) -> tuple[Remainder, ...]:
        """What is left and large for the machine as a whole.

        What matters only beside the little voltage that there is at standstill may be an
        instrument's drift as well as the machine: it is reported where some state of the machine
        predicts it.
        """
        system = self.steps[-1].system
        large = remainder(system, large=True)
        return tuple(left_over for left_over in self.remainders if left_over in large)


@dataclass(frozen=True, slots=True)
class SearchResult:
    """The result of the last search.

    Attributes
    ----------
    ladder
        Its steps.
    remainders
        What is over the floor and is reported.
    sketch
        The unknown structure in that; None without one.
    change
        The constant that changed between captures; None without one.
    freed
        What says that friction or a magnet is another in one kind of test, one sentence each.
    notes
        Remarks, one sentence each.

    """

    ladder: Ladder
    remainders: tuple[Remainder, ...]
    sketch: UnknownStructure | None
    change: Change | ChangeWithin | None
    freed: tuple[str, ...]
    notes: tuple[str, ...]


def search_ladder(
    campaign: Campaign,
    model: ModelSpec,
    machine: Machine,
    base: BaseFit,
    library: Mapping[str, Effect],
    name: str,
) -> SearchResult:
    """Searches a campaign, and describes what no effect explains.

    Parameters
    ----------
    campaign
        Captures of the motor.
    model
        The requested model.
    machine
        Size of the motor.
    base
        The fit of the requested model.
    library
        Effects that may be added.
    name
        Name of the effect that describes the unknown structure.

    Returns
    -------
    SearchResult
        Of the last search: with the orders that were found, and with instruments that drift where
        no state of the machine predicts what is left.

    """

    def search_again(*orders: float) -> Ladder:
        start, wider = base, replace(machine, load_orders=orders)
        if orders:
            start = fit_of(segments(campaign, wider), model_of(model, wider))
        return _from_other_place(_without_parts_of_a_curve(ladder_from(start, library)), library)

    ladder, sketch, gain = _by_orders(search_again, name)
    remainders, notes = ladder.remainders, []
    if sketch is None:
        drifting = _with_drift(ladder, library)
        if drifting is not None:
            ladder, remainders = drifting, drifting.large()
            sketch, gain = _sketched(ladder, remainders, name)
            notes.append(_DRIFT.format(policy_of(model.policy).selection.drift_size))
    if sketch is None:
        sketch, gain = _sketched(ladder, remainders, name, in_parts=True)
        remainders = remainders if sketch else ladder.large()
        notes += [_WITHIN] if sketch else []
    change = None if ladder.explains(remainders) else _changed_constant(ladder.steps[-1].system)
    if change is not None and (sketch is None or change.gain > gain):
        notes, sketch, remainders = [change.words], None, remainders or ladder.remainders
    else:
        notes, change = notes + _other_side_note(sketch, remainders), None
    freed = _freed(ladder)
    return SearchResult(ladder, remainders, sketch, change, freed, (*freed, *notes))


def _freed(ladder: Ladder) -> tuple[str, ...]:
    """What says that friction or a magnet is another in one kind of test, one sentence each."""
    last = ladder.steps[-1].system
    return (*friction_notes(last), *share_notes(last))


def _changed_constant(system: LinearSystem) -> Change | ChangeWithin | None:
    """The constant that changed between captures, or within one where that explains more."""
    between, within = changed_constant(system), changed_within(system)
    if between is None or within is None:
        return between or within
    return within if within.gain > between.gain else between


def _other_side_note(sketch: UnknownStructure | None, remainders: Sequence[Remainder]) -> list[str]:
    """A note where the signal that misses by most is not the sketched one's, winding or shaft."""
    worst = max(remainders, key=lambda left_over: left_over.chi2_per_n, default=None)
    if sketch is None or worst is None or (worst.signal in SHAFT) == (sketch.signal in SHAFT):
        return []
    floors = math.sqrt(worst.chi2_per_n)
    return [_SMALLER.format(sketch.signal, worst.signal, floors, worst.capture)]


def _by_orders(
    search_again: Callable[..., Ladder], name: str
) -> tuple[Ladder, UnknownStructure | None, float]:
    """The ladder, a sketch of what it leaves and the deviance that this takes.

    Orders a turn that a first ladder leaves unseen have rows of their own. Where something is left
    without one, an effect may have taken a part of them, and the steps before are looked at: a gap
    between two masses took the half of a cogging beyond the rows' reach.

    Steps of a programme make lines of any order too, and these predict no other capture: orders
    that are no whole numbers join where the sketch with them takes more.
    """
    ladder = search_again()
    unobserved = orders_left(ladder.steps[-1].system)
    integers = tuple(order for order in unobserved if isinstance(order, int))
    if integers:
        ladder = search_again(*integers)
    elif not unobserved and ladder.remainders:
        ladder = _by_earlier_orders(ladder, search_again)
    sketch, gain = _sketched(ladder, ladder.remainders, name)
    if len(unobserved) > len(integers) and not ladder.explains(ladder.remainders):
        with_fractions = search_again(*unobserved)
        wider_sketch, wider_gain = _sketched(with_fractions, with_fractions.remainders, name)
        if wider_sketch is not None and (sketch is None or wider_gain > gain):
            return with_fractions, wider_sketch, wider_gain
    return ladder, sketch, gain


def _by_earlier_orders(ladder: Ladder, search_again: Callable[..., Ladder]) -> Ladder:
    """The ladder with the whole orders that its latest step with some leaves, where less is left;
    else the same.
    """
    for step in reversed(ladder.steps[:-1]):
        orders = tuple(order for order in orders_left(step.system) if isinstance(order, int))
        if orders:
            return min(ladder, search_again(*orders), key=_worst)
    return ladder


def _worst(ladder: Ladder) -> float:
    """The largest χ²/n that a ladder leaves."""
    return max((left_over.chi2_per_n for left_over in ladder.remainders), default=0.0)


def _with_drift(ladder: Ladder, library: Mapping[str, Effect]) -> Ladder | None:
    """The ladder of instruments that drift; None where nothing large is left, or none does."""
    large = ladder.large()
    if ladder.explains(large):
        return None
    noisier = drifting_segments(ladder.steps[-1].fit, large)
    if noisier is None:
        return None
    start = replace(ladder.base.system.fit, segments=noisier)
    drifting = ladder_from(BaseFit(gauss_newton(start), ladder.base.hum), library)
    return _without_parts_of_a_curve(drifting)


def ladder_from(start: BaseFit, library: Mapping[str, Effect]) -> Ladder:
    """The search from a fitted model, without unsupported steps.

    Parameters
    ----------
    start
        The fitted model.
    library
        Effects that may be added.

    Notes
    -----
    Where an effect inside goes because captures contradict it, those after it were found beside its
    wrong form. They are looked for again without it.

    """
    searched = _that_explain(search(start.system.fit, library))
    errors = [leave_out(step.system) for step in searched]
    steps, unconfirmed = _confirmed(searched, errors)
    kept, remainders = truncated(steps, in_common([r.system for r in steps], errors[: len(steps)]))
    for step in steps[len(kept) : -1]:
        name, against = step.added[-1], contradiction(step)
        if against:
            again = ladder_from(start, {n: one for n, one in library.items() if n != name})
            return replace(again, cut={name: against, **again.cut})
    held_out = in_common([r.system for r in kept], errors[: len(kept)])
    cut = {step.added[-1]: contradiction(step) for step in steps[len(kept) :]}
    return Ladder(start, kept, list(held_out), remainders, cut | unconfirmed)


def _that_explain(steps: Sequence[LadderStep]) -> Sequence[LadderStep]:
    """The steps without trailing ones whose fit has too little less deviance than the one before,
    whichever floors it is held against: a `tie` is asked for, and where nothing was over its floor
    `below_floor_penalties` of the effect's own.

    A floor goes with the constants that noise is multiplied by. Where captures leave an inertia
    free, an effect that takes its place makes the noise of its acceleration smaller: by that floor
    the fit before misses, and by its own it does not. Or floors of a voltage are larger in the one
    fit by chance, and its residual counts less.
    """
    policy, count = steps[-1].fit.policy.selection, len(steps)
    while count > 1:
        before, after = steps[count - 2 : count]
        least = [policy.tie]
        if not significant_groups(before.system).any():
            own = [s for s in before.scores if s.candidate.effect.name == after.added[-1]]
            least += [policy.below_floor_penalties * score.penalty for score in own]
        if sure_fall(before.system, after.system) >= max(least):
            break
        count -= 1
    return steps[:count]


def sure_fall(before: LinearSystem, after: LinearSystem) -> float:
    """Fall of the deviance from one fit to another: of each group the lesser by the floors of each
    fit and by the larger of both.

    Parameters
    ----------
    before, after
        Fits of the same rows.

    Returns
    -------
    float
        That of the priors included.

    """
    if before.labels != after.labels or before.size != after.size:
        return before.deviance - after.deviance
    larger = np.minimum(before.row_weight, after.row_weight)
    own = _deviances(before, before.row_weight) - _deviances(after, after.row_weight)
    common = _deviances(before, larger) - _deviances(after, larger)
    priors = before.prior_costs().sum() - after.prior_costs().sum()
    return float(np.minimum(own, common).sum() + priors)


def _deviances(system: LinearSystem, weight: Array) -> Array:
    """−2 log likelihood [G] of the groups of a fit whose rows [R] are weighted by other floors."""
    residual = system.residual * (weight / system.row_weight)
    return deviances_of(system.counts, system.reduced_chi2(residual))


def _from_other_place(ladder: Ladder, library: Mapping[str, Effect]) -> Ladder:
    """The ladder with torque read at the other place, stator or shaft, where that leaves nothing
    and this does.

    What an effect hides may be more than the friction and inertia that discriminate the places,
    and beside the wrong inertia it has no size to be named with.
    """
    system = ladder.base.system
    if ladder.explains(ladder.remainders) or (elsewhere := at_other_place(system)) is None:
        return ladder
    if elsewhere.deviance >= system.deviance - system.policy.selection.tie:
        return ladder
    start = BaseFit(elsewhere, ladder.base.hum)
    other = _without_parts_of_a_curve(ladder_from(start, library))
    return other if other.explains(other.remainders) else ladder


def _without_parts_of_a_curve(ladder: Ladder) -> Ladder:
    """The ladder without trailing effects that are a part of what no effect explains: a curve of
    one state of the machine explains it better alone.

    Effects that explain what is left by their forms alone are asked as well, where they leave more
    than a floor may be wrong by: half of what a brake takes from a coast is a drag of eddies.
    """
    while len(ladder.steps) > 1 and (_freed(ladder) or ladder.leaves_something()):
        system, name = ladder.steps[-1].system, ladder.steps[-1].added[-1]
        if not is_part_of_a_curve(system, _worst_first(ladder.remainders), name):
            break
        kept = ladder.steps[:-1]
        ladder = replace(
            ladder,
            steps=kept,
            held_out=ladder.held_out[:-1],
            remainders=remainder(kept[-1].system),
            cut={**ladder.cut, name: _PART.format(name)},
        )
    return ladder


def _worst_first(remainders: Sequence[Remainder]) -> list[str]:
    """Signals with a remainder, the one that misses by most first."""
    worst = sorted(remainders, key=lambda left_over: -left_over.chi2_per_n)
    return list(dict.fromkeys(left_over.signal for left_over in worst))


def _confirmed(
    steps: Sequence[LadderStep], errors: Sequence[HeldOut]
) -> tuple[tuple[LadderStep, ...], dict[str, str]]:
    """The steps without trailing ones that one capture alone supports, of which others show that
    it is not there; and a note of each that goes.
    """
    count, notes = len(steps), {}
    while count > 1:
        systems = [step.system for step in steps[count - 2 : count]]
        held_out = in_common(systems, errors[count - 2 : count])
        capture = rests_on(systems, held_out)
        if capture is None:
            break
        name = systems[-1].fit.model.effects[-1].name
        notes[name] = _ALONE.format(name, capture)
        count -= 1
    return tuple(steps[:count]), notes


def _sketched(
    ladder: Ladder, remainders: Sequence[Remainder], name: str, in_parts: bool = False
) -> tuple[UnknownStructure | None, float]:
    """What the structure depends on that no effect explains, and the deviance that it takes; None
    where there is none, or where nothing that the machine does predicts it.

    The signal that misses by most is sketched, winding or shaft; the other one if that fails.
    """
    if not remainders or ladder.explains(remainders):
        return None, 0.0
    last = ladder.steps[-1].system
    signals = _worst_first(remainders)
    other_side = [signal for signal in signals if (signal in SHAFT) != (signals[0] in SHAFT)]
    sketch, gain = unknown_structure(last, signals, name, in_parts)
    if sketch is None and other_side:
        return unknown_structure(last, other_side, name, in_parts)
    return sketch, gain
