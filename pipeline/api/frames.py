"""Results as polars frames: one tidy row a fact, the unit in a column of its own."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import polars as pl

from pipeline.records.capture import Campaign
from pipeline.records.datasheet import Check
from pipeline.records.finding import Finding
from pipeline.views.tables import numbers, texts

CAPTURE_SCHEMA = {
    **texts("motor_id path test station started_at integrity"),
    "rows": pl.Int64,
    "masked": pl.Int64,
    "duration_s": pl.Float64,
    "columns": pl.List(pl.String),
}
CHECK_SCHEMA = {
    **texts("motor_id check status"),
    **numbers("value limit"),
    **texts("unit meaning suspect"),
}
FINDING_SCHEMA = {
    **texts("file severity code"),
    "first_row": pl.Int64,
    "last_row": pl.Int64,
    **texts("message remedy"),
}


def frame(rows: Iterable[Mapping[str, Any]], schema: Mapping[str, Any]) -> pl.DataFrame:
    """A frame of rows with the types of `schema`, also where there is no row.

    Parameters
    ----------
    rows
        One mapping a row; a key that a row lacks is null.
    schema
        Type of each column by name, in the order of the columns.

    Returns
    -------
    DataFrame
        One row each, columns as in `schema`.

    """
    chosen = [{name: row[name] for name in schema} for row in rows]
    return pl.DataFrame(chosen, schema=dict(schema), orient="row")


def capture_rows(campaign: Campaign) -> list[dict[str, Any]]:
    """One row a capture: what it is, how many rows it has and how many of them are masked.

    Parameters
    ----------
    campaign
        The captures of one motor.

    Returns
    -------
    list of dict
        Keys of `CAPTURE_SCHEMA`. `duration_s` [s] is the longest span of any clock, None for a
        table without time; `masked` counts rows that some gate set aside, over all tables.

    """
    rows = []
    for capture in campaign.captures:
        clocks = [t["t_s"].to_numpy() for t in capture.tables if "t_s" in t.columns and t.height]
        kept = sum(int(capture.kept(n).sum()) for n in range(len(capture.tables)))
        count = sum(table.height for table in capture.tables)
        rows.append(
            {
                "motor_id": campaign.motor_id,
                "path": capture.path,
                "test": capture.meta.test,
                "station": capture.meta.station,
                "started_at": capture.meta.started_at,
                "integrity": capture.integrity,
                "rows": count,
                "masked": count - kept,
                "duration_s": max((float(t[-1] - t[0]) for t in clocks), default=None),
                "columns": sorted(capture.columns),
            }
        )
    return rows


def check_rows(motor_id: str, checks: Sequence[Check]) -> list[dict[str, Any]]:
    """Cross-checks as rows of a frame.

    Parameters
    ----------
    motor_id
        The motor of all of them.
    checks
        The checks of its datasheet.

    Returns
    -------
    list of dict
        Keys of `CHECK_SCHEMA`; `value` and `limit` are in `unit`, None where the check was not
        evaluated.

    """
    return [{"motor_id": motor_id, "check": one.name, **one.document()} for one in checks]


def finding_rows(findings: Iterable[Finding]) -> list[dict[str, Any]]:
    """Findings as rows of a frame.

    Parameters
    ----------
    findings
        Refusals and warnings, in any order; the order is kept.

    Returns
    -------
    list of dict
        Keys of `FINDING_SCHEMA`. Rows count from 0 and are None where the finding is not about
        rows.

    """
    rows = []
    for one in findings:
        first, last = one.rows or (None, None)
        rows.append({**one.document(), "first_row": first, "last_row": last})
    return rows
