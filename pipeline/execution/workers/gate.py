"""A gate that the driver holds closed before a worker, and a motor's job that waits at one.

It opens by taking a file away, which a full disk does not prevent. A worker that waits ends with
its driver, as every worker does.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from pathlib import Path

from pipeline.execution.jobs import MotorJob

LOOK_EVERY_S = 0.01


@dataclass(frozen=True, slots=True)
class Gate:
    """A gate by the name of its two files: one holds the work back, one says that it is wanted."""

    place: str

    def close(self) -> None:
        """Makes the gate; raises OSError where its files cannot be written."""
        for path in (self._wanted, self._closed):
            path.parent.mkdir(parents=True, exist_ok=True)
            path.touch()

    def open(self) -> None:
        """Lets the work go on."""
        self._closed.unlink(missing_ok=True)

    def drop(self) -> None:
        """Ends the work at its gate; work that has passed it goes on."""
        self._wanted.unlink(missing_ok=True)
        self._closed.unlink(missing_ok=True)

    @property
    def dropped(self) -> bool:
        """Whether the work is no longer wanted."""
        return not self._wanted.exists()

    def passed(self) -> bool:
        """Waits until the gate opens; False where the work is no longer wanted."""
        while self._closed.exists():
            time.sleep(LOOK_EVERY_S)
        return not self.dropped

    @property
    def _closed(self) -> Path:
        return Path(f"{self.place}.closed")

    @property
    def _wanted(self) -> Path:
        return Path(f"{self.place}.wanted")


@dataclass(frozen=True, slots=True)
class HeldJob:
    """A motor's job that begins before it is sure that its files are complete: it writes none
    before its gate opens.
    """

    job: MotorJob
    gate: Gate

    @property
    def name(self) -> str:
        """What the task works on."""
        return self.job.name

    def without(self, path: str, reason: str) -> HeldJob:
        """The task with a file refused for a reason."""
        return replace(self, job=self.job.without(path, reason))
