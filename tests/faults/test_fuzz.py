"""Every input on which a reader once failed, and a short round of fuzzing."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path

import pytest

from pipeline.io.maps.map_file import parse_source_file
from pipeline.io.maps.source_map import SourceMap
from pipeline.records.errors import CaptureError, UsageError
from tests.faults import fuzz, grammar

INPUTS = sorted(path for path in fuzz.KEPT.iterdir() if path.name != "README.md")


@pytest.mark.parametrize("path", INPUTS, ids=lambda path: path.name)
def test_inputs_that_once_failed(path: Path, tmp_path: Path) -> None:
    """Expected: samples or a refusal; a folder is read as a whole."""
    maps = fuzz.every_map()
    if path.is_dir():
        fuzz.attempt_folder({f.name: f.read_bytes() for f in path.iterdir()}, tmp_path, maps)
    else:
        fuzz.attempt(path.name, path.read_bytes(), tmp_path, maps)


def test_hostile_numbers_and_texts_in_every_field_of_every_form() -> None:
    """Forty folders a form, one to three fields of each hostile: samples or refusals."""
    counted, kept = fuzz.fuzz_folders(range(40 * len(grammar.FORMS)))
    assert counted == 40 * len(grammar.FORMS)
    assert kept == []


def test_a_run_over_hostile_folders_refuses_them_and_nothing_more(tmp_path: Path) -> None:
    """Never 5, no traceback, no motor that could not be finished.

    A hostile number may be a sound one of another motor: 0.01 ohm stated, where 0.6 is measured.
    Then the check of stated constants fails, and the code is 1; no other check may.
    """
    numbers = range(5000, 5000 + len(grammar.FORMS))
    code, odd = fuzz.fuzz_command(numbers, tmp_path, "recordings=false")
    assert odd == []
    assert _failed(tmp_path) <= {"stated_constants"}
    assert code == (1 if _failed(tmp_path) else 3)


@pytest.mark.slow
def test_a_run_over_thousands_of_hostile_folders(tmp_path: Path) -> None:
    code, odd = fuzz.fuzz_command(range(10_000, 12_000), tmp_path)
    assert odd == []
    assert _failed(tmp_path) <= {"stated_constants"}
    assert code == (1 if _failed(tmp_path) else 3)


def _failed(folder: Path) -> set[str]:
    """Checks that fail on some datasheet of a run."""
    sheets = (json.loads(p.read_bytes()) for p in (folder / "out/datasheets").glob("*.json"))
    return {check["name"] for s in sheets for check in s["checks"] if check["status"] == "fail"}


@pytest.mark.parametrize("form", grammar.FORMS, ids=lambda form: form.__name__)
def test_the_grammar_is_sound_where_nothing_is_hostile(
    form: Callable[[grammar.Draw], grammar.Folder],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    """Without hostile fields one of 400 folders is a capture, so that refusals are due to fields.

    Kinds and lengths are drawn as well, by which two ROS 2 captures of 200 are whole.
    """
    monkeypatch.setattr(grammar.Draw, "_hit", lambda _: False)
    maps = fuzz.every_map()
    numbers = range(400)
    read = any(_is_read(form(grammar.Draw(n)), tmp_path / str(n), maps) for n in numbers)
    assert read == (form is not grammar.checksummed)


def _is_read(files: grammar.Folder, folder: Path, maps: Mapping[str, SourceMap]) -> bool:
    folder.mkdir()
    for name, data in files.items():
        (folder / name).write_bytes(data)
    for entry in fuzz.survey(folder, maps).entries:
        with suppress(CaptureError):
            fuzz.read_capture(folder, entry)
            return True
    return False


@pytest.mark.parametrize("number", range(300))
def test_a_hostile_source_map_is_a_usage_error(number: int) -> None:
    with suppress(UsageError):
        parse_source_file(grammar.source_map(number), "bench")["bench"]


def test_a_failing_reader_is_noticed_and_its_input_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A reader with a fault on one byte: found, kept, and the sound one is not accused."""
    monkeypatch.setattr(fuzz, "KEPT", tmp_path)
    counted, kept = fuzz.fuzz(0.5, examples=150)
    assert counted >= 100
    assert kept == []

    def faulty(*_: object, **__: object) -> None:
        raise KeyError("no such channel")

    monkeypatch.setattr(fuzz, "survey", faulty)
    _, kept = fuzz.fuzz(0.1, examples=3)
    assert kept
    assert all(path.is_file() for path in kept)
