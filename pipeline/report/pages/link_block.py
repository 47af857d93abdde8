"""The part of a page that leads to the other pages of the same motor, written anew when one comes.

Which pages there are depends on the commands that were given, in any order.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from pipeline.report.pages.page import render

BEGIN, END = "<!-- links -->", "<!-- end of links -->"


@dataclass(frozen=True, slots=True)
class Link:
    """Where a link leads, relative to the page, and what it is called."""

    text: str
    href: str


def link_block(links: Sequence[Link]) -> str:
    """The links between two marks; the marks alone where there are none.

    Parameters
    ----------
    links
        Links to other pages.

    """
    return f"{BEGIN}\n{render('links.html.jinja', links=links).strip()}\n{END}"


def with_links(page: str, links: Sequence[Link]) -> str:
    """The page with its links as they are now; a page without the marks stays as it is.

    No text of a capture can hold a mark: `<` is escaped in all of it.

    Parameters
    ----------
    page
        HTML text of the page.
    links
        Links to other pages.

    """
    return replaced(page, (BEGIN, END), link_block(links))


def replaced(page: str, marks: tuple[str, str], block: str) -> str:
    """The page with what stands from one mark to the other replaced; as it is without them.

    Parameters
    ----------
    page
        HTML text of the page.
    marks
        The mark before and the mark after.
    block
        What stands between the marks then.

    """
    before, begin, rest = page.partition(marks[0])
    _, end, after = rest.partition(marks[1])
    return f"{before}{block}{after}" if begin and end else page
