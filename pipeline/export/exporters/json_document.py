"""Everything that is known of a motor as one JSON document, by a published schema.

`motor-export/1`: constants with uncertainty, the parameters of the effects, and those effects as
tables over speed, angle or current, for whatever interpolates them. Names, units and conventions
are the glossary's; the schema is `motor-export.schema.json`.
"""

from __future__ import annotations

import json

from pipeline.export.protocol import Exporter, Options, Source, Values, no_effect_omitted

SCHEMA = "motor-export/1"


def render(source: Source, options: Options) -> str:
    """The document with sorted keys."""
    del options
    sheet = source.sheet
    constants = {
        one.name: {
            "value": one.value if isinstance(one.value, int) else one.number,
            "u": one.u,
            "unit": one.unit,
            "status": one.status,
            "at": dict(one.at),
            "words": source.terms[one.name].words,
        }
        for one in source.all()
    }
    effects = [
        {
            "effect": name,
            "parameters": {
                short: {"value": value, "u": u, "unit": unit}
                for short, (value, u, unit) in parameters.items()
            },
        }
        for name, parameters in source.sizes().items()
    ]
    document = {
        "schema": SCHEMA,
        "motor_id": sheet.motor_id,
        "motor_type": sheet.motor_type,
        "version": sheet.version,
        "revision": source.revision,
        "constants": constants,
        "effects": effects,
        "tables": [one.document() for one in source.effects.tables],
        "without_table": dict(source.effects.without),
    }
    return json.dumps(document, indent=1, sort_keys=True, ensure_ascii=False) + "\n"


def read(text: str) -> Values:
    """The constants of such a document."""
    constants = json.loads(text)["constants"]
    return {name: float(one["value"]) for name, one in constants.items()}


EXPORTER = Exporter(
    "json", "json", "constants, effects and tables, JSON", render, read, omits=no_effect_omitted
)
