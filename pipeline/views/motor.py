"""One motor's datasheet for people: its constants with budgets, its checks, what holds it back."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from pipeline.physics.glossary import Term, suffix_of, unit_of
from pipeline.physics.notation import (
    MINUS,
    Reading,
    plain,
    quantity,
    reading,
    scale_for,
    significant,
)
from pipeline.records.datasheet import Check, Datasheet
from pipeline.records.estimate import Conditions, Estimate
from pipeline.records.uncertainty import Budget, covariance
from pipeline.views.constants import constant_words, symbol
from pipeline.views.names import quantity_words

NEGLIGIBLE = 1e-3
CHECK_ORDER = ("fail", "marginal", "not_evaluated", "pass")
SCATTER, DISAGREEMENT, ASSUMED = "scatter", "disagreement", "assumptions"
_KINDS = {"scatter": SCATTER, "between": DISAGREEMENT, "assumed": ASSUMED, "lcr": "LCR meter"}
LEAST_SHARE = 0.05
"""Share of u² from which on a source is named beside its bar."""
_LOW, _HIGH = "low", "high"


@dataclass(frozen=True, slots=True)
class Alternative:
    """The same constant by another method, and how far it lies from the published one."""

    method: str
    reading: Reading
    difference: str


@dataclass(frozen=True, slots=True)
class Part:
    """What one kind of source has in a standard uncertainty: its share of u² [1]."""

    kind: str
    share: float

    @property
    def percent(self) -> str:
        """The share in percent, for people."""
        return f"{100.0 * self.share:.0f} %" if self.share >= 0.01 else "< 1 %"


@dataclass(frozen=True, slots=True)
class Row:
    """One constant of the table, every text ready to be shown; `parts` of u², largest first."""

    name: str
    symbol: tuple[str, str]
    words: str
    estimate: Estimate
    reading: Reading | None
    relative: str
    u_a: str
    u_b: str
    dof: str
    at: str
    parts: tuple[Part, ...]
    alternatives: tuple[Alternative, ...]

    def shares(self, least: float = 0.0) -> str:
        """The parts of u² that have at least this share of it, in words.

        Parameters
        ----------
        least
            Smallest share that is named [1].

        """
        return ", ".join(f"{p.kind} {p.percent}" for p in self.parts if p.share >= least)


def motor_rows(datasheet: Datasheet, own: Mapping[str, Term] | None = None) -> dict[str, Row]:
    """The constants of a datasheet by name, sorted; `own` are terms that the glossary lacks.

    Parameters
    ----------
    datasheet
        The datasheet.
    own
        Terms of plug-ins that the glossary lacks, by name.

    """
    return {
        name: _row(name, constant_words(name, own), datasheet)
        for name in sorted(datasheet.constants)
    }


def ordered_checks(checks: Iterable[Check]) -> list[Check]:
    """The failed ones first, by name.

    Parameters
    ----------
    checks
        The checks.

    """
    return sorted(checks, key=lambda check: (CHECK_ORDER.index(check.status), check.name))


def check_number(value: float | None, unit: str, digits: int = 5) -> str:
    """A number of a check with its unit; a dash where it was not evaluated.

    Parameters
    ----------
    value
        The number; None where there is none.
    unit
        Unit of the number.
    digits
        Significant digits.

    """
    if value is None:
        return "–"
    return plain(value, digits) if unit == "1" else quantity(value, unit)


def parts_of(budget: Budget) -> tuple[Part, ...]:
    """Shares of u² by kind of source: scatter, disagreement, assumptions, and each instrument.

    Parameters
    ----------
    budget
        Contributions to the uncertainty.

    """
    squares: dict[str, float] = {}
    for one in budget:
        kind = kind_of(one.source)
        squares[kind] = squares.get(kind, 0.0) + one.u**2
    total = sum(squares.values())
    if total <= 0.0:
        return ()
    parts = [Part(kind, square / total) for kind, square in squares.items()]
    return tuple(sorted(parts, key=lambda part: (-part.share, part.kind)))


def kind_of(source: str) -> str:
    """What a contribution comes from: `current@bench-1` is current, `scatter:lcr:r` scatter.

    Parameters
    ----------
    source
        Name of the contribution.

    """
    head = re.split("[:@]", source, maxsplit=1)[0]
    head = head.removesuffix("_commanded")
    if head.startswith("theta"):
        return "angle"
    return _KINDS.get(head, head.replace("_", " "))


def _row(name: str, words: str, datasheet: Datasheet) -> Row:
    estimate = datasheet.constants[name]
    others = tuple(_alternative(e, estimate) for e in datasheet.alternatives if e.name == name)
    shown = reading(estimate.number, estimate.u, estimate.unit) if estimate.known else None
    return Row(
        name=name,
        symbol=symbol(name),
        words=words,
        estimate=estimate,
        reading=shown,
        relative=_relative(estimate),
        u_a=_in_scale(estimate.u_a, estimate.u, shown),
        u_b=_in_scale(estimate.u_b, estimate.u, shown),
        dof=_dof(estimate),
        at=conditions(estimate.at),
        parts=parts_of(estimate.budget) if estimate.known else (),
        alternatives=tuple(sorted(others, key=lambda other: other.method)),
    )


def _alternative(other: Estimate, chosen: Estimate) -> Alternative:
    shown = reading(other.number, other.u, other.unit)
    difference = ""
    if chosen.known and chosen.number != 0.0:
        delta = other.number - chosen.number
        spread = other.u**2 + chosen.u**2 - 2.0 * covariance(other.budget, chosen.budget)
        difference = f"{_percent(delta / abs(chosen.number))} apart"
        if spread > 0.0:
            difference += f", {abs(delta) / math.sqrt(spread):.1f} u of the difference"
    return Alternative(other.method, shown, difference)


def _percent(share: float) -> str:
    text = f"{100.0 * share:+.2g}" if abs(share) < 0.1 else f"{100.0 * share:+.0f}"
    return f"{text.replace('-', MINUS)} %"


def _in_scale(u: float, total: float, shown: Reading | None) -> str:
    """A part of the standard uncertainty in the unit that the value is shown in, two digits."""
    if shown is None or not shown.expanded:
        return ""
    return significant(u / 10.0**shown.exponent, 2) if u >= NEGLIGIBLE * total else "≈ 0"


def _relative(estimate: Estimate) -> str:
    """U as a share of the value; empty where the value could as well be zero."""
    if not estimate.known or estimate.u == 0.0 or 2.0 * estimate.u >= abs(estimate.number):
        return ""
    return f"{significant(200.0 * estimate.u / abs(estimate.number), 2)} %"


def _dof(estimate: Estimate) -> str:
    if not estimate.known or estimate.u == 0.0:
        return ""
    return f"{estimate.dof:.0f}" if estimate.dof < 1e4 else "∞"


def conditions(at: Conditions) -> str:
    """Conditions in order of their names; `X_low_UNIT` with `X_high_UNIT` is one range.

    Parameters
    ----------
    at
        Conditions by name [unit of the name].

    """
    texts = []
    for key in sorted(at, key=_without_end):
        end, partner = _end(key), at.get(_partner(key))
        if end == _HIGH and isinstance(partner, int | float):
            continue
        value = at[key]
        if end == _LOW and isinstance(value, int | float) and isinstance(partner, int | float):
            texts.append(f"{_words(_without_end(key))} {_range(value, partner, unit_of(key))}")
        else:
            texts.append(f"{_words(key)} {_value(value, unit_of(key))}")
    return ", ".join(texts)


def _words(key: str) -> str:
    return quantity_words(key).replace("_", "").removesuffix(" temperature")


def _value(value: float | int | str, unit: str) -> str:
    if isinstance(value, str):
        return value
    scale = scale_for(value, unit)
    return f"{plain(scale.shown(value), 4)} {scale.unit}".strip()


def _range(low: float, high: float, unit: str) -> str:
    scale = scale_for(max(abs(low), abs(high)), unit)
    first, last = plain(scale.shown(low), 4), plain(scale.shown(high), 4)
    return f"{first} to {last} {scale.unit}".strip()


def _stem(key: str) -> list[str]:
    suffix = suffix_of(key)
    return (key[: -len(suffix) - 1] if suffix else key).split("_")


def _end(key: str) -> str:
    last = _stem(key)[-1]
    return last if last in {_LOW, _HIGH} else ""


def _without_end(key: str) -> str:
    stem = _stem(key)
    return "_".join([*(stem[:-1] if _end(key) else stem), *filter(None, [suffix_of(key)])])


def _partner(key: str) -> str:
    other = {_LOW: _HIGH, _HIGH: _LOW}.get(_end(key))
    if other is None:
        return ""
    return "_".join([*_stem(key)[:-1], other, *filter(None, [suffix_of(key)])])
