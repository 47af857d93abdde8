"""What passes of one process have read of an output, by the digest of the bytes that they read.

What is known of bytes cannot be out of date, so a pass that remembers comes to what a run by itself
comes to. Without it a watch would read each file of each motor again at every pass.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.io.storage.datasheets import datasheet_bytes, datasheet_from
from pipeline.records.datasheet import Datasheet
from pipeline.views.constants import KEY_CONSTANTS, PARTIAL_CONSTANTS

if TYPE_CHECKING:
    import polars as pl

OF_BATCH = frozenset((*KEY_CONSTANTS, *PARTIAL_CONSTANTS))
"""Constants that the page and the summary of the batch show."""


@dataclass(frozen=True, slots=True)
class Sheet:
    """What the outputs of a batch need of one datasheet: memory must not grow with the rest.

    Attributes
    ----------
    datasheet
        With the constants that a page of all motors shows.
    constants
        All its constants as rows of the fleet's table.

    """

    datasheet: Datasheet
    constants: pl.DataFrame


class SheetMemory:
    """Datasheets by their digest, and what each page shows, from pass to pass."""

    def __init__(self) -> None:
        self._sheets: dict[str, Sheet] = {}
        self._used: set[str] = set()
        self._pages: dict[str, Any] = {}

    def sheet(self, path: Path, sha256: str | None = None) -> Sheet:
        """A datasheet, which is read where these bytes were not read before.

        Parameters
        ----------
        path
            Its JSON file.
        sha256
            Digest of the file where it is known to hold it; the file is read otherwise.

        Raises
        ------
        UsageError
            The file is no datasheet of version 1.

        """
        if sha256 is None or sha256 not in self._sheets:
            data = datasheet_bytes(path)
            sha256 = hashlib.sha256(data).hexdigest()
            if sha256 not in self._sheets:
                self._sheets[sha256] = _sheet(datasheet_from(data, path.name))
        self._used.add(sha256)
        return self._sheets[sha256]

    def shows(self, page: str, facts: object) -> bool:
        """Whether a page was brought up to date with these facts, its digest among them.

        Parameters
        ----------
        page
            Name of the page.
        facts
            All that it would be made of.

        """
        return page in self._pages and bool(self._pages[page] == facts)

    def note(self, page: str, facts: object) -> None:
        """Notes what a page shows.

        Parameters
        ----------
        page
            Name of the page.
        facts
            All that it is made of, its digest among them.

        """
        self._pages[page] = facts

    def forget_others(self) -> None:
        """Forgets the datasheets that were not asked for since this was called last."""
        self._sheets = {one: self._sheets[one] for one in self._used if one in self._sheets}
        self._used = set()


def _sheet(sheet: Datasheet) -> Sheet:
    from pipeline.views.tables import constants_frame

    constants = {name: one for name, one in sheet.constants.items() if name in OF_BATCH}
    return Sheet(replace(sheet, constants=constants, alternatives=()), constants_frame(sheet))
