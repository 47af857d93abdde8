"""Every key of a source map in words: reference page and JSON Schema are built from here."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pipeline.io.maps.units import COUNTS, FOREIGN_UNITS
from pipeline.physics.glossary import COLUMNS, METADATA, TESTS

SCHEMA_ID = "source-map.schema.json"
_KIND_WORDS = {
    "text": "text",
    "texts": "list of texts",
    "pattern": "regular expression",
    "patterns": "list of regular expressions",
    "number": "number",
    "whole": "whole number",
    "flag": "`true` or `false`",
    "metadata": "metadata by key",
    "maps": "list of maps",
    "fields": "as `fields`",
}
_SCALAR: dict[str, Any] = {"type": ["string", "number", "boolean"]}


@dataclass(frozen=True, slots=True)
class Key:
    """A key by its place: `fields.*.unit` is `unit` of any field, `captures[].rows` of any item.

    `kind` is text, texts, pattern, patterns, number, whole, flag, or a list of words of which it
    is one; `example` is YAML.
    """

    place: str
    kind: str | tuple[str, ...]
    words: str
    example: str = ""

    @property
    def kind_words(self) -> str:
        """What the value is, for people."""
        if isinstance(self.kind, tuple):
            return " or ".join(f"`{word}`" for word in self.kind)
        return _KIND_WORDS[self.kind]


KEYS: tuple[Key, ...] = (
    Key("about", "text", "what the map is for; nothing reads it"),
    Key(
        "recognise.files",
        "texts",
        "names of files it is for, with `*` and `?`; every criterion that is stated must hold",
        "['log_*.csv']",
    ),
    Key(
        "recognise.header",
        "pattern",
        "found in the first 256 KiB of a text file, read byte by byte as Latin-1; `^` and `$` "
        "are ends of lines",
        "'^Time;RPM;'",
    ),
    Key(
        "recognise.topics",
        "texts",
        "a topic of an MCAP file, or a table of a form with a `reader`, with `*` and `?`",
        "['/joint*']",
    ),
    Key("reader", "text", "the plug-in for a form that is neither MCAP nor a text table", "npz"),
    Key(
        "messages",
        ("auto", "row", "block"),
        "whether a message of an MCAP file is a row or a block of rows; a file that differs is "
        "refused",
    ),
    Key("joint", "text", "which joint of ROS 2 `JointState` messages is the motor", "knee"),
    Key("layout.separator", "text", "between fields: one character, `tab`, or `space` for blanks"),
    Key("layout.decimal", "text", "decimal sign, one character", "','"),
    Key("layout.encoding", "text", "encoding of the text", "latin-1"),
    Key("layout.comment_lines", "flag", "leading lines with `#` hold metadata; true if not stated"),
    Key("layout.skip_lines", "whole", "lines before the header, or before the rows with `names`"),
    Key("layout.header_match", "pattern", "how the header line begins, instead of `skip_lines`"),
    Key(
        "layout.names",
        "texts",
        "names of the columns of a table without a header; an empty one leaves a column out",
        "[t, iq, '']",
    ),
    Key("layout.units_row", "flag", "the line behind the header names units, see `unit: row`"),
    Key("layout.skip_after_header", "whole", "lines between header and rows, the units row too"),
    Key("layout.fewer_columns", "flag", "rows may end before the header does, all at one column"),
    Key("layout.missing", "texts", "what stands for a missing number, beside nothing", "[∞, '--']"),
    Key("layout.time_start", "pattern", "finds the first instant [s] in the text before the rows"),
    Key("layout.time_increment", "pattern", "finds the sampling interval [s] there"),
    Key("layout.row_end", "text", "what ends every row and is no part of its last field", "';'"),
    Key(
        "layout.instant",
        "text",
        "how a field of date and time of day is written, in strptime's letters, `%.f` for a "
        "fraction of a second; it becomes seconds from the first row",
        "'%d.%m.%Y %H:%M:%S%.f'",
    ),
    Key(
        "layout.whole_last_line",
        "flag",
        "the last row must end in a line break, since a cut number looks whole; true if not stated",
    ),
    Key("fields.*.column", tuple(COLUMNS), "the column of the contract; `NAME: column` for short"),
    Key(
        "fields.*.unit",
        "text",
        "unit of the file's numbers; without it the column's own; `row` takes the units row's; "
        f"`{COUNTS}` needs `scale`",
        "rpm",
    ),
    Key("fields.*.sign", ("1", "-1"), "column = sign * scale * (value in `unit`) + offset"),
    Key("fields.*.scale", "number", "a further factor, such as of a current probe"),
    Key("fields.*.offset", "number", "added last, in the column's unit"),
    Key("fields.*.per_pole_pair", "flag", "divided by the metadata's `pole_pairs`: ERPM"),
    Key(
        "fields.*.wraps",
        "number",
        "span, in the file's numbers, after which a counter or an angle starts again; it is "
        "counted on",
        "65536",
    ),
    Key(
        "fields.*.times",
        "text",
        "field of the map that this one is a share of: a duty cycle times the bus voltage; `scale` "
        "is the voltage at full duty over the bus voltage (1 of a DC motor's bridge, 0.5 or 0.577 "
        "of the amplitude that a sine or a space vector modulation makes)",
        "bus_voltage",
    ),
    Key(
        "time.from",
        ("field", "even", "log", "stamp", "increment"),
        "where `t_s` comes from: a field; a field whose digits are too few, evenly spaced; the "
        "log clock of an MCAP file; the stamp that a message's sender wrote into its header; a "
        "sampling interval",
    ),
    Key("time.wraps_at", "number", "as `wraps` of the clock's field", "86400000"),
    Key("time.start_s", "number", "the first instant [s] with `from: increment`"),
    Key("time.increment_s", "number", "the sampling interval [s], of rows or within a block"),
    Key("metadata.*", "metadata", "what every file of the bench has in common", "{test: drive}"),
    Key(
        "per_file.*",
        "metadata",
        "metadata of files whose name matches; counts before `metadata` and `file_names`",
        "{'cold*': {ambient_degc: -20}}",
    ),
    Key(
        "file_names",
        "patterns",
        "searched in the path of a file below the input folder; every named group is metadata, or "
        "a column that is one number in the file: `(?P<omega_mech_rad_s__rpm>\\d+)rpm`, with "
        "`__minus_rpm` where the name leaves out a minus",
        r"['(?P<motor_id>M\d+)_(?P<test>[A-Za-z]+)']",
    ),
    Key(
        "values.*",
        "metadata",
        "what a word found by `file_names` means, by metadata key",
        "{test: {Auslauf: spin_down}}",
    ),
    Key("captures[].files", "texts", "files that this part is cut from; all without it"),
    Key(
        "captures[].rows",
        "text",
        "first and last row, counted from 0; `5000-` goes to the end; a file with parts is no "
        "capture as a whole",
        "0-4999",
    ),
    Key(
        "captures[].fields",
        "fields",
        "fields of this part alone, beside those of the whole file: of a terminal pair, of a motor",
        "{U2: vbc_v, I2: ib_a}",
    ),
    Key("captures[].*", "metadata", "other keys are metadata of the part", "test: spin_down"),
    Key(
        "variants",
        "maps",
        "maps that are laid over the other keys, one a shape of file; their names are NAME/1, ...",
    ),
)


def keys_page() -> str:
    """The reference page of every key, in Markdown."""
    lines = [
        "# Keys of a source map",
        "",
        "Built by `python -m pipeline schemas` from `pipeline/io/maps/keys.py`; what the keys are",
        "for, and how to get a map, is in [source-maps.md](source-maps.md). `*` is any name, `[]`",
        "one item of a list.",
        "",
        "| key | value | meaning | example |",
        "| --- | --- | --- | --- |",
    ]
    for key in KEYS:
        column = key.place == "fields.*.column"
        kind = "a column of [the glossary](glossary.md)" if column else key.kind_words
        example = f"`{key.example}`" if key.example else ""
        lines.append(f"| `{key.place}` | {kind} | {key.words} | {example} |".replace("|  |", "| |"))
    lines += ["", "## Units", "", "| of columns in | units |", "| --- | --- |"]
    lines += [
        f"| {target} | {', '.join(f'`{unit}`' for unit in units)} |"
        for target, units in FOREIGN_UNITS.items()
    ]
    return "\n".join([*lines, ""])


def map_schema() -> dict[str, Any]:
    """The JSON Schema of a source map, by which editors complete and check one."""
    top = _object("")
    top["properties"]["metadata"]["properties"] = metadata_properties()
    variant = {**top, "properties": {k: v for k, v in top["properties"].items() if k != "variants"}}
    top["properties"]["variants"] = {"type": "array", "minItems": 1, "items": variant}
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "$id": SCHEMA_ID,
        "title": "Source map of a bench",
        **top,
    }


def _object(prefix: str) -> dict[str, Any]:
    """The schema of the map under a place, from the keys that begin with it."""
    properties: dict[str, Any] = {}
    any_key: dict[str, Any] | bool = False
    for key in KEYS:
        if not key.place.startswith(prefix):
            continue
        name, dot, _ = key.place[len(prefix) :].partition(".")
        if name.removesuffix("[]") in properties or (name == "*" and any_key):
            continue
        if name == "*":
            any_key = _any_name(key, f"{prefix}*.") if dot or prefix != "captures[]." else _SCALAR
        elif name.endswith("[]"):
            inner = _object(f"{prefix}{name}.")
            properties[name[:-2]] = {
                "type": "array",
                "items": {**inner, "anyOf": [{"required": ["rows"]}, {"required": ["fields"]}]},
            }
        else:
            properties[name] = _object(f"{prefix}{name}.") if dot else _leaf(key)
    return {"type": "object", "properties": properties, "additionalProperties": any_key}


def _any_name(key: Key, prefix: str) -> dict[str, Any]:
    """The schema of a value under any name: a field, metadata, or metadata by name."""
    if key.place.startswith("fields."):
        return {"anyOf": [{"enum": list(COLUMNS)}, _object(prefix)]}
    if key.place.startswith("metadata."):
        return _SCALAR
    return {"type": "object", "additionalProperties": _SCALAR}


def _leaf(key: Key) -> dict[str, Any]:
    schema: dict[str, Any] = {"description": key.words}
    if isinstance(key.kind, tuple):
        numbers = [int(word) for word in key.kind if word.lstrip("-").isdigit()]
        return {**schema, "enum": numbers or list(key.kind)}
    if key.kind in ("texts", "patterns"):
        texts = {"type": "array", "items": {"type": "string"}}
        return {**schema, "anyOf": [{"type": "string"}, texts]}
    kinds = {
        "number": "number",
        "whole": "integer",
        "flag": "boolean",
        "maps": "array",
        "fields": "object",
    }
    return {**schema, "type": kinds.get(key.kind, "string")}


def metadata_properties() -> dict[str, Any]:
    """Keys of metadata that the contract knows, with their words, for completion."""
    properties: dict[str, Any] = {
        name: {**_SCALAR, "description": term.words}
        for name, term in METADATA.items()
        if name != "contract"
    }
    properties["test"] = {"enum": list(TESTS), "description": METADATA["test"].words}
    return properties
