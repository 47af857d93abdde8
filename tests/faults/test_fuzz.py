"""Every input on which a reader once failed, and a short round of fuzzing."""

from __future__ import annotations

import tempfile
from contextlib import suppress
from pathlib import Path

import pytest

from pipeline.io.maps.source_map import load_source_maps, parse_source_map
from pipeline.records.errors import CaptureError, UsageError
from pipeline.settings import configuration_folder
from tests.faults import fuzz, grammar

INPUTS = sorted(path for path in fuzz.KEPT.iterdir() if path.name != "README.md")


@pytest.mark.parametrize("path", INPUTS, ids=lambda path: path.name)
def test_inputs_that_once_failed(path: Path, tmp_path: Path) -> None:
    """Expected: samples or a refusal; a folder is read as a whole."""
    maps = load_source_maps(configuration_folder() / "source")
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
    """Never 5, no traceback, no motor that could not be finished; 1 where a check fails as well."""
    numbers = range(5000, 5000 + 3 * len(grammar.FORMS))
    code, odd = fuzz.fuzz_command(numbers, tmp_path, "recordings=false")
    assert odd == []
    assert code in (1, 3)


@pytest.mark.slow
def test_a_run_over_thousands_of_hostile_folders(tmp_path: Path) -> None:
    code, odd = fuzz.fuzz_command(range(10_000, 12_000), tmp_path)
    assert (code, odd) == (3, [])


def test_the_grammar_is_sound_where_nothing_is_hostile(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without hostile fields the forms are captures, so that a refusal is due to the field."""
    monkeypatch.setattr(grammar.Draw, "_hit", lambda _: False)
    maps = load_source_maps(configuration_folder() / "source")
    read = set()
    for number in range(20 * len(grammar.FORMS)):
        form, files = grammar.case(number)
        with tempfile.TemporaryDirectory() as scratch:
            for name, data in files.items():
                (Path(scratch) / name).write_bytes(data)
            for entry in fuzz.survey(Path(scratch), maps).entries:
                with suppress(CaptureError):
                    fuzz.read_capture(Path(scratch), entry)
                    read.add(form)
    assert read == {form.__name__ for form in grammar.FORMS} - {"checksummed"}


@pytest.mark.parametrize("number", range(300))
def test_a_hostile_source_map_is_a_usage_error(number: int) -> None:
    with suppress(UsageError):
        parse_source_map(grammar.source_map(number), "bench")


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
