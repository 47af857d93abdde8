"""Reading back the datasheets that a run wrote."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from pipeline.records.datasheet import CaptureReference, Check, Datasheet, Superseded
from pipeline.records.errors import UsageError
from pipeline.records.estimate import Estimate
from pipeline.records.model_verdict import ModelVerdict
from pipeline.records.plain_form import record_of
from pipeline.records.uncertainty import Budget, Contribution, effective_dof

SCHEMA = "motor-datasheet/1"
MAX_BYTES = 1 << 26


def read_datasheets(output: Path) -> tuple[Datasheet, ...]:
    """Every datasheet of an output folder, by motor.

    Parameters
    ----------
    output
        Folder of a run.

    Raises
    ------
    UsageError
        The folder has none, or a file is no datasheet of version 1.

    """
    paths = sorted((output / "datasheets").glob("*.json"))
    if not paths:
        raise UsageError(f"no datasheets in {output}", "name the output folder of a run")
    sheets = [read_datasheet(path) for path in paths]
    return tuple(sorted(sheets, key=lambda sheet: sheet.motor_id))


def read_datasheet(path: Path) -> Datasheet:
    """One datasheet.

    Parameters
    ----------
    path
        Its JSON file.

    Raises
    ------
    UsageError
        The file is no datasheet of version 1.

    """
    return datasheet_from(datasheet_bytes(path), path.name)


def datasheet_bytes(path: Path) -> bytes:
    """The bytes of a datasheet's file.

    Parameters
    ----------
    path
        Its JSON file.

    Raises
    ------
    UsageError
        The file is too large.

    """
    if path.stat().st_size > MAX_BYTES:
        raise UsageError(f"{path.name} is too large for a datasheet", "run again")
    return path.read_bytes()


def datasheet_from(data: bytes, name: str) -> Datasheet:
    """The datasheet of a file's bytes.

    Parameters
    ----------
    data
        The bytes.
    name
        Name of the file, for messages.

    Raises
    ------
    UsageError
        They are no datasheet of version 1.

    """
    try:
        document = json.loads(data)
        if document["schema"] != SCHEMA:
            raise UsageError(f"{name} is {document['schema']}, not {SCHEMA}", "run again")
        return datasheet_of(document)
    except (ValueError, LookupError, TypeError, RecursionError) as error:
        raise UsageError(f"{name} is no datasheet: {error}", "run again") from error


def datasheet_of(document: Mapping[str, Any]) -> Datasheet:
    """The record that `Datasheet.document` wrote.

    Parameters
    ----------
    document
        Its JSON form.

    Returns
    -------
    Datasheet
        A document of before contributions had degrees of freedom of their own gives those of type A
        what makes the published total (GUM eq. G.2b); one of before the residual test has no model.

    Raises
    ------
    LookupError, TypeError, ValueError
        The document has another form.

    """
    provenance, superseded = document["provenance"], document.get("supersedes")
    return Datasheet(
        motor_id=document["motor_id"],
        motor_type=document["motor_type"],
        lot=document["lot"],
        version=document["version"],
        status=document["status"],
        why=tuple(document.get("why", ())),
        captures=tuple(record_of(CaptureReference, c) for c in provenance["captures"]),
        config_sha256=provenance["config_sha256"],
        code_version=provenance["code_version"],
        constants={n: _estimate(n, e) for n, e in document["constants"].items()},
        alternatives=tuple(_estimate(e["name"], e) for e in document.get("alternatives", ())),
        checks=tuple(record_of(Check, check) for check in document["checks"]),
        libraries=provenance.get("libraries", ""),
        supersedes=None if superseded is None else record_of(Superseded, superseded),
        model=None if document.get("model") is None else ModelVerdict.of(document["model"]),
    )


def _estimate(name: str, document: Mapping[str, Any]) -> Estimate:
    without = record_of(Estimate, {**document, "name": name, "budget": []})
    return replace(without, budget=_budget(document))


def _budget(document: Mapping[str, Any]) -> Budget:
    parts = document.get("budget", ())
    dof = document["dof"]
    if all("dof" in p for p in parts):
        return tuple(
            Contribution(p["source"], p["u"], p["kind"], math.inf if p["dof"] is None else p["dof"])
            for p in parts
        )
    if dof is None or not parts:
        return tuple(Contribution(p["source"], p["u"], p["kind"]) for p in parts)
    # With one dof for every type A part, dof_total = dof * u^4 / sum(u_i^4).
    unit = tuple(
        Contribution(p["source"], p["u"], p["kind"], 1.0 if p["kind"] == "A" else math.inf)
        for p in parts
    )
    share = effective_dof(unit)
    return tuple(
        Contribution(p.source, p.u, p.kind, dof / share if p.kind == "A" else math.inf)
        for p in unit
    )
