"""Status words in colour, where a person reads them."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from typing import TextIO

GREEN, YELLOW, RED, DIM = "32", "33", "31", "2"
WORDS: Mapping[str, str] = {
    "released": GREEN,
    "adequate": GREEN,
    "same": GREEN,
    "provisional": YELLOW,
    "missing": YELLOW,
    "unknown": YELLOW,
    "marginal": YELLOW,
    "refused": RED,
    "revoked": RED,
    "fail": RED,
    "changed": RED,
}
"""Words of a status and the code of their colour (ECMA-48, SGR)."""
_STATUS = re.compile(rf"(?<![\w/.:=-])({'|'.join(WORDS)})(?![\w/.=-])")
_HEADS = {"error:": RED, "mismatch:": RED, "note:": DIM}


def wanted(stream: TextIO) -> bool:
    """Whether a stream is a terminal that shows colours and whose user has not refused them.

    Parameters
    ----------
    stream
        The stream.

    References
    ----------
    https://no-color.org

    """
    refused = os.environ.get("NO_COLOR", "") or os.environ.get("TERM") == "dumb"
    return stream.isatty() and not refused


def coloured(text: str) -> str:
    """The text with its status words in colour; what is data for a program stays as it is.

    Parameters
    ----------
    text
        Text of an outcome.

    Examples
    --------
    >>> coloured("1 refused, see refused/a.csv").count("refused")
    2
    >>> coloured('{"status": "refused"}')
    '{"status": "refused"}'

    """
    if text.startswith("{"):
        return text
    return "\n".join(_line(line) for line in text.split("\n"))


def _line(line: str) -> str:
    head = line.split(" ", 1)[0]
    if head in _HEADS:
        return line.replace(head, _in(_HEADS[head], head), 1)
    return _STATUS.sub(lambda status: _in(WORDS[status[1]], status[1]), line)


def _in(code: str, text: str) -> str:
    return f"\x1b[{code}m{text}\x1b[0m"
