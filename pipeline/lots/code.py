"""The same captures under two versions of the pipeline, so that the new one can be approved.

Nothing was measured again, so only the method can differ; each change is held against the
standard uncertainty that the old version stated. A change below a third of u hardly widens it (5 %
if it were added in squares); one above u says that one of the two versions is wrong by its own
account.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from pipeline.lots.capability import NONE as NO_CAPABILITY
from pipeline.lots.equivalence import NOT_EVALUATED
from pipeline.lots.regression import used
from pipeline.lots.sample import Member
from pipeline.lots.verdict import overall
from pipeline.physics.glossary import Term
from pipeline.physics.notation import MINUS
from pipeline.records.estimate import Estimate
from pipeline.records.limits import Limits
from pipeline.records.lot_constant import (
    Conformity,
    ConstantResult,
    Count,
    Decision,
    EffectSize,
    LotTest,
    MotorValue,
    Power,
    Verdict,
)
from pipeline.records.lot_regression import EffectChange, Group, LotRegression
from pipeline.records.naming import counted

U_RATIO = 2.0
# Relative; another order of the same sums.
ROUNDING = 1e-9


class Pair(NamedTuple):
    """One motor's datasheet under the old and under the new version."""

    before: Member
    after: Member


class Change(NamedTuple):
    """One motor's change of a constant: in units of the old u, with the decision on it."""

    motor_id: str
    difference: float
    in_u: float
    decision: Decision


def compare_versions(
    pairs: Sequence[Pair],
    groups: tuple[Group, Group],
    limits: Limits,
    terms: Mapping[str, Term],
    notes: Sequence[str] = (),
) -> LotRegression:
    """The same captures under two versions of the code: which constants and checks changed.

    Parameters
    ----------
    pairs
        Datasheets of one motor each, under the old and the new version.
    groups
        What the report says of either side.
    limits
        `code_negligible` and `code_limit`: changes [in units of the old u] up to which a constant
        passes, and above which it fails.
    terms
        Unit and words of each constant.
    notes
        Remarks to pass on.

    Returns
    -------
    LotRegression
        Of mode `code`.

    Notes
    -----
    A change is (new − old)/u_old. Only the method can differ, so no statistics enter. A constant
    also fails where the new version no longer gives it, and is marginal where its u became
    `U_RATIO` times larger or smaller.

    """
    names = sorted({n for pair in pairs for m in pair for n in m.sheet.constants})
    constants = tuple(_constant(name, pairs, limits, terms) for name in names)
    constants = tuple(one for one in constants if one.motors or one.missing)
    effects = _checks(pairs)
    verdict, reasons = overall(constants, effects)
    everything: tuple[ConstantResult | EffectChange, ...] = (*constants, *effects)
    failed = [one.name for one in everything if one.verdict == "fail"]
    words = {
        "pass": "gives the same datasheets",
        "marginal": "gives the same datasheets, with remarks",
        "fail": f"does not give the same datasheets: {', '.join(failed)}",
    }.get(verdict, "could not be compared")
    codes = ", ".join(groups[1].code_versions)
    return LotRegression(
        mode="code",
        verdict=verdict,
        headline=f"Code {codes} {words} ({counted(len(pairs), 'motor')})",
        reasons=reasons,
        history="sufficient",
        baseline=groups[0],
        candidate=groups[1],
        limits=used(limits),
        constants=constants,
        effects=effects,
        notes=tuple(notes),
    )


@dataclass(slots=True)
class _Seen:
    """What became of one constant over all motors."""

    changes: list[Change] = field(default_factory=list)
    motors: list[MotorValue] = field(default_factory=list)
    lost: list[str] = field(default_factory=list)
    gained: list[str] = field(default_factory=list)
    wider: list[str] = field(default_factory=list)

    def take(self, name: str, pair: Pair, limits: Limits) -> None:
        """Adds one motor."""
        before, after = (member.sheet.constants.get(name) for member in pair)
        motor_id = pair.after.sheet.motor_id
        if before is None or not before.known:
            if after is not None and after.known:
                self.gained.append(motor_id)
            return
        if after is None or not after.known:
            self.lost.append(motor_id)
            return
        change = _change(pair, before, after, limits)
        self.changes.append(change)
        if before.u > 0.0 and not 1.0 / U_RATIO <= after.u / before.u <= U_RATIO:
            self.wider.append(f"{motor_id} {after.u / before.u:.3g} times")
        self.motors += [
            _motor(pair.before, before, None, "not_evaluated"),
            _motor(pair.after, after, change, change.decision),
        ]

    @property
    def worst(self) -> Change | None:
        """The largest change in units of the old u."""
        return max(self.changes, key=lambda change: abs(change.in_u), default=None)

    def conformity(self) -> Conformity:
        """Motors by the decision on their change."""
        decisions: tuple[Decision, ...] = ("fail", "conditional_pass", "pass")
        counts = tuple(
            Count(d, n)
            for d in decisions
            if (n := sum(change.decision == d for change in self.changes))
        )
        worst = self.worst
        named = None if worst is None or worst.decision == "pass" else worst.motor_id
        return Conformity(counts, counts[0].decision if counts else "not_evaluated", named)


