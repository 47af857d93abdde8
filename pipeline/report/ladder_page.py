"""The page of one diagnosis: what is missing, how sure that is, and the error falling by rungs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from pipeline.physics.notation import MINUS, number_text, quantity, significant
from pipeline.records.diagnosis import Diagnosis, LadderRung, RankedEffect
from pipeline.report.axis import quantity_words, unit_of
from pipeline.report.curve_chart import curve_chart
from pipeline.report.heatmap import angle_bars, heatmap
from pipeline.report.notes import told_and_folded
from pipeline.report.page import render
from pipeline.report.rung_chart import rung_chart

VERDICT_WORDS = {
    "adequate": "The model explains these captures down to the noise; nothing is missing.",
    "missing": "Known effects are missing from the model. With them the error falls as below.",
    "unknown": "Something is missing that no known effect explains.",
    "insufficient": "The captures cannot tell; record what is named below.",
}
SPEED, CURRENT = "omega_mech_rad_s", "iq_a"
MOST_RANKED = 12


@dataclass(frozen=True, slots=True)
class ErrorCell:
    """One signal's error on one rung, its floor, their ratio, the change from the rung below."""

    rmse: str
    floor: str
    ratio: str
    change: str


@dataclass(frozen=True, slots=True)
class Figure:
    """One signal of one rung: map over speed and current, bars over the angle."""

    signal: str
    flat: str
    turn: str


@dataclass(frozen=True, slots=True)
class RungView:
    """One rung, every text ready to be shown."""

    number: int
    title: str
    explanations: tuple[str, ...]
    held_out: str
    change: str
    parameters: tuple[tuple[str, str], ...]
    others: tuple[tuple[str, str], ...]
    errors: tuple[tuple[str, ErrorCell | None], ...]
    figures: tuple[Figure, ...]


