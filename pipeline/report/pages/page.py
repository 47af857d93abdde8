"""The frame of every page: templates that escape whatever a capture claims to be called.

The links to the other pages of a motor are written anew when one comes: which there are depends on
the commands that were given, in any order.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from jinja2 import Environment

TEMPLATES = Path(__file__).parent / "templates"


def render(template: str, **values: Any) -> str:
    """HTML text of a template; a value that the template names and that is not given is an error.

    The indentation of the templates is not part of it.

    Parameters
    ----------
    template
        File name of the template.
    values
        Object or mapping that the template reads.

    """
    text = _environment().get_template(template).render(**values)
    return re.sub(r"\s*\n\s*", "\n", text)


@cache
def _environment() -> Environment:
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    return Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        finalize=_in_code,
        trim_blocks=True,
        lstrip_blocks=True,
        auto_reload=False,
    )


def _in_code(value: Any) -> Any:
    """A value as a page shows it: what stands between backticks in a message is code."""
    if not isinstance(value, str) or hasattr(value, "__html__") or not value.count("`"):
        return value
    from markupsafe import Markup

    parts = value.split("`")
    if len(parts) % 2 == 0:
        return value
    code = Markup("<code>{}</code>")
    return Markup("").join(code.format(part) if k % 2 else part for k, part in enumerate(parts))


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
