"""Captures of a folder as validated campaigns, one a motor; shared by compare and diagnose."""

from __future__ import annotations

from pathlib import Path

from pipeline.contracts.validate import validate
from pipeline.fit.registry import fit_all
from pipeline.io.ingest import Entry, read_capture, survey
from pipeline.io.source_map import find_map, load_source_maps
from pipeline.records.capture import Campaign, Capture
from pipeline.records.constants import Constants
from pipeline.records.errors import CaptureError, UsageError
from pipeline.records.finding import Finding
from pipeline.settings import configuration_folder


def campaigns(
    folder: str, source: str = "auto", motor: str | None = None
) -> tuple[tuple[Campaign, ...], tuple[Finding, ...]]:
    """Every motor's usable captures, by motor_id, and what was refused or doubtful.

    Raises UsageError where the folder is not there or holds no capture of `motor`.
    """
    if not Path(folder).is_dir():
        raise UsageError(f"input={folder} is no folder", "name the folder of captures")
    maps = load_source_maps(configuration_folder() / "source")
    found = survey(Path(folder), maps if source == "auto" else {source: find_map(maps, source)})
    findings = list(found.findings)
    motors: dict[str, list[Entry]] = {}
    for entry in found.entries:
        motors.setdefault(entry.said["motor_id"], []).append(entry)
    if motor is not None and motor not in motors:
        raise UsageError(
            f"no capture of motor {motor} in {folder}", f"there are {', '.join(sorted(motors))}"
        )
    made = []
    for motor_id in sorted(motors) if motor is None else [motor]:
        captures = _usable(Path(folder), motors[motor_id], findings)
        if captures:
            made.append(Campaign(motor_id, captures))
    return tuple(made), tuple(findings)


def _usable(folder: Path, entries: list[Entry], findings: list[Finding]) -> tuple[Capture, ...]:
    captures = []
    for entry in entries:
        try:
            capture, doubts = validate(read_capture(folder, entry), {})
        except CaptureError as error:
            findings.append(Finding.refusal(entry.path, error))
        else:
            captures.append(capture)
            findings.extend(doubts)
    return tuple(sorted(captures, key=lambda capture: capture.path))


def start_constants(campaign: Campaign) -> Constants:
    """Constants to start criticism from: none where a nameplate or a spin tells the pole pairs."""
    if campaign.nameplate("pole_pairs") is not None or campaign.of("open_circuit"):
        return Constants()
    return fit_all(campaign, {})[0]
