"""What is wrong with a limits file: every fault at once, one sentence each."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping

from pipeline.physics.glossary import Term
from pipeline.records.limits import ConstantLimits, Limits


def lint(limits: Limits, terms: Mapping[str, Term]) -> tuple[str, ...]:
    """Faults of a limits file, all at once.

    Parameters
    ----------
    limits
        The file, read.
    terms
        Constants that datasheets know, by name.

    Returns
    -------
    tuple of str
        One sentence each, the rules first and then the constants in the file's order; empty where
        all is well.

    Notes
    -----
    A test limit tighter than the design's tolerance is a fault: it rejects motors that are as
    designed. What is left of the tolerance after the guard band must not be empty.

    """
    found = list(_rules(limits))
    for name, count in Counter(limits.golden).items():
        if count > 1:
            found.append(f"golden: {name} is there {count} times")
    for one in limits.constants:
        if one.name not in terms:
            found.append(f"{one.name}: no such constant; docs/glossary.md lists them")
            continue
        found += [f"{one.name}: {fault}" for fault in _constant(one, terms[one.name])]
    return tuple(found)


def _rules(limits: Limits) -> Iterable[str]:
    if not 0.0 < limits.alpha < 0.5:
        yield f"rules: alpha {limits.alpha:g} is not between 0 and 0.5"
    if limits.min_lots < 3:
        yield f"rules: min_lots {limits.min_lots} is too few to know how lots scatter; 8 is usual"
    if limits.k <= 0.0:
        yield f"rules: coverage factor k {limits.k:g} is not positive"
    if not 0.0 <= limits.order_share < 1.0:
        yield f"rules: order_share {limits.order_share:g} is no share"
    if not 0.0 <= limits.code_negligible <= limits.code_limit:
        yield "rules: code_negligible is above code_limit"


def _constant(one: ConstantLimits, term: Term) -> Iterable[str]:
    yield from _sizes(one)
    low, high = one.minimum, one.maximum
    if low is not None and high is not None and low >= high:
        yield f"minimum {low:g} is not below maximum {high:g}"
    if one.nominal is None:
        return
    yield from _plausible(one, term)
    if one.tolerance is None or one.tolerance.per not in ("unit", "nominal"):
        width = None
    else:
        width = one.tolerance.in_unit(one.nominal, None, None)
    yield from _tighter(one, width or 0.0)
    yield from _width_faults(one, width)


def _sizes(one: ConstantLimits) -> Iterable[str]:
    if one.tolerance is not None and one.tolerance.value <= 0.0:
        yield "tolerance is not positive"
    if one.tolerance is not None and one.tolerance.per == "U":
        yield "tolerance counts in U: a worse bench would pass more motors"
    if one.guard_band.value < 0.0:
        yield "guard_band is negative: it would accept motors outside the tolerance"
    if any(margin.value <= 0.0 for margin in one.margins):
        yield "equivalence_margin is not positive"
    if one.tolerate and not one.margins:
        yield "tolerate_within_margin needs an equivalence_margin"


def _plausible(one: ConstantLimits, term: Term) -> Iterable[str]:
    nominal = one.nominal or 0.0
    low = -math.inf if term.low is None else term.low
    high = math.inf if term.high is None else term.high
    if not low <= nominal <= high:
        yield f"nominal {nominal:g} {term.unit} is beyond what the glossary takes for plausible"
    for word, limit in (("minimum", one.minimum), ("maximum", one.maximum)):
        beyond = limit is not None and (limit > nominal if word == "minimum" else limit < nominal)
        if beyond:
            yield f"{word} {limit:g} leaves the nominal {nominal:g} outside"


def _tighter(one: ConstantLimits, width: float) -> Iterable[str]:
    """Test limits inside the design's own range."""
    if width == 0.0 or one.nominal is None:
        return
    slack = 1e-12 * abs(one.nominal)
    low, high = one.nominal - width, one.nominal + width
    if one.minimum is not None and one.minimum > low + slack:
        yield f"minimum {one.minimum:g} is tighter than its design, which allows {low:g}"
    if one.maximum is not None and one.maximum < high - slack:
        yield f"maximum {one.maximum:g} is tighter than its design, which allows {high:g}"


def _width_faults(one: ConstantLimits, width: float | None) -> Iterable[str]:
    nominal = one.nominal or 0.0
    low = one.minimum if one.minimum is not None else None if width is None else nominal - width
    high = one.maximum if one.maximum is not None else None if width is None else nominal + width
    if low is None or high is None:
        return
    guard = one.guard_band
    if guard.per in ("unit", "nominal") and one.rule != "simple":
        band = guard.in_unit(nominal, None, None) or 0.0
        if 2.0 * band >= high - low:
            yield f"guard_band {band:g} leaves nothing of the tolerance {low:g} to {high:g}"
    for margin in one.margins:
        size = margin.in_unit(nominal, None, None) if margin.per in ("unit", "nominal") else None
        if size is not None and size > high - low:
            yield f"equivalence_margin {size:g} is wider than the tolerance itself"
