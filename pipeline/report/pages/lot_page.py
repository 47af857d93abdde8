"""The page of a comparison: the verdict for a minute, the grounds for an hour."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from pipeline.physics.notation import quantity, reading, scale_for
from pipeline.records.lot_constant import Component, ConstantResult, Gauge
from pipeline.records.lot_regression import EffectChange, LotRegression, OrderLevel
from pipeline.report.charts.lot_chart import cogging_chart, lot_chart
from pipeline.report.pages.page import Link, link_block, render
from pipeline.views.lots import NONE, TONES, ConstantRow, lot_view, p_text

MOST_MOTORS = 200


@dataclass(frozen=True, slots=True)
class Detail:
    """One constant's own section: chart, facts as (name, value), tables."""

    row: ConstantRow
    chart: str
    facts: tuple[tuple[str, str], ...]
    parts: tuple[tuple[str, str, str, str], ...]
    stations: tuple[tuple[str, str, str], ...]
    motors: tuple[tuple[str, str, str, str, str, str], ...]
    left_out: int
    missing: tuple[str, ...]


def render_regression(regression: LotRegression, links: Sequence[Link] = ()) -> str:
    """The self-contained HTML page; equal input, equal text. `links` lead to other pages.

    Parameters
    ----------
    regression
        The comparison of lots.
    links
        Links to other pages.

    """
    view = lot_view(regression)
    return render(
        "lot.html.jinja",
        found=regression,
        links=link_block(links),
        tone=TONES.get(regression.verdict, "none"),
        short=regression.verdict.replace("_", " "),
        reasons=regression.reasons,
        view=view,
        changed=[e for e in regression.effects if e.verdict != "pass"],
        effects=[_effect(one) for one in regression.effects],
        orders=_orders(regression.orders),
        cogging=cogging_chart(regression.cogging, regression.orders),
        outliers=[(o, quantity(o.value, o.unit)) for o in regression.outliers],
        details=[_detail(*one) for one in zip(view.present, view.rows, strict=True)],
        tones=TONES,
    )


def _detail(constant: ConstantResult, row: ConstantRow) -> Detail:
    shown = constant.motors[:MOST_MOTORS]
    return Detail(
        row=row,
        chart=lot_chart(constant),
        facts=tuple((name, text) for name, text in _facts(constant) if text),
        parts=tuple(_part(part, constant.unit) for part in constant.variance),
        stations=tuple(
            (
                station.station,
                NONE
                if station.bias is None
                else reading(station.bias, station.u or 0.0, constant.unit).text(),
                f"{station.by.replace('_', ' ')}"
                + (f", {station.golden_motors} motors" if station.golden_motors else ""),
            )
            for station in constant.stations
        ),
        motors=tuple(
            (
                motor.motor_id,
                motor.lot,
                reading(motor.value, motor.u, constant.unit).text(),
                motor.decision.replace("_", " "),
                NONE if motor.z is None else f"{motor.z:+.1f}",
                motor.capture or NONE,
            )
            for motor in shown
        ),
        left_out=len(constant.motors) - len(shown),
        missing=constant.missing,
    )


def _facts(constant: ConstantResult) -> Sequence[tuple[str, str]]:
    """What was found, each with the numbers it rests on."""
    return (
        ("limits", _limits(constant)),
        ("motors within limits", _counts(constant)),
        ("risks of the decision rule", _risks(constant)),
        ("lot-level test", _test(constant)),
        ("sameness", _same(constant)),
        ("power", _power(constant)),
        ("capability", _capability(constant)),
        ("gauge R&R", _gauge(constant.gauge, constant.unit)),
    )


def _limits(constant: ConstantResult) -> str:
    bounds = constant.bounds
    if bounds is None or (bounds.lower is None and bounds.upper is None):
        return ""
    sides = [
        NONE if side is None else quantity(side, constant.unit)
        for side in (bounds.lower, bounds.upper)
    ]
    band = quantity(bounds.guard_band, constant.unit, 2)
    return f"{sides[0]} to {sides[1]}, guard band {band}: {bounds.rule}"


