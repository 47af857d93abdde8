"""File names for motors: whatever the serial number says, one safe name that no other shares."""

from __future__ import annotations

import hashlib
import re

MAX_CHARS = 100
_KEPT = frozenset("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-_.")
_RESERVED = frozenset(
    ["con", "prn", "aux", "nul", "index"]
    + [f"{port}{n}" for port in ("com", "lpt") for n in range(10)]
)
_CAPITALS = re.compile("(?<![A-Za-z])[A-Za-z]{1,2}(?=-?[0-9])")


def file_stem(motor_id: str) -> str:
    """The file name, without extension, that stands for a motor.

    Parameters
    ----------
    motor_id
        Any text.

    Returns
    -------
    str
        At most `MAX_CHARS` characters; no two motors share a name, whatever its case.

    Notes
    -----
    ASCII letters, digits and `-_.` stay. Every other byte of the UTF-8 form becomes `~` and two
    hexadecimal digits, as do a first `-` or `.`, a last `.`, and the first letter of a name that
    Windows keeps for devices or that a folder of pages keeps for its first page.

    Two ids that differ in case alone must differ on every file system. One or two letters before a
    number are expected in capitals, all others in small letters (`joint-P0`, `SN-12`); an id
    written otherwise ends in `~u` and a hexadecimal mask of the letters that deviate (bit 0 is the
    first). What is then too long keeps a readable beginning and ends in `~h` and a sha256. The
    empty id is `~n`.

    """
    if not motor_id:
        return "~n"
    stem = _escaped(motor_id) + _case_mark(motor_id)
    if len(stem) <= MAX_CHARS:
        return stem
    digest = hashlib.sha256(_bytes(motor_id)).hexdigest()
    return f"{stem[: MAX_CHARS - len(digest) - 2]}~h{digest}"


def counted(number: int, noun: str) -> str:
    """A number of things: `1 motor`, `2 motors`, `2 mismatches`.

    Parameters
    ----------
    number
        How many.
    noun
        Regular, in the singular.

    """
    ending = "" if number == 1 else "es" if noun.endswith(("s", "ch")) else "s"
    return f"{number} {noun}{ending}"


def printable(text: str) -> str:
    """The text in one line that a terminal shows and does not obey.

    Parameters
    ----------
    text
        May hold control characters; these are written as escapes.

    """
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


def _bytes(text: str) -> bytes:
    return text.encode("utf-8", "surrogatepass")


def _escaped(text: str) -> str:
    forced = set()
    if text[0] in "-." or text.split(".", maxsplit=1)[0].lower() in _RESERVED:
        forced.add(0)
    if text[-1] == ".":
        forced.add(len(text) - 1)
    return "".join(
        char
        if char in _KEPT and index not in forced
        else "".join(f"~{byte:02x}" for byte in _bytes(char))
        for index, char in enumerate(text)
    )


def _case_mark(text: str) -> str:
    capitals = {i for m in _CAPITALS.finditer(text) for i in range(*m.span())}
    letters = [(i, char) for i, char in enumerate(text) if char.isascii() and char.isalpha()]
    mask = sum(
        1 << bit for bit, (i, char) in enumerate(letters) if char.isupper() != (i in capitals)
    )
    return f"~u{mask:x}" if mask else ""
