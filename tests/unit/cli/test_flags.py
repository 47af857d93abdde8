"""Flags as Hydra has them: version, configuration, sweeps, completion; and one JSON object."""

from __future__ import annotations

import json
import math
import shlex
import shutil
import subprocess
from pathlib import Path

import pytest

from pipeline import __version__
from pipeline.__main__ import main
from pipeline.cli import multirun
from pipeline.cli.commands import COMMANDS
from pipeline.cli.completion import candidates
from pipeline.cli.configuration import load_settings
from pipeline.cli.flags import FLAGS, Flags, split_flags
from pipeline.cli.plain import finite
from pipeline.records.outcome import Outcome

ROOT = Path(__file__).parents[3]
CONFIG = "# @package _global_\ndefaults:\n  - /schema: run\n  - /model: standard\n  - _self_\n"


def printed(capsys: pytest.CaptureFixture[str], *words: str, code: int = 0) -> str:
    assert main(list(words)) == code
    return capsys.readouterr().out


def test_flags_stand_anywhere_and_leave_the_other_words_in_order() -> None:
    flags, rest = split_flags(["run", "-m", "input=a", "--config-dir", "b c", "--cfg=job", "x=-1"])
    assert flags == Flags(multirun=True, config_dir="b c", cfg="job")
    assert rest == ["run", "input=a", "x=-1"]


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ("--verson", "did you mean --version?"),
        ("--zzz", "known are --help, --version"),
        ("run --cfg", "--cfg is none; --cfg takes job"),
        ("run --cfg hydra", "--cfg hydra is none; --cfg takes job"),
        ("run --config-dir", "--config-dir takes a folder"),
        ("run --config-dir nowhere", "config_dir=nowhere is no folder"),
        ("diagnos", "did you mean diagnose?"),
        ("run inptu=x", "did you mean input?"),
        ("calc kee-kt", "did you mean ke-kt?"),
        ("run limits=defualt", "did you mean default?"),
        ("compare --multirun motor=a", "no key has several values"),
    ],
)
def test_what_there_is_not_is_named_with_what_there_is(
    words: str, told: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "data" / "demo").mkdir(parents=True)
    assert main(words.split()) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert told in line


def test_version_names_the_package(capsys) -> None:
    assert printed(capsys, "--version") == f"motor-datasheets {__version__}\n"


def test_help_names_every_flag_in_80_columns(capsys) -> None:
    text = printed(capsys, "--help")
    assert all(f"\n  {flag}\n" in text for flag in FLAGS)
    pages = [text, *(printed(capsys, name, "--help") for name in COMMANDS)]
    assert not [line for page in pages for line in page.splitlines() if len(line) > 80]


def test_an_example_of_two_lines_is_one_command(capsys) -> None:
    """A shell joins its lines, and keeps what is quoted whole."""
    text = printed(capsys, "registry", "--help").replace(" \\\n", "")
    (line,) = (line for line in text.splitlines() if " registry approve " in line)
    assert shlex.split(line)[3:] == shlex.split(COMMANDS["registry"].examples[1])


@pytest.mark.parametrize("name", COMMANDS)
def test_every_example_of_the_help_is_taken(name: str) -> None:
    command = COMMANDS[name]
    assert command.examples
    for example in command.examples:
        flags, (word, *words) = split_flags(example.replace("'", "").split())
        assert word == name
        swept = [each for each in words if not each.startswith("model=")]
        load_settings(command, [w for w in (swept if flags.multirun else words) if "=" in w])


def test_common_keys_come_first(capsys) -> None:
    text = printed(capsys, "run", "--help")
    first, further = text.split("\nfurther keys\n")
    assert "\n  input=" in first
    assert "\n  model.effects=" in first
    assert "\n  tls_key=" not in first
    assert "\n  tls_key=" in f"\n{further}"


