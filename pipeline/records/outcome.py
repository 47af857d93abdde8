"""What a command returns to the entry point: what to print, where, and the exit code."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from pipeline.records.errors import PipelineError
from pipeline.records.finding import Finding

INTERRUPTED = 130
"""128 and the number of SIGINT, as shells have it."""
PRECEDENCE = (INTERRUPTED, 5, 2, 1, 3, 4, 0)


@dataclass(frozen=True, slots=True)
class Fault:
    """What went wrong, as `json=true` prints it under `errors`.

    Attributes
    ----------
    severity
        `error` where it ended the command, `refused` or `warning` as a finding.
    message, remedy
        What is wrong, and what to do about it.
    file
        Path of the file; None where it is not about one.
    rows
        First and last row concerned, from 0.
    code
        Short stable identifier.

    """

    severity: str
    message: str
    remedy: str = ""
    file: str | None = None
    rows: tuple[int, int] | None = None
    code: str = ""


def fault_of(error: PipelineError) -> Fault:
    """An error that ended a command, as data.

    Parameters
    ----------
    error
        The error.

    """
    code = getattr(error, "code", type(error).__name__.removesuffix("Error").lower())
    rows = getattr(error, "rows", None)
    return Fault("error", error.message, error.remedy, error.file, rows, code)


def faults_of(findings: Iterable[Finding]) -> tuple[Fault, ...]:
    """Findings on files, as data.

    Parameters
    ----------
    findings
        The findings.

    """
    return tuple(
        Fault(one.severity, one.message, one.remedy, one.file, one.rows, one.code)
        for one in findings
    )


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a command returns to the entry point.

    Attributes
    ----------
    exit_code
        As `contract/outputs.md` lists them.
    text
        For standard output.
    errors
        Lines for standard error.
    timings
        Stages and their seconds [s].
    then
        What the command goes on with once its text is printed, such as a window or a server that
        stays; it returns a further outcome.
    result
        What `json=true` prints, as plain data.
    wrote
        Path where results lie.
    next
        The command that a user would sensibly give next.
    faults
        What `errors` says of files, and of what ended the command, as plain data.
    is_content
        Whether the text is what a file holds, so that it can be piped: `wrote` and `next` then go
        to standard error.

    """

    exit_code: int = 0
    text: str = ""
    errors: tuple[str, ...] = ()
    timings: tuple[tuple[str, float], ...] = ()
    then: Callable[[], Outcome] | None = None
    result: Any = None
    wrote: str = ""
    next: str = ""
    faults: tuple[Fault, ...] = ()
    is_content: bool = False


def first_that_applies(*codes: int) -> int:
    """The exit code that takes precedence among those that apply.

    Parameters
    ----------
    *codes
        Exit codes of `contract/outputs.md`.

    Returns
    -------
    int
        By `PRECEDENCE`; 0 where none is given.

    """
    return min(codes, key=PRECEDENCE.index, default=0)


@dataclass(slots=True)
class Stopwatch:
    """Seconds spent in each stage, summed by name, for `timings=true`; never part of an output."""

    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Adds the wall time of a `with` block to a stage.

        Parameters
        ----------
        name
            Of the stage; times of one name add up [s].

        """
        start = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - start

    def table(self) -> tuple[tuple[str, float], ...]:
        """(stage, seconds) in the order in which stages first ran."""
        return tuple(self.seconds.items())
