"""Words in data stay words: no path, no code, no look-up, no mark-up, no command to a terminal."""

from __future__ import annotations

import json
import os
import socket
from pathlib import Path

import pytest
import yaml

from pipeline.__main__ import main
from pipeline.cli.commands import COMMANDS
from pipeline.cli.configuration import load_settings
from pipeline.records.errors import UsageError
from tests.unit.io.recordings import json_messages, mcap_file

SECRET = "in-no-output-5b1c"
SERIALS = (
    "../../outside",
    "/etc/cron.d/outside",
    "..",
    "a/b",
    "a~2fb",
    "SN-1",
    "sn-1",
    "con",
    "line\nbreak",
    "\x1b[2J\x1b[31mred",
    "=cmd|' /C calc'!A1",
    "<script>alert(1)</script>",
    "${oc.env:MOTOR_SECRET}",
    "{_target_: os.system, _args_: [touch outside]}",
    "$(touch outside)",
    "k\u00f6nig",
    "x" * 3000,
)
ROWS = "t_s,vab_v,ia_a,temp_winding_degc\n" + "".join(
    f"{0.001 * n},{0.5 * (n // 50)},{1.0 * (n // 50) + 0.001 * (n % 7)},25.0\n" for n in range(400)
)


def hostile_folder(folder: Path) -> Path:
    """One resistance test a serial number, said in a sidecar, as text of YAML can say anything."""
    folder.mkdir()
    for number, serial in enumerate(SERIALS):
        said = {"contract": "1", "motor_id": serial, "test": "resistance", "pair": "ab"}
        said |= {"lot": serial, "operator": "${oc.env:MOTOR_SECRET}", "_target_": "os.system"}
        (folder / f"r{number}.csv").write_text(ROWS + f"0.5,{number},1.0,25.0\n")
        (folder / f"r{number}.meta.yaml").write_text(yaml.safe_dump(said, allow_unicode=True))
    return folder


