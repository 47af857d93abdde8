"""Diagnose: ranks every known effect, adds what is missing, and says what is left."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

from pipeline.criticism.data.machine_scale import PAIRLESS, PARAMETERS, machine_of
from pipeline.criticism.data.segment import Segment
from pipeline.criticism.data.shaft_angle import ANGLES
from pipeline.criticism.discovery.changed_constants import Change
from pipeline.criticism.effect import Effect
from pipeline.criticism.library.equations import equation_of
from pipeline.criticism.library.named_models import model_of
from pipeline.criticism.library.registry import effects
from pipeline.criticism.machine.model import BEND_SPEED
from pipeline.criticism.parameter import UNLOGGED, Machine
from pipeline.criticism.policy.policy import policy_of
from pipeline.criticism.ranking import ranked, step_record
from pipeline.criticism.regression.cross_validation import HeldOut
from pipeline.criticism.regression.goodness import of_motor, over_floor
from pipeline.criticism.regression.linear_system import LinearSystem
from pipeline.criticism.regression.mains_hum import hum_notes
from pipeline.criticism.regression.reported import (
    against_stated,
    reported_combinations,
    reported_parameters,
)
from pipeline.criticism.residuals.channels import reported_signal
from pipeline.criticism.residuals.segments import segments
from pipeline.criticism.search import Ladder, SearchResult, search_ladder
from pipeline.criticism.selection.candidates import candidates
from pipeline.criticism.selection.missing_data import (
    loaded_drives,
    mixed_coasts,
    unexcited_effects,
    unlogged_temperatures,
    unrecorded_signals,
    unusable_captures,
    unused_captures,
)
from pipeline.criticism.selection.one_capture import rests_on
from pipeline.criticism.selection.other_readings import reading_notes
from pipeline.criticism.selection.requested_model import BaseFit, fit_of
from pipeline.criticism.selection.stepwise import LadderStep
from pipeline.criticism.validation.signature import signature
from pipeline.physics.notation import number_text
from pipeline.records.capture import Campaign
from pipeline.records.comparison import KnownCombination, ModelSpec
from pipeline.records.constants import Constants
from pipeline.records.diagnosis import (
    Diagnosis,
    RankedEffect,
    Remainder,
    ReportedParameter,
    StepRecord,
    Unexcited,
    Verdict,
)
from pipeline.records.naming import file_stem
from pipeline.records.policy import policy_digest

TOO_LITTLE = (
    "the captures cannot fit the base model: record a coast or an open-circuit spin, or better a "
    "torque map or drive log with dq voltages, currents and angle"
)
UNSTATED = (
    "current and motion alone show inertia and drags over the flux linkage: state the torque "
    "constant (kt_peak_nm_a), or record an open-circuit spin or a drive log with voltages as well"
)
_STATELESS = (
    "no state of the machine predicts what is left in captures it was not fitted to: see the "
    "remainder, and whether anything was changed between the captures"
)
_ALONE = (
    "{} rests on {} alone: predicted from the others, the other captures that it moves do not gain "
    "with it; record that test once more"
)


def diagnose(campaign: Campaign, model: ModelSpec, start: Constants) -> Diagnosis:
    """Which physical effects a model of one motor lacks, from its captures alone.

    Parameters
    ----------
    campaign
        Captures of the motor: recorded signals, tests and nameplate numbers are read.
    model
        The model.
    start
        Constants that are known; they give pole pairs and sizes.

    Returns
    -------
    Diagnosis
        Verdict `insufficient` where the captures cannot fit the base model.

    Raises
    ------
    UsageError
        There is no such model or effect, or an effect of the user's fails.

    """
    base = base_fit(campaign, model, start)
    if isinstance(base, str):
        return _insufficient(campaign, model, effects(model.effects_path), base)
    return searched(campaign, model, base)[0]


def base_fit(campaign: Campaign, model: ModelSpec, start: Constants) -> BaseFit | str:
    """The requested model fitted to the captures of a motor.

    Parameters
    ----------
    campaign
        Captures of the motor.
    model
        The model.
    start
        Constants that are known.

    Returns
    -------
    BaseFit or str
        The reason where it cannot be fitted.

    """
    machine = machine_of(campaign, start, policy_of(model.policy))
    if machine is None:
        return PAIRLESS
    cut_segments = segments(campaign, machine)
    if _enough(cut_segments, machine):
        return fit_of(cut_segments, model_of(model, machine))
    if not cut_segments:
        return "; ".join((TOO_LITTLE, *unusable_captures(campaign, machine)))
    return UNSTATED if _moved_by_current(cut_segments) else TOO_LITTLE


def searched(campaign: Campaign, model: ModelSpec, base: BaseFit) -> tuple[Diagnosis, BaseFit]:
    """The diagnosis that follows from a fitted model.

    Parameters
    ----------
    campaign
        Captures of the motor.
    model
        The model.
    base
        Its fit.

    Returns
    -------
    tuple of Diagnosis and BaseFit
        The fit is the one that the first reported step stands on.

    """
    library, machine = effects(model.effects_path), base.system.fit.machine
    name = f"{file_stem(campaign.motor_id)}_unknown"
    end = search_ladder(campaign, model, machine, base, library, name)
    ladder, last = end.ladder, end.ladder.steps[-1].system
    offered = candidates(library, last.fit.model)
    ranking = ranked(ladder, offered, library)
    not_excited = unexcited_effects(campaign, library, ladder.steps[-1], offered)
    verdict = _verdict_of(end, not_excited)
    combinations = reported_combinations(last, ladder.held_out[-1])
    diagnosis = Diagnosis(
        motor_id=campaign.motor_id,
        model=model.name,
        verdict=verdict,
        missing=ladder.steps[-1].added,
        ranking=ranking,
        ladder=_records(ladder.steps, ladder.held_out),
        unknown=end.sketch if verdict == "unknown" else None,
        remainder=_as_reported(last, end.remainders),
        notes=_notes(campaign, machine, end, verdict, combinations),
        unexcited=not_excited,
        asked=model.effects,
        combinations=combinations,
        policy=policy_digest(last.policy),
        constants=_constants(last, ladder.held_out[-1]),
    )
    return diagnosis, ladder.base


def _constants(system: LinearSystem, held_out: HeldOut) -> dict[str, ReportedParameter]:
    """The machine's own constants that a fit determines, by their names in a datasheet."""
    known = reported_parameters(system, held_out)
    found = {constant: known[name] for constant, name in PARAMETERS.items() if name in known}
    return {
        constant: ReportedParameter(one.value, one.u, one.unit)
        for constant, one in found.items()
        if one.value is not None and one.u is not None
    }


