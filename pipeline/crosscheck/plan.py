"""What to record next: the tests that resolve most of what a datasheet leaves open."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Literal

from pipeline.physics.glossary import CONSTANTS, TESTS
from pipeline.physics.notation import significant
from pipeline.records.datasheet import Check
from pipeline.records.estimate import Estimate
from pipeline.records.model_verdict import ModelVerdict

DoubtKind = Literal[
    "failed", "missing", "assumed", "at_bound", "uncertain", "not_evaluated", "unseen"
]

# How much one doubt weighs: what keeps a datasheet from its release before what would adorn it.
WEIGHTS: dict[DoubtKind, float] = {
    "failed": 4.0,
    "missing": 1.0,
    "assumed": 1.0,
    "at_bound": 1.0,
    "uncertain": 0.5,
    "not_evaluated": 0.5,
    "unseen": 0.25,
}
REQUIRED = 3.0
ASSUMED = "assumed:"


@dataclass(frozen=True, slots=True)
class Way:
    """How constants can be had: what an estimator declares, without the estimator.

    Attributes
    ----------
    gives
        The constants.
    tests
        Tests that it can use.
    experiment
        The test to record, in words.
    uses
        Constants that it needs, all of them.
    either
        Constants of which it needs one.

    """

    gives: tuple[str, ...]
    tests: tuple[str, ...]
    experiment: str
    uses: tuple[str, ...] = ()
    either: tuple[str, ...] = ()

    def wanting(self, known: Known) -> list[str]:
        """Constants that a way needs and that are missing.

        Parameters
        ----------
        known
            What is known of the motor.

        Returns
        -------
        list of str
            Empty where it can be gone.

        """
        missing = [name for name in self.uses if _is_missing(known, name)]
        if all(_is_missing(known, name) for name in self.either):
            missing += self.either
        return missing

    @property
    def computes(self) -> bool:
        """Whether it reads no test of its own but other constants: any test will do for it."""
        return bool(self.uses) and not set(TESTS) - set(self.tests)


@dataclass(frozen=True, slots=True)
class Known:
    """What is there of one motor: a constant a name, its checks, the tests recorded of it, and what
    the residual test of a run came to.
    """

    motor_id: str
    constants: Mapping[str, Estimate]
    checks: tuple[Check, ...]
    tests: frozenset[str]
    model: ModelVerdict | None = None


@dataclass(frozen=True, slots=True)
class Doubt:
    """One thing that is open: a constant or a check, why, and the tests that could settle it."""

    kind: DoubtKind
    name: str
    words: str
    tests: frozenset[str]
    weight: float


@dataclass(frozen=True, slots=True)
class Step:
    """One test to record, with the doubts that no earlier step settles."""

    test: str
    again: bool
    doubts: tuple[Doubt, ...]
    experiments: tuple[str, ...]

    @property
    def weight(self) -> float:
        """How much it resolves."""
        return sum(doubt.weight for doubt in self.doubts)


@dataclass(frozen=True, slots=True)
class Plan:
    """Steps, the most informative first, and what no capture will settle.

    `model` says in lines what the model lacks, which command adds it, and what would separate it
    from what else it could be.
    """

    motor_id: str
    steps: tuple[Step, ...]
    beyond: tuple[Doubt, ...] = ()
    model: tuple[str, ...] = ()

    def text(self) -> str:
        """The plan in words, one test a paragraph."""
        head = [f"{self.motor_id}: {line}" for line in self.model]
        if not self.steps and not self.beyond:
            return "\n".join(
                head or [f"{self.motor_id}: nothing is missing and nothing is in doubt"]
            )
        lines = head
        if self.steps:
            lines.append(f"{self.motor_id}: what to record next, the most informative first")
        for number, step in enumerate(self.steps, 1):
            again = ", again" if step.again else ""
            lines += ["", f"{number}. {step.test}{again}: {TESTS.get(step.test, '')}"]
            lines += [f"   how: {experiment}" for experiment in step.experiments]
            lines += _reasons(step)
        if self.beyond:
            lines += ["", "what no further capture settles"]
            lines += [f"   {doubt.name}: {doubt.words}" for doubt in self.beyond]
        return "\n".join(lines)


def _reasons(step: Step) -> list[str]:
    """One line a reason, for all doubts that share it; what `how` states is not repeated."""
    names: dict[str, list[str]] = {}
    for doubt in step.doubts:
        covered = doubt.words in step.experiments
        names.setdefault("" if covered else doubt.words, []).append(doubt.name)
    return [
        f"   for {', '.join(tests)}" + (f": {words}" if words else "")
        for words, tests in names.items()
    ]


@dataclass(frozen=True, slots=True)
class Aims:
    """What a datasheet is to reach.

    Attributes
    ----------
    required
        Constants that it must hold.
    u_rel
        Relative standard uncertainty that a constant must not exceed [1].
    u_rel_of
        The same for single constants.
    u_of
        Standard uncertainty [the constant's unit] for constants that are zero in a sound motor.

    """

    required: frozenset[str] = frozenset()
    u_rel: float = 0.02
    u_rel_of: Mapping[str, float] = field(default_factory=dict)
    u_of: Mapping[str, float] = field(default_factory=dict)


def make_plan(
    known: Known, ways: Iterable[Way], check_tests: Mapping[str, tuple[str, ...]], aims: Aims
) -> Plan:
    """Tests in the order in which they resolve most, each counted for what is left by then.

    Parameters
    ----------
    known
        Constants, checks and recorded tests of one motor.
    ways
        Estimators: what each gives, from which tests, with which constants.
    check_tests
        The tests that each check rests on, by its name.
    aims
        Constants that are required, and uncertainties that are wanted.

    Returns
    -------
    Plan
        Steps, and the doubts that no test settles.

    Notes
    -----
    A greedy cover: the test with the largest weight of doubts comes first, its doubts are taken
    off, and so on. Ties go to a test not yet recorded, then by name.

    References
    ----------
    V. Chvátal, Math. Oper. Res. 4(3), 1979, 233 (how near to the best a greedy cover comes),
    doi:10.1287/moor.4.3.233.

    """
    options = tuple(ways)
    doubts = [
        *_constants_in_doubt(known, options, aims),
        *_checks_in_doubt(known, options, check_tests),
        *_not_shown(known),
    ]
    open_doubts = [doubt for doubt in doubts if doubt.tests]
    steps: list[Step] = []
    while open_doubts:
        weights: dict[str, float] = {}
        for doubt in open_doubts:
            for test in doubt.tests:
                weights[test] = weights.get(test, 0.0) + doubt.weight
        best = min(weights, key=lambda test: (-weights[test], test in known.tests, test))
        settled = [doubt for doubt in open_doubts if best in doubt.tests]
        steps.append(_step(best, settled, known, options))
        open_doubts = [doubt for doubt in open_doubts if best not in doubt.tests]
    beyond = tuple(doubt for doubt in doubts if not doubt.tests)
    return Plan(known.motor_id, tuple(steps), beyond, _model_lines(known))


def _not_shown(known: Known) -> list[Doubt]:
    """Effects that the motor may have and that no capture would show."""
    unseen = () if known.model is None else known.model.unexcited
    return [
        Doubt("unseen", one.effect, one.words, frozenset(one.tests), WEIGHTS["unseen"])
        for one in unseen
    ]


def _model_lines(known: Known) -> tuple[str, ...]:
    """What the model lacks, the command that follows, and what would part it from the likes."""
    model = known.model
    if model is None or not model.tested or model.passed:
        return ()
    does = "adds it" if model.missing else "tells more"
    command = model.adding() or model.command(known.motor_id)
    return (
        f"{model.headline()}; `{command}` {does}",
        *(
            f"{name} could as well be {', '.join(one.confused_with)}: {one.experiment}"
            for name, one in model.missing.items()
            if one.confused_with
        ),
    )


def _step(test: str, doubts: list[Doubt], known: Known, ways: tuple[Way, ...]) -> Step:
    names = {doubt.name for doubt in doubts}
    measuring = [way for way in ways if test in way.tests and not way.computes]
    informative = [way for way in measuring if names & set(way.gives)] or measuring[:1]
    experiments = tuple(dict.fromkeys(way.experiment for way in informative))
    ordered = sorted(doubts, key=lambda doubt: (-doubt.weight, doubt.name))
    return Step(test, test in known.tests, tuple(ordered), experiments)


def settling_tests(constant: str, known: Known, ways: tuple[Way, ...]) -> frozenset[str]:
    """The tests that could give a constant, or give it better.

    Parameters
    ----------
    constant
        Its name.
    known
        What is there of the motor.
    ways
        Estimators.

    Returns
    -------
    frozenset of str
        Tests; empty where no way leads to the constant.

    Notes
    -----
    A way that has not been tried counts with all its tests. One that was tried and wants constants
    that are missing counts with the tests for those; one that had all it wants counts with its
    tests again, those not yet recorded where there are any. A way that only computes counts with
    the tests of what it computes from.

    """
    return _settling(constant, known, ways, frozenset())


def _settling(
    constant: str, known: Known, ways: tuple[Way, ...], above: frozenset[str]
) -> frozenset[str]:
    fresh: set[str] = set()
    repeats: set[str] = set()
    for way in ways:
        if constant not in way.gives:
            continue
        deeper = above | {constant}
        wanting = [name for name in way.wanting(known) if name not in deeper]
        if way.computes and not wanting:
            wanting = [n for n in way.uses if n not in deeper]
        tried = bool(known.tests & set(way.tests))
        if way.computes or (tried and wanting):
            for name in wanting:
                fresh |= _settling(name, known, ways, deeper)
        elif tried:
            fresh |= set(way.tests) - known.tests
            repeats |= set(way.tests) & known.tests
        else:
            fresh |= set(way.tests)
    return frozenset(fresh or repeats)


def _untried(constant: str, known: Known, ways: tuple[Way, ...]) -> frozenset[str]:
    """The tests of the ways to a constant that nothing has been recorded for."""
    measuring = (way for way in ways if constant in way.gives and not way.computes)
    return frozenset(t for way in measuring if not known.tests & set(way.tests) for t in way.tests)


def _is_missing(known: Known, name: str) -> bool:
    estimate = known.constants.get(name)
    return estimate is None or not (estimate.known or estimate.settled)


def _constants_in_doubt(known: Known, ways: tuple[Way, ...], aims: Aims) -> Iterator[Doubt]:
    names = sorted({name for way in ways for name in way.gives} & set(CONSTANTS) | aims.required)
    for name in names:
        doubt = _doubt_of(name, known.constants.get(name), aims)
        if doubt is None:
            continue
        kind, words = doubt
        settled = name in known.constants and known.constants[name].settled
        tests = frozenset() if settled else settling_tests(name, known, ways)
        if kind == "uncertain" and _mostly_instrument(known.constants[name]):
            assumed = _largest_instrument(known.constants[name]).startswith(ASSUMED)
            tests = _untried(name, known, ways) if assumed else frozenset()
        weight = WEIGHTS[kind] * (REQUIRED if name in aims.required else 1.0)
        yield Doubt(kind, name, words, tests, weight)


def _doubt_of(name: str, estimate: Estimate | None, aims: Aims) -> tuple[DoubtKind, str] | None:
    if estimate is None:
        return "missing", "nothing recorded gives it"
    if estimate.settled:
        return ("missing", estimate.note) if name in aims.required else None
    if not estimate.known:
        return "missing", estimate.note or "not identifiable from what is there"
    if estimate.status in ("assumed", "stated"):
        return "assumed", f"{estimate.status}, not measured ({estimate.note or estimate.method})"
    if estimate.at_bound:
        return "at_bound", f"its fit ended at a bound of its search, {estimate.number:.4g}"
    return _too_uncertain(name, estimate, aims)


def _too_uncertain(name: str, estimate: Estimate, aims: Aims) -> tuple[DoubtKind, str] | None:
    """Counts and zeros have no relative uncertainty; the rest is held against its target."""
    term = CONSTANTS.get(name)
    if (term is not None and term.integer) or estimate.number == 0.0:
        return None
    reached, target = estimate.u, aims.u_of.get(name)
    unit = f" {estimate.unit}".replace(" 1", "")
    if target is None:
        reached = 100.0 * reached / abs(estimate.number)
        target, unit = 100.0 * aims.u_rel_of.get(name, aims.u_rel), " %"
    if reached <= target:
        return None
    words = (
        f"known to {significant(reached, 2)}{unit} (k=1), wanted to {significant(target, 2)}{unit}"
    )
    if _mostly_instrument(estimate):
        source = _largest_instrument(estimate)
        cure = "" if source.startswith(ASSUMED) else ": calibrate that"
        words += f"; most of it is {source}, which repeating does not reduce{cure}"
    return "uncertain", words


def _largest_instrument(estimate: Estimate) -> str:
    """The source of the largest type B contribution."""
    return max((c for c in estimate.budget if c.kind == "B"), key=lambda c: abs(c.u)).source


def _mostly_instrument(estimate: Estimate) -> bool:
    """Whether the part that repeating cannot reduce is the larger one."""
    return estimate.u_b > estimate.u_a


def _checks_in_doubt(
    known: Known, ways: tuple[Way, ...], check_tests: Mapping[str, tuple[str, ...]]
) -> Iterator[Doubt]:
    for check in known.checks:
        if check.status not in ("fail", "not_evaluated"):
            continue
        if check.status == "not_evaluated" and _settled_in(check.meaning, known):
            continue
        rests_on = check_tests.get(check.name, ())
        if check.status == "fail":
            suspect = f"; suspect: {check.suspect}" if check.suspect else ""
            tests = frozenset(rests_on)
            kind: DoubtKind = "failed"
            words = f"the check failed: {check.meaning}{suspect}"
        else:
            kind, words = "not_evaluated", f"the check could not be made: {check.meaning}"
            tests = _tests_named(check.meaning, known, ways)
            tests = tests or frozenset(set(rests_on) - known.tests) or frozenset(rests_on)
            if not tests:
                continue  # it rests on what a user states, and nothing was stated
        yield Doubt(kind, check.name, words, tests, WEIGHTS[kind])


def _settled_in(meaning: str, known: Known) -> bool:
    """Whether a reason names a constant that was looked for and is not there."""
    named = set(re.findall(r"\w+", meaning)) & set(known.constants)
    return any(known.constants[name].settled for name in named)


def _tests_named(meaning: str, known: Known, ways: tuple[Way, ...]) -> frozenset[str]:
    """Tests not yet recorded that a reason names, directly or through a missing constant."""
    words = set(re.findall(r"\w+", meaning))
    named = (words & set(TESTS)) - known.tests
    for constant in sorted(words & set(CONSTANTS)):
        if _is_missing(known, constant):
            named |= settling_tests(constant, known, ways)
    return frozenset(named)
