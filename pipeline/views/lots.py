"""Lots held against lots, for people: what changed first, by how much, and why."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.physics.notation import quantity, reading
from pipeline.records.lot_constant import MOST_RELATIVE, ConstantResult, Side
from pipeline.records.lot_regression import LotRegression
from pipeline.views.constants import constant_words, symbol
from pipeline.views.reasons import Reason, shared_reasons

NONE = "–"
RANKS = ("fail", "CONFOUNDED", "INSUFFICIENT_HISTORY", "undecided", "marginal")
TONES = {"pass": "pass", "marginal": "marginal", "fail": "fail"}
MARKS = {"pass": "✓", "fail": "✗", "marginal": "⚠"}


@dataclass(frozen=True, slots=True)
class ConstantRow:
    """One constant of a comparison, every text ready to be shown.

    `before` and `after` are means of lot means, `change` their difference ± U in percent, or in
    the constant's unit where a share of the baseline says nothing. `shared` is the number of a
    reason that other constants have too, 0 where `why` is its own.
    """

    name: str
    symbol: tuple[str, str]
    words: str
    verdict: str
    tone: str
    mark: str
    why: str
    shared: int
    decides: bool
    before: str
    after: str
    change: str
    change_sort: str
    p_value: str
    same: str
    power: str
    cpk: str


@dataclass(frozen=True, slots=True)
class LotView:
    """The constants that a side has, what matters first; reasons that several of them have."""

    rows: tuple[ConstantRow, ...]
    present: tuple[ConstantResult, ...]
    reasons: tuple[Reason, ...]
    absent: tuple[str, ...]


def lot_view(regression: LotRegression) -> LotView:
    """The view of one comparison of lots.

    Parameters
    ----------
    regression
        The comparison of lots.

    """
    present = tuple(sorted((one for one in regression.constants if one.motors), key=_weight))
    reasons = shared_reasons((one.name, one.why) for one in present if one.why)
    numbers = {reason.text: number for number, reason in enumerate(reasons, 1)}
    return LotView(
        tuple(_row(one, numbers.get(one.why, 0)) for one in present),
        present,
        reasons,
        tuple(one.name for one in regression.constants if not one.motors),
    )


def compared(regression: LotRegression) -> tuple[ConstantResult, ...]:
    """Constants that both sides have, what matters first.

    Parameters
    ----------
    regression
        The comparison of lots.

    """
    both = [one for one in regression.constants if one.of("baseline") and one.of("candidate")]
    return tuple(sorted(both, key=_weight))


def mean_of(constant: ConstantResult, side: Side) -> float | None:
    """The mean of lot means of a side, or of its motors where there are no lots.

    Parameters
    ----------
    constant
        The constant's comparison.
    side
        `baseline` or `candidate`.

    """
    means = [lot.mean for lot in constant.lots if lot.side == side]
    means = means or [motor.value for motor in constant.of(side)]
    return sum(means) / len(means) if means else None


def change_text(constant: ConstantResult) -> str:
    """The difference of the sides ± U, with its sign; empty where there is none.

    In percent of the baseline, but where U or the change is beyond it: a share of nearly nothing
    says nothing.

    Parameters
    ----------
    constant
        The constant's comparison.

    """
    effect, before = constant.effect, mean_of(constant, "baseline")
    difference, spread = effect.difference, effect.expanded_u or 0.0
    if difference is None:
        if effect.relative is not None:
            return _signed(100.0 * effect.relative, 0.0, "%")
        return "" if effect.in_sd is None else f"{effect.in_sd:+.3g} u"
    size = abs(before or 0.0)
    if size > spread and abs(difference) <= MOST_RELATIVE * size:
        return _signed(100.0 * difference / size, 100.0 * spread / size, "%")
    return _signed(difference, spread, constant.unit)


def p_text(value: float | None) -> str:
    """A p-value to three places.

    Parameters
    ----------
    value
        The p-value; None where there is none.

    """
    return NONE if value is None else "< 0.001" if value < 0.001 else f"{value:.3f}"


def _signed(value: float, expanded: float, unit: str) -> str:
    text = reading(value, expanded / 2.0, unit).text()
    return f"+{text}" if value > 0.0 else text


def _weight(constant: ConstantResult) -> tuple[int, float, str]:
    """The worst verdicts first, then the largest change in motors' standard deviations."""
    rank = RANKS.index(constant.verdict) if constant.verdict in RANKS else len(RANKS)
    return rank, -abs(constant.effect.in_sd or 0.0), constant.name


def _row(constant: ConstantResult, shared: int) -> ConstantRow:
    before, after = mean_of(constant, "baseline"), mean_of(constant, "candidate")
    return ConstantRow(
        name=constant.name,
        symbol=symbol(constant.name),
        words=constant_words(constant.name) if constant.words == constant.name else constant.words,
        verdict=constant.verdict.replace("_", " ").lower(),
        tone=TONES.get(constant.verdict, "none"),
        mark=MARKS.get(constant.verdict, NONE),
        why=constant.why,
        shared=shared,
        decides=constant.decides,
        before=NONE if before is None else quantity(before, constant.unit),
        after=NONE if after is None else quantity(after, constant.unit),
        change=change_text(constant) or NONE,
        change_sort=repr(constant.effect.relative or 0.0),
        p_value=p_text(constant.test.p_holm),
        same=constant.equivalence.status.replace("_", " "),
        power=NONE if constant.power.power is None else f"{100 * constant.power.power:.0f} %",
        cpk=NONE if constant.capability.cpk is None else f"{constant.capability.cpk:.2f}",
    )
