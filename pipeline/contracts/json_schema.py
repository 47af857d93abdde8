"""JSON Schemas of everything the pipeline writes, from its records and the glossary.

They are published under `pipeline/contracts/json/`, written by `python -m pipeline schemas`.
Every file may hold more than its schema names; numbers are finite or null, never NaN. A file whose
keys are not the fields of one record is put together here, of records.
"""

from __future__ import annotations

from collections.abc import Mapping

from pipeline.contracts.schema_form import (
    Schema,
    document,
    list_of,
    map_of,
    object_of,
    of_kind,
    of_record,
)
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
from pipeline.records.field_kinds import Count, Extension, Name, Sha256, Spread
from pipeline.records.finding import Finding
from pipeline.records.lot_regression import LotRegression
from pipeline.records.model_verdict import FoundEffect, ModelVerdict, Parameters
from pipeline.records.performance import Blank, Curve, Derived, MapCell, Operation

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
