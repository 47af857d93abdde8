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
    messages = list(_rules(limits))
    for name, count in Counter(limits.golden).items():
        if count > 1:
            messages.append(f"golden: {name} is there {count} times")
    for one in limits.constants:
        if one.name not in terms:
            messages.append(f"{one.name}: no such constant; docs/glossary.md lists them")
            continue
        messages += [f"{one.name}: {fault}" for fault in _constant(one, terms[one.name])]
    return tuple(messages)


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


def _constant(limits: ConstantLimits, term: Term) -> Iterable[str]:
    yield from _sizes(limits)
    low, high = limits.minimum, limits.maximum
    if low is not None and high is not None and low >= high:
        yield f"minimum {low:g} is not below maximum {high:g}"
    if limits.nominal is None:
        return
    yield from _plausible(limits, term)
    if limits.tolerance is None or limits.tolerance.per not in ("unit", "nominal"):
        width = None
    else:
        width = limits.tolerance.in_unit(limits.nominal, None, None)
    yield from _tighter(limits, width or 0.0)
    yield from _width_faults(limits, width)


def _sizes(limits: ConstantLimits) -> Iterable[str]:
    if limits.tolerance is not None and limits.tolerance.value <= 0.0:
        yield "tolerance is not positive"
    if limits.tolerance is not None and limits.tolerance.per == "U":
        yield "tolerance counts in U: a worse bench would pass more motors"
    if limits.guard_band.value < 0.0:
        yield "guard_band is negative: it would accept motors outside the tolerance"
    if any(margin.value <= 0.0 for margin in limits.margins):
        yield "equivalence_margin is not positive"
    if limits.tolerate and not limits.margins:
        yield "tolerate_within_margin needs an equivalence_margin"


def _plausible(limits: ConstantLimits, term: Term) -> Iterable[str]:
    nominal = limits.nominal or 0.0
    low = -math.inf if term.low is None else term.low
    high = math.inf if term.high is None else term.high
    if not low <= nominal <= high:
        yield f"nominal {nominal:g} {term.unit} is beyond what the glossary takes for plausible"
    for word, limit in (("minimum", limits.minimum), ("maximum", limits.maximum)):
        beyond = limit is not None and (limit > nominal if word == "minimum" else limit < nominal)
        if beyond:
            yield f"{word} {limit:g} leaves the nominal {nominal:g} outside"


def _tighter(limits: ConstantLimits, width: float) -> Iterable[str]:
    """Test limits inside the design's own range."""
    if width == 0.0 or limits.nominal is None:
        return
    slack = 1e-12 * abs(limits.nominal)
    low, high = limits.nominal - width, limits.nominal + width
    if limits.minimum is not None and limits.minimum > low + slack:
        yield f"minimum {limits.minimum:g} is tighter than its design, which allows {low:g}"
    if limits.maximum is not None and limits.maximum < high - slack:
        yield f"maximum {limits.maximum:g} is tighter than its design, which allows {high:g}"


def _width_faults(limits: ConstantLimits, width: float | None) -> Iterable[str]:
    nominal = limits.nominal or 0.0
    low = (
        limits.minimum if limits.minimum is not None else None if width is None else nominal - width
    )
    high = (
        limits.maximum if limits.maximum is not None else None if width is None else nominal + width
    )
    if low is None or high is None:
        return
    guard = limits.guard_band
    if guard.per in ("unit", "nominal") and limits.rule != "simple":
        band = guard.in_unit(nominal, None, None) or 0.0
        if 2.0 * band >= high - low:
            yield f"guard_band {band:g} leaves nothing of the tolerance {low:g} to {high:g}"
    for margin in limits.margins:
        size = margin.in_unit(nominal, None, None) if margin.per in ("unit", "nominal") else None
        if size is not None and size > high - low:
            yield f"equivalence_margin {size:g} is wider than the tolerance itself"