def _notes(
    campaign: Campaign,
    machine: Machine,
    end: SearchResult,
    verdict: Verdict,
    combinations: Sequence[KnownCombination],
) -> tuple[str, ...]:
    """What a reader of the diagnosis has to know as well: data, frame, hum, combinations."""
    ladder, last = end.ladder, end.ladder.steps[-1].system
    stateless = verdict == "unknown" and not (end.sketch or end.change or end.freed)
    unexplained = verdict == "unknown" or not ladder.explains(end.remainders)
    return (
        *unused_captures(campaign, last.segments),
        *loaded_drives(campaign, machine),
        *mixed_coasts(campaign, machine),
        *unlogged_temperatures(last.fit),
        *against_stated(last, ladder.held_out[-1]),
        *hum_notes(ladder.base.hum),
        *reading_notes(last.fit),
        *end.notes,
        *_temperature_note(end),
        *_combination_notes(combinations, ladder.steps[-1].added),
        *(note for note in ladder.cut.values() if note),
        *_one_capture_notes(ladder),
        *((_STATELESS,) if stateless else ()),
        *(unrecorded_signals(campaign, last.segments) if unexplained else ()),
        *ladder.held_out[0].notes,
    )


def _records(steps: Sequence[LadderStep], held_out: Sequence[HeldOut]) -> tuple[StepRecord, ...]:
    """The steps for people, each with the signature of what came with it."""
    records = [step_record(step, errors) for step, errors in zip(steps, held_out, strict=True)]
    signatures = [
        signature(after.system, sorted({*after.added} - {*before.added}), record.maps)
        for (before, after), record in zip(pairwise(steps), records[1:], strict=True)
    ]
    return tuple(
        replace(record, signature=shown)
        for record, shown in zip(records, [None, *signatures], strict=True)
    )


def _one_capture_notes(ladder: Ladder) -> Iterator[str]:
    """Notes of the effects that one capture alone supports, of those that others could show."""
    for n in range(1, len(ladder.steps)):
        step = ladder.steps[n]
        path = rests_on((ladder.steps[n - 1].system, step.system), ladder.held_out[n - 1 : n + 1])
        name = step.fit.model.effects[-1].name
        if path is not None and name in ladder.steps[-1].added:
            yield _ALONE.format(name, path)


def _combination_notes(
    combinations: Sequence[KnownCombination], added: Sequence[str]
) -> tuple[str, ...]:
    """Notes of the sizes of effects that are known over another constant alone."""
    return tuple(
        f"{known.expression} = {number_text(known.value, known.u, known.unit)}, of which these "
        "captures tell no more"
        for known in combinations
        if any(name.split(".")[0] in added for name in known.of)
    )


