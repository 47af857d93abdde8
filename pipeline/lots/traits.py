"""What motors show or do not show: effects of a diagnosis, cogging orders, failed checks.

A share of motors is compared by Fisher's exact test, Holm over all traits of one source. Reference:
A. Agresti, Categorical Data Analysis, 3rd ed., 2013, 3.5.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from pipeline.lots.lot_test import holm
from pipeline.lots.sample import Member
from pipeline.records.diagnosis_summary import DiagnosisSummary
from pipeline.records.lot_constant import Side, Verdict
from pipeline.records.lot_regression import EffectChange

ALPHA = 0.01
MOST = 0.5
WAVE = re.compile("(?:sin|cos)_([0-9]+)_nm")
SPECTRUM = "cogging_amplitude_nm"
NO_COGGING = "no cogging found"
Source = Literal["diagnosis", "datasheet"]


@dataclass(frozen=True, slots=True)
class Shown:
    """What one motor shows: traits with their size; `side` and `lot` as in the comparison."""

    motor_id: str
    lot: str
    side: Side
    sizes: Mapping[str, float | None]
    units: Mapping[str, str] = field(default_factory=dict)


def order_name(order: int) -> str:
    """The name of a cogging order as a trait.

    Parameters
    ----------
    order
        Cycles a turn.

    """
    return f"cogging_order_{order}"


def orders_shown(members: Iterable[Member], share: float) -> list[Shown]:
    """Cogging orders of each motor's datasheet, the small ones left out.

    Parameters
    ----------
    members
        Datasheets; those that were not tested for cogging are left out.
    share
        Least amplitude, of the median over the motors of the leading order's [1].

    Returns
    -------
    list of Shown
        Sizes are amplitudes [N·m].

    """
    spectra: list[tuple[Member, dict[int, float]]] = []
    for member in members:
        estimate = member.sheet.constants.get(SPECTRUM)
        if member.side is None or estimate is None:
            continue
        if estimate.known or estimate.note.startswith(NO_COGGING):
            spectra.append((member, {one.order: one.amplitude for one in estimate.orders}))
    leading = [max(sizes.values()) for _, sizes in spectra if sizes]
    least = share * float(np.median(leading)) if leading else 0.0
    return [
        Shown(
            member.sheet.motor_id,
            member.lot,
            member.side,
            {order_name(order): size for order, size in sizes.items() if size >= least},
            {order_name(order): "N·m" for order in sizes},
        )
        for member, sizes in spectra
        if member.side is not None
    ]


def checks_failed(members: Iterable[Member]) -> list[Shown]:
    """The checks that the datasheet of each motor fails.

    Parameters
    ----------
    members
        Datasheets.

    Returns
    -------
    list of Shown
        One a motor; members without a side are left out.

    """
    return [
        Shown(
            member.sheet.motor_id,
            member.lot,
            member.side,
            {f"check {c.name}": None for c in member.sheet.checks if c.status == "fail"},
        )
        for member in members
        if member.side is not None
    ]


def effects_shown(
    members: Iterable[Member], diagnoses: Mapping[str, DiagnosisSummary]
) -> list[Shown]:
    """The effects that each diagnosed motor's model lacks.

    Parameters
    ----------
    members
        Datasheets.
    diagnoses
        By motor_id; a motor without one, or with too little data for one, is left out.

    Returns
    -------
    list of Shown
        An effect's size is its only parameter, None where it has several; orders of a wave over the
        angle have their amplitude [N·m].

    """
    shown = []
    for member in members:
        diagnosis = diagnoses.get(member.sheet.motor_id)
        if member.side is None or diagnosis is None or diagnosis.verdict == "insufficient":
            continue
        sizes: dict[str, float | None] = {}
        units: dict[str, str] = {}
        for effect in diagnosis.missing:
            parameters = diagnosis.parameters.get(effect, {})
            waves = _orders(parameters)
            # Of several parameters none is the size.
            only = next(iter(parameters.values())) if len(parameters) == 1 else None
            sizes[effect] = None if only is None else only[0]
            units[effect] = "" if only is None else only[1]
            sizes |= {f"{order_name(k)} (diagnosed)": size for k, size in waves.items()}
            units |= {f"{order_name(k)} (diagnosed)": "N·m" for k in waves}
        if diagnosis.verdict == "unknown":
            sizes["unknown structure"] = None
        shown.append(Shown(member.sheet.motor_id, member.lot, member.side, sizes, units))
    return shown


def _orders(parameters: Mapping[str, tuple[float, str]]) -> dict[int, float]:
    """Amplitude by order of an effect that is a sum of waves over the angle [N·m]."""
    amplitudes: dict[int, float] = {}
    for name, (value, _) in parameters.items():
        if match := WAVE.fullmatch(name):
            order = int(match[1])
            amplitudes[order] = math.hypot(amplitudes.get(order, 0.0), value)
    largest = max(amplitudes.values(), default=0.0)
    return {order: size for order, size in amplitudes.items() if size >= 0.1 * largest}


def compare_traits(shown: Sequence[Shown], source: Source) -> tuple[EffectChange, ...]:
    """Every trait that any motor shows, with the verdict on its change.

    Parameters
    ----------
    shown
        What each motor of either side shows.
    source
        Where that comes from.

    Returns
    -------
    tuple of EffectChange
        By name; empty where nothing is shown or a side has no motor.

    Notes
    -----
    Fisher's exact test of the shares of motors, Holm over the traits. A trait is new, and fails,
    where at least half of the candidate's motors show it, in no baseline lot half of them do, and
    the adjusted p value is below `ALPHA`.

    References
    ----------
    A. Agresti, Categorical Data Analysis, 3rd ed., Wiley, 2013, 3.5.

    """
    names = sorted({name for one in shown for name in one.sizes})
    sides = {side: [one for one in shown if one.side == side] for side in ("baseline", "candidate")}
    if not names or not all(sides.values()):
        return ()
    p_values = [_fisher(name, sides["baseline"], sides["candidate"]) for name in names]
    adjusted = holm(p_values)
    return tuple(
        _change(name, source, sides["baseline"], sides["candidate"], p, float(p_holm))
        for name, p, p_holm in zip(names, p_values, adjusted, strict=True)
    )


def _fisher(name: str, base: Sequence[Shown], candidate: Sequence[Shown]) -> float:
    from scipy.stats import fisher_exact

    table = [[sum(name in one.sizes for one in side) for side in (base, candidate)]]
    table.append([len(base) - table[0][0], len(candidate) - table[0][1]])
    return min(float(fisher_exact(table).pvalue), 1.0)


def _change(
    name: str,
    source: Source,
    base: Sequence[Shown],
    candidate: Sequence[Shown],
    p_value: float,
    p_holm: float,
) -> EffectChange:
    before = [one for one in base if name in one.sizes]
    after = [one for one in candidate if name in one.sizes]
    verdict = _verdict(before, after, base, candidate, p_holm)
    more = len(after) * len(base) - len(before) * len(candidate)
    kind = _kind(verdict, more, gone=not after)
    why = f"{kind}: {len(after)} of {len(candidate)} motors, {len(before)} of {len(base)} before"
    unit = next((one.units[name] for one in (*after, *before) if name in one.units), "")
    return EffectChange(
        name,
        source,
        verdict,
        why,
        len(before),
        len(base),
        len(after),
        len(candidate),
        p_value,
        p_holm,
        _mean([one.sizes[name] for one in before]),
        _mean([one.sizes[name] for one in after]),
        unit,
        tuple(sorted(one.motor_id for one in after)),
    )


def _kind(verdict: Verdict, more: int, *, gone: bool) -> str:
    """A verdict in words; `more` is above zero where a larger share of motors shows it now."""
    if verdict == "fail":
        return "new in this lot"
    if verdict == "undecided":
        return "in this lot, and too few motors to decide"
    if more == 0:
        return "as before"
    chance = ", which may be chance" if verdict == "pass" else ""
    if gone:
        return f"no longer there{chance}"
    return f"in {'more' if more > 0 else 'fewer'} motors than before{chance}"


def _verdict(
    before: Sequence[Shown],
    after: Sequence[Shown],
    base: Sequence[Shown],
    candidate: Sequence[Shown],
    p_holm: float,
) -> Verdict:
    """New: most candidate motors show it, no baseline lot mostly does, and it is not chance.

    Lots, not motors, are what differs, so a lot of the baseline that has it makes it old.
    """
    share = len(after) / len(candidate)
    lots = {one.lot for one in base}
    old = any(
        sum(one.lot == lot for one in before) >= MOST * sum(one.lot == lot for one in base)
        for lot in lots
    )
    if p_holm >= ALPHA:
        return "undecided" if share >= MOST and not old and not before else "pass"
    return "fail" if share >= MOST and not old else "marginal"


def _mean(sizes: Sequence[float | None]) -> float | None:
    known = [size for size in sizes if size is not None]
    return float(np.mean(known)) if known else None
