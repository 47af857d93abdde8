"""How a strange text table is probably laid out: separator, header, units row, decimal sign."""

from __future__ import annotations

import csv
import io
import re
from codecs import getincrementaldecoder
from collections.abc import Callable, Sequence
from dataclasses import replace

from pipeline.io.inspection.vocabulary import QUALIFIERS, QUANTITIES
from pipeline.io.tables.csv_dialect import CsvDialect
from pipeline.io.tables.csv_table import MAX_HEAD_BYTES
from pipeline.io.tables.instants import instants

_SEPARATORS = ("|", ";", ",", "\t", " ")
"""The first of equals counts."""
_NUMBER = re.compile(r"^[-+]?(\d+[.,]?\d*|[.,]\d+)([eE][-+]?\d+)?$|^[-+]?(nan|NaN|NAN)$")
_LOOK_AT_LINES = 200
_EAST_ASIAN = ("cp932", "gb18030", "big5", "euc_jp")
_INSTANT = re.compile(r"\d:\d\d")
_DAYS = ("%Y-%m-%d", "%Y/%m/%d", "%d.%m.%Y", "%d.%m.%y", "%m/%d/%Y", "%d/%m/%Y", "%d-%b-%Y")
_TIMES = ("%H:%M:%S%.f", "%I:%M:%S%.f %p", "%H:%M")
_INSTANTS = (
    *(f"{day}{gap}{time}" for day in _DAYS for gap in (" ", "T") for time in _TIMES),
    "%Y-%m-%dT%H:%M:%S%.f%#z",
    *_TIMES,
)
"""The first that fits counts; which of two numbers is the month matters past midnight alone."""


def sniff(text: str) -> tuple[CsvDialect, str | None] | None:
    """The layout of a text table, and its header line.

    Parameters
    ----------
    text
        The beginning of the file.

    Returns
    -------
    tuple of CsvDialect and str or None
        The header is None for a table without one; None in place of the tuple where no rows of
        numbers are found.

    Notes
    -----
    The separator is the one that separates the rows into the most numbers and fewest texts; the
    header is the last line of as many texts before the first such row, a second one is the units
    row. Three lines of one number each are a table of one column. Any number of blanks between
    numbers is one separator.

    """
    lines = text.replace("\r\n", "\n").split("\n")[:_LOOK_AT_LINES]
    lines, row_end = _without_ends(lines)
    best = _separated(lines) or _one_column(lines)
    if best is None:
        return None
    _, place, first, width = best
    separator = _SEPARATORS[-place]
    heads = [n for n in range(first) if _is_header(lines[n], separator, width)]
    comma = separator != "," and any(re.search(r"\d,\d", line) for line in lines[first:])
    decimal = "," if comma else "."
    fewer = separator != " "
    dialect = CsvDialect(separator=separator, decimal=decimal, fewer_columns=fewer, row_end=row_end)
    dialect = replace(dialect, instant=_instant_of(lines[first:], dialect))
    if not heads:
        names = tuple(f"column_{n + 1}" for n in range(width))
        return replace(dialect, names=names, skip_lines=first), None
    header = heads[-2] if len(heads) > 1 and heads[-1] - heads[-2] == 1 else heads[-1]
    return (
        replace(
            dialect,
            skip_lines=header,
            units_row=header != heads[-1],
            skip_after_header=first - header - 1,
        ),
        lines[header],
    )


def _separated(lines: list[str]) -> tuple[int, int, int, int] | None:
    """Worth, place of the separator (negative), first row and width of the best table; None for no
    rows of numbers.
    """
    best: tuple[int, int, int, int] | None = None
    for place, separator in enumerate(_SEPARATORS):
        looks = [_numbers(line, separator) for line in lines]
        counts = [count for count, _ in looks]
        led = [bool(_NUMBER.match(line.partition(separator)[0].strip())) for line in lines]
        widths = [count for count in counts if count > 1]
        if widths:
            width = max(set(widths), key=lambda w: (widths.count(w), w))
            worth = sum(surplus for count, surplus in looks if count == width)
            rows = [n for n, count in enumerate(counts) if count == width]
            # a line of a preamble is a name and a number, where rows begin with a number
            usual = 2 * sum(led[n] for n in rows) > len(rows)
            first = next(n for n in rows if led[n] or not usual)
            separated = (worth, -place, first, width)
            best = max(best, separated) if best else separated
    return best


def _without_ends(lines: list[str]) -> tuple[list[str], str]:
    """The lines without a `;` that ends rows which something else parts, and that mark."""
    ended = [line for line in lines if line.rstrip().endswith(";")]
    if 2 * len(ended) < len(lines) or any(line.count(";") > 1 for line in ended):
        return lines, ""
    return [line.rstrip().removesuffix(";") for line in lines], ";"


