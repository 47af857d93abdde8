"""How a text table is laid out: separators, where the header is, what comes before the rows."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class CsvDialect:
    """The layout of a text table. The defaults are the contract's own.

    `comment_lines` says that leading lines with `#` hold metadata and are not the header.
    `header_match` is a regular expression that the header line begins with; without it the header
    is the first line after `skip_lines`. `names` replaces the header of a table without one; an
    empty name leaves that column out. `skip_after_header` lines (a units row, a blank line) come
    before the rows, the first of them a units row if `units_row`. `time_start` and
    `time_increment` are regular expressions whose one group is a number in the text before the
    rows. `whole_last_line` asks for a line break after the last row, without which a cut number
    passes for a whole one.
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
    whole_last_line: bool = True


CONTRACT_DIALECT = CsvDialect()
