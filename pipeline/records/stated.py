"""Constants that are stated: on a nameplate, a maker's datasheet, another bench."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping

from pipeline.physics.glossary import CONSTANTS, METADATA
from pipeline.records.capture import Campaign
from pipeline.records.estimate import Estimate
from pipeline.records.parse import number
from pipeline.records.uncertainty import type_b

METHOD = "stated"
UNSTATED_SHARE = 0.05
"""Relative standard uncertainty of a constant that is stated without one; chosen: makers of small
motors commonly promise their constants within 10 %, which is taken as two standard ones."""
EXACT_SHARE = 1e-6
"""Least relative standard uncertainty of a stated constant; chosen: no instrument is as good, and a
prior of none at all has no weight that could be computed with."""


def may_be_stated(name: str) -> bool:
    """Whether a key may state a constant: one of the glossary that is no metadata key as well.

    Parameters
    ----------
    name
        The key.

    """
    return name in CONSTANTS and name not in METADATA


def number_wanted(key: str, value: float | None) -> str | None:
    """What a stated number should be, in words; None where it is.

    Parameters
    ----------
    key
        `NAME` or `u_NAME` of a constant that may be stated.
    value
        What is stated [the constant's unit]; None where it is no number.

    Returns
    -------
    str or None
        The glossary's range of the constant; an uncertainty is from 0 on.

    """
    name = key.removeprefix("u_")
    term = CONSTANTS[name]
    low, high = (term.low, term.high) if key == name else (0.0, None)
    low, high = -math.inf if low is None else low, math.inf if high is None else high
    if value is not None and math.isfinite(value) and low <= value <= high:
        return None
    return f"number from {low:g} to {high:g} [{term.unit}]"


def stated_constants(campaign: Campaign) -> tuple[Estimate, ...]:
    """Each stated constant as an estimate of status `stated`.

    Parameters
    ----------
    campaign
        All captures of one motor, and what the configuration states.

    Returns
    -------
    tuple of Estimate
        By name, with a type B contribution.

    Notes
    -----
    `NAME` is its value and `u_NAME` its standard uncertainty, both in the constant's unit. What the
    configuration says goes before what captures say; of captures that differ the most frequent pair
    counts. Without `u_NAME` it is `UNSTATED_SHARE` of the value; it is at least `EXACT_SHARE`.

    """
    estimates = []
    names = {key for c in campaign.captures for key in c.meta.extra} | set(campaign.stated)
    for name in sorted(filter(may_be_stated, names)):
        paths: tuple[str, ...] = ()
        if name in campaign.stated:
            stated = campaign.stated[name], campaign.stated.get(f"u_{name}")
        else:
            pairs = {c.path: _pair(c.meta.extra, name) for c in campaign.captures}
            counts = Counter(pair for pair in pairs.values() if pair is not None)
            if not counts:
                continue
            stated = max(counts, key=counts.__getitem__)
            paths = tuple(path for path, pair in pairs.items() if pair == stated)
        estimates.append(_estimate(name, *stated, paths))
    return tuple(estimates)


def _pair(extra: Mapping[str, str], name: str) -> tuple[float, float | None] | None:
    value = number(extra.get(name, ""))
    return None if value is None else (value, number(extra.get(f"u_{name}", "")))


def _estimate(name: str, value: float, u: float | None, captures: tuple[str, ...]) -> Estimate:
    note = "" if u is not None else f"u_{name} is not stated, taken as {UNSTATED_SHARE:.0%}"
    size = abs(value)
    spread = UNSTATED_SHARE * size if u is None else max(u, EXACT_SHARE * size)
    budget = type_b(f"stated:{name}", spread)
    unit = CONSTANTS[name].unit
    return Estimate(name, value, unit, "stated", METHOD, budget, captures=captures, note=note)
