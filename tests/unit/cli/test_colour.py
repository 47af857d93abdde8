"""Status words are coloured for people alone."""

from __future__ import annotations

import io
import re

import pytest

from pipeline.__main__ import main
from pipeline.cli.colour import WORDS, coloured
from pipeline.stages.calc import KINDS

CODES = re.compile(r"\x1b\[[0-9;]*m")


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def shown(monkeypatch: pytest.MonkeyPatch, stream: io.StringIO, *words: str) -> str:
    with monkeypatch.context() as patched:
        patched.setattr("sys.stderr", stream)
        assert main(list(words)) == 2
    return stream.getvalue()


def test_colours_change_no_text_and_colour_every_status() -> None:
    text = "\n".join(
        ["motor  status", *(f"m1  {word}, 12" for word in WORDS), "error: no", "note: a"]
    )
    assert CODES.sub("", coloured(text)) == text
    assert coloured(text).count("\x1b[0m") == len(WORDS) + 2


@pytest.mark.parametrize(
    "text", ["refused/a.csv", "status=released", "--fail", "unknown-7", "sames"]
)
def test_what_only_looks_like_a_status_is_not_coloured(text: str) -> None:
    assert coloured(text) == text


def test_a_terminal_gets_colours_and_nothing_else_does(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setenv("TERM", "xterm")
    terminal = shown(monkeypatch, Terminal(), "runn")
    assert terminal.startswith("\x1b[31merror:\x1b[0m no command 'runn'; did you mean run?")
    assert CODES.sub("", terminal) == shown(monkeypatch, io.StringIO(), "runn")
    monkeypatch.setenv("NO_COLOR", "1")
    assert "\x1b" not in shown(monkeypatch, Terminal(), "runn")
    monkeypatch.delenv("NO_COLOR")
    monkeypatch.setenv("TERM", "dumb")
    assert "\x1b" not in shown(monkeypatch, Terminal(), "runn")


@pytest.mark.parametrize(
    "words", ["ke-kt ke_ll_peak=0.0314", "copper r=0.5 from=20 to=70", "wye-delta r_ll=1", *KINDS]
)
def test_calc_fits_eighty_columns(words: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["calc", *words.split()]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert max(len(line) for line in lines if not line.startswith("convention: ")) <= 80
