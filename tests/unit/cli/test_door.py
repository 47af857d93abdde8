"""The one door: commands, keys, positional words and exit codes."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from pipeline.__main__ import main
from pipeline.commands import COMMANDS, Command
from pipeline.configuration import load_settings
from pipeline.criticism.registry import effects
from pipeline.records.errors import UsageError
from pipeline.settings import ModelSettings, RunSettings, result_document


def test_lists_every_command(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--help"]) == 0
    printed = capsys.readouterr().out
    assert all(name in printed for name in COMMANDS)


def test_help_of_a_command_names_every_key(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "--help"]) == 0
    printed = capsys.readouterr().out
    assert all(f"  {key}=" in printed for key in RunSettings.__dataclass_fields__)


@pytest.mark.parametrize(
    "words",
    [
        ["dance"],
        ["run", "inptu=x"],
        ["run", "loose"],
        ["run", "workers=many"],
        ["run", "input=/no"],
    ],
)
def test_wrong_usage_is_one_line_and_exit_2(
    words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(words) == 2
    error = capsys.readouterr().err
    assert error.startswith("error: ")
    assert error.count("\n") == 1


@pytest.mark.parametrize(
    ("word", "remedy"),
    [
        ("model.effects=dead_time", "write model.effects=[dead_time]"),
        ("model.effects=a,b", "write model.effects=[a,b]"),
        ("model.effects=[dead_time", "write model.effects=[dead_time]"),
        ("model=standrad", "known are ideal, standard"),
        ("model.efects=[dead_time]", "model has model.name, model.effects"),
        ("model.effects=[deadtime]", "did you mean dead_time? effects_path="),
        ("model.effects=[-deadtime]", "did you mean dead_time?"),
        ("model.effects=[zzzz]", "known are angle_eccentricity, "),
    ],
)
def test_a_wrong_model_says_what_to_write(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], word: str, remedy: str
) -> None:
    """Each before a capture is read: there is none to read here, which would be exit code 4."""
    assert main(["compare", f"input={tmp_path}", f"output={tmp_path / 'out'}", word]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert remedy in line


@pytest.mark.parametrize("command", ["compare", "diagnose"])
def test_help_explains_the_model_and_names_the_effects(
    command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([command, "--help"]) == 0
    printed = capsys.readouterr().out
    assert "ModelSettings" not in printed
    assert all(f"  model.{key}=" in printed for key in ModelSettings.__dataclass_fields__)
    assert all(name in printed for name in effects())


def test_a_reader_that_leaves_early_is_no_failure() -> None:
    """`pipeline ... | head -1`: no traceback, and the command's own exit code."""
    words = [sys.executable, "-c", "from pipeline.__main__ import main; raise SystemExit(main())"]
    ours, theirs = os.pipe()
    os.close(ours)
    done = subprocess.run([*words, "--help"], stdout=theirs, stderr=subprocess.PIPE, check=False)
    os.close(theirs)
    assert (done.returncode, done.stderr) == (0, b"")


def test_text_keys_are_taken_as_typed() -> None:
    """00123 is a serial number, 12:30:45 no base-60 integer, ${...} no look-up."""
    for text in ("00123", "12:30:45", "${oc.env:HOME}", "a b", "[x]", "caf\u00e9"):
        settings = load_settings(COMMANDS["run"], [f"input={text}"])
        assert isinstance(settings, RunSettings)
        assert settings.input == text


def test_interpolation_in_other_keys_is_refused() -> None:
    with pytest.raises(UsageError):
        load_settings(COMMANDS["run"], ["workers=${oc.env:SHLVL}"])


def test_positional_words_take_their_names() -> None:
    command = Command("run", "run", RunSettings, "", positional=("input", "output"))
    settings = load_settings(command, ["some dir", "report=false", "there"])
    assert isinstance(settings, RunSettings)
    assert (settings.input, settings.output, settings.report) == ("some dir", "there", False)


def test_nested_options_need_no_plus_sign() -> None:
    settings = load_settings(COMMANDS["run"], ["crosscheck.kt_vs_ke.allowance=0.02"])
    assert isinstance(settings, RunSettings)
    assert settings.crosscheck == {"kt_vs_ke": {"allowance": 0.02}}


def test_where_to_and_how_fast_are_no_part_of_the_digest() -> None:
    one = RunSettings(input="a", output="b", workers=1)
    other = RunSettings(input="c", output="d", workers=2, timings=True)
    assert result_document(one) == result_document(other)
    assert result_document(one) != result_document(RunSettings(release="auto"))
