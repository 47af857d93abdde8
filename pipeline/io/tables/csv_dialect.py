"""How a text table is laid out: separators, where the header is, what comes before the rows."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class CsvDialect:
    """The layout of a text table; the defaults are the contract's own.

    Attributes
    ----------
    separator, decimal, encoding
        Of the text.
    comment_lines
        Whether leading lines with `#` hold metadata and are not the header.
    skip_lines, header_match
        Lines before the header, or a regular expression that it begins with.
    names
        Stand in for the header of a table without one, or (with `header_match`) of one whose header
        names units only; an empty name leaves a column out.
    units_row, skip_after_header
        Whether a units row follows the header, and lines between header and rows.
    fewer_columns
        Whether rows may end before the header does, all of them at the same column.
    missing
        Texts that stand for a missing value.
    time_start, time_increment
        Regular expressions whose one group is a number [s] in the text before the rows.
    row_end
        What stands behind the last field of a row, such as `;`, and is no field.
    whole_last_line
        Whether the last row must end in a line break; a number that is cut off looks whole.
    instant
        How a field of date and time of day is written, in the letters of strptime; it becomes
        seconds from the first row.

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
    instant: str | None = None


CONTRACT_DIALECT = CsvDialect()