def test_cfg_prints_what_a_command_would_get_and_does_nothing(tmp_path: Path, capsys) -> None:
    text = printed(capsys, "run", f"output={tmp_path / 'out'}", "model=ideal", "--cfg", "job")
    assert "\n  name: ideal\n" in text
    assert f"\noutput: {tmp_path / 'out'}\n" in text
    assert not (tmp_path / "out").exists()


def test_a_folder_of_ones_own_comes_before_the_package(tmp_path: Path, capsys) -> None:
    """Defaults of a command, a model and a limits file, from a folder whose name has a quote."""
    conf = tmp_path / "it's mine"
    for group, content in (
        ("command/run", f"{CONFIG}release: auto\n"),
        ("model/ideal", "name: ideal\neffects: [cogging]\n"),
        ("model/rig", "name: standard\neffects: [windage]\n"),
    ):
        path = conf / f"{group}.yaml"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(content)
    flag = ("run", "--cfg", "job", "--config-dir", str(conf))
    assert "\nrelease: auto\n" in printed(capsys, *flag)
    assert "effects:\n  - cogging\n" in printed(capsys, *flag, "model=ideal")
    assert "effects:\n  - windage\n" in printed(capsys, *flag, "model=rig")
    assert "\nrelease: manual\n" in printed(capsys, "run", "--cfg", "job")
    origin = printed(capsys, "run", "--info", f"config_dir={conf}").splitlines()
    assert [line.strip() for line in origin[1:3]] == [
        str(conf / "command" / "run.yaml"),
        str(ROOT / "conf" / "command" / "run.yaml"),
    ]


def test_a_sweep_is_one_run_for_each_combination() -> None:
    seen = []

    def run(words: list[str]) -> Outcome:
        seen.append(words)
        return Outcome(4 if "model=b" in words else 0, f"did {words[0]}")

    words = ["model=a,b", "model.effects=[x,y],[]", "output=o/p", "motor='q,r'"]
    outcome = multirun.sweep(COMMANDS["compare"], words, run)
    assert [each[:2] for each in seen] == [
        ["model=a", "model.effects=[x,y]"],
        ["model=a", "model.effects=[]"],
        ["model=b", "model.effects=[x,y]"],
        ["model=b", "model.effects=[]"],
    ]
    assert seen[0][2:] == ["motor='q,r'", "output=o/p/multirun/model=a,model.effects=[x,y]"]
    assert outcome.exit_code == 4
    assert outcome.text.startswith("[model=a,model.effects=[x,y]]\ndid model=a\n[")


def test_json_holds_the_answer_and_the_exit_code(tmp_path: Path, capsys) -> None:
    document = json.loads(printed(capsys, "calc", "kv", "kv=340", "json=true"))
    assert (document["schema"], document["command"], document["exit_code"]) == (
        "outcome/1",
        "calc",
        0,
    )
    psi = [line for line in document["result"]["lines"] if line["name"] == "ke_ll_peak_v_s_rad"]
    assert psi[0]["value"] == pytest.approx(60 / (2 * 3.141592653589793 * 340))
    made = json.loads(
        printed(capsys, "simulate", f"output={tmp_path / 'sim'}", "exact=true", "json=true")
    )
    assert made["wrote"] == str(tmp_path / "sim")
    assert made["next"] == f"run input={tmp_path / 'sim'}"
    assert sorted(Path(p).name for p in made["result"][0]["captures"]) == sorted(
        p.name for p in (tmp_path / "sim").iterdir() if p.name != "truth.json"
    )


def failing(capsys, *words: str) -> tuple[int, dict]:
    """Exit code and JSON of a command that fails; standard error has a line as well."""
    code = main([*words, "json=true"])
    seen = capsys.readouterr()
    assert seen.err.strip()
    document = json.loads(seen.out)
    assert document["exit_code"] == code
    return code, document


