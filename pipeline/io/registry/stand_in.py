"""A folder with a plain name that stands in for a registry's, whose name Delta cannot work with.

deltalake 1.6 makes a URL of a table's folder: at `[` or `|` it panics, `%41` becomes `A`, a line
break or a backslash ends it; links are followed to the folder's true name first. So the table is
opened in a temporary folder that holds a link to the true log and one to each data file. A data
file is written to the true folder and is on the disk before the commit that names it, as Delta asks
of any writer; the commit itself goes through the linked log and is atomic as ever.

Reference: Delta transaction protocol, "Delta Log Entries", "Add File and Remove File".
"""

from __future__ import annotations

import json
import re
import tempfile
import uuid
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.io.storage.publish import sync_file, sync_folder

if TYPE_CHECKING:
    import polars as pl
    from deltalake import CommitProperties, DeltaTable

UNFIT = re.compile(r"""[\x00-\x1f\x7f"*<>\[\]\\^`{|}]|%[0-9A-Fa-f]{2}""")
LOG = "_delta_log"


def unfit(folder: Path) -> bool:
    """Whether Delta cannot work in a folder, for its name or that of a folder above it.

    Parameters
    ----------
    folder
        The folder.

    """
    return UNFIT.search(folder.resolve().as_posix()) is not None


class StandIn:
    """The stand-in of one registry folder; it goes with the object."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._temporary = tempfile.TemporaryDirectory(prefix="registry-")

    @property
    def place(self) -> str:
        """The plain folder, with every data file that the true one holds by now."""
        temporary, true = Path(self._temporary.name), self._folder.resolve()
        if (true / LOG).is_dir() and not (temporary / LOG).is_symlink():
            (temporary / LOG).symlink_to(true / LOG)
        for path in true.iterdir() if true.is_dir() else ():
            if path.suffix == ".parquet" and not (temporary / path.name).is_symlink():
                (temporary / path.name).symlink_to(path)
        return str(temporary)

    def create(self) -> str:
        """The place of a table that is to be made there."""
        (self._folder / LOG).mkdir(parents=True, exist_ok=True)
        return self.place

    def append(self, table: DeltaTable, rows: pl.DataFrame, properties: CommitProperties) -> None:
        """Adds rows to the events that a table was opened with.

        Parameters
        ----------
        table
            The table.
        rows
            Rows to add.
        properties
            Of the commit. Errors are raised as Delta raises them.

        """
        from deltalake.transaction import AddAction

        name = f"part-00000-{uuid.uuid4()}.parquet"
        path = self._folder / name
        with path.open("wb") as stream:
            rows.write_parquet(stream)
        sync_file(path)
        sync_folder(self._folder)
        statistics = json.dumps({"numRecords": rows.height})
        added = AddAction(name, path.stat().st_size, {}, 0, data_change=True, stats=statistics)
        table.create_write_transaction(
            [added], "append", table.schema(), commit_properties=properties
        )
