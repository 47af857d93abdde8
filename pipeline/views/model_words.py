"""The residual test of a datasheet for people: on a page, in a table, on a terminal."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from pipeline.physics.notation import number_text, quantity
from pipeline.records.model_verdict import ModelVerdict, number
from pipeline.views.constants import sentence
from pipeline.views.names import in_words

TONES = {
    "adequate": "pass",
    "missing": "marginal",
    "unknown": "marginal",
    "insufficient": "not_evaluated",
    "not_tested": "not_evaluated",
}
MOST_NAMED = 2
OLD = ModelVerdict("not_tested", note="the datasheet is older than the residual test; run again")


@dataclass(frozen=True, slots=True)
class ModelWords:
    """Verdict and error in `short`, and each by itself; one sentence without a full stop; what
    the two numbers of noise floors are `over`, where they differ; the
    command that shows more and the one that adds what was found (empty where there is none), in
    which FOLDER and OUTPUT stand for folders: the same captures give the same page anywhere;
    `rows` of name and text; a number to `sort` by.
    """

    short: str
    verdict: str
    floors: str
    tone: str
    sentence: str
    over: str
    command: str
    add: str
    rows: tuple[tuple[str, str], ...]
    sort: str
    passed: bool


def model_words(model: ModelVerdict | None, motor_id: str) -> ModelWords:
    """What the residual test of a motor came to; None is a datasheet of before there was one.

    Parameters
    ----------
    model
        The verdict of the residual test; None for a datasheet without one.
    motor_id
        The motor.

    """
    model = model or OLD
    verdict = " ".join((model.verdict.replace("_", " "), *_names(model)))
    floors = f"error {model.errors} floors" if model.errors else ""
    return ModelWords(
        short=", ".join(filter(None, (verdict, floors))),
        verdict=verdict,
        floors=floors,
        tone=TONES[model.verdict],
        sentence=in_words(sentence(model.headline())),
        over=_over(model),
        command=f"{model.command(motor_id)} output=OUTPUT"
        if model.tested and not model.passed
        else "",
        add=f"{adding} output=OUTPUT" if (adding := model.adding()) else "",
        rows=tuple(_rows(model)),
        sort=repr(model.held_out or 0.0),
        passed=model.passed,
    )


def _over(model: ModelVerdict) -> str:
    """That an error of all captures and the largest residual are not the same number."""
    if model.residual is None or model.held_out is None or not model.missing:
        return ""
    return (
        f"{number(model.held_out)} floors are over all signals of captures held out; one signal "
        f"alone reaches {number(model.residual)}."
    )


def _names(model: ModelVerdict) -> tuple[str, ...]:
    """The effects that are missing, two at most by name."""
    names = [name.replace("_", " ") for name in model.missing]
    if model.verdict != "missing" or not names:
        return ()
    more = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
    return (", ".join(names[:MOST_NAMED]) + more,)


def _rows(model: ModelVerdict) -> Iterator[tuple[str, str]]:
    if model.residual is None or model.held_out is None:
        return
    yield ("error, all signals of captures held out", f"{number(model.held_out)} noise floors")
    if model.held_out_with is not None:
        yield ("the same with what was found", f"{number(model.held_out_with)} noise floors")
    yield ("largest residual of one signal", f"{number(model.residual)} noise floors")
    if model.worst is not None:
        size = quantity(model.worst.size, model.worst.unit, 2)
        yield ("where", f"{in_words(model.worst.description)}, {size} beyond the noise")
        yield ("places over their floor", str(model.over))
    for effect, addition in model.missing.items():
        sizes = (f"{name} {number_text(*reading)}" for name, reading in addition.parameters.items())
        yield (effect.replace("_", " "), "; ".join(sizes))
        if addition.confused_with:
            others = ", ".join(addition.confused_with).replace("_", " ")
            yield ("which could as well be", f"{others}; to tell: {addition.experiment}")
    if model.unknown:
        yield ("not explained", in_words(model.unknown))
    if model.note:
        yield ("cannot be shown", model.note)