def _constant(
    name: str, pairs: Sequence[Pair], limits: Limits, terms: Mapping[str, Term]
) -> ConstantResult:
    seen = _Seen()
    for pair in pairs:
        seen.take(name, pair, limits)
    verdict, why = _verdict(seen, limits)
    worst, term = seen.worst, terms.get(name)
    in_u = None if worst is None or math.isinf(worst.in_u) else worst.in_u
    return ConstantResult(
        name=name,
        unit=term.unit if term else "1",
        words=term.words if term else name,
        verdict=verdict,
        why=why,
        decides=True,
        temperature_degc=None,
        motors=tuple(seen.motors),
        lots=(),
        bounds=None,
        conformity=seen.conformity(),
        test=LotTest("not_evaluated", 0, 0),
        equivalence=NOT_EVALUATED,
        effect=EffectSize(worst.difference if worst else None, in_sd=in_u),
        power=Power("none"),
        capability=NO_CAPABILITY,
        missing=(*(f"{m}: lost" for m in seen.lost), *(f"{m}: new" for m in seen.gained)),
    )


def _change(pair: Pair, before: Estimate, after: Estimate, limits: Limits) -> Change:
    difference = after.number - before.number
    u = before.u
    if abs(difference) <= ROUNDING * abs(before.number):
        in_u = 0.0
    else:
        in_u = difference / u if u > 0.0 else math.copysign(math.inf, difference)
    decision: Decision = "fail"
    if abs(in_u) <= limits.code_negligible:
        decision = "pass"
    elif abs(in_u) <= limits.code_limit:
        decision = "conditional_pass"
    return Change(pair.after.sheet.motor_id, difference, in_u, decision)


def _motor(
    member: Member, estimate: Estimate, change: Change | None, decision: Decision
) -> MotorValue:
    """A motor's value; `z` of a candidate is its change in units of the old u."""
    z = None if change is None or math.isinf(change.in_u) else change.in_u
    return MotorValue(
        member.sheet.motor_id,
        member.lot,
        member.side or "baseline",
        tuple(sorted({c.station for c in member.sheet.captures if c.station})),
        estimate.number,
        estimate.u,
        0.0,
        decision,
        z,
        False,
        estimate.captures[0] if estimate.captures else None,
    )


def _verdict(seen: _Seen, limits: Limits) -> tuple[Verdict, str]:
    if seen.lost:
        return "fail", f"{counted(len(seen.lost), 'motor')} lost it, {seen.lost[0]} first"
    worst, wider = seen.worst, seen.wider
    if worst is None:
        return "not_evaluated", "only the new version gives it"
    size = (
        "without a stated u"
        if math.isinf(worst.in_u)
        else f"{worst.in_u:+.3g} u".replace("-", MINUS)
    )
    words = f"largest change {size} ({worst.motor_id})"
    if worst.decision == "fail":
        return "fail", f"{words}, above {limits.code_limit:g} u"
    if worst.decision == "conditional_pass":
        return "marginal", f"{words}, above {limits.code_negligible:.3g} u"
    if wider:
        return "marginal", f"{words}, but its u changed: {', '.join(wider[:3])}"
    return "pass", words


def _checks(pairs: Sequence[Pair]) -> tuple[EffectChange, ...]:
    """Checks whose status changed for the worse or the better, by name."""
    before: dict[str, set[str]] = {}
    after: dict[str, set[str]] = {}
    for pair in pairs:
        for member, motors_by_check in ((pair.before, before), (pair.after, after)):
            for check in member.sheet.checks:
                if check.status == "fail":
                    motors_by_check.setdefault(check.name, set()).add(member.sheet.motor_id)
    changed = []
    for name in sorted({*before, *after}):
        old, new = before.get(name, set()), after.get(name, set())
        if old == new:
            continue
        worse = sorted(new - old)
        verdict: Verdict = "fail" if worse else "marginal"
        why = (
            f"failing it now: {counted(len(worse), 'motor')}, {', '.join(worse[:5])}"
            if worse
            else f"no longer failing it: {counted(len(old - new), 'motor')}"
        )
        counts, motors = (len(old), len(pairs), len(new), len(pairs)), tuple(sorted(new))
        changed.append(
            EffectChange(f"check {name}", "datasheet", verdict, why, *counts, motors=motors)
        )
    return tuple(changed)
