"""A diagnosis for people: what is missing in words with sizes, and the ladder step by step."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import dataclass

from pipeline.physics.glossary import unit_of
from pipeline.physics.notation import MINUS, number_text, quantity, significant
from pipeline.records.diagnosis import Diagnosis, RankedEffect, Signature, StepRecord
from pipeline.records.model_verdict import effects_key, error_with, number
from pipeline.views.constants import sentence
from pipeline.views.names import in_words, quantity_words

TONES = {"adequate": "pass", "missing": "marginal", "unknown": "fail"}
SPEED, CURRENT = "omega_mech_rad_s", "iq_a"


@dataclass(frozen=True, slots=True)
class ErrorCell:
    """One signal's error on one step, its floor, their ratio, the change from the step below."""

    signal: str
    rmse: str
    floor: str
    ratio: str
    change: str


@dataclass(frozen=True, slots=True)
class StepView:
    """One step, every text ready to be shown.

    `came` are the effects that it adds, `parameters` theirs as (name, value ± U), `others` those of
    effects that were there before. `errors` have one cell a signal of the ladder.
    """

    number: int
    title: str
    came: tuple[str, ...]
    headlines: tuple[str, ...]
    explanations: tuple[str, ...]
    held_out: str
    change: str
    parameters: tuple[tuple[str, str], ...]
    others: tuple[tuple[str, str], ...]
    errors: tuple[ErrorCell | None, ...]
    signature: Signature | None


@dataclass(frozen=True, slots=True)
class Doubt:
    """An effect that was found, what else it could be, and the tests that would decide, with the
    power that they are predicted to have.
    """

    effect: str
    alternatives: str
    tests: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class LadderView:
    """A diagnosis: `headline` in a few sentences; the commands to go on with; the steps.

    `signals` are those shown on every step, the one farthest over its floor on the first one
    first, those of which no floor is known last. `try_start` compares with the effect that was
    written as a start where something unknown is left.
    """

    tone: str
    headline: str
    compare: str
    add: str
    doubts: tuple[Doubt, ...]
    slight: tuple[str, ...]
    signals: tuple[str, ...]
    steps: tuple[StepView, ...]
    try_start: str = ""


def ladder_view(result: Diagnosis, folder: str = "FOLDER", output: str = "OUTPUT") -> LadderView:
    """The view of one diagnosis of the captures in a `folder`.

    Parameters
    ----------
    result
        The diagnosis.
    folder
        The input folder, as the user named it.
    output
        The output folder, as the user named it.

    """
    signals = shown_signals(result)
    ranked = {one.effect: one for one in result.ranking}
    words = f"input={shlex.quote(folder)} motor={shlex.quote(result.motor_id)}"
    base = "" if result.model == "standard" else f" model={result.model}"
    known = (*result.asked, *result.missing)
    model, where = base + effects_key(known), f" output={shlex.quote(output)}"
    start = ""
    if result.unknown is not None and result.unknown.sketch:
        path = shlex.quote(f"effects_path={output}/diagnosis/effects")
        more = base + effects_key((*known, result.unknown.effect))
        start = f"motor-datasheets compare {words}{more} {path}{where}"
    quiet = result.verdict in ("adequate", "missing")
    return LadderView(
        TONES.get(result.verdict, "not_evaluated"),
        headline(result),
        f"motor-datasheets compare {words}{model}{where}" if result.missing else "",
        f"motor-datasheets run input={shlex.quote(folder)}{model}{where}" if result.missing else "",
        tuple(_doubt(ranked[name]) for name in result.missing if ranked[name].confused_with),
        tuple(f"{r.effect} is {r.shortfall}" for r in result.ranking if r.slight and quiet),
        signals,
        tuple(_step(result, n, signals) for n in range(len(result.ladder))),
        start,
    )


def headline(result: Diagnosis) -> str:
    """The verdict in words with sizes, in sentences: what is missing, and what adding it does.

    Parameters
    ----------
    result
        The diagnosis.

    """
    ranked = {one.effect: one for one in result.ranking}
    names = [ranked[name].headline or name for name in result.missing if name in ranked]
    missing = f"{sentence(_listed(names))}. {_fall(result)}" if names else ""
    if result.verdict == "insufficient":
        undecided = "The captures do not decide it; what to record is named below."
        return f"{missing} {undecided}".strip()
    if result.verdict == "unknown":
        one = result.unknown
        shown = "" if one is None else f": {in_words(one.shape).replace(': ', ', ', 1)}"
        return f"{missing} Something is missing that no known effect explains{shown}.".strip()
    if result.verdict == "adequate":
        floors = f", to {number(result.ladder[-1].held_out)} noise floors" if result.ladder else ""
        more = "nothing else" if names else "nothing"
        explained = f"The model explains these captures down to the noise{floors}"
        return f"{missing} {explained}; {more} is missing.".strip()
    return missing


def _listed(texts: Sequence[str]) -> str:
    if len(texts) < 2:
        return "".join(texts)
    return f"{', '.join(texts[:-1])}, and {texts[-1]}"


