"""Numbers and texts of untrusted files: the one place where such bytes are converted.

Python's own conversions raise five kinds of errors on text that no bench writes (5,000 digits,
half a surrogate pair, 200,000 brackets) and take some that nobody means (`1_000`, `nan`, Arabic
digits). Here None comes back for a number that is none, so that a type checker asks every caller
what then.
"""

from __future__ import annotations

import json
import math
import re
from datetime import UTC, datetime
from typing import Any

MOST_CHARS = 400
"""Of a number: more than the 309 digits of the largest double."""
MOST_DIGITS = 18
"""Of a whole number: all of them fit into 64 bits."""
_WHOLE = re.compile(r"[+-]?[0-9]+")
_NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")


class ParseError(ValueError):
    """Bytes that are not what they should be; the text says why, as the end of a sentence."""


def whole(text: str, low: int = 0, high: int = 10**MOST_DIGITS) -> int | None:
    """The whole number that a text is.

    Parameters
    ----------
    text
        Decimal digits with or without a sign; blanks are not taken.
    low, high
        Bounds, both inclusive.

    Returns
    -------
    int or None
        None for other text, and for a number out of bounds.

    Examples
    --------
    >>> whole("12"), whole("-1"), whole("1.0")
    (12, None, None)

    """
    if len(text) > MOST_CHARS or not _WHOLE.fullmatch(text):
        return None
    digits = text.lstrip("+-").lstrip("0") or "0"
    if len(digits) > MOST_DIGITS + 1:
        return None
    value = -int(digits) if text.startswith("-") else int(digits)
    return value if low <= value <= high else None


def number(text: str) -> float | None:
    """The finite number that a text is.

    Parameters
    ----------
    text
        With a point as decimal sign; blanks around it are taken.

    Returns
    -------
    float or None
        None for other text, `nan` and `inf` among it, and for what is too large.

    Examples
    --------
    >>> number(" 1.5e3 "), number("1,5"), number("nan")
    (1500.0, None, None)

    """
    bare = text.strip()
    if len(bare) > MOST_CHARS or not _NUMBER.fullmatch(bare):
        return None
    value = float(bare)
    return value if math.isfinite(value) else None


def moment(text: str) -> datetime | None:
    """The moment that an ISO 8601 text names.

    Parameters
    ----------
    text
        Any text.

    Returns
    -------
    datetime or None
        With a time zone where the text has one; None for a text of another form.

    """
    try:
        return datetime.fromisoformat(text)
    except ValueError:
        return None


def utc_moment(text: str) -> datetime | None:
    """The moment that an ISO 8601 text names, in UTC.

    Parameters
    ----------
    text
        Any text; without a zone it counts as UTC.

    Returns
    -------
    datetime or None
        None for a text of another form, and where UTC would be before the year 1 or after 9999.

    """
    instant = moment(text)
    try:
        return instant and (instant if instant.tzinfo else instant.replace(tzinfo=UTC)).astimezone(
            UTC
        )
    except OverflowError:
        return None


def decoded(data: bytes, encoding: str = "utf-8") -> str:
    """The text that bytes hold.

    Parameters
    ----------
    data
        Content of a file.
    encoding
        Name of a codec.

    Returns
    -------
    str
        Without a replacement for any byte.

    Raises
    ------
    ParseError
        The bytes are no text in that encoding, or there is no such encoding.

    """
    try:
        return data.decode(encoding)
    except (UnicodeError, LookupError):
        name = "UTF-8" if encoding in ("utf-8", "utf-8-sig") else f"{encoding} text"
        raise ParseError(f"is not {name}") from None


def is_text(value: str) -> bool:
    """Whether a text can be written as UTF-8: no half of a surrogate pair, as JSON can spell it.

    Parameters
    ----------
    value
        Any string.

    """
    try:
        value.encode()
    except UnicodeEncodeError:
        return False
    return True


def json_value(data: bytes, *, unique_keys: bool = False) -> Any:
    """The value of a UTF-8 JSON document; NaN is taken, for recorders write it.

    Parameters
    ----------
    data
        Bytes of the document.
    unique_keys
        Whether a key that is there twice is an error.

    Returns
    -------
    object
        A whole number of more digits than 64 bits hold as a float.

    Raises
    ------
    ParseError
        It is no JSON, nests too deep, holds a number of more digits than any counter has, a text
        with half a surrogate pair, or a key twice where keys are to be unique.

    References
    ----------
    RFC 8259 (JSON), which has no NaN.

    """
    hook = _unique if unique_keys else None
    try:
        value = json.loads(decoded(data), parse_int=_json_whole, object_pairs_hook=hook)
        if b"\\u" in data and not is_text(json.dumps(value, ensure_ascii=False)):
            raise ParseError("holds half of a surrogate pair, which is no text")
    except ParseError:
        raise
    except RecursionError:
        raise ParseError("nests too deep") from None
    except ValueError as fault:
        raise ParseError(f"cannot be read: {fault}"[:160]) from None
    return value


def _json_whole(digits: str) -> int | float:
    """A whole number exactly; as a double where it has more digits than 64 bits hold."""
    if len(digits) <= MOST_DIGITS + 2:
        return int(digits)
    if len(digits) > MOST_CHARS:
        raise ParseError(f"holds a number of {len(digits)} digits")
    return float(digits)


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    members = dict(pairs)
    if len(members) != len(pairs):
        raise ParseError("has a key twice")
    return members
