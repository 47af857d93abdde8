"""Compare: one model fitted to a motor's captures, its errors held out, and where they live."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.criticism.data.machine_scale import PAIRLESS, machine_of
from pipeline.criticism.library.named_models import model_of
from pipeline.criticism.machine.model import Model
from pipeline.criticism.policy.policy import policy_of
from pipeline.criticism.regression.cross_validation import HeldOut, in_common, leave_out
from pipeline.criticism.regression.gauss_newton import gauss_newton
from pipeline.criticism.regression.linear_system import LinearSystem, linear_system
from pipeline.criticism.regression.mains_hum import hum_notes
from pipeline.criticism.regression.reported import (
    against_stated,
    reported_combinations,
    reported_parameters,
)
from pipeline.criticism.residuals.channels import reported_signal
from pipeline.criticism.residuals.segments import segments
from pipeline.criticism.selection.missing_data import (
    loaded_drives,
    mixed_coasts,
    unlogged_temperatures,
    unusable_captures,
    unused_captures,
)
from pipeline.criticism.selection.other_readings import by_best_readings
from pipeline.criticism.selection.pruning import reshaped, trimmed
from pipeline.criticism.selection.requested_model import fit_of
from pipeline.criticism.validation.error_maps import all_maps
from pipeline.criticism.validation.held_out import Before, effective, run_errors, simulate, traces
from pipeline.physics.glossary import unit_of
from pipeline.records.capture import Campaign
from pipeline.records.comparison import (
    Comparison,
    Dependence,
    ModelParameter,
    ModelSpec,
    Move,
    SignalError,
)
from pipeline.records.constants import Constants
from pipeline.records.error_map import ErrorMap


def compare(campaign: Campaign, model: ModelSpec, start: Constants) -> Comparison:
    """Fits the parameters of a model to all captures and gives its errors, capture by capture.

    Parameters
    ----------
    campaign
        Captures of the motor.
    model
        The model.
    start
        Constants that are known; they give pole pairs and sizes.

    Returns
    -------
    Comparison
        An error marked `held_out` is of a capture predicted from all the others; `fit` marks a
        capture that alone determines a constant. Without errors, and with a note, where no capture
        can be used.

    Raises
    ------
    UsageError
        There is no such model or effect.

    """
    machine = machine_of(campaign, start, policy_of(model.policy))
    if machine is None:
        return _no_comparison(campaign, model, model.effects, PAIRLESS)
    cut_segments = segments(campaign, machine)
    stated_model = model_of(model, machine)
    names = tuple(effect.name for effect in stated_model.effects)
    if not cut_segments:
        return _no_comparison(campaign, model, names, *unusable_captures(campaign, machine))
    base = fit_of(cut_segments, stated_model)
    system = linear_system(reshaped(trimmed(by_best_readings(base.system), names)).fit)
    held_out = leave_out(system)
    simulated = simulate(system, held_out)
    maps = all_maps(system, held_out.or_fit(system))
    parameters = reported_parameters(system, held_out)
    requested = _before_effects(model_of(model.bare(), machine), parameters, system, held_out)
    return Comparison(
        motor_id=campaign.motor_id,
        name=model.name,
        effects=names,
        parameters=parameters,
        errors=(*_errors(system, held_out), *run_errors(simulated)),
        held_out=held_out.total if requested is None else requested.whole,
        where=tuple(_where(maps)),
        notes=(*_notes(campaign, system, held_out), *hum_notes(base.hum), *held_out.notes),
        maps=maps,
        moved=() if requested is None else requested.moved,
        bare=None if requested is None else requested.total,
        traces=tuple(
            traces(system, held_out, simulated, None if requested is None else requested.fitted)
        ),
        combinations=reported_combinations(system, held_out),
        before=() if requested is None else requested.errors,
        added=() if requested is None else requested.added,
    )


def _notes(campaign: Campaign, system: LinearSystem, held_out: HeldOut) -> tuple[str, ...]:
    """What a reader should know of the captures of a comparison."""
    machine = system.fit.machine
    return (
        *unused_captures(campaign, system.segments),
        *loaded_drives(campaign, machine),
        *mixed_coasts(campaign, machine),
        *unlogged_temperatures(system.fit),
        *against_stated(system, held_out),
    )


def _no_comparison(
    campaign: Campaign, model: ModelSpec, names: tuple[str, ...], *notes: str
) -> Comparison:
    """No errors, and why there are none."""
    return Comparison(campaign.motor_id, model.name, names, {}, (), None, (), notes)


@dataclass(frozen=True, slots=True)
class _BeforeEffects:
    """A model less what was added: its held-out error beside that of the `whole` one, over the
    same rows; parameters of both; its errors; the fitted model; what it is without.
    """

    total: float
    whole: float
    moved: tuple[Move, ...]
    errors: tuple[SignalError, ...]
    fitted: Before
    added: tuple[str, ...]


def _before_effects(
    without: Model, after: dict[str, ModelParameter], whole: LinearSystem, full_held_out: HeldOut
) -> _BeforeEffects | None:
    """The model without the effects that were asked for; None where none were.

    Both fits share the noise floor of the fuller one and hold out the same rows, so that their
    errors compare.
    """
    names = {effect.name for effect in without.effects}
    if names == {effect.name for effect in whole.fit.model.effects}:
        return None
    removed = [e.name for e in whole.fit.model.effects if e.name not in names]
    base = replace(whole.fit.without(*removed), model=without, tolerance=())
    system = linear_system(gauss_newton(base).fit)
    held_out = leave_out(system)
    moved = _moves(reported_parameters(system, held_out), after)
    smaller, larger = in_common((system, whole), (held_out, full_held_out))
    errors = tuple(_errors(system, held_out))
    fitted = Before(system, held_out)
    return _BeforeEffects(smaller.total, larger.total, moved, errors, fitted, tuple(removed))


def _moves(
    before: Mapping[str, ModelParameter], after: Mapping[str, ModelParameter]
) -> tuple[Move, ...]:
    """The parameters that are determined both before and after."""
    return tuple(
        Move(name, one.unit, one.value, one.u, later.value, later.u)
        for name, one, later in ((name, one, after[name]) for name, one in before.items())
        if one.value is not None and one.u is not None
        if later.value is not None and later.u is not None
    )


def _errors(system: LinearSystem, held_out: HeldOut) -> Iterator[SignalError]:
    """Errors of every capture's equations in plain windows."""
    for place, (number, channel, order) in enumerate(system.labels):
        in_group = system.group == place
        if order != 0 or not in_group.any():
            continue
        predicted = bool(np.isfinite(held_out.residual[in_group]).all())
        residual = held_out.residual[in_group] if predicted else system.residual[in_group]
        unit, expected = system.unit[in_group], (system.noise_ratio * held_out.widening)[in_group]
        segment = system.segments[number]
        signal = reported_signal(segment, channel)
        yield SignalError(
            signal,
            segment.capture,
            "held_out" if predicted else "fit",
            math.sqrt(float(((residual * unit) ** 2).mean())),
            math.sqrt(float(((unit * expected) ** 2).mean())),
            int(in_group.sum()),
            effective(residual),
            unit_of(signal),
        )


def _where(maps: Sequence[ErrorMap]) -> Iterator[Dependence]:
    """For every signal: which variable's binned curve explains its error's variance."""
    for one in maps:
        if one.y is None:
            p_value = None if math.isnan(one.p_map) else one.p_map
            yield Dependence(one.signal, one.x.variable, one.explained, p_value)