def _as_reported(system: LinearSystem, remainders: Sequence[Remainder]) -> tuple[Remainder, ...]:
    """All that is over its floor: `remainders` first, then what is too small to matter.

    Signals have the names of outputs.
    """
    names = {
        (s.capture, channel): reported_signal(s, channel)
        for s in system.segments
        for channel in s.channels
    }
    small = [excess for excess in over_floor(system) if excess not in remainders]
    reported = (*remainders, *(replace(r, matters=False) for r in small))
    return tuple(replace(r, signal=names[r.capture, r.signal]) for r in reported)


def _enough(cut_segments: Sequence[Segment], machine: Machine) -> bool:
    """Whether some test turns the machine: coasts alone show drags over an inertia, and free motion
    under a current over the flux linkage as well, where nothing states that.
    """
    if "psi_wb" in machine.stated and _moved_by_current(cut_segments):
        return True
    return any(equation_of(segment).use.turns for segment in cut_segments)


def _moved_by_current(cut_segments: Sequence[Segment]) -> bool:
    """Whether some test shows what a current makes of the motion."""
    observed = (equation_of(segment).observes.constants for segment in cut_segments)
    return any({"psi_wb", "j_kgm2"} <= {*constants} for constants in observed)


def _insufficient(
    campaign: Campaign, model: ModelSpec, library: dict[str, Effect], note: str
) -> Diagnosis:
    ranking = tuple(
        RankedEffect(e.name, 0.0, 0.0, 1.0, (), e.signature, e.experiment, {})
        for e in library.values()
    )
    return Diagnosis(
        motor_id=campaign.motor_id,
        model=model.name,
        verdict="insufficient",
        missing=(),
        ranking=ranking,
        ladder=(),
        unknown=None,
        remainder=(),
        notes=(note,),
        asked=model.effects,
        policy=policy_digest(policy_of(model.policy)),
    )


def _temperature_note(end: SearchResult) -> tuple[str, ...]:
    """A note where a constant that differs between captures is as another temperature makes it:
    where none of those with the other value records the temperature that the constant goes with.
    """
    changed, last = end.change, end.ladder.steps[-1].system
    if not isinstance(changed, Change) or end.freed or not changed.value:
        return ()
    for effect in last.fit.model.effects:
        signals = [name for name in effect.signals if name in UNLOGGED]
        parameters = effect.parameters_of(last.fit.machine)
        goes_with = {"drop": "r_ohm", "flux": "psi_wb"}.get(effect.hook)
        if len(parameters) != 1 or not signals or goes_with != changed.name:
            continue
        logged = {s.capture for s in last.segments if signals[0] in s.recorded}
        coefficient = last.fit.values[f"{effect.name}.{parameters[0].name}"]
        if logged.intersection(changed.captures) or not coefficient:
            continue
        difference_k = changed.difference / changed.value / coefficient
        if abs(difference_k) < 5.0 * last.policy.priors.unlogged_k:
            return (
                f"that is as {difference_k:+.0f} K of {signals[0]} would make it, which none of "
                "these captures records: log it",
            )
    return ()


def _verdict_of(end: SearchResult, not_excited: Sequence[Unexcited]) -> Verdict:
    """The verdict at the end of the ladder; `not_excited` are effects that nothing shows."""
    if end.freed or not end.ladder.explains(end.remainders):
        unrecorded = _may_be_observer_noise(end) or _may_be_unlogged_current(end)
        return "insufficient" if unrecorded else "unknown"
    last = end.ladder.steps[-1]
    if any(of_motor(last.system, name) for name in last.added):
        return "missing"
    return "insufficient" if not_excited else "adequate"


def _may_be_observer_noise(end: SearchResult) -> bool:
    """Whether all that is left is of motions that a drive's own speed alone shows, and no state of
    the machine predicts it: the noise of an observer is not white, and may be all of it.
    """
    if end.freed or end.sketch is not None or end.change is not None:
        return False
    last = end.ladder.steps[-1].system
    by_observer = {s.capture for s in last.segments if BEND_SPEED in s.fixed}
    return bool(end.remainders) and all(
        left_over.capture in by_observer and not left_over.signal.endswith("_v")
        for left_over in end.remainders
    )


def _may_be_unlogged_current(end: SearchResult) -> bool:
    """Whether all that is left is of logs of a q current without the d current: a map steps through
    both, a drive weakens its field, and whatever is missed there may be of the one that is not
    known. A curve over the angle alone is of no current.
    """
    last = end.ladder.steps[-1].system
    of_q = {s.capture for s in last.segments if "iq_a" in s.recorded and "id_a" not in s.recorded}
    left = {left_over.capture for left_over in end.remainders}
    of_angle = end.sketch is not None and ANGLES.issuperset(end.sketch.variables)
    return not (end.freed or of_angle) and bool(left) and left <= of_q
