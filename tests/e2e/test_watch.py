"""`run watch=true`: a station drops captures slowly, and only whole campaigns are published."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path
from queue import Queue
from threading import Thread

from pipeline.io.registry.store import Registry

DEMO = Path("data/demo")
NAMES = ("resistance_ab.mcap", "resistance_bc.mcap", "resistance_ca.mcap", "hand_turn.csv")
LONGEST_S = 240.0
"""For a machine that is busy with other things; a pass takes a few seconds."""


def dropped_slowly(motor: str, folder: Path) -> int:
    """Copies captures of a motor in pieces with pauses shorter than `settle_s`."""
    files = [DEMO / motor / name for name in NAMES]
    target = folder / motor
    target.mkdir(parents=True)
    for file in files:
        data = file.read_bytes()
        with (target / file.name).open("wb", buffering=0) as stream:
            for part in (data[: len(data) // 3], data[len(data) // 3 :]):
                stream.write(part)
                time.sleep(0.2)
    return len(files)


class Watched:
    """A watching process and the lines that it prints."""

    def __init__(self, folder: Path, output: Path) -> None:
        command = f"run watch=true settle_s=1.5 workers=1 input={folder} output={output}"
        less = "residual_test=false recordings=false"
        self.process = subprocess.Popen(
            [sys.executable, "-m", "pipeline", *command.split(), *less.split()],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        self.lines: Queue[str] = Queue()
        Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.lines.put(line)

    def line_with(self, words: str) -> str:
        while words not in (line := self.lines.get(timeout=LONGEST_S)):
            pass
        return line

    def stop(self) -> int:
        self.process.send_signal(signal.SIGTERM)
        return self.process.wait(LONGEST_S)


def versions(output: Path, motor: str) -> int:
    return len(Registry(str(output / "registry")).history(motor))


def test_a_station_that_drops_slowly(tmp_path: Path) -> None:
    """Expected: one version of each motor, of all its files; a stop loses nothing."""
    folder, output = tmp_path / "in", tmp_path / "out"
    folder.mkdir()
    watched = Watched(folder, output)
    try:
        watched.line_with("watching")
        count = dropped_slowly("G52-0601", folder)
        assert "provisional, version " in watched.line_with("G52-0601")
        assert watched.stop() == 0
        assert not (output / ".work").exists()
        watched = Watched(folder, output)
        watched.line_with("watching")
        dropped_slowly("G52-0602", folder)
        watched.line_with("G52-0602")
        assert watched.stop() == 0
    finally:
        watched.process.kill()
    for motor in ("G52-0601", "G52-0602"):
        sheet = json.loads((output / "datasheets" / f"{motor}.json").read_bytes())
        assert len(sheet["provenance"]["captures"]) == count
    assert [versions(output, motor) for motor in ("G52-0601", "G52-0602")] == [1, 1]
