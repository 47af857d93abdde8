"""A table of every constant with its uncertainty, RFC 4180.

Names, units and conventions are the glossary's; `conditions` are those that the value holds for.
"""

from __future__ import annotations

import csv
import io

from pipeline.export.protocol import Exporter, Options, Source, Values, no_effect_omitted, plain

HEAD = ("name", "value", "unit", "u", "status", "conditions", "words")


def render(source: Source, options: Options) -> str:
    """One row a constant under a header line; what it is of stands in the first rows."""
    del options
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(HEAD)
    sheet = source.sheet
    own = {"motor_id": plain(sheet.motor_id), "version": sheet.version}
    for name, text in own.items():
        writer.writerow((name, text, "", "", "", "", f"revision {source.revision}, released"))
    for estimate in source.all():
        term = source.terms[estimate.name]
        value = estimate.value if isinstance(estimate.value, int) else estimate.number
        at = "; ".join(f"{key}={value}" for key, value in sorted(estimate.at.items()))
        writer.writerow(
            (
                estimate.name,
                repr(value),
                term.unit,
                repr(estimate.u),
                estimate.status,
                at,
                term.words,
            )
        )
    for name, value, u, unit in source.effect_parameters():
        writer.writerow((name, repr(value), unit, repr(u), "measured", "", "of an effect"))
    return stream.getvalue()


def read(text: str) -> Values:
    """The constants of such a table."""
    rows = list(csv.DictReader(io.StringIO(text)))
    return {row["name"]: float(row["value"]) for row in rows if row["unit"]}


EXPORTER = Exporter(
    "csv", "csv", "table of constants with uncertainties", render, read, omits=no_effect_omitted
)
