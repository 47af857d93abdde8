"""Whether a model explains a motor's captures down to the noise, and what it lacks if not.

The search for what is missing is most of the time of a diagnosis. Without it the verdict stands as
soon as it can only be that something is missing: where the model leaves something over the noise
that is large for the machine, and that no slow drift of the instruments explains.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from pipeline.criticism.data.segment import Segment
from pipeline.criticism.diagnosis import base_fit, searched
from pipeline.criticism.effect import Effect
from pipeline.criticism.library.friction_parts import friction_parts
from pipeline.criticism.library.headline import headline
from pipeline.criticism.library.registry import effects
from pipeline.criticism.parameter import Machine
from pipeline.criticism.regression.cross_validation import leave_out
from pipeline.criticism.regression.goodness import remainder
from pipeline.criticism.regression.linear_system import LinearSystem
from pipeline.criticism.residuals.channels import reported_signal
from pipeline.criticism.selection.drift import drifting_segments
from pipeline.criticism.selection.requested_model import BaseFit
from pipeline.physics.glossary import unit_of
from pipeline.records.capture import Campaign
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants
from pipeline.records.diagnosis import Diagnosis, ReportedParameter
from pipeline.records.model_verdict import Excess, FoundEffect, ModelVerdict, Parameters

TORQUE, INERTIA = "torque_shaft_nm", "j_rotor_kgm2"


def model_verdict(
    campaign: Campaign, model: ModelSpec, start: Constants, *, search: bool = True
) -> tuple[ModelVerdict, Diagnosis | None]:
    """Fits a model to a motor's captures and holds the residuals against their noise floors.

    Parameters
    ----------
    campaign
        Captures of one motor, validated.
    model
        Which model, by name, and effects to add to it or take from it.
    start
        Constants that give pole pairs and sizes where the captures do not.
    search
        Whether to search for what is missing where that something is, is sure without.

    Returns
    -------
    ModelVerdict
        The verdict that `diagnose` gives to the same model of the same captures, with the effects
        found and their sizes. Without a search, what `diagnose` would call `unknown` may be
        `missing`, and nothing is named.
    Diagnosis or None
        The diagnosis, where it was made.

    Raises
    ------
    UsageError
        A model or effect that there is not.

    Notes
    -----
    A residual of group g (signal, capture, order a turn) counts by the root of χ²_g/n_g over the
    noise floor of `noise_floors.noise_floor`. A group is over the floor by the rule of
    `goodness.remainder`: chance passes it as seldom as five standard deviations, the variance is
    twice the floor's, and the size matters in use.

    """
    base = base_fit(campaign, model, start)
    if isinstance(base, str):
        return _stated(model, ModelVerdict("insufficient", note=base)), None
    if not search and _misses_beyond_drift(base):
        return _stated(model, replace(_residuals(base), verdict="missing")), None
    diagnosis, fitted = searched(campaign, model, base)
    # instruments that drift count as noise where the verdict says that nothing else is left
    tested = _residuals(base if diagnosis.verdict in ("missing", "unknown") else fitted)
    machine, library = base.system.fit.machine, effects(model.effects_path)
    named = replace(_named(tested, diagnosis), scales=machine.scales)
    far = _far_inertia(named.sizes, library, base.system.fit.segments)
    left = {name: parameters for name, parameters in named.sizes.items() if name not in far}
    named = replace(
        named,
        touches=_touches(left, library),
        in_friction=_in_friction(named, library, machine),
        far_inertia=far,
        constants=_of_the_shaft_alone(named.constants, left, library),
    )
    return _stated(model, named), diagnosis


def _stated(model: ModelSpec, verdict: ModelVerdict) -> ModelVerdict:
    return replace(verdict, model=model.name, effects=model.effects)


def _misses_beyond_drift(base: BaseFit) -> bool:
    large = remainder(base.system, large=True)
    return bool(large) and drifting_segments(base.system.fit, large) is None


def _named(tested: ModelVerdict, diagnosis: Diagnosis) -> ModelVerdict:
    """The residuals of a model with what a diagnosis of it says."""
    ranked = {unknown.effect: unknown for unknown in diagnosis.ranking}
    missing = {
        name: FoundEffect(
            ranked[name].parameters,
            ranked[name].headline,
            ranked[name].confused_with,
            ranked[name].experiment,
        )
        for name in diagnosis.missing
    }
    unseen = diagnosis.unexcited
    unknown = diagnosis.unknown
    return replace(
        tested,
        verdict=diagnosis.verdict,
        missing=missing,
        note="; ".join(u.words for u in unseen) if diagnosis.verdict == "insufficient" else "",
        # both over what every step of the ladder can hold out, as a diagnosis has them
        held_out=diagnosis.ladder[0].held_out if missing else tested.held_out,
        held_out_with=diagnosis.ladder[-1].held_out if missing else None,
        unknown="" if unknown is None else f"{unknown.signal}, {unknown.shape}",
        unexcited=unseen,
        fitted=_fitted(diagnosis),
        constants=diagnosis.constants,
    )


def _touches(sizes: Mapping[str, Parameters], library: Mapping[str, Effect]) -> dict[str, str]:
    """What constants mean where the effects that are known of the motor act, with their sizes."""
    return {
        constant: f"{words}: {headline(library[name], parameters)}"
        for name, parameters in sizes.items()
        for constant, words in library[name].touches.items()
    }


def _in_friction(
    named: ModelVerdict, library: Mapping[str, Effect], machine: Machine
) -> dict[str, Parameters]:
    """What friction constants contain of the effects that are known of the motor.

    Of an effect that another explains as well, any share from none to all: a half, with the
    uncertainty of a uniform distribution (GUM 4.3.7).
    """
    parts: dict[str, Parameters] = {}
    for name, parameters in named.sizes.items():
        if name not in library or not library[name].in_friction:
            continue
        whole = friction_parts(library[name], parameters, machine)
        confused = name in named.missing and named.missing[name].confused_with
        parts[name] = {n: _any_share(*one) for n, one in whole.items()} if confused else whole
    return parts


def _far_inertia(
    sizes: Mapping[str, Parameters], library: Mapping[str, Effect], segments: Sequence[Segment]
) -> dict[str, ReportedParameter]:
    """Share of the inertia that is beyond a coupling, by the effect that says so.

    Where a drive logs the torque in the coupling, its inertia is of the motor's side alone. Where
    none logs one, the share may be anything where only a torque shows it.
    """
    logged = any(TORQUE in one.recorded for one in segments if one.test == "drive")
    shares: dict[str, ReportedParameter] = {}
    for name, parameters in sizes.items():
        share = parameters.get(library[name].far_inertia) if name in library else None
        between = parameters.get("between")
        in_coupling = logged and between is not None and between.value == 1.0
        if share is None or share.value is None or share.u is None or in_coupling:
            continue
        unseen = library[name].far_by_torque and not logged
        shares[name] = _any_share(1.0, 0.0, share.unit) if unseen else share
    return shares


def _of_the_shaft_alone(
    constants: Parameters, left: Mapping[str, Parameters], library: Mapping[str, Effect]
) -> dict[str, ReportedParameter]:
    """The constants of a fit, without an inertia of all that turns where that of a datasheet may be
    of the motor's side: a coupling is among the effects `left`, whose share is not taken off.
    """
    coupled = any(library[name].far_inertia for name in left if name in library)
    return {name: one for name, one in constants.items() if not (coupled and name == INERTIA)}


def _any_share(value: float | None, u: float | None, unit: str) -> ReportedParameter:
    whole = value or 0.0
    return ReportedParameter(whole / 2.0, math.hypot(u or 0.0, whole / math.sqrt(12.0)), unit)


def _fitted(diagnosis: Diagnosis) -> dict[str, dict[str, ReportedParameter]]:
    """Parameters of the effects that were asked for, beside those that were found."""
    if not diagnosis.ladder:
        return {}
    last = diagnosis.ladder[-1].parameters
    values = {full.partition("."): one for full, one in last.items()}
    return {
        name: {short: one for (effect, _, short), one in values.items() if effect == name}
        for name in diagnosis.asked
        if any(effect == name for effect, _, _ in values)
    }


def _residuals(base: BaseFit) -> ModelVerdict:
    """What a fit leaves; the verdict is the caller's."""
    system = base.system
    remainders = remainder(system)
    worst = None
    if remainders:
        first = max(remainders, key=lambda one: one.chi2_per_n)
        names = {(s.capture, c): reported_signal(s, c) for s in system.segments for c in s.channels}
        signal = names[first.capture, first.signal]
        floors = math.sqrt(first.chi2_per_n)
        worst = Excess(first.capture, signal, first.order, floors, first.size, unit_of(signal))
    return ModelVerdict(
        "adequate",
        held_out=leave_out(system).total,
        residual=_largest(system),
        worst=worst,
        over=len(remainders),
    )


def _largest(system: LinearSystem) -> float:
    """The largest root of χ²/n of any group."""
    reduced_chi2 = system.reduced_chi2(system.residual / system.noise_ratio)[system.counts > 0]
    return math.sqrt(float(np.max(reduced_chi2, initial=0.0)))
