"""Writing results: whole or not at all, and a remedy that fits what the disk said."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

from pipeline.io.storage import publish
from pipeline.io.storage.publish import canonical_json, together, write_whole
from pipeline.records.errors import MachineError

FULL, CLOSED = "free the disk and run again", "name an output folder that can be written"


@pytest.mark.parametrize(
    ("number", "remedy"),
    [
        (errno.ENOSPC, FULL),
        (errno.EDQUOT, FULL),
        (errno.EFBIG, FULL),
        (errno.EACCES, CLOSED),
        (errno.EROFS, CLOSED),
        (errno.ENOTDIR, CLOSED),
    ],
)
def test_a_disk_that_refuses_is_named_with_what_to_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int, remedy: str
) -> None:
    """The old content stands, nothing half written is left, and the one line says what to do."""
    place = tmp_path / "deep" / "x.json"
    write_whole(place, b"old")

    def refuses(path: Path, content: bytes) -> None:
        path.write_bytes(content[:2])
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(publish, "write_synced", refuses)
    with pytest.raises(MachineError) as raised:
        write_whole(place, b"new content")
    error = raised.value
    assert error.message == f"cannot write x.json in {place.parent}: {os.strerror(number)}"
    assert (error.remedy, error.exit_code) == (remedy, 5)
    assert place.read_bytes() == b"old"
    assert [path.name for path in place.parent.iterdir()] == ["x.json"]


def test_a_file_in_the_place_of_a_folder(tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("")
    with pytest.raises(MachineError, match="cannot write x") as raised:
        write_whole(tmp_path / "taken" / "x", b"")
    assert raised.value.remedy == CLOSED


def test_json_is_canonical_and_holds_no_nan() -> None:
    """Keys sorted, text as it is, shortest numbers that read back the same, a last newline."""
    assert canonical_json({"b": 0.1, "a": "ü"}) == '{\n "a": "ü",\n "b": 0.1\n}\n'.encode()
    for number in (float("nan"), float("inf")):
        with pytest.raises(ValueError, match="JSON"):
            canonical_json({"a": [number]})


def test_files_get_their_names_together_or_not_at_all(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The disk is full at the third: the old of the first stands, and nothing of the others."""
    write_whole(tmp_path / "datasheets" / "m.json", b"old")
    whole = publish.write_synced

    def full(path: Path, content: bytes) -> None:
        whole(path, content[:2] if content == b"third" else content)
        if content == b"third":
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    def files() -> dict[str, bytes]:
        return {p.name: p.read_bytes() for p in tmp_path.rglob("*") if p.is_file()}

    def write_all() -> None:
        with together(tmp_path) as write:
            for name, content in (("m.json", b"new"), ("m.html", b"page"), ("m.rrd", b"third")):
                write(f"datasheets/{name}", content)

    monkeypatch.setattr(publish, "write_synced", full)
    with pytest.raises(MachineError, match=r"cannot write m\.rrd .*; free the disk"):
        write_all()
    assert files() == {"m.json": b"old"}
    monkeypatch.setattr(publish, "write_synced", whole)
    write_all()
    assert files() == {"m.json": b"new", "m.html": b"page", "m.rrd": b"third"}