def _fall(result: Diagnosis) -> str:
    without, after = (result.ladder[n].held_out for n in (0, -1))
    return f"{sentence(error_with(len(result.missing), without, after))}."


def _doubt(ranked: RankedEffect) -> Doubt:
    tests = [
        f"against {apart.against}: {apart.experiment}, predicted power {apart.power:.0%}"
        for apart in ranked.separation
        if apart.power is not None
    ]
    return Doubt(
        ranked.effect, ", ".join(ranked.confused_with), tuple(tests) or (ranked.experiment,)
    )


def shown_signals(result: Diagnosis) -> tuple[str, ...]:
    """Signals shown on every step, the one farthest over its floor on the first step first, those
    of which no floor is known last.

    Parameters
    ----------
    result
        The diagnosis.

    """
    if not result.ladder:
        return ()
    first = result.ladder[0]
    names = [
        n
        for n in dict.fromkeys([*first.errors, *first.signals])
        if all(n in r.errors or n in r.signals for r in result.ladder)
    ]
    return tuple(sorted(names, key=lambda n: (n not in first.errors, -over_floor(first, n), n)))


def mapped_signals(result: Diagnosis) -> tuple[str, ...]:
    """Signals with a floor on every step, those with a map over speed and current first.

    Parameters
    ----------
    result
        The diagnosis.

    """
    names = [n for n in shown_signals(result) if all(n in step.errors for step in result.ladder)]
    flat = [n for n in names if result.ladder[0].map_of(n, SPEED, CURRENT) is not None]
    return (*flat, *(n for n in names if n not in flat))


def over_floor(step: StepRecord, name: str) -> float:
    """A signal's error over its noise floor, 0 where it is not known.

    Parameters
    ----------
    step
        The step.
    name
        The signal.

    """
    error = step.errors.get(name)
    return 0.0 if error is None else error.rmse / max(error.noise_floor, 1e-300)


def angle_of(signal: str) -> str:
    """The angle that a signal's error is drawn over: torque ripples with the shaft.

    Parameters
    ----------
    signal
        The signal.

    """
    return "theta_mech_rad" if signal == "torque_shaft_nm" else "theta_elec_rad"


def reaches(ladder: Sequence[StepRecord]) -> dict[tuple[str, str], float]:
    """Full colour, or the axis' end, of each signal's maps: the largest mean on any step [unit].

    Parameters
    ----------
    ladder
        The steps.

    """
    reach: dict[tuple[str, str], float] = {}
    for step in ladder:
        for one in step.maps:
            key = (one.signal, one.x.variable)
            reach[key] = max(reach.get(key, 0.0), one.reach)
    return reach


def _step(result: Diagnosis, place: int, signals: Sequence[str]) -> StepView:
    step = result.ladder[place]
    below = result.ladder[place - 1] if place else None
    came = tuple(e for e in step.effects if below is None or e not in below.effects)
    gone = [e for e in below.effects if e not in step.effects] if below is not None else []
    title = " ".join([*(f"+ {e}" for e in came), *(f"{MINUS} {e}" for e in gone)])
    ranked = {one.effect: one for one in result.ranking}
    shown = [(name, number_text(*value)) for name, value in step.parameters.items()]
    own = tuple(one for one in shown if one[0].split(".")[0] in came)
    return StepView(
        place,
        title or result.whole_model,
        came,
        tuple(sentence(ranked[e].headline) for e in came if e in ranked and ranked[e].headline),
        tuple(ranked[e].explanation for e in came if e in ranked),
        f"{step.held_out:.4g}",
        "" if below is None else percent(step.held_out, below.held_out),
        own,
        tuple(one for one in shown if one not in own),
        tuple(_cell(step, below, name) for name in signals),
        step.signature,
    )


def _cell(step: StepRecord, below: StepRecord | None, name: str) -> ErrorCell | None:
    now, before = _rmse(step, name), None if below is None else _rmse(below, name)
    if now is None:
        return None
    error = step.errors.get(name)
    return ErrorCell(
        quantity_words(name),
        quantity(now, unit_of(name) if error is None else error.unit, 3),
        "" if error is None else quantity(error.noise_floor, error.unit, 3),
        "" if error is None else significant(over_floor(step, name), 3),
        "" if before is None else percent(now, before),
    )


def _rmse(step: StepRecord, name: str) -> float | None:
    """A signal's error, whether its floor is known or not [its unit]."""
    if name in step.errors:
        return step.errors[name].rmse
    return step.signals.get(name)


def percent(now: float, before: float) -> str:
    """A change in percent with its sign; empty where there was nothing before.

    Parameters
    ----------
    now
        The value now.
    before
        The value before.

    """
    if before <= 0.0:
        return ""
    change = f"{100.0 * (now / before - 1.0):+.0f}"
    return "0 %" if change in ("+0", "-0") else f"{change} %".replace("-", MINUS)