def _one_column(lines: list[str]) -> tuple[int, int, int, int] | None:
    """The table of one column that most lines are, with a separator that is no decimal sign."""
    filled = [n for n, line in enumerate(lines) if line.strip()]
    numbers = [n for n in filled if _NUMBER.match(lines[n].strip())]
    if len(numbers) < 3 or 2 * len(numbers) < len(filled):
        return None
    decimal_comma = any("," in lines[n] for n in numbers)
    return len(numbers), -_SEPARATORS.index(";" if decimal_comma else ","), numbers[0], 1


def _cells(line: str, separator: str) -> list[str]:
    if separator == " ":
        return line.split()
    row = next(csv.reader(io.StringIO(line), delimiter=separator), [])
    cells = [cell.strip() for cell in row]
    while cells and not cells[-1]:
        cells.pop()
    return cells


def _numbers(line: str, separator: str) -> tuple[int, int]:
    """Fields of a row that consists of numbers (some may be empty or text), or 0.

    Beside it by how many the numbers outnumber the texts.
    """
    cells = _cells(line, separator)
    numeric = sum(bool(_NUMBER.match(cell)) for cell in cells)
    if not numeric or 2 * numeric < len(cells):
        return 0, 0
    return len(cells), numeric - sum(bool(cell) and not _NUMBER.match(cell) for cell in cells)


def _is_header(line: str, separator: str, width: int) -> bool:
    cells = _cells(line, separator)
    if separator == " " and len(cells) != width:
        return False
    return len(cells) >= width and not any(_NUMBER.match(cell) for cell in cells[:1])


def encoding_of(head: bytes) -> str:
    """The encoding of a text.

    Parameters
    ----------
    head
        First bytes of the file.

    Returns
    -------
    str
        UTF-8 where the bytes are; else the one of East Asia in which most words are known; else
        Latin-1, in which every byte is a letter.

    """
    try:
        getincrementaldecoder("utf-8")().decode(head)
    except UnicodeDecodeError:
        texts = (*(words for _, words in QUANTITIES.values()), *QUALIFIERS.values())
        words = [word for text in texts for word in text.split() if not word.isascii()]
        known = {code: _known_words(head, code, words) for code in _EAST_ASIAN}
        best = max(known, key=lambda code: known[code])
        return best if known[best] else "latin-1"
    return "utf-8"


def _known_words(head: bytes, encoding: str, words: Sequence[str]) -> int:
    """Letters of known words in a text by an encoding, 0 where it cannot be of it."""
    try:
        text = getincrementaldecoder(encoding)().decode(head)
    except UnicodeDecodeError:
        return 0
    return sum(len(word) * text.count(word) for word in words)


def _instant_of(lines: Sequence[str], dialect: CsvDialect) -> str | None:
    """How a column of date and time of day is written, in strptime's letters, or None."""
    rows = [_cells(line, dialect.separator) for line in lines]
    for place in range(max(map(len, rows), default=0)):
        cells = [row[place] for row in rows if len(row) > place and row[place]]
        if cells and all(map(_INSTANT.search, cells)):
            fitting = (form for form in _INSTANTS if _are_instants(cells, form, dialect))
            instant = next(fitting, None)
            if instant is not None:
                return instant
    return None


def _are_instants(cells: Sequence[str], form: str, dialect: CsvDialect) -> bool:
    """Whether fields are date and time of day of a form, and do not go back."""
    import polars as pl

    texts = pl.Series([cell.replace(dialect.decimal, ".") for cell in cells])
    times = instants(texts, form)
    return bool(times.null_count() == 0 and (times.is_sorted() or "%d" not in form))


def numeric_columns(body: bytes, dialect: CsvDialect) -> Callable[[str], bool]:
    """A filter for the columns whose first rows hold numbers.

    Parameters
    ----------
    body
        Bytes of the table.
    dialect
        Its layout.

    Returns
    -------
    callable
        Name of a column -> whether it holds numbers.

    """
    lines = (
        body[:MAX_HEAD_BYTES].decode(dialect.encoding, "replace").replace("\r\n", "\n").split("\n")
    )
    header = dialect.skip_lines
    first = header + (0 if dialect.names else 1 + dialect.skip_after_header)
    names = list(dialect.names or _cells(lines[header], dialect.separator))
    cells: dict[str, list[str]] = {name: [] for name in names}
    for line in lines[first : first + _LOOK_AT_LINES]:
        bare = line.rstrip().removesuffix(dialect.row_end)
        for name, cell in zip(names, _cells(bare, dialect.separator), strict=False):
            if cell:
                cells[name].append(cell)
    numeric = {name for name, texts in cells.items() if all(map(_NUMBER.match, texts))}
    if dialect.instant:
        form = dialect.instant
        numeric |= {n for n, c in cells.items() if c and _are_instants(c, form, dialect)}
    return numeric.__contains__
