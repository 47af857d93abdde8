"""At a terminal: a line while a command works, and one line where Ctrl-C ends it."""

from __future__ import annotations

import io
import os
import re
import select
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from pipeline.report.text.waiting import AFTER_S, waiting

pty = pytest.importorskip("pty", reason="there are no pseudo terminals here")
ROOT = Path(__file__).parents[3]
LONGEST_S = 120.0


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_the_line_says_what_is_done_and_for_how_long_and_is_gone_at_the_end() -> None:
    stream = Terminal()
    with waiting("reading", stream) as line:
        time.sleep(2 * AFTER_S)
        line.say("motor 1 of 2")
        time.sleep(2 * AFTER_S)
    shown = stream.getvalue()
    assert shown.index("reading, 0 s") < shown.index("motor 1 of 2, ")
    assert shown.endswith("\r\x1b[K")


def test_nothing_is_shown_where_nobody_looks_or_nothing_lasts() -> None:
    stream = Terminal()
    with waiting("soon done", stream):
        pass
    with waiting("", stream):
        time.sleep(2 * AFTER_S)
    assert not stream.getvalue().strip("\r\x1b[K")
    plain = io.StringIO()
    with waiting("to a file", plain):
        time.sleep(2 * AFTER_S)
    assert plain.getvalue() == ""


@pytest.fixture
def started(tmp_path: Path) -> Iterator[tuple[int, int]]:
    """`run` on the demo at a terminal of its own: process and terminal."""
    words = ["run", f"input={ROOT / 'data' / 'demo'}", f"output={tmp_path}", "cache=false"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    pid, terminal = pty.fork()
    if pid == 0:
        os.execve(sys.executable, [sys.executable, "-m", "pipeline", *words], environment)
    yield pid, terminal
    os.close(terminal)


def test_an_interrupt_is_one_line_and_exit_130(started: tuple[int, int]) -> None:
    pid, terminal = started
    shown, interrupted, end = b"", False, time.monotonic() + LONGEST_S
    while time.monotonic() < end:
        if not select.select([terminal], [], [], 1.0)[0]:
            continue
        try:
            part = os.read(terminal, 65536)
        except OSError:
            break
        if not part:
            break
        shown += part
        # whichever stage first lasts long enough to be shown
        if not interrupted and re.search(rb", \d+ s", shown):
            os.write(terminal, b"\x03")
            interrupted = True
    assert interrupted
    assert os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) == 130
    assert b"Traceback" not in shown
    plain = re.sub(rb"\x1b\[[0-9;]*[mK]", b"", shown)
    assert plain.rstrip().endswith(b"error: interrupted; rerun the same command to go on")
