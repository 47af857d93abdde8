"""The page of one diagnosis: what is missing with sizes, what to do, and the error falling."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.physics.glossary import unit_of
from pipeline.physics.notation import MINUS, quantity, significant
from pipeline.records.diagnosis import (
    Diagnosis,
    RankedEffect,
    Signature,
    StepRecord,
    UnknownStructure,
)
from pipeline.records.evidence import Evidence, Series
from pipeline.report.charts.chart import chart
from pipeline.report.charts.curve_chart import curve_chart
from pipeline.report.charts.heatmap import angle_bars, heatmap
from pipeline.report.charts.step_chart import step_chart
from pipeline.report.pages.page import Link, link_block, render
from pipeline.views.ladder import (
    CURRENT,
    SPEED,
    LadderView,
    StepView,
    angle_of,
    ladder_view,
    over_floor,
    reaches,
)
from pipeline.views.names import in_words, quantity_words
from pipeline.views.notes import shown_and_folded

MOST_RANKED = 12


@dataclass(frozen=True, slots=True)
class Figure:
    """One signal of one step: map over speed and current, bars over the angle."""

    signal: str
    flat: str
    turn: str


@dataclass(frozen=True, slots=True)
class Shown:
    """What gives away an effect that came with a step: its words, its drawing, whose capture."""

    step: StepView
    svg: str
    caption: str


def render_ladder(
    result: Diagnosis,
    links: Sequence[Link] = (),
    folder: str = "FOLDER",
    output: str = "OUTPUT",
) -> str:
    """The self-contained HTML page of one diagnosis; equal input gives equal text.

    Parameters
    ----------
    result
        The diagnosis.
    links
        Links to other pages.
    folder
        The input folder, as the user named it.
    output
        The output folder, as the user named it.

    """
    view = ladder_view(result, folder, output)
    reach = reaches(result.ladder)
    notes, folded = shown_and_folded(result)
    ranked = [_ranked(one) for one in result.ranking]
    return render(
        "ladder.html.jinja",
        result=result,
        view=view,
        links=link_block(links),
        notes=notes,
        folded=folded,
        shown=[_shown(step) for step in view.steps if step.signature is not None],
        chart=step_chart([_short(one) for one in view.steps], _over_floors(result.ladder, view)),
        figures=[tuple(_figures(step, view.signals, reach)) for step in result.ladder],
        signals=[quantity_words(name) for name in view.signals],
        found=[one for one in ranked if one["effect"] in result.missing],
        others=[one for one in ranked if one["effect"] not in result.missing][:MOST_RANKED],
        sketch=_sketch(result.unknown),
        remainder=[
            (
                one.capture,
                quantity_words(one.signal),
                str(one.order) if one.order else "mean",
                significant(one.chi2_per_n, 3),
                quantity(one.size, unit_of(one.signal), 3),
                "yes" if one.matters else "too small",
            )
            for one in result.remainder
        ],
    )


def _over_floors(ladder: Sequence[StepRecord], view: LadderView) -> dict[str, list[float]]:
    """What the chart draws: each signal's error over its floor, else that of all together."""
    drawn = [name for name in view.signals if all(name in step.errors for step in ladder)]
    if not drawn:
        return {"all signals": [step.held_out for step in ladder]} if ladder else {}
    return {name: [over_floor(step, name) for step in ladder] for name in drawn}


def _figures(
    step: StepRecord, signals: Sequence[str], reach: dict[tuple[str, str], float]
) -> Iterator[Figure]:
    mapped = [n for n in signals if step.map_of(n, SPEED, CURRENT) is not None]
    for name in [*mapped, *(n for n in signals if n not in mapped)]:
        flat = step.map_of(name, SPEED, CURRENT)
        angle = angle_of(name)
        turn = step.map_of(name, angle)
        if flat is None and turn is None:
            continue
        yield Figure(
            quantity_words(name),
            "" if flat is None else heatmap(flat, reach[name, SPEED]),
            "" if turn is None else angle_bars(turn, reach[name, angle]),
        )


def _shown(step: StepView) -> Shown:
    """Points: what the model without the effect leaves; line: what it explains; below: the rest."""
    assert step.signature is not None
    one: Signature = step.signature
    before, after = np.array(one.before), np.array(one.after)
    series = (Series("", np.array(one.at), before, before - after),)
    drawn = Evidence("", step.title, one.x_name, one.signal, "scatter", series, one.capture)
    words = f"{quantity_words(one.signal)} over {quantity_words(one.x_name)}"
    where = one.capture or "all captures"
    return Shown(step, chart(drawn), f"{words}, {where}")


def _short(view: StepView) -> str:
    return f"{view.number}: {view.title}" if len(view.title) < 26 else f"step {view.number}"


def _ranked(ranked: RankedEffect) -> dict[str, str]:
    return {
        "effect": ranked.effect,
        "score": f"{ranked.score:.4g}".replace("-", MINUS),
        "drop": f"{100.0 * ranked.held_out_drop:.0f} %" if ranked.held_out_drop else "–",
        "p_value": f"{ranked.p_value:.2g}" if ranked.p_value else "< 1e−300",
        "confused_with": ", ".join(ranked.confused_with),
        "explanation": ranked.explanation,
        "experiment": ranked.experiment,
        "shortfall": ranked.shortfall,
    }


@dataclass(frozen=True, slots=True)
class Sketch:
    """An unknown structure in words: where it shows, on what it depends, its terms, and, where
    there is one, its curve.
    """

    signal: str
    variables: str
    shape: str
    terms: tuple[tuple[str, str], ...]
    curve: str
    alternatives: tuple[str, ...]


def _sketch(unknown: UnknownStructure | None) -> Sketch | None:
    if unknown is None:
        return None
    unit = unknown.sketch[0].unit if unknown.sketch else "1"
    title = unknown.shape.partition(" as ")[0]
    drawn = len(unknown.curve) > 1
    return Sketch(
        quantity_words(unknown.signal),
        " and ".join(map(quantity_words, unknown.variables)),
        in_words(unknown.shape),
        tuple((one.term, quantity(one.coefficient, one.unit, 4)) for one in unknown.sketch),
        curve_chart(unknown.variables[0], title, unit, unknown.curve) if drawn else "",
        tuple(
            f"{', '.join(map(quantity_words, one.variables))} ({100 * one.share:.0f} %)"
            for one in unknown.alternatives
        ),
    )