def _counts(constant: ConstantResult) -> str:
    counts = [f"{c.motors} {c.decision.replace('_', ' ')}" for c in constant.conformity.counts]
    worst = constant.conformity.worst_motor
    return ", ".join(counts) + (f"; worst {worst}" if worst else "")


def _risks(constant: ConstantResult) -> str:
    accept, reject = constant.conformity.risk_false_accept, constant.conformity.risk_false_reject
    if accept is None or reject is None:
        return ""
    return f"false acceptance {100 * accept:.2g} %, false rejection {100 * reject:.2g} % of motors"


def _test(constant: ConstantResult) -> str:
    test = constant.test
    if test.status != "evaluated":
        return f"{test.status.replace('_', ' ')}: {test.lots} of {test.needed} baseline lots"
    t = NONE if test.t is None else f"{test.t:.3g}"
    return (
        f"t = {t} with {test.dof:.3g} degrees of freedom, p {p_text(test.p_value)}, "
        f"after Holm {p_text(test.p_holm)}"
    )


def _same(constant: ConstantResult) -> str:
    same = constant.equivalence
    if same.low is None or same.high is None or same.margin is None:
        return ""
    low, high, margin = (quantity(x, constant.unit, 3) for x in (same.low, same.high, same.margin))
    return f"{same.status}: difference {low} to {high} against ± {margin}, p {p_text(same.p_value)}"


def _power(constant: ConstantResult) -> str:
    power = constant.power
    if power.power is None or power.shift is None or power.detectable is None:
        return ""
    shift, seen = (
        quantity(power.shift, constant.unit, 3),
        quantity(power.detectable, constant.unit, 3),
    )
    by = "scatter of lots" if power.by == "lots" else "scatter of motors"
    return f"{100 * power.power:.0f} % for {shift} (1.5 sd); 95 % from {seen} on, by the {by}"


def _capability(constant: ConstantResult) -> str:
    capability = constant.capability
    if capability.cpk is None or capability.cpk_low is None or capability.cpk_high is None:
        return ""
    cp = "" if capability.cp is None else f"Cp {capability.cp:.2f}, "
    level = f"{100 * capability.level:.0f} %"
    interval = f"({capability.cpk_low:.2f} to {capability.cpk_high:.2f} at {level})"
    return f"{cp}Cpk {capability.cpk:.2f} {interval}"


def _gauge(gauge: Gauge | None, unit: str) -> str:
    if gauge is None:
        return ""
    rr = quantity(gauge.rr, unit, 3)
    return (
        f"{gauge.percent:.1f} % of the study variation ({gauge.percent_low:.1f} to "
        f"{gauge.percent_high:.1f} %), {gauge.verdict.replace('_', ' ')}: {rr} over "
        f"{gauge.motors} motors, {gauge.stations} stations, {gauge.repeats} repeats"
    )


def _part(part: Component, unit: str) -> tuple[str, str, str, str]:
    sd = NONE if part.sd is None else quantity(part.sd, unit, 3)
    share = NONE if part.share is None else f"{100 * part.share:.0f} %"
    return part.name, sd, share, part.note


def _effect(one: EffectChange) -> tuple[EffectChange, str, str, str, str]:
    sizes = [
        NONE if size is None or not one.unit else quantity(size, one.unit, 3)
        for size in (one.baseline_amplitude, one.candidate_amplitude)
    ]
    return one, TONES.get(one.verdict, "none"), sizes[0], sizes[1], p_text(one.p_holm)


def _orders(levels: Sequence[OrderLevel]) -> list[tuple[int, str, str]]:
    """(order, baseline, candidate) amplitudes on one scale."""
    if not levels:
        return []
    scale = scale_for(max(level.mean for level in levels), "N·m")
    rows: dict[int, dict[str, str]] = {}
    for level in levels:
        text = reading(level.mean, (level.sd or 0.0) / 2.0, "N·m", scale).text()
        rows.setdefault(level.order, {})[level.side] = (
            f"{text} ({level.shown} of {level.motors} motors)"
        )
    return [
        (order, own.get("baseline", NONE), own.get("candidate", NONE))
        for order, own in sorted(rows.items())
    ]
