"""JSON Schemas of everything the pipeline writes, built from the glossary and the records.

They are published under `pipeline/contracts/json/`, written by `python -m pipeline schemas`.
Every file may hold more than its schema names; numbers are finite or null, never NaN.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import is_dataclass
from types import UnionType
from typing import Any, Literal, Union, get_args, get_origin

from pipeline.physics.glossary import CONSTANTS, TESTS, Term
from pipeline.records.capture import Integrity
from pipeline.records.datasheet import CheckStatus, DatasheetStatus
from pipeline.records.diagnosis import Unexcited
from pipeline.records.effect_table import EffectTable
from pipeline.records.estimate import Status
from pipeline.records.finding import Severity
from pipeline.records.lot_regression import LotRegression
from pipeline.records.model_verdict import ModelState
from pipeline.records.performance import Blank, Curve, Derived, MapCell, Operation
from pipeline.records.plain_form import hints_of
from pipeline.records.uncertainty import Kind

Schema = dict[str, Any]

DIALECT = "https://json-schema.org/draft/2020-12/schema"
TEXT: Schema = {"type": "string"}
NAME: Schema = {"type": "string", "minLength": 1}
NUMBER: Schema = {"type": "number"}
WHOLE: Schema = {"type": "integer"}
SPREAD: Schema = {"type": "number", "minimum": 0}
SHARE: Schema = {"type": "number", "minimum": 0, "maximum": 1}
COUNT: Schema = {"type": "integer", "minimum": 0}
SHA256: Schema = {"type": "string", "pattern": "^[0-9a-f]{64}$"}


def _or_null(schema: Schema) -> Schema:
    return {"anyOf": [schema, {"type": "null"}]}


def _one_of(literal: Any) -> Schema:
    return {"enum": list(get_args(literal))}


def _list(items: Schema, **more: Any) -> Schema:
    return {"type": "array", "items": items, **more}


def _map(values: Schema) -> Schema:
    return {"type": "object", "additionalProperties": values}


def _object(needed: Mapping[str, Schema], more: Mapping[str, Schema] | None = None) -> Schema:
    """An object that holds `needed`, may hold `more`, and anything else."""
    return {
        "type": "object",
        "properties": {**needed, **(more or {})},
        "required": sorted(needed),
    }


def _document(identity: str, words: str, body: Schema) -> Schema:
    body["properties"]["schema"] = {"const": identity}
    body["required"] = sorted({*body["required"], "schema"})
    return {"$schema": DIALECT, "$id": f"urn:{identity}", "title": words, **body}


def _estimate() -> Schema:
    """An estimate as records write it: a value exactly when it is identifiable."""
    known = {"value": NUMBER, "u": SPREAD, "u_a": SPREAD, "u_b": SPREAD}
    unknown = {name: {"type": "null"} for name in known}
    schema = _object(
        {
            "value": _or_null(NUMBER),
            "unit": NAME,
            "u": _or_null(SPREAD),
            "u_a": _or_null(SPREAD),
            "u_b": _or_null(SPREAD),
            "dof": _or_null(SPREAD),
            "at": _map({"type": ["number", "string"]}),
            "method": TEXT,
            "status": _one_of(Status),
            "captures": _list(NAME),
            "note": TEXT,
        },
        {
            "bounds": _or_null(_list(NUMBER, minItems=2, maxItems=2)),
            "at_bound": {"type": "boolean"},
            "settled": {"const": True},
            "orders": _list(
                _object({"order": COUNT, "amplitude": SPREAD, "u": SPREAD, "phase_rad": NUMBER})
            ),
            "budget": _list(
                _object(
                    {"source": NAME, "u": NUMBER, "kind": _one_of(Kind)}, {"dof": _or_null(SPREAD)}
                )
            ),
        },
    )
    schema["if"] = {"properties": {"status": {"const": "not_identifiable"}}}
    schema["then"] = {"properties": unknown}
    schema["else"] = {"properties": known}
    return schema


def _constant(term: Term) -> Schema:
    """What the glossary adds for one constant: its words, unit, range and wholeness."""
    value: Schema = {"type": ["integer" if term.integer else "number", "null"]}
    if term.low is not None and term.high is not None:
        value |= {"minimum": term.low, "maximum": term.high}
    own = {"properties": {"unit": {"const": term.unit}, "value": value}}
    return {"description": term.words, "allOf": [{"$ref": "#/$defs/estimate"}, own]}


def _check() -> Schema:
    return _object(
        {
            "name": NAME,
            "status": _one_of(CheckStatus),
            "value": _or_null(NUMBER),
            "limit": _or_null(NUMBER),
            "unit": NAME,
            "meaning": TEXT,
            "suspect": _or_null(TEXT),
        }
    )


def _model() -> Schema:
    """The residual test of a datasheet: numbers where a model was fitted."""
    quantity = _object({"value": _or_null(NUMBER), "u": _or_null(SPREAD), "unit": TEXT})
    excess = {"capture": NAME, "signal": NAME, "order": SPREAD, "floors": SPREAD, "size": SPREAD}
    return _object(
        {
            "verdict": _one_of(ModelState),
            "missing": _list(
                _object(
                    {"effect": NAME, "parameters": _map(quantity)},
                    {"headline": TEXT, "confused_with": _list(NAME), "experiment": TEXT},
                )
            ),
            "held_out": _or_null(SPREAD),
            "residual": _or_null(SPREAD),
        },
        {
            "name": NAME,
            "effects": _list(NAME),
            "worst": _or_null(_object({**excess, "unit": TEXT})),
            "over": COUNT,
            "note": TEXT,
            "held_out_with": _or_null(SPREAD),
            "unknown": TEXT,
            "unexcited": _list(_kind(Unexcited)),
            "fitted": _list(_object({"effect": NAME, "parameters": _map(quantity)})),
            "scales": _map(SPREAD),
        },
    )


def datasheet_schema() -> Schema:
    """`datasheets/MOTOR.json`."""
    capture = {"path": NAME, "sha256": SHA256, "test": {"enum": [*TESTS]}}
    capture["integrity"] = _one_of(Integrity)
    constants: Schema = {
        "type": "object",
        "properties": {name: _constant(term) for name, term in sorted(CONSTANTS.items())},
        "additionalProperties": {"$ref": "#/$defs/estimate"},
    }
    body = _object(
        {
            "motor_id": NAME,
            "motor_type": _or_null(TEXT),
            "lot": _or_null(TEXT),
            "version": SHA256,
            "status": _one_of(DatasheetStatus),
            "provenance": _object(
                {
                    "captures": _list(
                        _object(
                            capture,
                            {
                                "station": _or_null(TEXT),
                                "started_at": _or_null(TEXT),
                                "read_sha256": _or_null(SHA256),
                            },
                        )
                    ),
                    "config_sha256": SHA256,
                    "code_version": NAME,
                },
                {"libraries": TEXT},
            ),
            "constants": constants,
            "checks": _list(_check()),
        },
        {
            "why": _list(TEXT),
            "supersedes": _or_null(_object({"version": SHA256, "by": TEXT, "why": TEXT})),
            "alternatives": _list(
                {"allOf": [{"$ref": "#/$defs/estimate"}, _object({"name": NAME})]}
            ),
            "model": _model(),
        },
    )
    return _document("motor-datasheet/1", "One version of one motor's datasheet", body) | {
        "$defs": {"estimate": _estimate()}
    }


def performance_schema() -> Schema:
    """`performance/MOTOR.json`: what a motor does at stated conditions, 95 % intervals."""
    lists = {"numbers": Derived, "curves": Curve, "efficiency_map": MapCell, "blanks": Blank}
    needed = {"motor_id": NAME, "datasheet_version": SHA256}
    needed |= {"operation": _or_null(_kind(Operation))}
    needed |= {name: _list(_kind(record)) for name, record in lists.items()}
    body = _object(needed, {"regimes": _list(TEXT), "notes": _list(TEXT)})
    return _document("motor-performance/1", "A motor's curves and ratings", body)


def export_schema() -> Schema:
    """`export json`: constants, effects, and the effects as tables."""
    quantity = _object({"value": _or_null(NUMBER), "u": _or_null(SPREAD), "unit": TEXT})
    constant = _object(
        {"value": NUMBER, "u": SPREAD, "unit": NAME, "status": _one_of(Status), "words": TEXT},
        {"at": _map({"type": ["number", "string"]})},
    )
    body = _object(
        {
            "motor_id": NAME,
            "motor_type": _or_null(TEXT),
            "version": SHA256,
            "revision": COUNT,
            "constants": _map(constant),
            "effects": _list(_object({"effect": NAME, "parameters": _map(quantity)})),
            "tables": _list(_kind(EffectTable)),
            "without_table": _map(NAME),
        }
    )
    return _document("motor-export/1", "A released motor for other programs", body)


def findings_schema() -> Schema:
    """`findings.json`."""
    finding = _object(
        {
            "file": TEXT,
            "severity": _one_of(Severity),
            "code": {"type": "string", "pattern": "^[a-z0-9_]+$"},
            "rows": _or_null(_list(COUNT, minItems=2, maxItems=2)),
            "message": NAME,
            "remedy": TEXT,
        }
    )
    return _document(
        "findings/1", "What was refused or doubted", _object({"findings": _list(finding)})
    )


def _error_map() -> Schema:
    """Mean error over cells of one variable, or rows of cells of two."""
    numbers = _list({"type": ["number", "null", "array"]})
    bins = _object({"variable": NAME, "edges": _list(NUMBER, minItems=2)})
    return _object(
        {
            "signal": NAME,
            "unit": TEXT,
            "x": bins,
            "y": _or_null(bins),
            "count": _list({"type": ["integer", "array"]}),
            "mean": numbers,
            "p_value": numbers,
            "explained": SHARE,
            "p_map": _or_null(SHARE),
        }
    )


def _combination() -> Schema:
    return _object(
        {"expression": NAME, "value": NUMBER, "u": SPREAD, "unit": NAME, "of": _list(NAME)}
    )


def comparison_schema() -> Schema:
    """`comparison/MOTOR.json`."""
    signals = ["vd_v", "vq_v", "torque_shaft_nm", "omega_mech_rad_s", "iq_a", "psi_d_wb"]
    signal: Schema = {"enum": [*signals, "psi_q_wb"]}
    parameter = _object(
        {
            "value": _or_null(NUMBER),
            "u": _or_null(SPREAD),
            "unit": NAME,
            "at_bound": {"type": "boolean"},
        },
        {"status": {"enum": ["measured", "stated", "not_identifiable"]}},
    )
    error = _object(
        {
            "signal": signal,
            "capture": NAME,
            "split": {"enum": ["fit", "held_out"]},
            "rmse": _or_null(SPREAD),
            "noise_floor": _or_null(SPREAD),
            "n": COUNT,
            "n_eff": _or_null(SPREAD),
        },
        {"unit": TEXT, "kind": {"enum": ["equation", "free_run"]}},
    )
    before = _object({"value": NUMBER, "u": SPREAD})
    moved = _object(
        {
            "parameter": NAME,
            "unit": NAME,
            "before": before,
            "after": before,
            "change_in_u": NUMBER,
        }
    )
    where = _object(
        {"signal": signal, "variable": NAME, "explained": SHARE, "p_value": _or_null(SHARE)}
    )
    body = _object(
        {
            "motor_id": NAME,
            "model": _object(
                {"name": NAME, "effects": _list(NAME), "parameters": _map(parameter)},
                {"combinations": _list(_combination())},
            ),
            "errors": _list(error),
            "total": _object({"held_out": _or_null(SPREAD)}),
            "where": _list(where),
        },
        {"maps": _list(_error_map()), "moved": _list(moved)},
    )
    return _document("model-comparison/1", "A model held against a motor's captures", body)


def diagnosis_schema() -> Schema:
    """`diagnosis/MOTOR.json`."""
    sized = _object({"value": _or_null(NUMBER), "u": _or_null(SPREAD), "unit": NAME})
    rank = _object(
        {
            "effect": NAME,
            "score": _or_null(NUMBER),
            "held_out_drop": _or_null(NUMBER),
            "p_value": _or_null(SHARE),
            "confused_with": _list(NAME),
            "explanation": TEXT,
            "experiment": TEXT,
        },
        {"parameters": _map(sized)},
    )
    step = _object(
        {
            "effects": _list(NAME),
            "held_out": _or_null(SPREAD),
            "signals": _map(_or_null(SPREAD)),
        },
        {
            "errors": _map(_object({"rmse": SPREAD, "noise_floor": SPREAD, "unit": TEXT})),
            "parameters": _map(sized),
            "maps": _list(_error_map()),
        },
    )
    term = _object({"term": NAME, "coefficient": NUMBER, "unit": NAME})
    unknown = _object(
        {"signal": NAME, "variables": _list(NAME), "shape": TEXT, "sketch": _list(term)}
    )
    body = _object(
        {
            "motor_id": NAME,
            "model": {"type": ["string", "object"]},
            "verdict": {"enum": ["adequate", "missing", "unknown", "insufficient"]},
            "missing": _list(NAME),
            "ranking": _list(rank),
            "ladder": _list(step),
            "unknown": _or_null(unknown),
        },
        {"policy": TEXT, "asked": _list(NAME), "combinations": _list(_combination())},
    )
    return _document("model-diagnosis/1", "What a model of a motor leaves out", body)


def truth_schema() -> Schema:
    """`truth.json` beside simulated captures; effects and sizes are free text and numbers."""
    constants: Schema = {
        "type": "object",
        "properties": {
            name: _or_null(WHOLE if term.integer else NUMBER)
            for name, term in sorted(CONSTANTS.items())
        },
    }
    body = _object({"constants": constants, "hidden": _list(NAME), "sizes": _map({})})
    return _document("motor-truth/1", "What is true of simulated captures", body)


def outputs_schema() -> Schema:
    """`outputs.json`, the list of files that the last run wrote."""
    return _document(
        "outputs/1",
        "Files of the last run",
        _object({"files": _list(NAME)}, {"motors": _map(_list(NAME))}),
    )


def lot_regression_schema() -> Schema:
    """`regression/report.json`, from the kinds of its record's fields."""
    return _document(
        "lot-regression/1", "A lot, or a version of the code, against another", _kind(LotRegression)
    )


