"""Reading back the diagnoses that `diagnose` wrote, as far as lots are compared by them."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, get_args

from pipeline.records.diagnosis import Verdict
from pipeline.records.diagnosis_summary import DiagnosisSummary
from pipeline.records.errors import UsageError

SCHEMA = "model-diagnosis/1"
MAX_BYTES = 1 << 26


def read_diagnoses(folders: Iterable[Path]) -> dict[str, DiagnosisSummary]:
    """The diagnosis of each motor, as far as lots are compared by them.

    Parameters
    ----------
    folders
        Folders of diagnoses; those that are not there hold none.

    Returns
    -------
    dict of DiagnosisSummary
        By motor_id; of folders that hold one motor, the last counts.

    Raises
    ------
    UsageError
        A file is no diagnosis.

    """
    summaries: dict[str, DiagnosisSummary] = {}
    for folder in folders:
        for path in sorted(folder.glob("*.json")):
            one = _read(path)
            summaries[one.motor_id] = one
    return summaries


def _read(path: Path) -> DiagnosisSummary:
    if path.stat().st_size > MAX_BYTES:
        raise UsageError(f"{path.name} is too large for a diagnosis", "diagnose again")
    try:
        return _summary(json.loads(path.read_bytes()))
    except (ValueError, LookupError, TypeError, AttributeError, RecursionError) as error:
        raise UsageError(f"{path.name} is no diagnosis: {error}", "diagnose again") from error


def _summary(document: Mapping[str, Any]) -> DiagnosisSummary:
    if document["schema"] != SCHEMA or document["verdict"] not in get_args(Verdict):
        raise ValueError(f"{document['schema']!r} with verdict {document['verdict']!r}")
    sizes = {ranked["effect"]: ranked.get("parameters", {}) for ranked in document["ranking"]}
    # of an effect whose numbers are not all determined, none is its size
    parameters = {
        effect: {name: (float(one["value"]), str(one["unit"])) for name, one in sizes_of.items()}
        for effect, sizes_of in sizes.items()
        if all(one["value"] is not None for one in sizes_of.values())
    }
    return DiagnosisSummary(
        str(document["motor_id"]),
        document["verdict"],
        tuple(str(effect) for effect in document["missing"]),
        parameters,
    )
