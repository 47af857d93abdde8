"""What `inspect` found as plain data, for `json=true`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from pipeline.records.naming import printable

if TYPE_CHECKING:
    from pipeline.io.inspection.describe import InspectReport
    from pipeline.io.inspection.proposals import FieldSeen, StreamSeen
    from pipeline.records.capture import Campaign


def file_record(path: str, report: InspectReport) -> dict[str, Any]:
    """One file: form, metadata, faults, and every field with its column, unit and evidence.

    Parameters
    ----------
    path
        The file, as the user named it.
    report
        What is known of the file.

    """
    return {
        "path": path,
        "form": report.form,
        "size_bytes": report.size,
        "sha256": report.sha256,
        "checksums": report.checksums,
        "source": report.source,
        "metadata": dict(report.metadata),
        "faults": list(report.faults),
        "tables": [_table(stream) for stream in report.streams],
    }


def _table(stream: StreamSeen) -> dict[str, Any]:
    return {
        "name": stream.name,
        "rows": stream.rows,
        "rate_hz": stream.rate_hz,
        "clock": stream.clock,
        "fields": [_field(seen) for seen in stream.fields],
    }


def _field(seen: FieldSeen) -> dict[str, Any]:
    known = seen.first is not None and math.isfinite(seen.first)
    return {
        "name": seen.name,
        "first": seen.first if known else None,
        "column": seen.column,
        "unit": seen.unit,
        "certain": seen.certain,
        "scale": seen.scale,
        "wraps": seen.wraps,
        "per_pole_pair": seen.per_pole_pair,
        "evidence": seen.why,
        "asked": None if seen.question is None else seen.question[0],
    }


def motor_record(campaign: Campaign) -> dict[str, Any]:
    """Captures of a motor with the constants that rest on each, and what none determines.

    Parameters
    ----------
    campaign
        The captures of one motor.

    """
    from pipeline.api.fits import fit
    from pipeline.api.recordings import Recordings

    fits = fit(Recordings({campaign.motor_id: campaign}))
    chosen = fits.motors[campaign.motor_id].constants.chosen()
    open_ = {name: one.note for name, one in chosen.items() if one.status == "not_identifiable"}
    captures = [
        {
            "path": capture.path,
            "test": capture.meta.test,
            "rows": max(table.height for table in capture.tables),
            "columns": sorted(capture.columns),
            "constants": [n for n, one in chosen.items() if capture.path in one.captures],
        }
        for capture in campaign.captures
    ]
    return {"motor_id": campaign.motor_id, "captures": captures, "not_determined": open_}


def motor_lines(motor: Mapping[str, Any]) -> list[str]:
    """The record of a motor as text for people.

    Parameters
    ----------
    motor
        A result of `motor_record`.

    """
    lines = [f"motor {printable(motor['motor_id'])}"]
    for capture in motor["captures"]:
        constants = ", ".join(capture["constants"]) or "no constant by itself"
        head = f"{printable(capture['path'])}: {capture['test']}, {capture['rows']} rows"
        lines.append(f"  {head}: {constants}")
    if motor["not_determined"]:
        lines.append(f"  not determined: {', '.join(motor['not_determined'])}")
    return lines
