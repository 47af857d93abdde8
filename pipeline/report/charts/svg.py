"""Elements of a picture: the frame with its words, a text, a line through points, a band."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape


def picture(css: str, width: float, height: float, words: str, *marks: str) -> str:
    """A whole picture.

    Parameters
    ----------
    css
        Its classes.
    width, height
        Of its own coordinates [px].
    words
        What a screen reader says.
    marks
        What is drawn, the last on top.

    """
    return (
        f'<svg class="{css}" viewBox="0 0 {width:g} {height:g}" role="img" '
        f'aria-label="{escape(words)}">{"".join(marks)}</svg>'
    )


def text(css: str, x: float, y: float, words: str, hover: str = "") -> str:
    """A text, with its whole in a hover where it is a short form.

    Parameters
    ----------
    css
        Its classes.
    x, y
        Where [px].
    words
        The text.
    hover
        What the pointer shows; empty for nothing.

    """
    title = f"<title>{escape(hover)}</title>" if hover else ""
    return f'<text class="{css}" x="{x:.1f}" y="{y:.1f}">{title}{escape(words)}</text>'


def line(x: Iterable[float], y: Iterable[float]) -> str:
    """The path through points.

    Parameters
    ----------
    x, y
        Of each [px].

    """
    return "M" + "L".join(f"{a:.1f} {b:.1f}" for a, b in zip(x, y, strict=True))


def band(x: Sequence[float], high: Sequence[float], low: Sequence[float]) -> str:
    """The path around the area between two curves.

    Parameters
    ----------
    x
        Of each point [px].
    high, low
        The curves [px].

    """
    return line([*x, *x[::-1]], [*high, *low[::-1]]) + "Z"
