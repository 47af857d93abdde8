"""What was found wrong with a file: refused, or worth a warning."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Annotated, Literal

from pipeline.records.errors import CaptureError
from pipeline.records.field_kinds import Count, Keyword, Name
from pipeline.records.naming import counted, printable
from pipeline.records.plain_form import PlainRecord

Severity = Literal["refused", "warning"]
MOST_LINES_OF_A_KIND = 3


@dataclass(frozen=True, slots=True, order=True)
class Finding(PlainRecord):
    """One line of `findings.json`.

    Attributes
    ----------
    file
        Path of the file.
    severity
        `refused` or `warning`.
    code
        Short stable identifier.
    message, remedy
        What is wrong, and what to do about it.
    rows
        First and last row concerned, from 0.

    """

    file: str
    severity: Severity
    code: Annotated[str, Keyword("pattern", "^[a-z0-9_]+$")]
    message: Name
    remedy: str
    rows: tuple[Count, Count] | None = None

    @classmethod
    def refusal(cls, file: str, error: CaptureError) -> Finding:
        """The finding for a capture that had to be refused.

        Parameters
        ----------
        file
            Path of the capture.
        error
            Why it was refused.

        """
        return cls(file, "refused", error.code, error.message, error.remedy, error.rows)

    def order(self) -> tuple[str, str, str, tuple[int, int], str]:
        """Where it stands among others: by file, severity, code, rows and words."""
        return self.file, self.severity, self.code, self.rows or (-1, -1), self.message

    def line(self) -> str:
        """The one line that standard error carries."""
        rows = "" if self.rows is None else f" rows {self.rows[0]}-{self.rows[1]}"
        line = f"{self.severity}: {self.file}{rows}: {self.message}; {self.remedy} [{self.code}]"
        return printable(line)


def lines_of(findings: Iterable[Finding]) -> list[str]:
    """Findings as the lines of standard error: one a refused file, and one a cause of many
    warnings.

    Parameters
    ----------
    findings
        In the order of the files.

    Returns
    -------
    list of str
        Warnings of one code and remedy that concern more than `MOST_LINES_OF_A_KIND` findings are
        one line with the count of findings and files, at the place of the first. `findings.json`
        holds them all.

    """
    every = list(findings)
    kinds: dict[tuple[str, str], list[Finding]] = {}
    for one in every:
        if one.severity == "warning":
            kinds.setdefault((one.code, one.remedy), []).append(one)
    lines = []
    for one in every:
        alike = kinds.get((one.code, one.remedy), []) if one.severity == "warning" else []
        if len(alike) <= MOST_LINES_OF_A_KIND:
            lines.append(one.line())
        elif one is alike[0]:
            files = len({other.file for other in alike})
            count = f" ({len(alike)} such warnings in {counted(files, 'file')})"
            lines.append(one.line() + count)
    return lines
