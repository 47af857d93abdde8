"""A plot that a notebook shows and a file keeps."""

from __future__ import annotations

import base64
import re
from dataclasses import dataclass
from functools import cache
from html import escape
from pathlib import Path

from pipeline.report.pages.page import TEMPLATES

_DRAWING_RULE = re.compile(r"^(?:svg |\.ladder)[^{}]*\{[^{}]*\}", re.MULTILINE)


@dataclass(frozen=True, slots=True, repr=False)
class Figure:
    """One drawing as a self-contained SVG document; light and dark follow the viewer.

    Attributes
    ----------
    title : str
        What is drawn.
    svg : str
        The SVG document.

    """

    title: str
    svg: str

    def __repr__(self) -> str:
        return f"Figure({self.title!r})"

    def _repr_html_(self) -> str:
        """The drawing as an image, so that its style sheet stays its own."""
        encoded = base64.b64encode(self.svg.encode()).decode()
        return f'<img alt="{escape(self.title)}" src="data:image/svg+xml;base64,{encoded}"/>'

    def save(self, path: str | Path) -> Path:
        """Writes the SVG document.

        Parameters
        ----------
        path : path
            The file to write.

        Returns
        -------
        pathlib.Path
            The path of the file.

        """
        place = Path(path)
        place.write_text(self.svg, encoding="utf-8")
        return place


def figure(title: str, element: str) -> Figure:
    """A figure of the report's inline `<svg>` element, with the report's style sheet.

    Parameters
    ----------
    title
        What is drawn.
    element
        Text that begins with `<svg`; anything else is the report's remark that there is nothing to
        draw.

    Returns
    -------
    Figure
        One self-contained SVG document.

    Raises
    ------
    ValueError
        The element is no `<svg>`: no sample is finite.

    """
    if not element.startswith("<svg"):
        raise ValueError(f"{title}: no finite samples to draw")
    style = _style()
    head, _, body = element.partition(">")
    head = head.replace("<svg", '<svg xmlns="http://www.w3.org/2000/svg"', 1)
    return Figure(title, f"{head}><style><![CDATA[{style}]]></style>{body}")


@cache
def _style() -> str:
    """The report's colours and its rules for drawings, without those for pages."""
    sheet = (TEMPLATES / "style.css").read_text(encoding="utf-8")
    colours, _, rules = sheet.partition("* {")
    return "\n".join([colours.rstrip(), *_DRAWING_RULE.findall(rules)])
