"""How a text table is laid out: separators, where the header is, what comes before the rows."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class CsvDialect:
    """The layout of a text table. The defaults are the contract's own.

    `comment_lines`: leading lines with `#` hold metadata and are not the header.
    `header_match`: regular expression that the header line begins with; without it the header is
    the first line after `skip_lines`.
    `names`: stand in for the header of a table without one, or (with `header_match`) of one whose
    header names units only; an empty name leaves a column out.
    `skip_after_header`: lines between header and rows, the first a units row if `units_row`.
    `fewer_columns`: rows may end before the header does, all of them at the same column.
    `time_start`, `time_increment`: regular expressions whose one group is a number [s] in the text
    before the rows.
    `row_end`: what stands behind the last field of a row, such as `;`, and is no field.
    `whole_last_line`: the last row must end in a line break; a cut number looks whole.
    """

    separator: str = ","
    decimal: str = "."
    encoding: str = "utf-8"
    comment_lines: bool = True
    skip_lines: int = 0
    header_match: str | None = None
    names: tuple[str, ...] | None = None
    units_row: bool = False
    skip_after_header: int = 0
    fewer_columns: bool = False
    missing: tuple[str, ...] = ()
    time_start: str | None = None
    time_increment: str | None = None
    row_end: str = ""
    whole_last_line: bool = True


CONTRACT_DIALECT = CsvDialect()
