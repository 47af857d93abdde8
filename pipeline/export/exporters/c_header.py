"""A C header with every constant as a macro, in the glossary's names, units and conventions.

The name of a macro is that of the constant in capitals; its comment says what the number is, in
which unit, and its standard uncertainty.
"""

from __future__ import annotations

import re

from pipeline.export.protocol import Exporter, Options, Source, Values, no_effect_omitted, plain

PREFIX = "MOTOR_"
MACRO = re.compile(rf"#define {PREFIX}([A-Z0-9_]+) \(?([-+.0-9eE]+)\)?")


def render(source: Source, options: Options) -> str:
    """The header; a whole constant is an integer, every other a double."""
    del options
    lines = [f"/* {line} */" for line in source.heading()]
    lines += ["#ifndef MOTOR_DATASHEET_H", "#define MOTOR_DATASHEET_H", ""]
    for estimate in source.all():
        term = source.terms[estimate.name]
        whole = isinstance(estimate.value, int)
        number = repr(estimate.value if whole else estimate.number)
        shown = f"({number})" if number.startswith("-") else number
        unit = "" if term.unit == "1" else f" [{term.unit}]"
        words = plain(f"{term.words}{unit}, u = {estimate.u:.3g}, {estimate.status}")
        lines.append(f"#define {PREFIX}{estimate.name.upper()} {shown} /* {words} */")
    for name, value, u, unit in source.effect_parameters():
        number = f"({value!r})" if value < 0.0 else repr(value)
        words = plain(f"effect [{unit}], u = {u:.3g}")
        lines.append(f"#define {PREFIX}{name.upper()} {number} /* {words} */")
    return "\n".join([*lines, "", "#endif", ""])


def read(text: str) -> Values:
    """The constants of such a header."""
    return {name.lower(): float(number) for name, number in MACRO.findall(text)}


EXPORTER = Exporter(
    "c-header", "h", "C header, one macro a constant", render, read, omits=no_effect_omitted
)