def render_ladder(result: Diagnosis) -> str:
    """The self-contained HTML page of one diagnosis; equal input gives equal text."""
    signals = _signals(result)
    reach = _reaches(result.ladder)
    views = [_view(result, n, signals, reach) for n in range(len(result.ladder))]
    over = _over_floors(result.ladder, signals)
    notes, folded = told_and_folded(result)
    return render(
        "ladder.html.jinja",
        result=result,
        notes=notes,
        folded=folded,
        verdict_words=VERDICT_WORDS[result.verdict],
        chart=rung_chart([_short(view) for view in views], over),
        rungs=views,
        signals=[quantity_words(name) for name in signals],
        found=[_ranked(one) for one in result.ranking if one.effect in result.missing],
        others=[_ranked(one) for one in result.ranking if one.effect not in result.missing][
            :MOST_RANKED
        ],
        sketch=_sketch(result),
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


def _signals(result: Diagnosis) -> list[str]:
    """Signals told on every rung, the one farthest over its floor on the first rung first, those
    of which no floor is told last.
    """
    if not result.ladder:
        return []
    first = result.ladder[0]
    told = dict.fromkeys([*first.errors, *first.signals])
    names = [n for n in told if all(n in r.errors or n in r.signals for r in result.ladder)]
    return sorted(names, key=lambda n: (n not in first.errors, -_over(first, n), n))


def _over(rung: LadderRung, name: str) -> float:
    """A signal's error over its noise floor, 0 where none is told."""
    error = rung.errors.get(name)
    return 0.0 if error is None else error.rmse / max(error.noise_floor, 1e-300)


def _over_floors(ladder: Sequence[LadderRung], signals: Sequence[str]) -> dict[str, list[float]]:
    """What the chart draws: each signal's error over its floor, else that of all together."""
    drawn = [name for name in signals if all(name in rung.errors for rung in ladder)]
    if not drawn:
        return {"all signals": [rung.held_out for rung in ladder]} if ladder else {}
    return {name: [_over(rung, name) for rung in ladder] for name in drawn}


def _reaches(ladder: Sequence[LadderRung]) -> dict[tuple[str, str], float]:
    """Full colour, or the axis' end, of each signal's maps: the largest mean on any rung."""
    reach: dict[tuple[str, str], float] = {}
    for rung in ladder:
        for one in rung.maps:
            key = (one.signal, one.x.variable)
            reach[key] = max(reach.get(key, 0.0), one.reach)
    return reach


def _view(
    result: Diagnosis, number: int, signals: Sequence[str], reach: dict[tuple[str, str], float]
) -> RungView:
    rung = result.ladder[number]
    below = result.ladder[number - 1] if number else None
    came = [e for e in rung.effects if below is None or e not in below.effects]
    gone = [e for e in below.effects if e not in rung.effects] if below is not None else []
    title = " ".join([*(f"+ {e}" for e in came), *(f"{MINUS} {e}" for e in gone)])
    told = {one.effect: one.explanation for one in result.ranking}
    shown = [(n, number_text(*v)) for n, v in rung.parameters.items()]
    own = tuple(one for one in shown if one[0].split(".")[0] in came)
    return RungView(
        number,
        title or result.whole_model,
        tuple(told[e] for e in came if e in told),
        f"{rung.held_out:.4g}",
        "" if below is None else _percent(rung.held_out, below.held_out),
        own,
        tuple(one for one in shown if one not in own),
        tuple((quantity_words(n), _cell(rung, below, n)) for n in signals),
        tuple(_figures(rung, signals, reach)),
    )


def _cell(rung: LadderRung, below: LadderRung | None, name: str) -> ErrorCell | None:
    now, before = _rmse(rung, name), None if below is None else _rmse(below, name)
    if now is None:
        return None
    error = rung.errors.get(name)
    return ErrorCell(
        quantity(now, unit_of(name) if error is None else error.unit, 3),
        "" if error is None else quantity(error.noise_floor, error.unit, 3),
        "" if error is None else significant(_over(rung, name), 3),
        "" if before is None else _percent(now, before),
    )


def _rmse(rung: LadderRung, name: str) -> float | None:
    """A signal's error, whether its floor is told or not [its unit]."""
    if name in rung.errors:
        return rung.errors[name].rmse
    return rung.signals.get(name)


def _percent(now: float, before: float) -> str:
    if before <= 0.0:
        return ""
    return f"{100.0 * (now / before - 1.0):+.0f} %".replace("-", MINUS)


def _figures(
    rung: LadderRung, signals: Sequence[str], reach: dict[tuple[str, str], float]
) -> Iterator[Figure]:
    mapped = [n for n in signals if rung.map_of(n, SPEED, CURRENT) is not None]
    for name in [*mapped, *(n for n in signals if n not in mapped)]:
        flat = rung.map_of(name, SPEED, CURRENT)
        angle = "theta_mech_rad" if name == "torque_shaft_nm" else "theta_elec_rad"
        turn = rung.map_of(name, angle)
        if flat is None and turn is None:
            continue
        yield Figure(
            quantity_words(name),
            "" if flat is None else heatmap(flat, reach[name, SPEED]),
            "" if turn is None else angle_bars(turn, reach[name, angle]),
        )


def _short(view: RungView) -> str:
    return f"{view.number}: {view.title}" if len(view.title) < 26 else f"rung {view.number}"


def _ranked(one: RankedEffect) -> dict[str, str]:
    return {
        "effect": one.effect,
        "score": f"{one.score:.4g}".replace("-", MINUS),
        "drop": f"{100.0 * one.held_out_drop:.0f} %" if one.held_out_drop else "–",
        "p_value": f"{one.p_value:.2g}",
        "confused_with": ", ".join(one.confused_with),
        "explanation": one.explanation,
        "experiment": one.experiment,
        "shortfall": one.shortfall,
    }


@dataclass(frozen=True, slots=True)
class Sketch:
    """An unknown structure: its terms, and and where told its curve, formula and rivals."""

    terms: tuple[tuple[str, str], ...]
    curve: str
    expression: str
    alternatives: tuple[str, ...]


def _sketch(result: Diagnosis) -> Sketch | None:
    if result.unknown is None:
        return None
    told = result.unknown.document()
    points, sketch = told.get("curve", []), told["sketch"]
    unit = sketch[0]["unit"] if sketch else "1"
    return Sketch(
        tuple((t["term"], quantity(t["coefficient"], t["unit"], 4)) for t in sketch),
        curve_chart(told["variables"][0], unit, points) if len(points) > 1 else "",
        told.get("expression", ""),
        tuple(
            f"{', '.join(one['variables'])} ({100 * one['share']:.0f} %)"
            for one in told.get("alternatives", [])
        ),
    )
