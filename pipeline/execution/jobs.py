"""The job of one motor and its result: plain data, cheap to import for the driver."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Self

from pipeline.io.ingest.entry import Entry
from pipeline.io.ingest.guard import ReadLimits
from pipeline.records.comparison import ModelSpec
from pipeline.records.finding import Finding
from pipeline.records.ledger import Revocation
from pipeline.records.naming import printable

Files = tuple[tuple[str, str], ...]
"""Names relative to the output folder, each with its sha256."""


@dataclass(frozen=True, slots=True)
class Finished:
    """A finished motor: its findings and its files."""

    findings: tuple[Finding, ...]
    files: Files


@dataclass(frozen=True, slots=True, kw_only=True)
class OfFiles:
    """A task on several files; `refused` are those that must not be read, with the reason."""

    refused: tuple[tuple[str, str], ...] = ()

    def without(self, path: str, reason: str) -> Self:
        """The task with a file refused for a reason.

        Parameters
        ----------
        path
            The file, relative to the input folder.
        reason
            The reason, in words.

        """
        return replace(self, refused=(*self.refused, (path, reason)))


@dataclass(frozen=True, slots=True)
class OfFile:
    """A task on one file of a folder; `refused` is why it must not be read."""

    folder: str
    file: str
    limits: ReadLimits
    refused: str | None = field(default=None, kw_only=True)

    @property
    def name(self) -> str:
        """What the task works on."""
        return f"file {printable(self.file)}"

    @property
    def place(self) -> Path:
        """Where the file lies."""
        return Path(self.folder) / self.file

    def without(self, path: str, reason: str) -> Self:  # noqa: ARG002 (it has one file)
        """The task with its file refused for a reason.

        Parameters
        ----------
        path
            The file, relative to the input folder.
        reason
            The reason, in words.

        """
        return replace(self, refused=reason)


@dataclass(frozen=True, slots=True)
class MotorJob(OfFiles):
    """Everything that a worker needs for one motor: plain data, so that it can be pickled.

    `key` is the digest of the work, None where the result is not cached; `refused` are files that
    must not be read, with the reason. `revoked` are the motor's revoked versions: a version of the
    same work with other content supersedes them. `model` is the model of the residual test, None
    for no test; `diagnose` is the key of a run. `model_gates` is False where what the model leaves
    keeps no datasheet from its release. `operate` are the stated conditions of the performance.
    """

    motor_id: str
    entries: tuple[Entry, ...]
    input: str
    output: str
    config_sha256: str
    required: tuple[str, ...]
    release: str
    report: bool
    recordings: bool
    gates: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    fit: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    crosscheck: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    constants: Mapping[str, float] = field(default_factory=dict)
    model: ModelSpec | None = None
    diagnose: str = "auto"
    model_gates: bool = True
    operate: Mapping[str, float | None] = field(default_factory=dict)
    findings: tuple[Finding, ...] = ()
    limits: ReadLimits = field(default_factory=ReadLimits)
    revoked: tuple[Revocation, ...] = ()
    key: str | None = None

    @property
    def name(self) -> str:
        """What the task works on."""
        return f"motor {printable(self.motor_id)}"


@dataclass(frozen=True, slots=True)
class ModelTest:
    """The residual test of a motor's job, for a worker that would be idle beside its fits.

    Its verdict is kept where the job finds it. Nothing depends on it but the time.
    """

    job: MotorJob

    @property
    def name(self) -> str:
        """What the task works on."""
        return f"the residual test of {self.job.name}"

    def without(self, path: str, reason: str) -> ModelTest:
        """The task with a file refused for a reason."""
        return replace(self, job=self.job.without(path, reason))


@dataclass(frozen=True, slots=True)
class WarmUp:
    """The start of a worker of a command that stays: everything that a motor needs is imported.

    `shares` is whether it gets a process that does half of its residual tests.
    """

    shares: bool = False

    @property
    def name(self) -> str:
        """What the task works on."""
        return "the start of a worker"

    def without(self, path: str, reason: str) -> WarmUp:
        """The task itself: it reads no file.

        Parameters
        ----------
        path
            The file.
        reason
            Why it is refused.

        """
        del path, reason
        return self


@dataclass(frozen=True, slots=True)
class MotorResult:
    """The result of a job: findings, files (none if no capture was usable) and times [s].

    `lasting` is False where a file killed its reader. A retry may succeed, so nothing is cached.
    """

    motor_id: str
    finished: Finished
    seconds: Mapping[str, float]
    lasting: bool = True