def _kind(kind: Any) -> Schema:
    """The schema of a field of a record: a record, a tuple, a literal, a scalar or nothing."""
    origin, inner = get_origin(kind), get_args(kind)
    if is_dataclass(kind) and isinstance(kind, type):
        return _object({name: _kind(hint) for name, hint in hints_of(kind).items()})
    if origin in (Union, UnionType):
        (one,) = (part for part in inner if part is not type(None))
        return _or_null(_kind(one))
    if origin is tuple:
        return _list(_kind(inner[0]))
    if origin is Mapping:
        return _map(_kind(inner[1]))
    if origin is Literal:
        return _one_of(kind)
    return {float: NUMBER, int: WHOLE, str: TEXT, bool: {"type": "boolean"}}[kind]


SCHEMAS: dict[str, Callable[[], Schema]] = {
    "motor-datasheet": datasheet_schema,
    "findings": findings_schema,
    "motor-export": export_schema,
    "motor-performance": performance_schema,
    "model-comparison": comparison_schema,
    "model-diagnosis": diagnosis_schema,
    "motor-truth": truth_schema,
    "outputs": outputs_schema,
    "lot-regression": lot_regression_schema,
}


def build_schemas() -> dict[str, Schema]:
    """Every schema by the stem of its file `STEM.schema.json`."""
    return {stem: build() for stem, build in sorted(SCHEMAS.items())}
