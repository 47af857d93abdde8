"""Whether a model explains a motor's captures down to the noise: the verdict of `diagnose` alone.

What is missing is named by `diagnose`. Here the search ends as soon as its verdict can only be that
something is: where the model leaves something over the noise that is large for the machine, and
that no slow drift of the instruments explains.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from pipeline.criticism.data.machine_scale import PAIRLESS, machine_of
from pipeline.criticism.diagnosis import TOO_LITTLE, enough, not_shown, verdict_of
from pipeline.criticism.effect import Array
from pipeline.criticism.ladder import parameters_of
from pipeline.criticism.library.named_models import model_of
from pipeline.criticism.library.registry import effects
from pipeline.criticism.regression.goodness import HeldOut, leave_out, remainder
from pipeline.criticism.regression.linear_system import own_columns
from pipeline.criticism.residuals.channels import reported_signal
from pipeline.criticism.residuals.segments import segments
from pipeline.criticism.search import End, ended
from pipeline.criticism.selection.drift import wandering
from pipeline.criticism.selection.requested_model import Begun, fit_of
from pipeline.criticism.validation.error_maps import unit_of
from pipeline.records.capture import Campaign
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants
from pipeline.records.diagnosis import ToldParameter
from pipeline.records.model_verdict import Excess, ModelVerdict

_NAME = "unknown"


def model_verdict(campaign: Campaign, model: ModelSpec, start: Constants) -> ModelVerdict:
    """Fits a model to a motor's captures and holds the residuals against their noise floors.

    Parameters
    ----------
    campaign
        Captures of one motor, validated.
    model
        Which model, by name, and effects to add to it or take from it.
    start
        Constants that give pole pairs and sizes where the captures do not.

    Returns
    -------
    ModelVerdict
        The verdict that `diagnose` gives to the same model of the same captures. Where it would
        name effects, or an unknown structure, `missing` is said, with names only where they had to
        be searched for to know the verdict.

    Raises
    ------
    UsageError
        A model or effect that there is not.

    Notes
    -----
    A residual of group g (signal, capture, order a turn) counts by the root of χ²_g/n_g over the
    noise floor of `noise_floors.noise_floor`. A group is over the floor by the rule of
    `goodness.remainder`: chance passes it as seldom as five standard deviations, the variance is
    twice the floor's, and the size is one that somebody would act on.

    """
    machine = machine_of(campaign, start)
    if machine is None:
        return _stated(model, ModelVerdict("insufficient", note=PAIRLESS))
    found = segments(campaign, machine)
    if not enough(found):
        return _stated(model, ModelVerdict("insufficient", note=TOO_LITTLE))
    begun = fit_of(found, model_of(model, machine))
    around = begun.around
    large = remainder(around, begun.segments, around.residual, large=True)
    if large and wandering(begun.segments, begun.fitted, large) is None:
        return _stated(model, replace(_residuals(begun), verdict="missing"))
    library = effects(model.effects_path)
    end = ended(campaign, model, machine, begun, library, _NAME)
    unseen = not_shown(campaign, library, end)
    verdict = verdict_of(end, unseen)
    note = "; ".join(one.words for one in unseen) if verdict == "insufficient" else ""
    tested = _residuals(begun if verdict in ("missing", "unknown") else end.ladder.begun)
    missing = _named(end) if verdict == "missing" else {}
    return _stated(model, replace(tested, verdict=verdict, missing=missing, note=note))


def _stated(model: ModelSpec, found: ModelVerdict) -> ModelVerdict:
    return replace(found, model=model.name, effects=model.effects)


def _residuals(begun: Begun) -> ModelVerdict:
    """What a fit leaves; the verdict is the caller's."""
    around, held = begun.around, _held_out(begun)
    left = remainder(around, begun.segments, around.residual)
    worst = None
    if left:
        first = max(left, key=lambda one: one.chi2_per_n)
        names = {(s.capture, c): reported_signal(s, c) for s in begun.segments for c in s.channels}
        signal = names[first.capture, first.signal]
        floors = math.sqrt(first.chi2_per_n)
        worst = Excess(first.capture, signal, first.order, floors, first.size, unit_of(signal))
    return ModelVerdict(
        "adequate",
        held_out=held.total,
        residual=_largest(begun, around.residual),
        worst=worst,
        over=len(left),
    )


def _held_out(begun: Begun) -> HeldOut:
    own = len(own_columns(begun.fitted.model))
    return leave_out(begun.around, own, begun.segments)


def _largest(begun: Begun, residual: Array) -> float:
    """The largest root of χ²/n of any group."""
    around = begun.around
    spreads = around.spreads(residual / around.soft)[around.counts > 0]
    return math.sqrt(float(np.max(spreads, initial=0.0)))


def _named(end: End) -> dict[str, dict[str, ToldParameter]]:
    """Effects at the end of the ladder: value, standard uncertainty and unit of each parameter."""
    last, held = end.ladder.rungs[-1], end.ladder.held[-1]
    told = parameters_of(last, held)
    return {
        name: {
            key.removeprefix(f"{name}."): one
            for key, one in told.items()
            if key.startswith(f"{name}.")
        }
        for name in last.added
    }
