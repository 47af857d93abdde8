"""`simulate`: captures of a simulated motor or fleet, and what is true of them."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Mapping
from itertools import cycle
from pathlib import Path

from pipeline.api.simulated import fleet, simulated, single
from pipeline.io.storage.publish import canonical_json, output_folder, write_whole
from pipeline.io.storage.write_capture import Format, write_capture
from pipeline.records.errors import UsageError
from pipeline.records.naming import counted
from pipeline.records.outcome import Outcome, Stopwatch
from pipeline.settings import SimulateSettings
from pipeline.simulator.bench import CAMPAIGN
from pipeline.simulator.design import Recording

TRUTH = "truth.json"
FORMATS: Mapping[str, Format] = {
    "csv": Format("csv"),
    "json": Format("json"),
    "json_samples": Format("json", block_rows=None, compression="lz4"),
    "protobuf": Format("protobuf"),
    "protobuf_samples": Format("protobuf", block_rows=None),
    "cdr": Format("cdr", compression="none"),
    "cdr_samples": Format("cdr", block_rows=None),
}
SMALL = ("csv", "json_samples", "protobuf_samples", "cdr_samples", "json", "cdr")
LARGE = (Format("protobuf"), Format("cdr"))
LARGE_ROWS = 3000


def main(settings: SimulateSettings) -> Outcome:
    """Writes the captures of one motor, or of every motor of a fleet, each with `truth.json`.

    Parameters
    ----------
    settings
        The keys of `simulate`.

    """
    if not settings.output:
        raise UsageError("simulate needs output=DIR", "name the folder to write to")
    if settings.encoding != "mixed" and settings.encoding not in FORMATS:
        raise UsageError(
            f"no encoding {settings.encoding!r}", f"known are mixed, {', '.join(FORMATS)}"
        )
    if settings.seed < 0:
        raise UsageError(f"simulate: seed={settings.seed}", "it must be 0 or more")
    watch, output = Stopwatch(), Path(settings.output)
    try:
        jobs = list(fleet(settings) if settings.fleet else single(settings))
    except (ValueError, KeyError) as error:
        raise UsageError(f"simulate: {error}", "correct it") from error
    output_folder(settings.output)
    _ours(output, [folder for folder, *_ in jobs])
    lines, folders = [], []
    for folder, motor, bench, seed, plan in jobs:
        with watch.stage("simulate"):
            recordings, true = simulated(motor, bench, seed, plan)
        with watch.stage("write"):
            written = write(output / folder, recordings, settings.encoding)
            write_whole(output / folder / TRUTH, canonical_json(true))
            for stale in _captures(output / folder) - written:
                stale.unlink()
        count = counted(len(written), "capture")
        lines.append(f"{motor.motor_id}: {count} in {output / folder}")
        folders.append({"motor_id": motor.motor_id, "folder": output / folder, "captures": written})
    return Outcome(
        text="\n".join(lines),
        timings=watch.table(),
        result=folders,
        wrote=str(output),
        next=f"run input={shlex.quote(str(output))}",
    )


def _captures(folder: Path) -> set[Path]:
    """The files of a folder that have names of a simulated campaign."""
    stems = {stem for stem, _, _ in CAMPAIGN}
    return {path for s in (".csv", ".mcap") for path in folder.glob(f"*{s}") if path.stem in stems}


def _ours(output: Path, folders: Iterable[str]) -> None:
    """Refuses folders of captures that no simulation wrote: they would be written over.

    What an earlier simulation left is taken away when the new one is written.
    """
    for folder in folders:
        captures = sorted(_captures(output / folder))
        if captures and not (output / folder / TRUTH).is_file():
            raise UsageError(
                f"{output / folder} holds {captures[0].name}, and no {TRUTH}: it is not simulated",
                "name another folder by output=",
            )


def write(folder: Path, recordings: Iterable[Recording], encoding: str) -> set[Path]:
    """Writes captures.

    Tables without a clock are CSV always, captures of several clocks MCAP always.

    Parameters
    ----------
    folder
        Where they are written.
    recordings
        The captures.
    encoding
        A key of `FORMATS`; `mixed` goes through the encodings in turn, but long captures stay in
        compact ones.

    Returns
    -------
    set of Path
        The files.

    """
    large, small = cycle(LARGE), cycle(SMALL)
    written = set()
    for recording in recordings:
        table = recording.tables[0]
        if "t_s" not in table:
            form = FORMATS["csv"]
        elif encoding != "mixed" and (encoding != "csv" or len(recording.tables) == 1):
            form = FORMATS[encoding]
        elif table["t_s"].size > LARGE_ROWS or len(recording.tables) > 1:
            form = next(large)
        else:
            form = FORMATS[next(small)]
        path = write_capture(folder, recording.stem, recording.meta, recording.tables, form)
        written.add(path)
    return written
