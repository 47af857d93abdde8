"""Every input on which a reader once failed, and a short round of fuzzing."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.io.source_map import load_source_maps
from pipeline.settings import configuration_folder
from tests.faults import fuzz

INPUTS = sorted(path for path in fuzz.KEPT.iterdir() if path.name != "README.md")


@pytest.mark.parametrize("path", INPUTS, ids=lambda path: path.name)
def test_inputs_that_once_failed(path: Path, tmp_path: Path) -> None:
    """Expected: samples or a refusal."""
    maps = load_source_maps(configuration_folder() / "source")
    fuzz.attempt(path.name, path.read_bytes(), tmp_path, maps)


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
