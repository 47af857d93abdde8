"""Folders of captures that hold none, and outputs that cannot be written."""

from __future__ import annotations

from pathlib import Path

import pytest

import pipeline.stages.steps.criticism as criticism_stage
from pipeline.__main__ import main

NOBODYS = "# contract: 1\n# test: spin_down\nt_s,omega_mech_rad_s\n0,1\n1,2\n"
READING = ("run", "compare", "diagnose")


@pytest.mark.parametrize("command", READING)
@pytest.mark.parametrize(
    ("name", "content", "code", "said"),
    [
        (None, "", 4, ("undecided: no usable capture in ", "input=")),
        ("notes.txt", "hello\n", 4, ("undecided: no usable capture in ", "inspect", "notes.txt")),
        ("a.csv", NOBODYS, 3, ("refused: a.csv", "undecided: no usable capture in ", "correct")),
    ],
)
def test_a_folder_without_a_usable_capture_is_said_and_what_to_do(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    command: str,
    name: str | None,
    content: str,
    code: int,
    said: tuple[str, ...],
) -> None:
    folder = tmp_path / "in"
    folder.mkdir()
    if name is not None:
        (folder / name).write_text(content)
    assert main([command, f"input={folder}", f"output={tmp_path / 'out'}"]) == code
    printed = capsys.readouterr()
    assert all(words in printed.err for words in said)
    assert not printed.out.startswith("\n")


@pytest.mark.parametrize("command", [*READING, "simulate"])
@pytest.mark.parametrize("place", ["taken", "taken/deeper", "/proc/nowhere"])
def test_an_output_that_cannot_be_written_is_refused_before_the_work(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    command: str,
    place: str,
) -> None:
    """One line, exit code 2, with what to do; nothing has been read by then."""

    def too_late(*_: object) -> None:
        raise AssertionError("captures are read before the output is looked at")

    monkeypatch.setattr(criticism_stage, "campaigns", too_late)
    (tmp_path / "taken").write_text("a file")
    words = [f"output={tmp_path / place}"] + [f"input={tmp_path}"] * (command in READING)
    assert main([command, *words]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"error: output={tmp_path / place} ")
    assert line.endswith("; name a folder to write to, output=DIR")
