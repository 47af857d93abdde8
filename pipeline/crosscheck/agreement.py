"""Whether the captures of one motor are of one motor: a chi-square test between captures.

For each quantity, readings x_i of single captures have the covariance C of their budgets, in which
instruments that captures share are common and cancel in every difference, and the independent
spread of the method. Of one motor, chi2 = r' C^-1 r with r = x - mean (generalised least squares)
is chi-square distributed with n - 1 degrees of freedom [1]. Where it is too large, the readings
are split at the gap that leaves least chi-square in both parts, again and again until each part
agrees in itself.

Parts are reported only where they can be another motor's: the gap between them is wider than the
parts themselves (else it is a drift), and captures of one way of measuring stand in both (else it
is the way, a convention or a gain, for which there are other checks).

References: [1] A. C. Aitken, Proc. R. Soc. Edinb. 55, 42 (1935); JCGM 100:2008, 5.2.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.records.agreement import Disagreement, Group, Reading
from pipeline.records.capture import Array
from pipeline.records.datasheet import Check
from pipeline.records.finding import Finding
from pipeline.records.naming import counted
from pipeline.records.uncertainty import propagate

CODE = "captures_disagree"
REMEDY = "look at the serial numbers: give each motor its own motor_id, or take the odd files out"
MOST_NAMED = 6


@dataclass(frozen=True, slots=True)
class AgreementPolicy:
    """Choices of judgement.

    `level` [1]: probability of a larger chi-square below which readings disagree; a healthy motor
    is tested on some six quantities, so one in 1,600 would be accused. `link` [1]: how near, in
    logarithm, a reading of another way must be to a group's mean to be counted with that group.
    """

    level: float = 1e-4
    link: float = 0.03


POLICY = AgreementPolicy()


def disagreements(readings: Iterable[Reading]) -> tuple[Disagreement, ...]:
    """Where the captures of one motor disagree, a quantity each.

    Parameters
    ----------
    readings
        Single captures' values of all quantities, above zero.

    Returns
    -------
    tuple of Disagreement
        By quantity; empty where the captures are of one motor.

    Notes
    -----
    With the covariance C of the readings x and their generalised mean m, χ² = (x − m)' C⁻¹ (x − m)
    has n − 1 degrees of freedom. Where its p-value is below `AgreementPolicy.level`, the readings
    are split in two at the gap that leaves least χ² in both parts, again and again until each part
    agrees in itself. Parts that are wider than the gap between them are a drift, not two motors.

    References
    ----------
    A. C. Aitken, Proc. R. Soc. Edinb. 55, 1936, 42, doi:10.1017/S0370164600014346.
    JCGM 100:2008 (GUM), 5.2.

    """
    by_quantity: dict[str, list[Reading]] = {}
    for reading in readings:
        by_quantity.setdefault(reading.quantity, []).append(reading)
    checks = []
    for _, readings_of in sorted(by_quantity.items()):
        groups = max((_clusters(way) for way in _ways(readings_of)), key=len, default=[])
        if len(groups) > 1:
            checks.append(_disagreement(readings_of, groups))
    return tuple(checks)


def _ways(readings: Sequence[Reading]) -> list[list[Reading]]:
    """Readings of one way each, the way of most captures first, each in order of value."""
    ways: dict[tuple[str, ...], list[Reading]] = {}
    for reading in readings:
        ways.setdefault(reading.way, []).append(reading)
    ordered = sorted(ways.items(), key=lambda item: (-len(item[1]), item[0]))
    return [sorted(part, key=lambda r: (r.value, r.path)) for _, part in ordered]


def _clusters(readings: list[Reading]) -> list[list[Reading]]:
    """Readings, in order of value, as groups that agree in themselves; one where they all do.

    Two neighbouring groups that are wider than the gap between them are one group that drifts.
    """
    if len(readings) < 2 or _p_value(readings) >= POLICY.level:
        return [readings]
    cut = _best_cut(readings)
    low, high = readings[:cut], readings[cut:]
    gap = math.log(high[0].value / low[-1].value)
    if gap < max(_width(low), _width(high)) and len(readings) > 2:
        finer = [_clusters(low), _clusters(high)]
        return [readings] if max(map(len, finer)) == 1 else [*finer[0], *finer[1]]
    return [*_clusters(low), *_clusters(high)]


def _width(readings: Sequence[Reading]) -> float:
    return math.log(readings[-1].value / readings[0].value)


def _best_cut(readings: Sequence[Reading]) -> int:
    """Where two parts leave least chi-square, shared gains left aside, which cancel in both."""
    values = np.array([r.value for r in readings])
    weights = 1.0 / np.diag(_covariance(readings, shared=False))
    sums = [np.concatenate([[0.0], np.cumsum(weights * values**k)]) for k in (0, 1, 2)]

    def left(begin: int, end: int) -> float:
        w, wx, wxx = (s[end] - s[begin] for s in sums)
        return float(wxx - wx * wx / w)

    n = len(readings)
    return min(range(1, n), key=lambda cut: left(0, cut) + left(cut, n))


def _p_value(readings: Sequence[Reading]) -> float:
    """Probability that readings of one motor differ by as much."""
    from scipy.special import chdtrc

    _, _, chi2 = _mean(readings)
    return float(chdtrc(len(readings) - 1, chi2))


def _mean(readings: Sequence[Reading]) -> tuple[float, float, float]:
    """Generalised mean, its standard uncertainty [unit] and chi-square."""
    values = np.array([r.value for r in readings])
    inverse = np.linalg.inv(_covariance(readings))
    weight = float(inverse.sum())
    mean = float(inverse.sum(axis=0) @ values) / weight
    residuals = values - mean
    return mean, 1.0 / math.sqrt(weight), float(residuals @ inverse @ residuals)


def _covariance(readings: Sequence[Reading], *, shared: bool = True) -> Array:
    """Covariance [n, n, unit²] of budgets and methods."""
    parts = [{part.source: part.u for part in propagate([(1.0, r.budget)])} for r in readings]
    sources = sorted({source for shares in parts for source in shares})
    common = [s for s in sources if sum(s in shares for shares in parts) == len(parts) > 1]
    used = sources if shared else [s for s in sources if s not in common]
    table = np.array([[shares.get(source, 0.0) for source in used] for shares in parts])
    spread = np.array([r.u_rel_model * r.value for r in readings])
    covariance: Array = table.reshape(len(parts), -1) @ table.reshape(len(parts), -1).T
    return covariance + np.diag(spread**2)


def _disagreement(readings: Sequence[Reading], groups: list[list[Reading]]) -> Disagreement:
    """The groups of one way, joined by the readings of other ways that lie near one of them."""
    p_value = _p_value([r for part in groups for r in part])
    means = [_mean(part)[:2] for part in groups]
    joined: list[set[str]] = [{r.path for r in part} for part in groups]
    placed = set().union(*joined)
    for reading in readings:
        nearest = sorted((abs(math.log(reading.value / m[0])), n) for n, m in enumerate(means))
        if reading.path not in placed and nearest[0][0] < min(POLICY.link, 0.5 * nearest[1][0]):
            joined[nearest[0][1]].add(reading.path)
    apart = [Group(tuple(sorted(paths)), *mean) for paths, mean in zip(joined, means, strict=True)]
    apart.sort(key=lambda group: (-len(group.paths), group.paths))
    tied = len(apart[0].paths) == len(apart[1].paths)
    return Disagreement(
        readings[0].quantity, readings[0].unit, apart[0], tuple(apart[1:]), p_value, tied
    )


def parties(disagreements: Sequence[Disagreement]) -> tuple[list[str], list[str]]:
    """The captures of the usual motor and the odd ones, over all quantities.

    Parameters
    ----------
    disagreements
        Disagreements of one motor.

    Returns
    -------
    usual, odd
        Paths, each sorted, none in both.

    Notes
    -----
    Larger groups decide; a quantity whose groups are of one size goes by the captures that it
    shares with the others. With nothing to go by the odd ones are those that come later by name.

    """
    odd: set[str] = set()
    usual: set[str] = set()
    for one in sorted(disagreements, key=lambda one: one.tied):
        mine, others = set(one.usual.paths), set(one.odd_paths)
        as_it_is = len(mine & usual) + len(others & odd)
        exchanged = len(mine & odd) + len(others & usual)
        if one.tied and exchanged > as_it_is:
            mine, others = others, mine
        usual |= mine
        odd |= others
    return sorted(usual - odd), sorted(odd)


def suspects(disagreements: Sequence[Disagreement]) -> str:
    """Which files are of another motor, in words.

    Parameters
    ----------
    disagreements
        Disagreements, at least one.

    """
    usual, odd = parties(disagreements)
    if all(one.tied for one in disagreements):
        return f"{_named(usual)} against {_named(odd)}: of two motors?"
    agree = "agree with each other and not" if len(odd) > 1 else "does not agree"
    rest = f"with the other {len(usual)}" if len(usual) > 1 else f"with {usual[0]}"
    return f"{_named(odd)} ({counted(len(odd), 'file')}) {agree} {rest}: of another motor?"


def _named(paths: Sequence[str]) -> str:
    named = ", ".join(paths[:MOST_NAMED])
    more = len(paths) - MOST_NAMED
    return f"{named} and {counted(more, 'more file')}" if more > 0 else named


def describe(one: Disagreement) -> str:
    """One quantity of groups of captures in words, with k = 2.

    Parameters
    ----------
    one
        Its disagreement.

    """
    groups = [
        f"{g.mean:.5g} ± {2.0 * g.u:.2g} in {counted(len(g.paths), 'file')}"
        for g in (one.usual, *one.odd)
    ]
    unit = f" [{one.unit}]" if one.unit != "1" else ""
    return f"{one.quantity}{unit} is {' but '.join(groups)} (k=2)"


def findings(disagreements: Sequence[Disagreement]) -> tuple[Finding, ...]:
    """One warning that names the odd files and every quantity in which they differ.

    Parameters
    ----------
    disagreements
        Disagreements.

    Returns
    -------
    tuple of Finding
        Empty where there is none.

    """
    if not disagreements:
        return ()
    words = f"{suspects(disagreements)} {'; '.join(map(describe, disagreements))}"
    return (Finding(parties(disagreements)[1][0], "warning", CODE, words, REMEDY),)


def failing(name: str, concerned: Sequence[Disagreement]) -> Check:
    """The check whose constants come from captures that disagree: it has two motors to judge.

    Parameters
    ----------
    name
        Of the check.
    concerned
        Disagreements in quantities that the check rests on, one or more.

    Returns
    -------
    Check
        Failed. `value` is the ratio of two groups' means that is farthest from 1, `limit` the
        largest deviation from 1 that captures of one motor show (k = 3).

    """

    def ratio(one: Disagreement) -> tuple[float, float]:
        worst = max(one.odd, key=lambda group: abs(math.log(group.mean / one.usual.mean)))
        value = worst.mean / one.usual.mean
        u = value * math.hypot(worst.u / worst.mean, one.usual.u / one.usual.mean)
        return value, 3.0 * u

    value, limit = max(map(ratio, concerned), key=lambda pair: abs(math.log(pair[0])))
    words = f"its captures disagree: {'; '.join(map(describe, concerned))}"
    return Check(name, "fail", words, value, limit, "1", suspects(concerned))
