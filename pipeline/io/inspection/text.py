"""What `inspect` says of one field, as text for people."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.io.inspection.parts import PartSeen
from pipeline.io.inspection.proposals import FieldSeen


def field_line(seen: FieldSeen) -> str:
    """What a field is, probably is, or what must be asked of it, with the evidence.

    Parameters
    ----------
    seen
        The field.

    """
    first = "" if seen.first is None else f" (first {seen.first:.6g})"
    why = f"; {seen.why}" if seen.why else ""
    name = f"{seen.name}{first}"
    if seen.column is None:
        return f"{name}: {'unclear' if seen.question else 'not recognised'}{why}"
    unit = f" [{seen.unit}]" if seen.unit else ""
    lacks = ", its unit is not stated" if seen.question else ""
    verb = "is" if seen.certain else "probably"
    return f"{name}: {verb} {seen.column}{unit}{lacks}{why}"


def part_lines(parts: Sequence[PartSeen]) -> list[str]:
    """What the rows of a log show of several tests in it, one line a part.

    Parameters
    ----------
    parts
        The parts.

    """
    several = len({part.file for part in parts}) > 1
    return [
        f"  rows {part.first}-{part.last}{f' of {part.file}' if several else ''}: {part.why}"
        + (f"; test {part.test}" if part.test else "")
        for part in parts
    ]
