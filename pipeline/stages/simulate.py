"""`simulate`: captures of a simulated motor or fleet, and what is true of them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import cycle
from pathlib import Path
from typing import Any

from pipeline.io.plain_yaml import load_plain
from pipeline.io.publish import canonical_json, output_folder, write_whole
from pipeline.io.write_capture import Format, write_capture
from pipeline.records.errors import UsageError
from pipeline.records.naming import counted, file_stem
from pipeline.records.outcome import Outcome, Stopwatch
from pipeline.settings import SimulateSettings, configuration_folder
from pipeline.simulator.bench import CAMPAIGN, campaign
from pipeline.simulator.catalogue import (
    bench_from,
    fleet_from,
    motor_from,
    seed_of,
    with_effects,
)
from pipeline.simulator.design import EXACT, Bench, Motor, Recording
from pipeline.simulator.outside import with_unknown
from pipeline.simulator.truth import truth

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

Plan = tuple[tuple[str, str, Mapping[str, Any]], ...]


def main(settings: SimulateSettings) -> Outcome:
    """Writes the captures of one motor, or of every motor of a fleet, each with `truth.json`."""
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
        jobs = list(_fleet(settings) if settings.fleet else _single(settings))
    except (ValueError, KeyError) as error:
        raise UsageError(f"simulate: {error}", "correct it") from error
    output_folder(settings.output)
    _ours(output, [folder for folder, *_ in jobs])
    lines = []
    for folder, motor, bench, seed, plan in jobs:
        with watch.stage("simulate"):
            recordings, true = _simulated(motor, bench, seed, plan)
        with watch.stage("write"):
            written = _write(output / folder, recordings, settings.encoding)
            write_whole(output / folder / TRUTH, canonical_json(true))
            for stale in _captures(output / folder) - written:
                stale.unlink()
        count = counted(len(written), "capture")
        lines.append(f"{motor.motor_id}: {count} in {output / folder}")
    return Outcome(text="\n".join(lines) + "\n", timings=watch.table())


def _captures(folder: Path) -> set[Path]:
    """The files of a folder that have names of a simulated campaign."""
    stems = {stem for stem, _, _ in CAMPAIGN}
    return {path for s in (".csv", ".mcap") for path in folder.glob(f"*{s}") if path.stem in stems}


def _ours(output: Path, folders: Iterable[str]) -> None:
    """Refuses folders of captures that no simulation wrote: they would be written over.

    What an earlier simulation left is taken away when the new one is written.
    """
    for folder in folders:
        found = sorted(_captures(output / folder))
        if found and not (output / folder / TRUTH).is_file():
            raise UsageError(
                f"{output / folder} holds {found[0].name}, and no {TRUTH}: it is not simulated",
                "name another folder by output=",
            )


def _simulated(
    motor: Motor, bench: Bench, seed: int, plan: Plan
) -> tuple[list[Recording], dict[str, Any]]:
    try:
        return campaign(motor, bench, seed, plan), truth(motor)
    except ValueError as error:
        raise UsageError(f"simulate: {motor.motor_id}: {error}", "choose another size") from error


Job = tuple[str, Motor, Bench, int, Plan]
"""Subfolder, motor, bench, seed, captures to record (all of the campaign where empty)."""


def _single(settings: SimulateSettings) -> Iterable[Job]:
    document = _document("motor", settings.motor)
    motor = motor_from(document)
    name = settings.motor_id or f"{settings.motor}-{settings.seed}"
    motor = with_effects(replace(motor, lot=settings.lot, motor_id=name), settings.effects)
    if settings.outside is not None:
        motor = with_unknown(motor, settings.outside)
    bench = bench_from(document.get("bench") or {})
    if settings.exact:
        bench = replace(bench, instruments=EXACT)
    yield "", motor, bench, settings.seed, ()


def _fleet(settings: SimulateSettings) -> Iterable[Job]:
    """Every motor on one station, whose gains are drawn once from the fleet's seed."""
    import numpy as np

    words = _document("fleet", str(settings.fleet))
    document = _document("motor", str(words.get("motor")))
    fleet = fleet_from(words, document)
    settled = {**(document.get("bench") or {}), **(words.get("bench") or {})}
    bench = replace(bench_from(settled), station=fleet.station)
    plan = _plan(fleet.tests)
    drawn = EXACT if settings.exact else bench.drawn(np.random.default_rng(fleet.seed))
    for motor in fleet.motors:
        there = replace(bench, instruments=drawn, started_at=fleet.started_at[motor.motor_id])
        yield file_stem(motor.motor_id), motor, there, seed_of(fleet.seed, motor.motor_id), plan


def _plan(tests: Sequence[str]) -> Plan:
    """The steps of the campaign of these names; raises ValueError for one that it has not."""
    known = [stem for stem, _, _ in CAMPAIGN]
    if stray := set(tests) - set(known):
        raise ValueError(f"no test {', '.join(sorted(stray))}; there are {', '.join(known)}")
    return tuple(step for step in CAMPAIGN if step[0] in tests)


def _document(kind: str, name: str) -> dict[str, Any]:
    folder = configuration_folder() / kind
    known = sorted(path.stem for path in folder.glob("*.yaml"))
    if name not in known:
        raise UsageError(f"no {kind} {name!r} in conf/{kind}", f"known are {', '.join(known)}")
    document = load_plain((folder / f"{name}.yaml").read_bytes(), f"{kind}/{name}.yaml")
    if not isinstance(document, dict):
        raise UsageError(f"conf/{kind}/{name}.yaml holds no keys", "write `key: value` lines")
    return document


def _write(folder: Path, recordings: Iterable[Recording], encoding: str) -> set[Path]:
    """Returns the files written. `mixed` goes through the encodings in turn; long captures stay
    in compact ones.

    Tables without a clock are CSV always, captures of several clocks MCAP always.
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
