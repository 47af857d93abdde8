"""JSON of moteus' measurement of L_d: levels of d current, each run at several speeds.

`raw` maps a level [A] to rows of `omega`, the electrical speed [rad/s], and `y`, the q voltage
less the resistive drop of the q current [V]; `params` holds the number of poles.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from pipeline.io.foreign import Reader
from pipeline.io.raw_table import RawTable
from pipeline.records.errors import CaptureError

_REMEDY = "is it what moteus' measurement of L_d writes?"


def _document(data: bytes) -> Mapping[str, Any]:
    try:
        document = json.loads(data)
    except (ValueError, RecursionError) as fault:
        raise CaptureError("not_json", f"it is no JSON: {fault}", _REMEDY) from fault
    if not isinstance(document, dict) or not isinstance(document.get("raw"), dict):
        raise CaptureError("missing_column", "it has no table `raw`", _REMEDY)
    return document


def read(data: bytes) -> RawTable:
    """Fields `d_A`, `omega` and `y`, a row a speed, levels in rising order; raises CaptureError."""
    rows: list[tuple[float, float, float]] = []
    try:
        for level, runs in _document(data)["raw"].items():
            rows += [(float(level), float(run["omega"]), float(run["y"])) for run in runs]
    except (TypeError, KeyError, ValueError) as fault:
        raise CaptureError(
            "missing_column", f"a row of `raw` lacks omega or y: {fault}", _REMEDY
        ) from fault
    table = np.array(sorted(rows), dtype=float).reshape(-1, 3)
    return RawTable("raw", {"d_A": table[:, 0], "omega": table[:, 1], "y": table[:, 2]})


def metadata(data: bytes) -> Mapping[str, str]:
    """Pole pairs, half the poles of `params`, where it states an even number."""
    params = _document(data).get("params")
    poles = params.get("poles") if isinstance(params, dict) else None
    if isinstance(poles, int) and poles > 0 and poles % 2 == 0:
        return {"pole_pairs": str(poles // 2)}
    return {}


READER = Reader("moteus_ld", read, metadata)
