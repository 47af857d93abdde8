"""A source map to finish by hand: what is recognised filled in, the rest as comments."""

from __future__ import annotations

import re
from dataclasses import dataclass

from pipeline.io.inspection.aliases import Guess
from pipeline.io.tables.csv_dialect import CONTRACT_DIALECT, CsvDialect


@dataclass(frozen=True, slots=True)
class FieldSeen:
    """One field: its name, a first value, and the column it is or probably is."""

    name: str
    first: float | None
    guess: Guess | None
    certain: bool


@dataclass(frozen=True, slots=True)
class StreamSeen:
    """One table or topic: rows, rate [Hz] (None without a clock), and its fields."""

    name: str
    encoding: str
    rows: int
    rate_hz: float | None
    fields: tuple[FieldSeen, ...]


def starter_map(
    streams: tuple[StreamSeen, ...],
    dialect: CsvDialect,
    header: str | None,
    topics: list[str],
    *,
    by_name: bool = False,
) -> str:
    """A source map in YAML: guesses filled in, the rest as comments to finish.

    `by_name`: the file says `contract` and so has to name the map that it is to be read by.
    """
    lines = ["# Save as conf/source/NAME.yaml, correct what is guessed, and run again."]
    if by_name:
        text = "`# source: NAME` among its first lines"
        where = text if header is not None else "`source: NAME` in its metadata or NAME.meta.yaml"
        lines.append(f"# The file itself must name it: {where}.")
    lines.append("recognise:")
    if header is not None:
        pattern = "^" + re.escape(header.strip()[:120])
        lines.append(f"  header: {_quoted(pattern)}")
    elif topics:
        lines.append(f"  topics: [{', '.join(_quoted(topic) for topic in sorted(set(topics)))}]")
    else:
        lines.append("  files: ['*.csv']")
    lines += _layout_lines(dialect)
    lines.append("fields:")
    taken: set[str] = set()
    clock = False
    for seen in (seen for stream in streams for seen in stream.fields):
        line, column = _field_line(seen, taken)
        clock = clock or column == "t_s"
        lines.append(line)
    if not clock:
        origin = "increment" if header is not None or not topics else "log"
        lines += ["time:", f"  from: {origin}"]
        if origin == "increment":
            lines.append("  increment_s: 1.0e-3   # the sampling interval: state the true one")
    lines += ["metadata:", "  # motor_id: the serial number", "  # test: one of the contract's"]
    return "\n".join(lines) + "\n  station: unknown\n"


def _field_line(seen: FieldSeen, taken: set[str]) -> tuple[str, str | None]:
    if seen.guess is None or seen.guess.column in taken:
        return f"  # {_quoted(seen.name)}: {{column: , unit: }}", None
    taken.add(seen.guess.column)
    unit = f", unit: {_quoted(seen.guess.unit)}" if seen.guess.unit else ""
    note = "" if seen.certain else "   # guessed: check column, unit and sign"
    return f"  {_quoted(seen.name)}: {{column: {seen.guess.column}{unit}}}{note}", seen.guess.column


def _layout_lines(dialect: CsvDialect) -> list[str]:
    lines: list[str] = []
    for key in ("separator", "decimal", "encoding", "skip_lines", "skip_after_header"):
        value = getattr(dialect, key)
        if value != getattr(CONTRACT_DIALECT, key):
            text = "tab" if value == "\t" else value
            lines.append(f"  {key}: {_quoted(text) if isinstance(text, str) else text}")
    flags = ("units_row", "fewer_columns")
    lines += [f"  {key}: true" for key in flags if getattr(dialect, key)]
    if dialect.names:
        lines.append(f"  names: [{', '.join(_quoted(name) for name in dialect.names)}]")
    return ["layout:", *lines] if lines else []


def _quoted(text: str) -> str:
    """YAML text in single quotes; control characters cannot be in a name that was printed."""
    plain = "".join(c if c.isprintable() else " " for c in text)
    return "'" + plain.replace("'", "''") + "'"
