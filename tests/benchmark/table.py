"""The table: every share with its count and interval, beside what was asked for."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from tests.benchmark.cases import Case
from tests.benchmark.scoring import Judged, judged
from tests.benchmark.values import Compared, compared

CONFIDENCE = 0.95
MATTERS = 0.01
FEW = 20
"""Cases below which a share says little; the table marks it."""
_ANY = " (also under `unknown`)"
LIBRARY = ("size", "set", "tie", "gap")


@dataclass(frozen=True, slots=True)
class Line:
    """One share: how many of how many, its interval, and what was asked for.

    `least` or `most` is the figure that was asked for; neither where none was.
    """

    what: str
    count: int
    total: int
    least: float | None = None
    most: float | None = None

    @property
    def share(self) -> float:
        """The share, 0 where there are no cases."""
        return self.count / self.total if self.total else 0.0

    @property
    def met(self) -> bool | None:
        """Whether the share is what was asked for; None where nothing was, or nothing ran."""
        if self.total == 0 or (self.least is None and self.most is None):
            return None
        low = self.least is None or self.share >= self.least
        return low and (self.most is None or self.share <= self.most)

    def text(self) -> str:
        """The line as a row of a Markdown table."""
        if self.total == 0:
            return f"| {self.what} | no cases | | {self._asked()} | |"
        low, high = interval(self.count, self.total)
        met = {True: "yes", False: "no", None: ""}[self.met]
        if met and self.total < FEW:
            met += " (few)"
        share = f"{100.0 * self.share:.1f} % ({self.count}/{self.total})"
        spread = f"{100.0 * low:.1f} to {100.0 * high:.1f} %"
        return f"| {self.what} | {share} | {spread} | {self._asked()} | {met} |"

    def _asked(self) -> str:
        parts = []
        if self.least is not None:
            parts.append(f"at least {100.0 * self.least:g} %")
        if self.most is not None:
            parts.append(f"at most {100.0 * self.most:g} %")
        return ", ".join(parts)


def interval(count: int, total: int, confidence: float = CONFIDENCE) -> tuple[float, float]:
    """Clopper-Pearson interval of a share: exact, never too narrow.

    References: [1] Clopper & Pearson, Biometrika 26 (1934).
    """
    from scipy.stats import beta

    tail = 0.5 * (1.0 - confidence)
    low = 0.0 if count == 0 else float(beta.ppf(tail, count, total - count + 1))
    high = 1.0 if count == total else float(beta.isf(tail, count + 1, total - count))
    return low, high


Pairs = Sequence[tuple[Case, Mapping[str, Any]]]
Test = Callable[[Judged], bool]


def _line(
    what: str,
    rows: Iterable[Judged],
    test: Test,
    least: float | None = None,
    most: float | None = None,
) -> Line:
    found = list(rows)
    return Line(what, sum(test(row) for row in found), len(found), least, most)


def _right(row: Judged) -> bool:
    return row.right


def _wrong(row: Judged) -> bool:
    return row.mark == "wrong"


def lines(pairs: Pairs) -> list[Line]:
    """Every line of the table, of cases with their diagnoses."""
    rows = [judged(case, document) for case, document in pairs]
    made = _sizes(rows) + _nulls(rows) + _others(rows)
    floors = [row for row in rows if row.case.family in LIBRARY and row.floor is not None]
    made.append(_line("held-out error at most 1.05 of the floor", floors, _at_floor, least=0.9))
    values = [found for case, document in pairs for found in compared(case, document)]
    inside = [value.covered for value in values if value.covered is not None]
    made.append(Line("value inside its 95 % interval", sum(inside), len(inside), 0.92, 0.98))
    made.append(_line("diagnosis broke down", rows, lambda row: row.mark == "failed", most=0.0))
    return made


def _at_floor(row: Judged) -> bool:
    return bool(row.floor)


def _of(rows: list[Judged], family: str, line: str | None = None) -> list[Judged]:
    return [r for r in rows if r.case.family == family and line in (None, r.case.line)]


def _sizes(rows: list[Judged]) -> list[Line]:
    asked: dict[str, tuple[float | None, float | None]] = {
        "1 a*": (None, 0.02),
        "2 a*": (0.98, 0.01),
    }
    made = []
    for line in dict.fromkeys(r.case.line for r in rows if r.case.family == "size"):
        here = _of(rows, "size", line)
        right, wrong = asked.get(line, (None, None))
        made.append(_line(f"{line}: right", here, _right, least=right))
        made.append(_line(f"{line}: wrong with confidence", here, _wrong, most=wrong))
        made.append(_line(f"{line}: unknown", here, lambda row: row.mark == "unknown"))
        made.append(_line(f"{line}: right, or reported as too small to matter", here, _seen))
        made.append(_line(f"{line}: another reported as too small to matter", here, _misread))
        found = [row for row in here if row.right]
        made.append(_line(f"{line}: right, and a remainder that matters", found, _flagged))
        if line.endswith("a*"):
            big = [row for row in here if row.case.of_typical >= MATTERS]
            made.append(_line(f"{line} and over 1 % of typical: right", big, _right))
    return made


def _seen(row: Judged) -> bool:
    return row.right or bool(row.slight)


def _flagged(row: Judged) -> bool:
    return row.flagged


def _misread(row: Judged) -> bool:
    return row.slight is False


def _nulls(rows: list[Judged]) -> list[Line]:
    clean = _of(rows, "null", "clean")
    coloured = [row for row in _of(rows, "null") if row.case.line != "clean"]
    made = [_line("nothing hidden, clean: false name", clean, _wrong, most=0.01)]
    made.append(_line("nothing hidden, coloured: false name", coloured, _wrong, most=0.03))
    for line in dict.fromkeys(r.case.line for r in rows if r.case.family == "null"):
        here = _of(rows, "null", line)
        made.append(_line(f"nothing hidden, {line}: not called adequate", here, _not_right))
    quiet = [row for row in _of(rows, "null") if row.right]
    made.append(_line("nothing hidden: an effect reported as too small to matter", quiet, _misread))
    return made


def _not_right(row: Judged) -> bool:
    return not row.right


def _others(rows: list[Judged]) -> list[Line]:
    sets, forms, ties = _of(rows, "set"), _of(rows, "form"), _of(rows, "tie")
    outside, gaps = _of(rows, "outside"), _of(rows, "gap")
    hidden = sum(row.hidden for row in sets)
    sketches = [row for row in outside if row.sketch is not None]
    return [
        _line("2 to 5 effects: exact set", sets, lambda row: row.exact, least=0.92),
        Line(f"2 to 5 effects: recall{_ANY}", sum(row.found for row in sets), hidden, 0.98),
        _line("among 25 small others: right", _of(rows, "crowd"), _right),
        _line("among 25 small others: wrong", _of(rows, "crowd"), _wrong),
        _line(f"wrong form: right name{_ANY}", forms, _all_found, least=0.95),
        _line(
            "wrong form: remainder reported, or none left",
            forms,
            lambda row: row.left or bool(row.floor),
            least=1.0,
        ),
        _line("wrong form: remainder that matters", forms, _flagged),
        _line("outside the library: flagged", outside, _flagged, least=1.0),
        _line("outside the library: wrong with confidence", outside, _wrong, most=0.01),
        _line("outside the library: right variable", sketches, _sketched, least=0.95),
        _line("ties: class right", ties, _right, least=1.0),
        _line("ties: one singled out", ties, lambda row: row.mark == "singled out", most=0.0),
        _line("test missing: right", gaps, _right),
        _line("test missing: wrong with confidence", gaps, _wrong),
    ]


def _all_found(row: Judged) -> bool:
    return row.found == row.hidden


def _sketched(row: Judged) -> bool:
    return bool(row.sketch)


def table(pairs: Pairs, heading: str) -> str:
    """The table in Markdown, with points and the median error of values below it."""
    rows = [judged(case, document) for case, document in pairs]
    values: list[Compared] = [v for case, document in pairs for v in compared(case, document)]
    out = [
        heading,
        "",
        "| what | share | 95 % interval | asked for | met |",
        "|---|---|---|---|---|",
    ]
    out += [line.text() for line in lines(pairs)]
    points = sum(row.points for row in rows)
    out += ["", f"Points (right and tie +1, wrong -5, else 0): {points} of {len(rows)}."]
    exact = [value.error for value in values if value.covered is not None]
    sizes = [value.error for value in values if value.covered is None]
    for what, errors in (("values", exact), ("sizes of effects of another form", sizes)):
        if errors:
            median = 100.0 * statistics.median(errors)
            out.append(f"Median error of {len(errors)} {what}: {median:.2g} % (asked for: 1 %).")
    return "\n".join(out) + "\n"


def by_effect(pairs: Pairs) -> str:
    """How often each effect was right, with its cases of every size: `--` where none ran."""
    rows = [judged(case, document) for case, document in pairs if case.family == "size"]
    columns = list(dict.fromkeys(row.case.line for row in rows))
    head = ["| effect |", *(f" {name} |" for name in columns)]
    out = ["".join(head), "|---" * (1 + len(columns)) + "|"]
    for effect in sorted({row.case.truth[0] for row in rows}):
        cells = []
        for line in columns:
            here = [r for r in rows if r.case.truth == (effect,) and r.case.line == line]
            cells.append(f"{sum(map(_right, here))}/{len(here)}" if here else "--")
        out.append(f"| `{effect}` | " + " | ".join(cells) + " |")
    return "\n".join(out) + "\n"
