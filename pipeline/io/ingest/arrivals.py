"""Whether the files of a watched folder are at rest: none came, grew, changed or went for a while.

The folder is listed again and again rather than subscribed to: that works on network shares too,
where the kernel reports nothing of what other machines write.
"""

from __future__ import annotations

import math
import os
from dataclasses import dataclass, field
from pathlib import Path

from pipeline.records.errors import MachineError

Snapshot = frozenset[tuple[str, int, int, int]]
"""Path, size [bytes], time of the last change [ns] and inode of every file."""


def snapshot(folder: Path) -> Snapshot:
    """Every file below a folder as it lies there now; hidden ones are left out, as in a run.

    Parameters
    ----------
    folder
        The watched folder.

    Returns
    -------
    frozenset
        Path, size, time of change and inode of each file.

    Raises
    ------
    MachineError
        The folder itself is not there any more.

    """
    if not folder.is_dir():
        raise MachineError(f"the watched folder {folder} is gone", "bring it back; start again")
    files: set[tuple[str, int, int, int]] = set()
    for where, folders, names in os.walk(folder):
        folders[:] = [name for name in folders if not name.startswith(".")]
        for name in names:
            if name.startswith("."):
                continue
            path = os.path.join(where, name)  # noqa: PTH118 - a Path a file would cost most of the time
            try:
                at = os.lstat(path)
            except FileNotFoundError:
                continue
            files.add((path, at.st_size, at.st_mtime_ns, at.st_ino))
    return frozenset(files)


@dataclass(slots=True)
class Arrivals:
    """Notices when a folder has changed since it was last taken up, and how long it has rested."""

    taken: Snapshot | None = None
    _seen: Snapshot | None = None
    _since_s: float = field(default=0.0)

    def rested_s(self, now: Snapshot, time_s: float) -> float:
        """How long nothing has changed in a folder that differs from what was taken up [s].

        Parameters
        ----------
        now
            The files as they lie there at this moment.
        time_s
            This moment, of a clock that never goes back [s].

        Returns
        -------
        float
            Minus infinity where nothing has come.

        """
        if now != self._seen:
            self._seen, self._since_s = now, time_s
        return -math.inf if now == self.taken else time_s - self._since_s
