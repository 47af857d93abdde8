"""Reading captures: a folder in, validated recordings of each motor out."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import polars as pl

from pipeline.api import frames
from pipeline.api.by_motor import Shown, of_name
from pipeline.api.options import check_options
from pipeline.execution.tasks.captures import ReadTask, usable_captures
from pipeline.io.ingest.files import input_folder
from pipeline.io.ingest.guard import ReadLimits
from pipeline.io.ingest.survey import survey
from pipeline.io.maps.places import source_maps
from pipeline.io.maps.source_map import SourceMap
from pipeline.records.capture import Campaign, Capture
from pipeline.records.errors import UsageError
from pipeline.records.finding import Finding
from pipeline.records.naming import counted
from pipeline.settings import RunSettings

Options = Mapping[str, Mapping[str, float]]
"""Options by the name of a gate, an estimator or a check."""


@dataclass(frozen=True, slots=True, repr=False)
class Recordings(Shown):
    """Validated captures by motor, with findings on refused or doubtful files.

    Attributes
    ----------
    campaigns : mapping of str to Campaign
        The captures of each motor by motor_id.
    findings : tuple of Finding
        Files that were refused or are doubtful: rows, reason and remedy.
    truth : mapping of str to mapping
        The true parameters of simulated motors; empty for recordings from files.
    sources : mapping of str to tuple of SourceMap
        The source maps by which the captures of each motor were read.
    note : str
        Counts and names the files of the folder that are no captures; empty without any.

    """

    campaigns: Mapping[str, Campaign]
    findings: tuple[Finding, ...] = ()
    truth: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    sources: Mapping[str, tuple[SourceMap, ...]] = field(default_factory=dict)
    note: str = ""

    def __getitem__(self, motor_id: str) -> Campaign:
        """The captures of one motor."""
        return of_name("motor", motor_id, self.campaigns)

    def __iter__(self) -> Iterator[str]:
        return iter(self.campaigns)

    def __len__(self) -> int:
        return len(self.campaigns)

    @property
    def motors(self) -> tuple[str, ...]:
        """The motor_ids, sorted."""
        return tuple(self.campaigns)

    @property
    def captures(self) -> pl.DataFrame:
        """One row a capture: motor_id, path, test, station, rows, masked rows, columns."""
        rows = [row for one in self.campaigns.values() for row in frames.capture_rows(one)]
        return frames.frame(rows, frames.CAPTURE_SCHEMA)

    @property
    def refusals(self) -> pl.DataFrame:
        """One row a finding: file, severity, code, rows, message and remedy."""
        return frames.frame(frames.finding_rows(self.findings), frames.FINDING_SCHEMA)

    def signals(self, path: str) -> pl.DataFrame:
        """The longest table of one capture, in SI units; NaN for a missing value.

        Parameters
        ----------
        path : str
            Path of the capture as in the column `path` of `captures`.

        Returns
        -------
        polars.DataFrame
            The columns of the glossary [units by their suffix].

        Raises
        ------
        KeyError
            If there is no such capture.

        """
        return max(self._capture(path).tables, key=lambda table: table.height)

    def only(self, motor: str | None = None, tests: str | tuple[str, ...] = ()) -> Recordings:
        """The recordings of one motor, of some tests, or of both.

        Parameters
        ----------
        motor : str, optional
            A motor_id; all motors without it.
        tests : tuple of str
            Names of tests, or one name; all tests where it is empty.

        Returns
        -------
        Recordings
            Motors without any such capture are left out.

        """
        kept, named = {}, (tests,) if isinstance(tests, str) else tests
        for name, campaign in self.campaigns.items():
            captures = campaign.of(*named) if named else campaign.captures
            if captures and motor in (None, name):
                kept[name] = replace(campaign, captures=captures)
        return replace(self, campaigns=kept)

    def _capture(self, path: str) -> Capture:
        captures = (capture for one in self.campaigns.values() for capture in one.captures)
        return of_name("capture", path, {capture.path: capture for capture in captures})

    def _title(self) -> str:
        motors, findings = counted(len(self), "motor"), counted(len(self.findings), "finding")
        note = f"; {self.note}" if self.note and not self.campaigns else ""
        return f"Recordings: {motors}, {findings}{note}"

    def _table(self) -> pl.DataFrame:
        return self.captures.group_by("motor_id", "test", maintain_order=True).agg(
            pl.len().alias("captures"), pl.col("rows").sum()
        )


def read(
    folder: str | Path,
    *,
    source: str = "auto",
    motor: str | None = None,
    gates: Options | None = None,
    recover: bool = False,
    limits: ReadLimits | None = None,
) -> Recordings:
    """Reads and validates every capture of a folder and its subfolders, in this process.

    Nothing is written. The commands read files in worker processes with a time limit. This function
    does not, so use the commands for untrusted files.

    Parameters
    ----------
    folder : path
        Folder of MCAP and CSV captures.
    source : str
        Source map for files of another bench, by name or as path/to/map.yaml; `auto` recognises
        them by every map in `conf/source/` and the user's configuration folder.
    motor : str, optional
        Only the captures of this motor_id.
    gates : mapping of mapping, optional
        Options by gate [units in the gate's file], for instance
        `{"clock_jump": {"enabled": 0}}`.
    recover : bool
        Read the intact part of truncated MCAP files.
    limits : ReadLimits, optional
        Memory [MB] and time [s] that one file may take; only the memory is enforced here.

    Returns
    -------
    Recordings
        A file that cannot be used is a finding with rows and remedy; the others are read.

    Raises
    ------
    UsageError
        If the folder, the source map, the motor, a gate or its option does not exist.

    Examples
    --------
    >>> import pipeline
    >>> recordings = pipeline.read("data/demo", motor="G52-0601")
    >>> recordings.motors
    ('G52-0601',)
    >>> recordings.captures.columns[:3]
    ['motor_id', 'path', 'test']

    """
    check_options(RunSettings(gates=dict(gates or {})))
    place = str(folder)
    input_folder(place)
    sources = source_maps(source)
    surveyed = survey(Path(place), sources, recover=recover)
    entries = surveyed.motors
    if motor is not None and motor not in entries:
        there = f"there are {', '.join(entries)}" if entries else "there is none"
        raise UsageError(f"no capture of motor {motor} in {place}", there)
    findings, campaigns = list(surveyed.findings), {}
    for name in entries if motor is None else [motor]:
        task = ReadTask(name, place, entries[name], limits or ReadLimits(), gates or {})
        captures, doubts = usable_captures(task)
        findings += doubts
        if captures:
            campaigns[name] = Campaign(name, captures)
    used = {n: tuple(e.source for e in own if e.source) for n, own in entries.items()}
    return Recordings(campaigns, tuple(findings), sources=used, note=surveyed.note)


def recordings_of(given: Recordings | str | Path) -> Recordings:
    """Recordings, or those of a folder.

    Parameters
    ----------
    given
        The result of `read` or `simulate`, or a folder to read.

    Raises
    ------
    TypeError
        If it is neither.
    UsageError
        If there is no such folder.

    """
    if isinstance(given, Recordings):
        return given
    if not isinstance(given, (str, Path)):
        raise TypeError(f"a {type(given).__name__} is neither Recordings nor a folder to read")
    return read(given)
