"""JSON Schemas of everything the pipeline writes, from its records and the glossary.

They are published under `pipeline/contracts/json/`, written by `python -m pipeline schemas`.
Every file may hold more than its schema names; numbers are finite or null, never NaN. A file whose
keys are not the fields of one record is put together here, of records.

A record's schema follows from the kinds of its fields.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import is_dataclass
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from pipeline.physics.glossary import CONSTANTS, TESTS, Term
from pipeline.records.comparison import (
    Dependence,
    KnownCombination,
    ModelParameter,
    ParameterStatus,
    Signal,
    SignalError,
)
from pipeline.records.datasheet import CaptureReference, Check, DatasheetStatus, Superseded
from pipeline.records.diagnosis import Diagnosis
from pipeline.records.effect_table import EffectTable
from pipeline.records.error_map import ErrorMap
from pipeline.records.estimate import Conditions, Estimate, Status
from pipeline.records.field_kinds import EXTENSION, Count, Extension, Keyword, Name, Sha256, Spread
from pipeline.records.finding import Finding
from pipeline.records.lot_regression import LotRegression
from pipeline.records.model_verdict import FoundEffect, ModelVerdict, Parameters
from pipeline.records.performance import Blank, Curve, Derived, MapCell, Operation

Schema = dict[str, Any]

DIALECT = "https://json-schema.org/draft/2020-12/schema"
ARRAYS: Mapping[Any, Schema] = {
    NDArray[np.int64]: {"type": "array", "items": {"type": ["integer", "array"]}},
    NDArray[np.float64]: {"type": "array", "items": {"type": ["number", "null", "array"]}},
}
SCALARS: Mapping[Any, str] = {float: "number", int: "integer", str: "string", bool: "boolean"}


def object_of(needed: Mapping[str, Any], more: Mapping[str, Any] | None = None) -> Schema:
    """An object; other keys than those named are allowed.

    Parameters
    ----------
    needed
        Kinds of keys that it must hold, or their schemas.
    more
        Those of keys that it may hold.

    """
    kinds = {**needed, **(more or {})}
    return {
        "type": "object",
        "properties": {name: of_kind(kind) for name, kind in kinds.items()},
        "required": sorted(needed),
    }


def document(identity: str, words: str, body: Schema) -> Schema:
    """The schema of a file.

    Parameters
    ----------
    identity
        Such as `findings/1`; the file holds it under `schema`.
    words
        Title in a few words.
    body
        Schema of the file's keys; it is changed in place.

    """
    body["properties"]["schema"] = {"const": identity}
    body["required"] = sorted({*body["required"], "schema"})
    return {"$schema": DIALECT, "$id": f"urn:{identity}", "title": words, **body}


def list_of(items: Schema) -> Schema:
    """A list of one kind of item.

    Parameters
    ----------
    items
        Schema of an item.

    """
    return {"type": "array", "items": items}


def map_of(values: Schema) -> Schema:
    """An object of one kind of value under any name.

    Parameters
    ----------
    values
        Schema of a value.

    """
    return {"type": "object", "additionalProperties": values}


def of_record(record: type, *, without: Sequence[str] = (), **changed: Any) -> Schema:
    """The schema of a record: every field is a needed key, save an `Extension`.

    Parameters
    ----------
    record
        A dataclass or a named tuple.
    without
        Fields that are not written.
    **changed
        Kinds or schemas of keys that its JSON form has beside its fields, or unlike them.

    """
    hints = get_type_hints(record, include_extras=True)
    kinds = {name: kind for name, kind in hints.items() if name not in without} | changed
    more = {name: kind for name, kind in kinds.items() if EXTENSION in _marks(kind)}
    return object_of({name: kind for name, kind in kinds.items() if name not in more}, more)


def of_kind(kind: Any) -> Schema:
    """The schema of a field of a record.

    Parameters
    ----------
    kind
        Its type: a record, a tuple, a mapping, a literal, an array, a scalar, or several of these;
        a schema is its own.

    """
    if isinstance(kind, dict):
        return kind
    origin, inner = get_origin(kind), get_args(kind)
    if origin is Annotated:
        keywords = [mark for mark in _marks(kind) if isinstance(mark, Keyword)]
        return of_kind(inner[0]) | {word.name: word.value for word in keywords}
    if origin in FORMS:
        return FORMS[origin](inner)
    if is_dataclass(kind) or hasattr(kind, "_fields"):
        return of_record(kind)
    return ARRAYS.get(kind) or {"type": SCALARS[kind]}


def _marks(kind: Any) -> tuple[Any, ...]:
    return kind.__metadata__ if get_origin(kind) is Annotated else ()


def _any_of(kinds: tuple[Any, ...]) -> Schema:
    """One of several kinds; a whole number is a number."""
    kinds = tuple(kind for kind in kinds if kind is not int or float not in kinds)
    schemas = [{"type": "null"} if kind is NoneType else of_kind(kind) for kind in kinds]
    return schemas[0] if len(schemas) == 1 else {"anyOf": schemas}


def _tuple(kinds: tuple[Any, ...]) -> Schema:
    """A list of one kind of item, of any length or of one."""
    length = {} if kinds[-1] is Ellipsis else {"minItems": len(kinds), "maxItems": len(kinds)}
    return list_of(of_kind(kinds[0])) | length


FORMS: Mapping[Any, Callable[[tuple[Any, ...]], Schema]] = {
    Union: _any_of,
    UnionType: _any_of,
    tuple: _tuple,
    Mapping: lambda kinds: map_of(of_kind(kinds[1])),
    Literal: lambda kinds: {"enum": list(kinds)},
}


ESTIMATE: Schema = {"$ref": "#/$defs/estimate"}
Names = tuple[Name, ...]
Texts = tuple[str, ...]


def _estimate() -> Schema:
    """An estimate as records write it: a value exactly when it is identifiable."""
    known = {"value": float, "u": Spread, "u_a": Spread, "u_b": Spread}
    or_null = {name: kind | None for name, kind in {**known, "dof": Spread}.items()}
    schema = of_record(Estimate, without=("name", "impossible"), **or_null)
    schema["if"] = {"properties": {"status": {"const": "not_identifiable"}}}
    schema["then"] = {"properties": {name: {"type": "null"} for name in known}}
    schema["else"] = {"properties": {name: of_kind(kind) for name, kind in known.items()}}
    return schema


def _constant(term: Term) -> Schema:
    """What the glossary adds for one constant: its words, unit, range and wholeness."""
    value: Schema = {"type": ["integer" if term.integer else "number", "null"]}
    if term.low is not None and term.high is not None:
        value |= {"minimum": term.low, "maximum": term.high}
    limits = {"properties": {"unit": {"const": term.unit}, "value": value}}
    return {"description": term.words, "allOf": [ESTIMATE, limits]}


def _constants() -> Schema:
    return {
        "type": "object",
        "properties": {name: _constant(term) for name, term in sorted(CONSTANTS.items())},
        "additionalProperties": ESTIMATE,
    }


def _provenance() -> Schema:
    """What a datasheet was computed from: captures, configuration, code."""
    captures = list_of(of_record(CaptureReference, test={"enum": [*TESTS]}))
    return object_of(
        {"captures": captures, "config_sha256": Sha256, "code_version": Name}, {"libraries": str}
    )


def _model() -> Schema:
    """The residual test of a datasheet: numbers where a model was fitted."""
    schema = of_record(ModelVerdict, missing=list_of(of_record(FoundEffect, effect=Name)))
    properties = schema["properties"]
    properties["name"] = properties.pop("model")
    properties["fitted"] = list_of(object_of({"effect": Name, "parameters": Parameters}))
    return schema


def datasheet_schema() -> Schema:
    """`datasheets/MOTOR.json`."""
    body = object_of(
        {
            "motor_id": Name,
            "motor_type": str | None,
            "lot": str | None,
            "version": Sha256,
            "status": DatasheetStatus,
            "provenance": _provenance(),
            "constants": _constants(),
            "checks": tuple[Check, ...],
        },
        {
            "why": Texts,
            "supersedes": Superseded | None,
            "alternatives": list_of({"allOf": [ESTIMATE, object_of({"name": Name})]}),
            "model": _model(),
        },
    )
    return document("motor-datasheet/1", "One version of one motor's datasheet", body) | {
        "$defs": {"estimate": _estimate()}
    }


def performance_schema() -> Schema:
    """`performance/MOTOR.json`: what a motor does at stated conditions, 95 % intervals."""
    body = object_of(
        {
            "motor_id": Name,
            "datasheet_version": Sha256,
            "operation": Operation | None,
            "numbers": tuple[Derived, ...],
            "curves": tuple[Curve, ...],
            "efficiency_map": tuple[MapCell, ...],
            "blanks": tuple[Blank, ...],
        },
        {"regimes": Texts, "notes": Texts},
    )
    return document("motor-performance/1", "A motor's curves and ratings", body)


def export_schema() -> Schema:
    """`export json`: constants, effects, and the effects as tables."""
    constant = object_of(
        {"value": float, "u": Spread, "unit": Name, "status": Status, "words": str},
        {"at": Conditions},
    )
    body = object_of(
        {
            "motor_id": Name,
            "motor_type": str | None,
            "version": Sha256,
            "revision": Count,
            "constants": map_of(constant),
            "effects": list_of(object_of({"effect": Name, "parameters": Parameters})),
            "tables": tuple[EffectTable, ...],
            "without_table": Mapping[str, Name],
        }
    )
    return document("motor-export/1", "A released motor for other programs", body)


def findings_schema() -> Schema:
    """`findings.json`."""
    body = object_of({"findings": tuple[Finding, ...]})
    return document("findings/1", "What was refused or doubted", body)


def comparison_schema() -> Schema:
    """`comparison/MOTOR.json`."""
    status = Extension[ParameterStatus]
    parameter = of_record(ModelParameter, without=("stated",), status=status)
    sized = object_of({"value": float, "u": Spread})
    moved = {"parameter": Name, "unit": Name, "before": sized, "after": sized, "change_in_u": float}
    body = object_of(
        {
            "motor_id": Name,
            "model": object_of(
                {"name": Name, "effects": Names, "parameters": map_of(parameter)},
                {"combinations": tuple[KnownCombination, ...]},
            ),
            "errors": list_of(of_record(SignalError, signal=Signal)),
            "total": object_of({"held_out": Spread | None}),
            "where": list_of(of_record(Dependence, signal=Signal)),
        },
        {"maps": tuple[ErrorMap, ...], "moved": list_of(object_of(moved))},
    )
    return document("model-comparison/1", "A model held against a motor's captures", body)


def truth_schema() -> Schema:
    """`truth.json` beside simulated captures; effects and sizes are free text and numbers."""
    constants = {
        name: (int if term.integer else float) | None for name, term in sorted(CONSTANTS.items())
    }
    body = object_of({"constants": object_of({}, constants), "hidden": Names, "sizes": map_of({})})
    return document("motor-truth/1", "What is true of simulated captures", body)


def build_schemas() -> dict[str, Schema]:
    """Every schema by the stem of its file `STEM.schema.json`."""
    diagnosis = of_record(Diagnosis)
    files = object_of({"files": Names}, {"motors": Mapping[str, Names]})
    regression = of_record(LotRegression)
    regression_words = "A lot, or a version of the code, against another"
    return {
        "findings": findings_schema(),
        "lot-regression": document("lot-regression/1", regression_words, regression),
        "model-comparison": comparison_schema(),
        "model-diagnosis": document(
            "model-diagnosis/1", "What a model of a motor leaves out", diagnosis
        ),
        "motor-datasheet": datasheet_schema(),
        "motor-export": export_schema(),
        "motor-performance": performance_schema(),
        "motor-truth": truth_schema(),
        "outputs": document("outputs/1", "Files of the last run", files),
    }
