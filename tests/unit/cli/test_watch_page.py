"""The unit and the Compose file of docs/watch.md start a command that there is."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
from configparser import ConfigParser
from pathlib import Path

import pytest
import yaml

from pipeline.cli.commands import COMMANDS
from pipeline.cli.configuration import load_settings
from pipeline.settings import RunSettings

PAGE = Path("docs/watch.md").read_text("utf-8")


def block(language: str) -> str:
    (found,) = re.findall(rf"```{language}\n(.*?)```", PAGE, flags=re.DOTALL)
    return str(found)


def unit() -> ConfigParser:
    parser = ConfigParser(interpolation=None)
    parser.optionxform = str  # type: ignore[assignment,method-assign]
    parser.read_string(block("ini"))
    return parser


def check(words: list[str]) -> RunSettings:
    settings = load_settings(COMMANDS[words[0]], words[1:])
    assert isinstance(settings, RunSettings)
    assert settings.watch
    return settings


def test_the_unit_may_write_where_its_command_writes() -> None:
    service = unit()["Service"]
    words = shlex.split(service["ExecStart"])
    settings = check(words[words.index("pipeline") + 1 :])
    assert settings.output == service["ReadWritePaths"]
    assert service["KillMode"] == "mixed", "the workers end with the watch, not beside it"


def test_the_services_volumes_are_its_folders() -> None:
    service = yaml.safe_load(block("yaml"))["services"]["datasheets"]
    settings = check(service["command"])
    targets = {volume.split(":")[1] for volume in service["volumes"]}
    assert targets == {settings.input, settings.output}
    assert service["build"]["dockerfile_inline"].startswith("FROM python:3.1")


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="systemd is not there")
def test_systemd_knows_every_key(tmp_path: Path) -> None:
    file = tmp_path / "motor-datasheets.service"
    file.write_text(block("ini"))
    said = subprocess.run(
        ["systemd-analyze", "verify", str(file)], capture_output=True, text=True, check=False
    ).stderr
    assert not [
        line for line in said.splitlines() if "Unknown" in line or "Failed to parse" in line
    ]
