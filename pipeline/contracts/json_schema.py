"""JSON Schemas of everything the pipeline writes, built from the glossary and the records.

They are published under `pipeline/contracts/json/`, written by `python -m pipeline schemas`.
Every file may hold more than its schema names; numbers are finite or null, never NaN.
"""

from __future__ import annotations

from collections.abc import Callable

from pipeline.contracts.schema_form import (
    COUNT,
    NAME,
    NUMBER,
    SHA256,
    SHARE,
    SPREAD,
    TEXT,
    WHOLE,
    Schema,
    document,
    list_of,
    map_of,
    object_of,
    of_kind,
    one_of,
    or_null,
)
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
from pipeline.records.uncertainty import Kind


def _estimate() -> Schema:
    """An estimate as records write it: a value exactly when it is identifiable."""
    known = {"value": NUMBER, "u": SPREAD, "u_a": SPREAD, "u_b": SPREAD}
    unknown = {name: {"type": "null"} for name in known}
    schema = object_of(
        {
            "value": or_null(NUMBER),
            "unit": NAME,
            "u": or_null(SPREAD),
            "u_a": or_null(SPREAD),
            "u_b": or_null(SPREAD),
            "dof": or_null(SPREAD),
            "at": map_of({"type": ["number", "string"]}),
            "method": TEXT,
            "status": one_of(Status),
            "captures": list_of(NAME),
            "note": TEXT,
        },
        {
            "bounds": or_null(list_of(NUMBER, minItems=2, maxItems=2)),
            "at_bound": {"type": "boolean"},
            "settled": {"const": True},
            "orders": list_of(
                object_of({"order": COUNT, "amplitude": SPREAD, "u": SPREAD, "phase_rad": NUMBER})
            ),
            "budget": list_of(
                object_of(
                    {"source": NAME, "u": NUMBER, "kind": one_of(Kind)}, {"dof": or_null(SPREAD)}
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
    return object_of(
        {
            "name": NAME,
            "status": one_of(CheckStatus),
            "value": or_null(NUMBER),
            "limit": or_null(NUMBER),
            "unit": NAME,
            "meaning": TEXT,
            "suspect": or_null(TEXT),
        }
    )


def _provenance() -> Schema:
    """What a datasheet was computed from: captures, configuration, code."""
    capture = {"path": NAME, "sha256": SHA256, "test": {"enum": [*TESTS]}}
    capture["integrity"] = one_of(Integrity)
    stated = {
        "station": or_null(TEXT),
        "started_at": or_null(TEXT),
        "read_sha256": or_null(SHA256),
    }
    return object_of(
        {
            "captures": list_of(object_of(capture, stated)),
            "config_sha256": SHA256,
            "code_version": NAME,
        },
        {"libraries": TEXT},
    )


def _model() -> Schema:
    """The residual test of a datasheet: numbers where a model was fitted."""
    quantity = object_of({"value": or_null(NUMBER), "u": or_null(SPREAD), "unit": TEXT})
    excess = {"capture": NAME, "signal": NAME, "order": SPREAD, "floors": SPREAD, "size": SPREAD}
    return object_of(
        {
            "verdict": one_of(ModelState),
            "missing": list_of(
                object_of(
                    {"effect": NAME, "parameters": map_of(quantity)},
                    {"headline": TEXT, "confused_with": list_of(NAME), "experiment": TEXT},
                )
            ),
            "held_out": or_null(SPREAD),
            "residual": or_null(SPREAD),
        },
        {
            "name": NAME,
            "effects": list_of(NAME),
            "worst": or_null(object_of({**excess, "unit": TEXT})),
            "over": COUNT,
            "note": TEXT,
            "held_out_with": or_null(SPREAD),
            "unknown": TEXT,
            "unexcited": list_of(of_kind(Unexcited)),
            "fitted": list_of(object_of({"effect": NAME, "parameters": map_of(quantity)})),
            "scales": map_of(SPREAD),
            "touches": map_of(TEXT),
        },
    )


def datasheet_schema() -> Schema:
    """`datasheets/MOTOR.json`."""
    constants: Schema = {
        "type": "object",
        "properties": {name: _constant(term) for name, term in sorted(CONSTANTS.items())},
        "additionalProperties": {"$ref": "#/$defs/estimate"},
    }
    body = object_of(
        {
            "motor_id": NAME,
            "motor_type": or_null(TEXT),
            "lot": or_null(TEXT),
            "version": SHA256,
            "status": one_of(DatasheetStatus),
            "provenance": _provenance(),
            "constants": constants,
            "checks": list_of(_check()),
        },
        {
            "why": list_of(TEXT),
            "supersedes": or_null(object_of({"version": SHA256, "by": TEXT, "why": TEXT})),
            "alternatives": list_of(
                {"allOf": [{"$ref": "#/$defs/estimate"}, object_of({"name": NAME})]}
            ),
            "model": _model(),
        },
    )
    return document("motor-datasheet/1", "One version of one motor's datasheet", body) | {
        "$defs": {"estimate": _estimate()}
    }


def performance_schema() -> Schema:
    """`performance/MOTOR.json`: what a motor does at stated conditions, 95 % intervals."""
    lists = {"numbers": Derived, "curves": Curve, "efficiency_map": MapCell, "blanks": Blank}
    needed = {"motor_id": NAME, "datasheet_version": SHA256}
    needed |= {"operation": or_null(of_kind(Operation))}
    needed |= {name: list_of(of_kind(record)) for name, record in lists.items()}
    body = object_of(needed, {"regimes": list_of(TEXT), "notes": list_of(TEXT)})
    return document("motor-performance/1", "A motor's curves and ratings", body)


def export_schema() -> Schema:
    """`export json`: constants, effects, and the effects as tables."""
    quantity = object_of({"value": or_null(NUMBER), "u": or_null(SPREAD), "unit": TEXT})
    constant = object_of(
        {"value": NUMBER, "u": SPREAD, "unit": NAME, "status": one_of(Status), "words": TEXT},
        {"at": map_of({"type": ["number", "string"]})},
    )
    body = object_of(
        {
            "motor_id": NAME,
            "motor_type": or_null(TEXT),
            "version": SHA256,
            "revision": COUNT,
            "constants": map_of(constant),
            "effects": list_of(object_of({"effect": NAME, "parameters": map_of(quantity)})),
            "tables": list_of(of_kind(EffectTable)),
            "without_table": map_of(NAME),
        }
    )
    return document("motor-export/1", "A released motor for other programs", body)


def findings_schema() -> Schema:
    """`findings.json`."""
    finding = object_of(
        {
            "file": TEXT,
            "severity": one_of(Severity),
            "code": {"type": "string", "pattern": "^[a-z0-9_]+$"},
            "rows": or_null(list_of(COUNT, minItems=2, maxItems=2)),
            "message": NAME,
            "remedy": TEXT,
        }
    )
    return document(
        "findings/1", "What was refused or doubted", object_of({"findings": list_of(finding)})
    )


def _error_map() -> Schema:
    """Mean error over cells of one variable, or rows of cells of two."""
    numbers = list_of({"type": ["number", "null", "array"]})
    bins = object_of({"variable": NAME, "edges": list_of(NUMBER, minItems=2)})
    return object_of(
        {
            "signal": NAME,
            "unit": TEXT,
            "x": bins,
            "y": or_null(bins),
            "count": list_of({"type": ["integer", "array"]}),
            "mean": numbers,
            "p_value": numbers,
            "explained": SHARE,
            "p_map": or_null(SHARE),
        }
    )


def _combination() -> Schema:
    return object_of(
        {"expression": NAME, "value": NUMBER, "u": SPREAD, "unit": NAME, "of": list_of(NAME)}
    )


_SIGNAL: Schema = {
    "enum": ["vd_v", "vq_v", "torque_shaft_nm", "omega_mech_rad_s", "iq_a", "psi_d_wb", "psi_q_wb"]
}


def _signal_error() -> Schema:
    """Error of a model in one signal of one capture."""
    return object_of(
        {
            "signal": _SIGNAL,
            "capture": NAME,
            "split": {"enum": ["fit", "held_out"]},
            "rmse": or_null(SPREAD),
            "noise_floor": or_null(SPREAD),
            "n": COUNT,
            "n_eff": or_null(SPREAD),
        },
        {"unit": TEXT, "kind": {"enum": ["equation", "free_run"]}},
    )


def comparison_schema() -> Schema:
    """`comparison/MOTOR.json`."""
    parameter = object_of(
        {
            "value": or_null(NUMBER),
            "u": or_null(SPREAD),
            "unit": NAME,
            "at_bound": {"type": "boolean"},
        },
        {"status": {"enum": ["measured", "stated", "not_identifiable"]}},
    )
    before = object_of({"value": NUMBER, "u": SPREAD})
    moved = object_of(
        {
            "parameter": NAME,
            "unit": NAME,
            "before": before,
            "after": before,
            "change_in_u": NUMBER,
        }
    )
    where = object_of(
        {"signal": _SIGNAL, "variable": NAME, "explained": SHARE, "p_value": or_null(SHARE)}
    )
    body = object_of(
        {
            "motor_id": NAME,
            "model": object_of(
                {"name": NAME, "effects": list_of(NAME), "parameters": map_of(parameter)},
                {"combinations": list_of(_combination())},
            ),
            "errors": list_of(_signal_error()),
            "total": object_of({"held_out": or_null(SPREAD)}),
            "where": list_of(where),
        },
        {"maps": list_of(_error_map()), "moved": list_of(moved)},
    )
    return document("model-comparison/1", "A model held against a motor's captures", body)


def _ranked_effect(sized: Schema) -> Schema:
    """One effect of a diagnosis; `sized` is a value with its uncertainty and unit."""
    return object_of(
        {
            "effect": NAME,
            "score": or_null(NUMBER),
            "held_out_drop": or_null(NUMBER),
            "p_value": or_null(SHARE),
            "confused_with": list_of(NAME),
            "explanation": TEXT,
            "experiment": TEXT,
        },
        {"parameters": map_of(sized)},
    )


def diagnosis_schema() -> Schema:
    """`diagnosis/MOTOR.json`."""
    sized = object_of({"value": or_null(NUMBER), "u": or_null(SPREAD), "unit": NAME})
    step = object_of(
        {
            "effects": list_of(NAME),
            "held_out": or_null(SPREAD),
            "signals": map_of(or_null(SPREAD)),
        },
        {
            "errors": map_of(object_of({"rmse": SPREAD, "noise_floor": SPREAD, "unit": TEXT})),
            "parameters": map_of(sized),
            "maps": list_of(_error_map()),
        },
    )
    term = object_of({"term": NAME, "coefficient": NUMBER, "unit": NAME})
    unknown = object_of(
        {"signal": NAME, "variables": list_of(NAME), "shape": TEXT, "sketch": list_of(term)}
    )
    body = object_of(
        {
            "motor_id": NAME,
            "model": {"type": ["string", "object"]},
            "verdict": {"enum": ["adequate", "missing", "unknown", "insufficient"]},
            "missing": list_of(NAME),
            "ranking": list_of(_ranked_effect(sized)),
            "ladder": list_of(step),
            "unknown": or_null(unknown),
        },
        {"policy": TEXT, "asked": list_of(NAME), "combinations": list_of(_combination())},
    )
    return document("model-diagnosis/1", "What a model of a motor leaves out", body)


def truth_schema() -> Schema:
    """`truth.json` beside simulated captures; effects and sizes are free text and numbers."""
    constants: Schema = {
        "type": "object",
        "properties": {
            name: or_null(WHOLE if term.integer else NUMBER)
            for name, term in sorted(CONSTANTS.items())
        },
    }
    body = object_of({"constants": constants, "hidden": list_of(NAME), "sizes": map_of({})})
    return document("motor-truth/1", "What is true of simulated captures", body)


def outputs_schema() -> Schema:
    """`outputs.json`, the list of files that the last run wrote."""
    return document(
        "outputs/1",
        "Files of the last run",
        object_of({"files": list_of(NAME)}, {"motors": map_of(list_of(NAME))}),
    )


def lot_regression_schema() -> Schema:
    """`regression/report.json`, from the kinds of its record's fields."""
    return document(
        "lot-regression/1",
        "A lot, or a version of the code, against another",
        of_kind(LotRegression),
    )


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