def test_hostile_serial_numbers(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each motor has its own file inside the folder; nothing is run, looked up or marked up."""
    monkeypatch.setenv("MOTOR_SECRET", SECRET)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    monkeypatch.chdir(tmp_path)
    folder, output = hostile_folder(tmp_path / "in"), tmp_path / "deep" / "er" / "out"
    code = main(["run", f"input={folder}", f"output={output}"])
    said = capsys.readouterr()
    assert code in (0, 3, 4), said.err
    assert sorted(p.name for p in tmp_path.iterdir()) == ["deep", "home", "in"]
    assert [p.name for p in (tmp_path / "deep").iterdir()] == ["er"]
    assert [p.name for p in (tmp_path / "deep" / "er").iterdir()] == ["out"]
    sheets = [json.loads(p.read_bytes()) for p in (output / "datasheets").iterdir()]
    assert sorted(sheet["motor_id"] for sheet in sheets) == sorted(SERIALS)
    names = [p.name.lower() for p in (output / "datasheets").iterdir()]
    assert len(set(names)) == len(SERIALS)
    for page in (output / "report").glob("*.html"):
        assert "<script>alert" not in page.read_text()
    for path in (p for p in [*output.rglob("*"), *(tmp_path / "home").rglob("*")] if p.is_file()):
        assert SECRET.encode() not in path.read_bytes(), path
    for stream in (said.out, said.err):
        assert SECRET not in stream
        assert all(line.isprintable() for line in stream.split("\n"))
    lines = [line for line in said.err.splitlines() if line]
    findings = json.loads((output / "findings.json").read_bytes())["findings"]
    causes = {(finding["code"], finding["remedy"]) for finding in findings}
    assert len(lines) == len(causes)


@pytest.mark.parametrize(
    "word",
    [
        "workers=${oc.env:HOME}",
        "fit.resistance.x=${oc.env:HOME}",
        "+evil._target_=os.system",
        "fit={_target_:os.system}",
        "gates.stuck_channel={_target_:builtins.exec}",
        "~report",
        "hydra.run.dir=/tmp/elsewhere",
        "+hydra/launcher=evil",
        "--multirun",
    ],
)
def test_the_command_line_reaches_no_resolver_and_no_target(
    word: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Expected: exit 2 and one line, before anything is read or written."""
    output = tmp_path / "out"
    assert main(["run", f"input={tmp_path}", f"output={output}", word]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("error: ")
    assert os.environ.get("HOME", "/root") + "/" not in line.replace(str(tmp_path), "")
    assert not output.exists()


@pytest.mark.parametrize("value", ["${oc.env:HOME}", "{_target_: os.system}"])
def test_a_configuration_folder_reaches_no_resolver_and_no_target(
    value: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A file of the user's own folder holds values and nothing that is looked up or called."""
    (tmp_path / "conf" / "model").mkdir(parents=True)
    (tmp_path / "conf" / "model" / "own.yaml").write_text(f"name: {value}\n")
    words = [f"input={tmp_path}", f"output={tmp_path / 'out'}", "model=own"]
    assert main(["run", *words, f"--config-dir={tmp_path / 'conf'}"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("error: ")
    assert os.environ.get("HOME", "/root") + "/" not in line.replace(str(tmp_path), "")
    assert not (tmp_path / "out").exists()


def test_text_keys_are_taken_as_typed() -> None:
    settings = load_settings(COMMANDS["run"], ["input=${oc.env:HOME}", "source=!!python/object:x"])
    assert vars(settings)["input"] == "${oc.env:HOME}"
    with pytest.raises(UsageError):
        load_settings(COMMANDS["run"], ["workers=!!python/object/apply:os.getpid []"])


def test_what_is_no_file_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A pipe, a socket, a device, links out of the folder and to nothing: a line each, no waiting.

    A link inside the folder is the file again.
    """
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    folder = tmp_path / "in"
    folder.mkdir()
    head = "# contract: 1\n# motor_id: m\n# test: resistance\n# pair: ab\n"
    (folder / "good.csv").write_text(head + ROWS)
    (tmp_path / "secret.csv").write_text(head + ROWS)
    os.mkfifo(folder / "pipe.csv")
    (folder / "device.csv").symlink_to("/dev/zero")
    (folder / "outside.csv").symlink_to(tmp_path / "secret.csv")
    (folder / "nothing.mcap").symlink_to(tmp_path / "nowhere")
    (folder / "loop.csv").symlink_to(folder / "loop.csv")
    (folder / "up").symlink_to(tmp_path)
    (folder / "again.csv").symlink_to(folder / "good.csv")
    monkeypatch.chdir(folder)
    with socket.socket(socket.AF_UNIX) as server:
        server.bind("s.mcap")
        words = [f"input={folder}", f"output={tmp_path / 'out'}", "recordings=false"]
        assert main(["run", *words]) == 3
    refused = {
        finding["file"]: finding["code"]
        for finding in json.loads((tmp_path / "out" / "findings.json").read_bytes())["findings"]
        if finding["severity"] == "refused"
    }
    expected = ("pipe.csv", "device.csv", "outside.csv", "nothing.mcap", "loop.csv", "up", "s.mcap")
    assert refused == dict.fromkeys(expected, "not_a_file")
    lines = capsys.readouterr().err.splitlines()
    assert sum(line.startswith("refused: ") for line in lines) == len(expected)


def test_recovering_the_good_part_is_a_choice_and_marked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, bench_cut: Path
) -> None:
    """A cut recording is refused; with recover=true its good part is used, unverified and named."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    words = ["run", f"input={bench_cut}", f"output={tmp_path / 'out'}", "recordings=false"]

    def outcome(*more: str) -> tuple[int, list[dict[str, object]], list[dict[str, str]]]:
        code = main([*words, *more])
        found = json.loads((tmp_path / "out" / "findings.json").read_bytes())["findings"]
        sheets = list((tmp_path / "out" / "datasheets").glob("*.json"))
        captures = [c for s in sheets for c in json.loads(s.read_bytes())["provenance"]["captures"]]
        return code, [f for f in found if f["file"] == "cut.mcap"], captures

    code, found, captures = outcome()
    assert code == 3
    assert [(f["severity"], f["code"]) for f in found] == [("refused", "truncated")]
    assert not [c for c in captures if c["path"] == "cut.mcap"]
    code, found, captures = outcome("recover=true")
    assert code != 3
    (mark,) = [f for f in found if f["code"] == "recovered"]
    rows = mark["rows"]
    assert isinstance(rows, list)
    assert mark["severity"] == "warning"
    assert f"the {rows[1] + 1} messages" in str(mark["message"])
    (capture,) = [c for c in captures if c["path"] == "cut.mcap"]
    assert capture["integrity"] == "unverified"


@pytest.fixture
def bench_cut(tmp_path: Path) -> Path:
    """A whole resistance test as a table, and another one as a recording without its last third."""
    folder = tmp_path / "bench"
    folder.mkdir()
    said = {"contract": "1", "motor_id": "cut", "test": "resistance", "pair": "ab"}
    head = "".join(f"# {key}: {value}\n" for key, value in said.items())
    (folder / "whole.csv").write_text(head + ROWS)
    names, *lines = ROWS.splitlines()
    rows = [dict(zip(names.split(","), map(float, line.split(",")), strict=True)) for line in lines]
    # another reading of the same test: one recording under two names would count once
    rows = [{n: x if n == "t_s" else 1.0001 * x for n, x in row.items()} for row in rows]
    whole = mcap_file(json_messages(rows), ("S", "jsonschema", b"{}"), "json", said)
    (folder / "cut.mcap").write_bytes(whole[: 2 * len(whole) // 3])
    return folder
