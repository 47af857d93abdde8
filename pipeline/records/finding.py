"""What was found wrong with a file: refused, or worth a warning."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from pipeline.records.errors import CaptureError
from pipeline.records.naming import printable

Severity = Literal["refused", "warning"]


@dataclass(frozen=True, slots=True, order=True)
class Finding:
    """One line of `findings.json`; `rows` is the first and last row concerned, from 0."""

    file: str
    severity: Severity
    code: str
    message: str
    remedy: str
    rows: tuple[int, int] | None = None

    @classmethod
    def refusal(cls, file: str, error: CaptureError) -> Finding:
        """The finding for a capture that had to be refused."""
        return cls(file, "refused", error.code, error.message, error.remedy, error.rows)

    @classmethod
    def of(cls, document: Mapping[str, Any]) -> Finding:
        """The finding that `document` wrote; raises LookupError or TypeError for anything else."""
        rows = document["rows"]
        return cls(
            document["file"],
            document["severity"],
            document["code"],
            document["message"],
            document["remedy"],
            None if rows is None else (rows[0], rows[1]),
        )

    def line(self) -> str:
        """The one line that standard error carries."""
        rows = "" if self.rows is None else f" rows {self.rows[0]}-{self.rows[1]}"
        line = f"{self.severity}: {self.file}{rows}: {self.message}; {self.remedy} [{self.code}]"
        return printable(line)

    def document(self) -> dict[str, Any]:
        """The JSON form of `contract/outputs.md`."""
        return {
            "file": self.file,
            "severity": self.severity,
            "code": self.code,
            "rows": None if self.rows is None else list(self.rows),
            "message": self.message,
            "remedy": self.remedy,
        }