@pytest.mark.parametrize(
    ("words", "code", "kind"),
    [
        (("diagnos",), 2, "usage"),
        (("run", "inputs=x"), 2, "usage"),
        (("run", "input=nowhere"), 2, "usage"),
        (("inspect", "missing.csv"), 2, "usage"),
    ],
)
def test_a_command_that_fails_prints_json_with_the_remedy(words, code, kind, capsys) -> None:
    """The same that stands on standard error, in parts; the exit code stays."""
    ended, document = failing(capsys, *words)
    (error,) = document["errors"]
    assert (ended, error["severity"], error["code"]) == (code, "error", kind)
    assert (document["command"], document["result"]) == (words[0], None)
    assert error["message"] and error["remedy"]
    assert f"error: {error['message']}; {error['remedy']}" == document["messages"][0]


def test_refused_captures_are_named_in_json_with_rows_and_remedy(tmp_path: Path, capsys) -> None:
    """A file of bytes that are no capture, alone and in a folder beside none other."""
    bad = tmp_path / "in" / "bad.csv"
    bad.parent.mkdir()
    bad.write_text("# contract: 1\n# motor_id: m\n# test: drive\nt_s,vq_v\n0,1\n1,x\n")
    code, document = failing(capsys, "compare", f"input={bad.parent}", f"output={tmp_path / 'o'}")
    (error,) = document["errors"]
    assert (code, error["severity"], error["file"]) == (3, "refused", "bad.csv")
    assert error["rows"] == [1, 1]
    assert error["remedy"]
    code, document = failing(capsys, "inspect", str(bad))
    (seen,) = document["errors"]
    assert (code, seen["file"], seen["rows"], seen["code"]) == (3, "bad.csv", [1, 1], error["code"])


def test_a_sweep_in_json_is_one_list(capsys) -> None:
    found = json.loads(printed(capsys, "calc", "kv", "kv=340,350", "--multirun", "json=true"))
    first, second = (one["result"]["lines"][0]["value"] for one in found)
    assert first / second == pytest.approx(350 / 340)


def test_a_number_that_is_not_finite_is_null_in_json() -> None:
    """As in every output; degrees of freedom are infinite where they do not matter."""
    given = {"a": (math.inf, math.nan, 1.5), "b": [Flags(cfg="job")], "c": {2}, "d": Path("x")}
    found = finite(given)
    assert found["a"] == [None, None, 1.5]
    assert (found["b"][0]["cfg"], found["c"], found["d"]) == ("job", [2], "x")


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("motor-datasheets di", ["diagnose"]),
        ("motor-datasheets diagnose mot", ["motor="]),
        ("motor-datasheets run release=", ["release=manual", "release=auto"]),
        ("motor-datasheets run report=t", ["report=true"]),
        ("motor-datasheets run model=i", ["model=ideal"]),
        ("motor-datasheets run model.effects=[cog", ["model.effects=[cogging]"]),
        ("motor-datasheets run --mul", ["--multirun"]),
        ("motor-datasheets nothing x", []),
        ("motor-datasheets run input=", []),
    ],
)
def test_completion_offers_what_may_come_next(line: str, words: list[str]) -> None:
    assert candidates(line) == words


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_what_a_shell_evaluates_asks_for_its_words(shell: str, capsys) -> None:
    text = printed(capsys, "--shell-completion", f"install={shell}")
    assert f"-sc query={shell}" in text
    assert "{{" not in text


def test_bash_completes_by_what_it_evaluated(capsys) -> None:
    bash = shutil.which("bash")
    if bash is None:
        pytest.skip("bash is not installed")
    text = printed(capsys, "--shell-completion", "install=bash")
    ask = "COMP_LINE='motor-datasheets run rele'; COMP_POINT=99; _motor_datasheets"
    script = f'compopt() {{ :; }}\n{text}\n{ask}\necho "${{COMPREPLY[@]}}"'
    done = subprocess.run(
        [bash, "-c", script], capture_output=True, text=True, check=True, cwd=ROOT
    )
    assert done.stdout == "release=\n"
