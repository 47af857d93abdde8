"""The entry point: commands, keys, positional words and exit codes."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from pipeline.__main__ import main
from pipeline.cli.commands import COMMANDS, Command
from pipeline.cli.configuration import load_settings, with_source
from pipeline.criticism.library.registry import effects
from pipeline.records.errors import UsageError
from pipeline.settings import (
    ModelSettings,
    OperateSettings,
    RunSettings,
    configuration_folder,
    result_document,
)


def test_lists_every_command(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--help"]) == 0
    printed = capsys.readouterr().out
    assert all(name in printed for name in COMMANDS)


def test_help_of_a_command_names_every_key(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "--help"]) == 0
    printed = capsys.readouterr().out
    groups = {"model": ModelSettings, "operate": OperateSettings}
    nested = {f"{name}.{key}" for name, kind in groups.items() for key in kind.__dataclass_fields__}
    keys = {*RunSettings.__dataclass_fields__} - set(groups) | nested
    assert [key for key in sorted(keys) if f"  {key}=" not in printed] == []


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


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ("run workers=abc", "workers=abc is no whole number; write workers= and a whole number"),
        ("run workers=1.5", "workers=1.5 is no whole number"),
        ("simulate seed=x", "seed=x is no whole number"),
        ("run report=maybe", "report=maybe is neither true nor false"),
        ("run timings=3", "timings=3 is neither true nor false"),
        ("run read_seconds=abc", "read_seconds=abc is no number"),
        ("run read_seconds=nan", "read_seconds=nan is no time"),
        ("run read_seconds=inf", "read_seconds=inf is no time"),
        ("run read_memory_mb=99999999999999", "is more than there can be"),
        ("compare model.name=null", "model.name=null is nothing"),
        ("run input=null", "input=null is nothing; it takes folder of captures"),
        ("run output=null", "output=null is nothing"),
        ("compare input=null", "input=null is nothing"),
        ("diagnose output=null", "output=null is nothing"),
        ("plan output=null", "output=null is nothing"),
        ("run limits=null", "limits=null is nothing"),
        ("run input=", "input= is empty; it takes folder of captures"),
        ("run output=", "output= is empty"),
        ("simulate output=", "output= is empty; it takes folder to write to; `.` is"),
        ("compare effects_path=", "effects_path= is empty"),
        ("registry list registry=", "registry= is empty"),
        ("run policy.selection.tei=9", "'selection.tei'; did you mean selection.tie?"),
        ("diagnose policy.selection.tie=-9", "selection.tie=-9 is not of the default's sign"),
        ("compare policy.tie=abc", "policy: no field 'tie'; did you mean selection.tie?"),
        ("run policy=strict", "run: no policy 'strict'; known are default"),
        ("run release=yes", "release=yes is unknown; it is manual or auto"),
        (
            "run source.root=x",
            "source has no keys below it; did you mean source=x? it takes source",
        ),
        ("compare source.root=x", "source has no keys below it; did you mean source=x?"),
        ("run source=", "source= is empty; it takes source map"),
        ("run workers.most=2", "workers has no keys below it; did you mean workers=2? it takes a"),
        ("run workers.most=x", "workers has no keys below it; it takes a whole number: motors"),
        ("run release.auto=true", "did you mean release=auto? it takes manual, or auto"),
        (
            "run model.name.x=ideal",
            "no keys below it; did you mean model.name=ideal?",
        ),
        ("run model.effects.cogging=1", "no keys below it; write model.effects=[cogging]"),
        (
            "run operate.vdc_v.x=48",
            "no keys below it; did you mean operate.vdc_v=48? it takes",
        ),
        ("run operate.vdc_v=x", "operate.vdc_v=x is no number; write operate.vdc_v= and a number"),
        ("run operate=3", "operate is a group of keys; it has operate.vdc_v, operate.current_a"),
        ("run fit=3", "fit is a group of keys; write fit.NAME=value (options of an estimator"),
        ("run fit..share=3", "no key 'fit..share'"),
        ("run gates={a", "gates={a cannot be read; close its brackets and quotes"),
        ("run gates=3", "gates=3: gates is a group of keys"),
        ("run gates.sampling_rate=3", "write gates.sampling_rate.OPTION=number; it has enabled"),
        ("run fit.current_step=null", "write fit.current_step.OPTION=number; it has least_share"),
        ("run crosscheck.kt_vs_ke=abc", "crosscheck.kt_vs_ke=abc: kt_vs_ke is no option"),
        ("run crosscheck.kt_vs_ke.allowance=abc", "allowance=abc is not a number; "),
        ("run crosscheck.kt_vs_ke.allowance=[1]", "allowance=[1] is not a number; "),
        ("run crosscheck.kt_vs_ke.allowance=true", "allowance=True is not a number; "),
        ("run crosscheck.kt_vs_ke.allowance=-0.1", "is not a number of 0 or more; "),
        ("run fit.current_step.least_share=-1", "least_share=-1 is not a number from 0 to 1"),
        ("run fit.current_step.least_share=nan", "least_share=nan is not a number"),
        ("run fit.current_step.least_share=inf", "least_share=inf is not a number"),
        ("run fit.cogging.level=0", "level=0 is not a number between 0 and 1"),
        ("run fit.soak.temp_assumed_degc=-300", "is not above -273.15 degC"),
        ("run gates.sampling_rate.enabled=2", "enabled=2 is not 1 or 0"),
        ("compare model.effects=[cogging,cogging]", "model.effects names cogging twice"),
        ("compare model.effects=[cogging,-cogging]", "model.effects names cogging twice"),
        ("review web=true port=99999", "port=99999 is none; 0, or one of 1 to 65534"),
        ("review port=-1", "port=-1 is none"),
        ("run registry=http://x/y", "registry http://x/y: no registry can be at such an address"),
        ("registry list registry=foo://x/y", "no registry can be at such an address"),
        ("calc ke-kt ke_ll_peak=1e400", "ke_ll_peak_v_s_rad=1e400; it is too large for a number"),
    ],
)
def test_a_value_that_cannot_be_is_named_with_what_can_be(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    words: str,
    told: str,
) -> None:
    """One line, exit code 2, and nothing is read or written."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "in").mkdir()
    command, *keys = words.split()
    given = {"input": "in", "output": "out"} if command in ("run", "compare", "diagnose") else {}
    given = {k: v for k, v in given.items() if not any(w.startswith(f"{k}=") for w in keys)}
    assert main([command, *(f"{k}={v}" for k, v in given.items()), *keys]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("error: ")
    assert told in line
    assert command in ("compare", "diagnose") or [path.name for path in tmp_path.iterdir()] == [
        "in"
    ]


@pytest.mark.parametrize(
    ("yaml", "told"),
    [
        ("source:\n  root: x", "source is one value: no list, no keys; it takes source map for"),
        ("workers: x", "workers is no whole number; it takes a whole number: motors worked on"),
        ("sauce: x", "no key 'sauce'; did you mean source?"),
        ("model:\n  nam: x", "no key 'model.nam'; model has model.name, model.effects"),
        ("model:\n  effects: x", "model.effects is no list of texts; it takes [a,b]"),
        ("fit: 5", "fit is a group of keys; write fit.NAME=value"),
        ("operate:\n  vdc_v: x", "operate.vdc_v is no number; it takes a number: DC bus voltage"),
        ("a: [b", "expected ',' or ']'"),
    ],
)
def test_a_configuration_file_at_fault_is_named_with_its_key(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], yaml: str, told: str
) -> None:
    file = tmp_path / "command" / "run.yaml"
    file.parent.mkdir()
    file.write_text(f"{(configuration_folder() / 'command' / 'run.yaml').read_text()}{yaml}\n")
    assert main(["run", f"input={tmp_path}", f"config_dir={tmp_path}"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert file.as_posix() in line
    assert told in line


@pytest.mark.parametrize(
    "word",
    [
        "operate.vdc_v=null",
        "constants={r_phase_ohm: 0.3, u_r_phase_ohm: 0.01}",
        "fit.soak.temp_assumed_degc=-40",
        "fit.hand_turn.alpha_assumed_1_k=-0.002",
        "gates.sampling_rate.enabled=false",
        "gates.sampling_rate.step_warn=0",
        "crosscheck.kt_vs_ke.allowance=1e-3",
        "policy.selection.tie=9",
        "policy=default",
        "report=off",
        "workers='2'",
        "read_seconds=1.5e2",
    ],
)
def test_what_can_be_is_taken(tmp_path: Path, word: str) -> None:
    """No captures are there: exit code 4."""
    (tmp_path / "in").mkdir()
    assert main(["run", f"input={tmp_path / 'in'}", f"output={tmp_path / 'out'}", word]) == 4


def test_a_tilde_is_the_home_which_no_shell_expands_after_an_equals_sign(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("HOME", "/home/someone")
    settings = load_settings(COMMANDS["run"], ["input=~/captures", "output=a~b"])
    assert isinstance(settings, RunSettings)
    assert (settings.input, settings.output) == ("/home/someone/captures", "a~b")


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
    command = Command("run", RunSettings, "", positional=("input", "output"))
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


@pytest.mark.parametrize(
    ("command", "source", "printed"),
    [
        (
            "diagnose input=in motor=a",
            "my map.yaml",
            "diagnose input=in motor=a source='my map.yaml'",
        ),
        ("diagnose input=in motor=a", "auto", "diagnose input=in motor=a"),
        ("registry show a", "map.yaml", "registry show a"),
    ],
)
def test_the_next_command_reads_captures_by_the_map_of_this_one(command, source, printed) -> None:
    assert with_source(command, RunSettings(source=source)) == printed
