"""From two selectors to what is compared: versions of the registry as samples."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from pipeline.io.registry.store import Registry
from pipeline.lots.code import Pair
from pipeline.lots.regression import Samples
from pipeline.lots.sample import Member, lots_in_order
from pipeline.lots.selector import Query, known, parse_selector
from pipeline.records.datasheet import Datasheet
from pipeline.records.errors import UsageError
from pipeline.records.ledger import Version, histories
from pipeline.records.lot_constant import Side
from pipeline.records.lot_regression import Group
from pipeline.records.naming import counted
from pipeline.records.parse import utc_moment


@dataclass(frozen=True, slots=True)
class Chosen:
    """What is compared; `pairs` only for versions of the code."""

    samples: Samples
    pairs: tuple[Pair, ...]
    notes: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Sheet:
    """A version with its datasheet and the time of its tests."""

    version: Version
    sheet: Datasheet
    when: str

    @property
    def inputs(self) -> frozenset[str]:
        """Digests of the captures that it rests on."""
        return frozenset(capture.sha256 for capture in self.sheet.captures)


def choose(
    registry: Registry, baseline: str, candidate: str, mode: str, golden: Sequence[str]
) -> Chosen:
    """The two sides, golden motors and repeats.

    Of a motor the newest version on a side counts. Golden motors stand in no lot.

    Parameters
    ----------
    registry
        The registry.
    baseline
        Selector of the baseline.
    candidate
        Selector of the candidate.
    mode
        As the key `mode` of `regress`.
    golden
        Motors that are measured again and again.

    Raises
    ------
    UsageError
        A side is empty.

    """
    versions = [v for history in histories(registry.events()).values() for v in history]
    queries = {
        "baseline": parse_selector(baseline, versions),
        "candidate": parse_selector(candidate, versions),
    }
    shelf = _Shelf(registry)
    sides = {
        side: [one for one in _selected(shelf, versions, query) if one.sheet.motor_id not in golden]
        for side, query in queries.items()
    }
    for side, query in queries.items():
        if not sides[side]:
            raise UsageError(f"{side}={query.text} selects nothing", known(versions))
    newest = {side: _newest(versions) for side, versions in sides.items()}
    same = _same_captures(newest["baseline"], newest["candidate"])
    if mode == "code" and not same:
        raise UsageError(
            "mode=code: no motor is on both sides with the same captures",
            "choose the versions by code:... or version:...",
        )
    if same and (mode == "code" or (mode == "auto" and _of_code(newest, same))):
        return _versions(newest, same, queries)
    return _lots(shelf, versions, newest, queries, golden)


class _Shelf:
    """Datasheets of the registry, each read once."""

    def __init__(self, registry: Registry) -> None:
        self._registry = registry
        self._read: dict[tuple[str, str], Sheet] = {}

    def sheets(self, versions: Sequence[Version]) -> list[Sheet]:
        """The datasheets of versions, in their order."""
        new = [version for version in versions if version.key not in self._read]
        for version, sheet in zip(new, self._registry.datasheets(new), strict=True):
            self._read[version.key] = Sheet(version, sheet, _when(version, sheet))
        return [self._read[version.key] for version in versions]


def _when(version: Version, sheet: Datasheet) -> str:
    """When the first capture was started, else when the version was published (ISO 8601, UTC)."""
    stated = [c.started_at for c in sheet.captures if c.started_at]
    usable = [text for text in stated if utc_moment(text) is not None]
    return min(usable) if usable else version.published.recorded_at.isoformat()


def _selected(shelf: _Shelf, versions: Sequence[Version], query: Query) -> list[Sheet]:
    rows = [version for version in versions if query.takes(version)]
    return [
        one for one in shelf.sheets(rows) if query.takes_content(one.sheet.code_version, one.when)
    ]


def _newest(sheets: Iterable[Sheet]) -> dict[str, Sheet]:
    """The newest version of each motor."""
    newest: dict[str, Sheet] = {}
    for one in sorted(sheets, key=lambda one: (one.version.motor_id, one.version.revision)):
        newest[one.sheet.motor_id] = one
    return newest


def _same_captures(base: Mapping[str, Sheet], candidate: Mapping[str, Sheet]) -> list[str]:
    """Motors that rest on the same captures on both sides."""
    return [m for m, one in candidate.items() if m in base and base[m].inputs == one.inputs]


def _of_code(newest: Mapping[str, Mapping[str, Sheet]], same: Sequence[str]) -> bool:
    """Whether versions of the code are meant: all candidates have their captures on both sides,
    and their versions differ; some of them, where both sides are of the same motors. A lot against
    itself compares nothing.
    """
    base, candidate = newest["baseline"], newest["candidate"]
    if len(same) < len(candidate):
        return False
    differ = [base[m].version.version != candidate[m].version.version for m in same]
    return all(differ) or (any(differ) and base.keys() == candidate.keys())


def _versions(
    newest: Mapping[str, Mapping[str, Sheet]], same: Sequence[str], queries: Mapping[str, Query]
) -> Chosen:
    base, candidate = newest["baseline"], newest["candidate"]
    pairs = tuple(
        Pair(_member(base[motor], "baseline"), _member(candidate[motor], "candidate"))
        for motor in same
    )
    notes = []
    left = len(candidate) - len(same)
    if left:
        notes.append(f"{left} candidate motors rest on other captures and are left out")
    if all(base[motor].version.version == candidate[motor].version.version for motor in same):
        notes.append("both sides are the very same versions")
    groups = [
        _group(side, queries[side], [newest[side][motor] for motor in same], ())
        for side in ("baseline", "candidate")
    ]
    return Chosen(Samples(groups[0], groups[1], ()), pairs, tuple(notes))


def _lots(
    shelf: _Shelf,
    versions: Sequence[Version],
    newest: Mapping[str, Mapping[str, Sheet]],
    queries: Mapping[str, Query],
    golden: Sequence[str],
) -> Chosen:
    candidate = newest["candidate"]
    shared = [motor for motor in newest["baseline"] if motor in candidate]
    base = {m: one for m, one in newest["baseline"].items() if m not in candidate}
    notes = [f"on both sides, counted as candidate: {counted(len(shared), 'motor')}"] * bool(shared)
    if not base:
        raise UsageError(
            f"baseline={queries['baseline'].text} holds no motor that the candidate does not",
            "name other lots; the same captures under two versions are mode=code",
        )
    base, others = _of_one_type(base, candidate)
    if others:
        notes.append(f"left out of the baseline, of another type: {counted(len(others), 'motor')}")
    codes = {one.sheet.code_version for one in (*base.values(), *candidate.values())}
    if len(codes) > 1:
        notes.append(f"datasheets of {len(codes)} code versions are compared: {_few(codes)}")
    refused = [m for m, one in {**base, **candidate}.items() if one.sheet.status == "refused"]
    if refused:
        notes.append(
            f"in the comparison though a check failed: {counted(len(refused), 'datasheet')}, "
            f"{_few(refused)}"
        )
    members = [_member(one, "baseline") for one in base.values()]
    members += [_member(one, "candidate") for one in candidate.values()]
    again = _repeats(shelf, versions, {*base, *candidate, *golden})
    samples = Samples(
        _group("baseline", queries["baseline"], list(base.values()), [*shared, *others]),
        _group("candidate", queries["candidate"], list(candidate.values()), ()),
        tuple(members),
        tuple(again),
        tuple(member for member in again if member.sheet.motor_id in golden),
    )
    return Chosen(samples, (), tuple(notes))


def _few(names: Iterable[str], most: int = 8) -> str:
    ordered = sorted(names)
    return ", ".join(ordered[:most]) + (
        f" and {len(ordered) - most} more" if len(ordered) > most else ""
    )


def _of_one_type(
    base: Mapping[str, Sheet], candidate: Mapping[str, Sheet]
) -> tuple[dict[str, Sheet], list[str]]:
    """The baseline's motors of the candidate's type, and the others' names.

    Lots of one type are compared. Raises UsageError for candidates of several types, and for a
    baseline that has none of theirs.
    """
    types = {one.sheet.motor_type for one in candidate.values()}
    names_of_types = _few(name or "(not stated)" for name in types)
    if len(types) > 1:
        raise UsageError(
            f"the candidate's motors are of several types: {names_of_types}", "add type:NAME"
        )
    kept = {m: one for m, one in base.items() if one.sheet.motor_type in types}
    if not kept:
        has = _few({one.sheet.motor_type or "(not stated)" for one in base.values()})
        raise UsageError(
            f"the candidate is of type {names_of_types}, the baseline of {has}",
            "name lots of one type",
        )
    return kept, sorted(set(base) - set(kept))


def _repeats(shelf: _Shelf, versions: Sequence[Version], motors: set[str]) -> list[Member]:
    """Versions of motors that were measured more than once, newest first, none of them revoked."""
    by_motor: dict[str, list[Version]] = {}
    for version in versions:
        if version.motor_id in motors and version.status != "revoked":
            by_motor.setdefault(version.motor_id, []).append(version)
    wanted = [
        v for history in by_motor.values() for v in sorted(history, key=lambda v: -v.revision)
    ]
    return [Member(one.sheet, None, one.when) for one in shelf.sheets(wanted)]


def _member(one: Sheet, side: Side) -> Member:
    return Member(one.sheet, side, one.when)


def _group(side: str, query: Query, sheets: Sequence[Sheet], left_out: Sequence[str]) -> Group:
    members = [Member(one.sheet, None, one.when) for one in sheets]
    types = {one.sheet.motor_type for one in sheets}
    codes = {one.sheet.code_version for one in sheets}
    return Group(
        side=side,  # type: ignore[arg-type]
        selector=query.text,
        motors=len(sheets),
        lots=tuple(lot for lot, _ in lots_in_order(members)),
        stations=tuple(sorted({s for one in sheets for s in one.version.published.stations})),
        motor_types=tuple(sorted(name for name in types if name)),
        code_versions=tuple(sorted(codes)),
        versions=tuple(one.version.version for one in sheets),
        left_out=tuple(sorted(left_out)),
    )
