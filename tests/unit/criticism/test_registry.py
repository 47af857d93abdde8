"""The library of effects: ours, and a user's folder as it is at the time."""

from __future__ import annotations

import pickle
from pathlib import Path

import pytest

from pipeline.criticism.library.registry import effects
from pipeline.records.errors import UsageError

BRAKE = """
from dataclasses import replace
from pipeline.criticism.effects.windage import EFFECT as KNOWN


def torque(x, q):
    return {factor} * q["drag_nm"]


EFFECT = replace(KNOWN, name="brake", torque=torque)
"""


def strength(effect) -> float:
    return effect.torque(None, {"drag_nm": 1.0})


def written(folder: Path, factor: int) -> str:
    folder.mkdir(exist_ok=True)
    (folder / "brake.py").write_text(BRAKE.format(factor=factor), encoding="utf-8")
    return str(folder)


def test_what_a_caller_does_to_the_library_is_its_own():
    mine = effects()
    mine.pop("windage")
    mine["cogging"] = mine["stribeck"]
    assert "windage" in effects()
    assert effects()["cogging"].name == "cogging"


def test_a_folder_that_has_changed_is_read_again(tmp_path: Path):
    """In the same second and of the same length, so that no time stamp tells."""
    first = effects(written(tmp_path, 2))["brake"]
    assert effects(str(tmp_path))["brake"] is first
    assert strength(effects(written(tmp_path, 3))["brake"]) == 3.0
    assert strength(first) == 2.0
    (tmp_path / "brake.py").unlink()
    assert "brake" not in effects(str(tmp_path))


def test_files_of_one_name_in_two_folders_are_two_effects(tmp_path: Path):
    """Each travels to another process by the name of its own module."""
    one, two = (effects(written(tmp_path / str(n), n))["brake"] for n in (2, 3))
    assert one.torque.call.__module__ != two.torque.call.__module__
    for effect, factor in ((one, 2.0), (two, 3.0)):
        assert strength(pickle.loads(pickle.dumps(effect))) == factor


def test_a_file_without_an_effect_is_said_every_time(tmp_path: Path):
    (tmp_path / "empty.py").write_text("", encoding="utf-8")
    for _ in range(2):
        with pytest.raises(UsageError, match="defines no EFFECT"):
            effects(str(tmp_path))
