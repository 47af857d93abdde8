"""The first rows of a file as a source map would turn them into columns of the contract."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from pipeline.io.ingest.capture_reader import read_capture
from pipeline.io.ingest.identification import Question, identify
from pipeline.io.maps.map_file import parse_source_file
from pipeline.records.errors import CaptureError
from pipeline.records.naming import printable

_UNANSWERED = {"motor_id": "unknown", "test": "drive"}


def preview(folder: Path, file: str, map_text: str, rows: int) -> list[str]:
    """The first rows of a file as a source map would convert them.

    Parameters
    ----------
    folder
        The input folder.
    file
        Path of the file in it.
    map_text
        The source map as YAML.
    rows
        How many rows of each table.

    Returns
    -------
    list of str
        Lines of text, or why there are none. Metadata that is not answered yet prevents a run, not
        a preview.

    """
    maps = {
        name: replace(one, metadata=tuple((_UNANSWERED | dict(one.metadata)).items()))
        for name, one in parse_source_file(map_text.encode(), "proposed").items()
    }
    answer = identify(folder, Question(file, None, ()), maps)
    if answer.entry is None:
        faults = [f"{one.message}; {one.remedy}" for one in answer.findings]
        return [f"{printable(file)}: {one}" for one in faults or ["the map does not recognise it"]]
    try:
        tables = read_capture(folder, answer.entry).tables
    except CaptureError as fault:
        return [f"{printable(file)} through the map: {fault}"]
    lines = [f"{printable(file)} through the map:"]
    for table in tables:
        width = max(12, *(len(name) for name in table.columns))
        lines.append("  " + " ".join(f"{name:>{width}}" for name in table.columns))
        numbers = table.head(rows).iter_rows()
        lines += ["  " + " ".join(f"{value:>{width}.6g}" for value in row) for row in numbers]
    return lines
