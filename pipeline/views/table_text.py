"""Tables for a terminal: nothing in a cell moves the cursor, nothing is wider than the window."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

NONE = "-"
GAP = "  "
WIDTH = 80


def safe(text: str) -> str:
    """The text with everything that a terminal would act on written out.

    Parameters
    ----------
    text
        Text that may hold control characters.

    """
    return "".join(
        char if char.isprintable() else char.encode("unicode_escape").decode() for char in text
    )


def shortened(text: str, most: int) -> str:
    """A text of so many characters at most, cut at its end.

    Parameters
    ----------
    text
        The text.
    most
        Characters, the ellipsis counted.

    """
    return text if len(text) <= most else f"{text[: most - 1]}…"


def table(rows: Sequence[Sequence[str]], right: Sequence[int] = ()) -> str:
    """Columns of text, left-aligned but for those named.

    Parameters
    ----------
    rows
        Cells of each row.
    right
        Numbers of the columns that are aligned to the right.

    """
    cells = [[safe(cell) for cell in row] for row in rows]
    return _block(cells, range(len(cells[0])), right)


def blocks(
    rows: Sequence[Sequence[str]], right: Sequence[int] = (), width: int = WIDTH
) -> list[str]:
    """The same in tables of at most `width` characters that all begin with the first column.

    Parameters
    ----------
    rows
        Cells of each row.
    right
        Numbers of the columns that are aligned to the right.
    width
        Most characters of a line.

    """
    cells = [[safe(cell) for cell in row] for row in rows]
    widths = [max(len(row[i]) for row in cells) for i in range(len(cells[0]))]
    return [_block(cells, columns, right) for columns in _column_blocks(widths, width)]


def _column_blocks(widths: Sequence[int], width: int) -> Iterator[list[int]]:
    columns, used = [0], widths[0]
    for column, own in enumerate(widths[1:], 1):
        if used + len(GAP) + own > width and len(columns) > 1:
            yield columns
            columns, used = [0], widths[0]
        columns.append(column)
        used += len(GAP) + own
    yield columns


def _block(cells: Sequence[Sequence[str]], columns: Sequence[int], right: Sequence[int]) -> str:
    widths = {column: max(len(row[column]) for row in cells) for column in columns}
    return "\n".join(
        GAP.join(
            row[column].rjust(widths[column])
            if column in right
            else row[column].ljust(widths[column])
            for column in columns
        ).rstrip()
        for row in cells
    )
