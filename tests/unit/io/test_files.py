"""Which files of a folder are used, and what becomes of what cannot be read."""

from __future__ import annotations

import errno
import os
from pathlib import Path
from typing import Any

import pytest

from pipeline.io.ingest import files
from pipeline.io.ingest.files import list_files
from pipeline.records.errors import CaptureError, MachineError


def closed(monkeypatch: pytest.MonkeyPatch, *folders: Path) -> None:
    """Denies the listing of folders, as the system does to a user without permission."""
    scandir = os.scandir
    denied = {os.fspath(folder) for folder in folders}

    def guarded(path: Any = ".") -> Any:
        if os.fspath(path) in denied:
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), os.fspath(path))
        return scandir(path)

    monkeypatch.setattr(os, "scandir", guarded)


def batch(folder: Path) -> Path:
    """A file beside two folders with one each."""
    for name in ("a.csv", "shut/b.csv", "open/c.csv"):
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text("t_s\n")
    return folder


def test_an_unreadable_subfolder_costs_itself_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Refused by its name, with the reason; the rest is used."""
    closed(monkeypatch, batch(tmp_path) / "shut")
    listing = list_files(tmp_path)
    assert listing.paths == ("a.csv", "open/c.csv")
    (finding,) = listing.findings
    assert (finding.file, finding.severity, finding.code) == ("shut", "refused", "unreadable")
    assert "Permission denied" in finding.message
    assert "permissions" in finding.remedy


def test_the_input_itself_must_be_readable(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing can be done without it: the command ends, naming it."""
    closed(monkeypatch, batch(tmp_path))
    with pytest.raises(MachineError, match="cannot be listed"):
        list_files(tmp_path)


def test_a_file_behind_a_closed_door_is_no_dead_link(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A folder that may be listed and not entered: its files are unreadable, not to be removed."""
    stat = Path.stat

    def guarded(path: Path, **options: Any) -> os.stat_result:
        if path.name == "b.csv":
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), os.fspath(path))
        return stat(path, **options)

    monkeypatch.setattr(files.Path, "stat", guarded)
    batch(tmp_path)
    fault = files._fault(tmp_path / "shut" / "b.csv", tmp_path, "shut/b.csv")
    assert isinstance(fault, CaptureError)
    assert fault.code == "unreadable"
    assert "remove" not in fault.remedy
