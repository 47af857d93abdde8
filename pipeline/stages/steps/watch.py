"""`run watch=true`: the same run again whenever captures have arrived and are at rest.

A pass is an ordinary run of the whole folder, in which everything that did not change is cached. So
a stop at any moment loses nothing, and a start goes on where it was.
"""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path
from typing import Protocol

from pipeline.execution.outputs.sheet_memory import SheetMemory
from pipeline.io.ingest.arrivals import Arrivals, Snapshot, snapshot
from pipeline.records.errors import MachineError
from pipeline.records.naming import printable
from pipeline.records.outcome import Outcome
from pipeline.report.text.waiting import waiting
from pipeline.settings import RunSettings

LOOK_EVERY_S = 0.1
"""Between two looks at the folder; ten times the time of a look where that is more."""
RETRY_S = 30.0
"""Until a pass is tried again that failed for the machine's sake, such as a full disk."""


class Pass(Protocol):
    """One run of the folder."""

    def __call__(self, surveyed: Callable[[], object], *, ahead: bool) -> Outcome:
        """The outcome.

        Parameters
        ----------
        surveyed
            Called when every file was looked at, before anything is written.
        ahead
            Whether work that is kept in the cache alone begins before that.

        """
        ...


class FolderChangedError(Exception):
    """Files came or changed before the folder had rested: the pass begins again when it rests."""


@dataclass
class Watch:
    """A folder that is watched; `perform` is one run of it, within the open `workers`.

    `perform` calls what it is given once it has looked at every file, before anything is written.
    It begins to look as soon as nothing changes any more, and what it is given waits until the
    folder has rested for `settle_s`. Long work begins ahead of that, unless files came during the
    pass before: it would be in the way of the next one.
    """

    settings: RunSettings
    perform: Pass
    workers: ExitStack
    memory: SheetMemory = field(default_factory=SheetMemory)
    arrivals: Arrivals = field(default_factory=Arrivals)
    _ahead: bool = True
    _inside: bool = False
    _ended: bool = False
    _shown: dict[str, str] = field(default_factory=dict)
    _errors: frozenset[str] = frozenset()

    def begin(self) -> Outcome:
        """The first line; what follows are the passes, until Ctrl-C or a termination signal."""
        end_at_once_or_next(self._signalled)
        text = f"watching {self.settings.input}; Ctrl-C ends it, and the same command goes on"
        return Outcome(text=text, then=self._next)

    def _next(self) -> Outcome:
        """Waits until a pass is due, and performs it; its outcome goes on with the next one."""
        self._inside = True
        try:
            if self._ended:
                raise KeyboardInterrupt
            outcome = self._pass()
        except BaseException:
            self._ended = True
            self.workers.close()
            raise
        finally:
            self._inside = False
        return replace(outcome, exit_code=0, then=self._next)

    def _signalled(self, *_: object) -> None:
        """Ends a pass at once; between two passes, while a line is printed, the next one ends."""
        ended, self._ended = self._ended, True
        if self._inside and not ended:
            raise KeyboardInterrupt

    def _at_rest(self, least_s: float, begun_with: Snapshot | None = None) -> Snapshot:
        """The files, once some have come and none has changed for `least_s`.

        Raises FolderChangedError where they are not those that a pass has begun with.
        """
        folder = Path(self.settings.input)
        while True:
            begun_s = time.monotonic()
            now = snapshot(folder)
            ended_s = time.monotonic()
            if begun_with is not None and now != begun_with:
                raise FolderChangedError
            rested_s = self.arrivals.rested_s(now, ended_s)
            if rested_s >= least_s:
                return now
            pause_s = max(LOOK_EVERY_S, 10.0 * (ended_s - begun_s))
            time.sleep(min(pause_s, least_s - rested_s))

    def _pass(self) -> Outcome:
        settle_s = self.settings.settle_s
        with waiting(f"watching {self.settings.input}"):
            now = self._at_rest(min(LOOK_EVERY_S, settle_s))
        try:
            outcome = self.perform(lambda: self._at_rest(settle_s, now), ahead=self._ahead)
        except FolderChangedError:
            self._ahead = False
            return Outcome()
        except MachineError as error:
            time.sleep(RETRY_S)
            return Outcome(errors=(f"error: {error}; trying again",))
        self.arrivals.taken, self._ahead = now, True
        return self._news(outcome)

    def _news(self, outcome: Outcome) -> Outcome:
        """What this pass changed: a line a motor, and the error lines that are new."""
        output = Path(self.settings.output)
        paths = sorted((output / "datasheets").glob("*.json"))
        read = [self.memory.sheet(path).datasheet for path in paths]
        sheets = sorted(read, key=lambda sheet: sheet.motor_id)
        self.memory.forget_others()
        at = datetime.now().astimezone().strftime("%H:%M:%S")
        lines = [
            f"{at} {printable(sheet.motor_id)}: {sheet.status}, version {sheet.version[:12]}"
            + (f"; {sheet.why[0]}" if sheet.why else "")
            for sheet in sheets
            if self._shown.get(sheet.motor_id) != sheet.version
        ]
        gone = sorted(set(self._shown) - {sheet.motor_id for sheet in sheets})
        lines += [f"{at} {printable(motor)}: its captures are gone" for motor in gone]
        errors = tuple(line for line in outcome.errors if line not in self._errors)
        self._shown = {sheet.motor_id: sheet.version for sheet in sheets}
        self._errors = frozenset(outcome.errors)
        return Outcome(text="\n".join(lines), errors=errors)


def end_at_once_or_next(signalled: Callable[..., None]) -> None:
    """Ctrl-C, and SIGTERM as service managers send it, call `signalled`.

    Parameters
    ----------
    signalled
        Called with the signal's number and frame.

    """
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGINT, signalled)
        signal.signal(signal.SIGTERM, signalled)
