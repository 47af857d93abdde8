"""How names and silence move when a constant of judgement is halved and doubled.

Every variant is a run of the same sealed cases under another policy, kept like any run, so that a
command that was stopped goes on. A case is run again only where it reads the number: elsewhere its
result stays. Rows that have not been run say so.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from pipeline.criticism.policy.policy import DEFAULT, policy_of
from pipeline.records.errors import UsageError
from pipeline.records.policy import Entry, Number, Overrides, entries, policy_digest
from tests.benchmark.blind import product
from tests.benchmark.cases import Case
from tests.benchmark.policy_reads import READS, listening_product
from tests.benchmark.running import Book, run
from tests.benchmark.scoring import judged

FACTORS = (0.5, 2.0)
HEAD = """# What moves when a constant of judgement is halved or doubled

`python -m tests.benchmark action=policy fields=NAME,... count=N docs=docs/policy-sensitivity.md`
runs {count} cases of the small blind benchmark ([benchmark.md](benchmark.md)) at the default policy
and with one chosen number halved and doubled; `fields=all` takes every number. *read* counts the
cases that read the number; in the others it can move nothing, and they are not run again. *right*,
*wrong* and *silent* count the cases' marks (silent: nothing named with confidence where something
is hidden); *moved* counts cases whose verdict or names differ from the default's. A share of few
cases says little: no row here calibrates a number. [policy.md](policy.md) says what each number is.

Cases: {cases}. Code {code}, seed {seed}. Run so far: {rows} of {all} numbers.
Those that move a verdict or a name, halved or doubled: {moving}.
"""
_COLUMNS = "right | wrong | silent | moved"


@dataclass(frozen=True, slots=True)
class Variant:
    """A field, and the factor by which it is multiplied; None is the default policy."""

    entry: Entry | None = None
    factor: float = 1.0

    @property
    def changes(self) -> Overrides:
        """The override that it is; none where a whole number stays as it is."""
        if self.entry is None:
            return ()
        value = scaled(self.entry.value, self.factor)
        return () if value == self.entry.value else ((self.entry.name, value),)


def scaled(value: Number, factor: float) -> Number:
    """A number or row of numbers times a factor; whole numbers stay whole and at least one."""
    if isinstance(value, tuple):
        return tuple(factor * one for one in value)
    return max(round(factor * value), 1) if isinstance(value, int) else factor * value


def chosen_entries(fields: Sequence[str]) -> list[Entry]:
    """Every number that somebody has chosen, those of `fields` first; raises UsageError."""
    found = {entry.name: entry for entry in entries(DEFAULT) if entry.origin.kind == "chosen"}
    for name in fields:
        if name not in found:
            raise UsageError(f"no chosen number {name!r}", "docs/policy.md lists them")
    return [*(found[name] for name in fields), *(e for n, e in found.items() if n not in fields)]


def spread(cases: Sequence[Case], count: int) -> list[Case]:
    """So many of the cases, evenly over their list and so over families and lines."""
    step = max(len(cases) / max(count, 1), 1.0)
    return [cases[int(n * step)] for n in range(min(count, len(cases)))]


def book_of(book: Book, variant: Variant) -> Book:
    """Where the results of a variant are kept; those of the default policy say what they read."""
    if not variant.changes:
        return Book(book.folder, f"{book.code}-read")
    return Book(book.folder, f"{book.code}-{policy_digest(policy_of(variant.changes))[:12]}")


def measure(cases: Sequence[Case], book: Book, fields: Sequence[str]) -> int:
    """Runs the default and the variants of some fields; returns how many cases it diagnosed."""
    done = run(list(cases), book_of(book, Variant()), listening_product)
    for entry in chosen_entries(fields)[: len(fields)]:
        feeling = [case for case in cases if entry.name in _read(case, book)]
        for factor in FACTORS:
            one = Variant(entry, factor)
            done += run(feeling, book_of(book, one), partial(product, policy=one.changes))
    return done


def _read(case: Case, book: Book) -> frozenset[str]:
    """The numbers that the diagnosis of a case reads by the default policy."""
    document = book_of(book, Variant()).document(case)
    return frozenset() if document is None else frozenset(document.get(READS, ()))


def page(cases: Sequence[Case], book: Book, fields: Sequence[str], seed: int) -> str:
    """The table of the chosen numbers that have been run."""
    listed = ", ".join(f"{case.family} {case.line} ({case.motor})" for case in cases)
    numbers = chosen_entries(fields)
    rows = {entry.name: row for entry in numbers if (row := _row(entry, cases, book))}
    moving = ", ".join(f"`{name}`" for name, row in rows.items() if _moves(row)) or "none"
    count = {"count": len(cases), "rows": len(rows), "all": len(numbers)}
    lines = [
        HEAD.format(cases=listed, code=book.code, seed=seed, moving=moving, **count),
        f"| field | value | read | halved: {_COLUMNS} | doubled: {_COLUMNS} |",
        "| --- | --- | --- |" + " --- |" * 8,
        f"| *default* | | | {_marks(cases, book, Variant())} | | | | |",
    ]
    return "\n".join([*lines, *rows.values(), ""])


def _row(entry: Entry, cases: Sequence[Case], book: Book) -> str:
    """The row of a number; empty where a case has no result of it yet."""
    both = [_marks(cases, book, Variant(entry, factor)) for factor in FACTORS]
    if not all(both) or not _marks(cases, book, Variant()):
        return ""
    value = entry.value if not isinstance(entry.value, tuple) else "row"
    count = sum(entry.name in _read(case, book) for case in cases)
    return f"| `{entry.name}` | {value} | {count} | {' | '.join(both)} |"


def _moves(row: str) -> bool:
    """Whether a row counts a case that moved, the number halved or doubled."""
    cells = [cell.strip() for cell in row.strip("| ").split("|")]
    return any(int(cell) for cell in (cells[-5], cells[-1]))


def _marks(cases: Sequence[Case], book: Book, variant: Variant) -> str:
    """Right, wrong, silent and moved as cells; empty where a case has no result yet."""
    pairs = list(_pairs(cases, book, variant))
    if len(pairs) < len(cases):
        return ""
    marks = [judged(case, document).mark for case, document, _ in pairs]
    silent = sum(mark in ("unknown", "missed") for mark in marks)
    moved = sum(_told(document) != _told(plain) for _, document, plain in pairs)
    right = sum(mark in ("right", "tie") for mark in marks)
    return f"{right} | {marks.count('wrong')} | {silent} | {moved}"


def _pairs(
    cases: Sequence[Case], book: Book, variant: Variant
) -> Iterator[tuple[Case, Mapping[str, Any], Mapping[str, Any]]]:
    for case in cases:
        plain = book_of(book, Variant()).document(case)
        moves = variant.entry is None or variant.entry.name in _read(case, book)
        document = book_of(book, variant).document(case) if moves else plain
        if document is not None and plain is not None:
            yield case, document, plain


def _told(document: Mapping[str, Any]) -> tuple[Any, ...]:
    return document.get("verdict"), tuple(document.get("missing", ()))
