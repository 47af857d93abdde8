"""JSON of moteus' measurement of L_d: levels of d current, each run at several speeds.

`raw` maps a level [A] to rows of `omega`, the electrical speed [rad/s], and `y`, the q voltage
less the resistive drop of the q current [V]; `params` holds the number of poles.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from pipeline.io.tables.foreign import Reader
from pipeline.io.tables.raw_table import RawTable
from pipeline.records.errors import CaptureError
from pipeline.records.parse import ParseError, json_value, number

_REMEDY = "is it what moteus' measurement of L_d writes?"


def _document(data: bytes) -> Mapping[str, Any]:
    try:
        document = json_value(data)
    except ParseError as fault:
        raise CaptureError("not_json", f"it {fault}", _REMEDY) from fault
    if not isinstance(document, dict) or not isinstance(document.get("raw"), dict):
        raise CaptureError("missing_column", "it has no table `raw`", _REMEDY)
    return document


def read(data: bytes) -> tuple[RawTable, ...]:
    """Levels of d current, each run at several speeds.

    Parameters
    ----------
    data
        Bytes of the file: JSON with the table `raw`.

    Returns
    -------
    tuple of one RawTable
        Fields `d_A` [A], `omega` [rad/s, electrical] and `y` [V], a row a speed, in rising order.

    Raises
    ------
    CaptureError
        It is no JSON (`not_json`), or a row has no numbers (`missing_column`).

    """
    rows: list[tuple[float, ...]] = []
    for level, runs in _document(data)["raw"].items():
        for run in runs if isinstance(runs, list) else [None]:
            row = run if isinstance(run, dict) else {}
            values = number(level), _number(row.get("omega")), _number(row.get("y"))
            if None in values:
                place = (len(rows), len(rows))
                words = f"a row of `raw` at {level[:60]!r} has no numbers as level, omega and y"
                raise CaptureError("missing_column", words, _REMEDY, place)
            rows.append(tuple(one for one in values if one is not None))
    table = np.array(sorted(rows), dtype=float).reshape(-1, 3)
    fields = {"d_A": table[:, 0], "omega": table[:, 1], "y": table[:, 2]}
    return (RawTable("raw", fields),)


def _number(value: Any) -> float | None:
    """A number of JSON; None for anything else."""
    if isinstance(value, str):
        return number(value)
    return float(value) if isinstance(value, (int, float)) and math.isfinite(value) else None


def metadata(data: bytes) -> Mapping[str, str]:
    """Pole pairs: half the poles of `params`, where that states an even number.

    Parameters
    ----------
    data
        Content of the file.

    """
    params = _document(data).get("params")
    poles = params.get("poles") if isinstance(params, dict) else None
    if isinstance(poles, int) and poles > 0 and poles % 2 == 0:
        return {"pole_pairs": str(poles // 2)}
    return {}


READER = Reader("moteus_ld", read, metadata)
