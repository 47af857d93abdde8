"""The table of keys of a source map: page and schema say what the parser takes."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import jsonschema
import pytest
import yaml

import pipeline
from pipeline.io.maps.keys import KEYS, map_schema
from pipeline.io.maps.map_file import parse_source_file
from pipeline.io.maps.section import Section
from pipeline.records.errors import UsageError
from pipeline.stages.schemas import build

ROOT = Path(pipeline.__file__).parents[1]
MAPS = sorted((ROOT / "conf" / "source").glob("*.yaml"))
EVERYTHING = """
about: all of it
fields: {a: {column: t_s}, b: vdc_v}
metadata: {test: drive}
per_file: {'x*': {test: lcr}}
values: {test: {a: drive}}
file_names: '(?P<test>a)'
captures: [{rows: 0-1, files: x, test: drive}]
variants: [{recognise: {header: a}}]
"""


def _place(section: Section, key: str) -> str:
    where = re.sub(r"\[\d+\]", "[]", section.where)
    where = re.sub(r"^fields\..+", "fields.*", where)
    return f"{where}.{key}".strip(".")


def test_every_key_that_the_parser_asks_for_is_in_the_table(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """And the other way round; names that a user chooses are `*`."""
    asked: set[str] = set()
    take = Section.take

    def noting(self: Section, key: str) -> Any:
        asked.add(_place(self, key))
        return take(self, key)

    monkeypatch.setattr(Section, "take", noting)
    parse_source_file(EVERYTHING.encode(), "x")
    free = ("metadata.", "per_file.", "values.", "captures[].test")
    found = {place for place in asked if not place.startswith(free)}
    groups = {"recognise", "layout", "fields", "time", "metadata", "per_file", "values", "captures"}
    known = {key.place for key in KEYS if not key.place.endswith("*")}
    assert found - groups - {"fields.a", "fields.b"} == known - {"variants"}


def test_what_is_published_is_what_the_code_builds() -> None:
    for name in ("conf/source/source-map.schema.json", "docs/source-map-keys.md"):
        assert (ROOT / name).read_bytes() == build()[name], name


@pytest.mark.parametrize("path", MAPS, ids=lambda path: path.stem)
def test_every_shipped_map_passes_the_schema(path: Path) -> None:
    jsonschema.Draft202012Validator(map_schema()).validate(yaml.safe_load(path.read_text()))


@pytest.mark.parametrize(
    "text",
    [
        "recognise: {heder: a}",
        "fields: {a: {column: speed}}",
        "fields: {a: {column: t_s, units: ms}}",
        "time: {from: clock}",
        "captures: [{test: drive}]",
        "variants: []",
        "metadata: {test: dance}",
        "layout: {units_row: maybe}",
    ],
)
def test_the_schema_refuses_what_the_parser_or_the_contract_refuses(text: str) -> None:
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.Draft202012Validator(map_schema()).validate(yaml.safe_load(text))
    if "dance" not in text:
        with pytest.raises(UsageError):
            parse_source_file(text.encode(), "x")
