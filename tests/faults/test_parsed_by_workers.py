"""`compare`, `diagnose` and `inspect` parse no stranger's file in the driver, and keep limits."""

from __future__ import annotations

import os
import struct
import zlib
from pathlib import Path
from typing import Any

import pytest
import zstandard

from pipeline.__main__ import main
from pipeline.io.ingest.guard import LEAST_MB
from tests.faults.bombs import MB, chunk, file_of, record, text

pytestmark = pytest.mark.workers
PARSERS = (
    ("pipeline.io.ingest.identification", "scan"),
    ("pipeline.io.ingest.identification", "split_comments"),
    ("pipeline.io.ingest.capture_reader", "read_csv"),
    ("pipeline.io.ingest.capture_reader", "scan"),
    ("pipeline.io.inspection.describe", "describe"),
)
HEAVY = "reading it takes more than"
LITTLE = f"read_memory_mb={LEAST_MB}"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A whole resistance test, and a chunk that keeps every rule but unpacks to 60 MiB of
    messages, whose times and places alone take as much again.

    Whatever parses a file is broken in this process; workers begin anew and know nothing of that.
    """
    folder = tmp_path / "in"
    folder.mkdir()
    rows = "".join(f"{n / 1000},{n // 50},{2 * (n // 50)},25.0\n" for n in range(400))
    head = "# contract: 1\n# motor_id: m\n# test: resistance\n# pair: ab\n"
    (folder / "whole.csv").write_text(f"{head}t_s,vab_v,ia_a,temp_winding_degc\n{rows}")
    channel = struct.pack("<HH", 1, 0) + text(b"/s") + text(b"json") + text(b"")
    message = record(5, struct.pack("<HIQQ", 1, 0, 0, 0) + b"{}")
    noise = record(5, struct.pack("<HIQQ", 1, 0, 0, 0) + os.urandom(MB // 8))
    plain = record(4, channel) + noise + message * (60 * MB // len(message))
    packed = zstandard.compress(plain)
    (folder / "heavy.mcap").write_bytes(file_of(chunk(packed, len(plain), zlib.crc32(plain))))

    def broken(*_: Any, **__: Any) -> Any:
        raise AssertionError("a stranger's file was parsed in the driver")

    for module, name in PARSERS:
        monkeypatch.setattr(f"{module}.{name}", broken)
    return folder


@pytest.mark.parametrize("command", [pytest.param("compare", marks=pytest.mark.slow), "diagnose"])
def test_one_heavy_file_costs_itself(
    command: str, folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Expected: exit 3, one line for the heavy file, a result for the motor of the other."""
    output = tmp_path / "out"
    assert main([command, f"input={folder}", f"output={output}", LITTLE]) == 3
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("refused: ") and "heavy.mcap" in line and HEAVY in line
    folder = {"compare": "comparison", "diagnose": "diagnosis"}[command]
    assert (output / folder / "m.json").is_file()
    assert not (output / ".work").exists()


def test_inspect_reads_in_a_worker(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Expected: exit 3 and one line for the heavy file, the usual text for the other."""
    assert main(["inspect", str(folder / "heavy.mcap"), LITTLE]) == 3
    assert HEAVY in capsys.readouterr().err
    assert main(["inspect", str(folder / "whole.csv")]) == 0
    assert "in the form of the contract" in capsys.readouterr().out


def test_inspect_names_the_file_that_it_cannot_read(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Expected: exit 3, for a pipe is read by nobody."""
    os.mkfifo(tmp_path / "pipe.csv")
    assert main(["inspect", str(tmp_path / "pipe.csv")]) == 3
    (line,) = capsys.readouterr().err.splitlines()
    assert "pipe.csv: it is no regular file" in line


def test_inspect_says_what_a_gate_of_run_would(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Half a turn is no cogging test: it was called sound, and `run` refused it."""
    rows = "".join(f"{n / 100},{n / 400},{0.01 * (n % 7)}\n" for n in range(400))
    head = "# contract: 1\n# motor_id: m\n# test: cogging\n"
    text = f"{head}t_s,theta_mech_rad,torque_shaft_nm\n{rows}"
    (folder / "half.csv").write_text(text)
    (folder / "heavy.mcap").unlink()
    output = f"output={folder.parent / 'out'}"
    words = [output, "report=false", "residual_test=false", "workers=1"]
    main(["run", f"input={folder}", *words])
    refused = [line for line in capsys.readouterr().err.splitlines() if "half.csv" in line]
    assert main(["inspect", str(folder / "half.csv")]) == 3
    said = capsys.readouterr()
    told = [x for x in said.out.splitlines() if x.startswith("fault: ")]
    assert len(told) == 1
    assert told[0].removeprefix("fault: ").partition(";")[0] in refused[0]
    assert said.err.splitlines() == refused


@pytest.mark.parametrize(
    ("name", "content", "code"),
    [
        ("empty.csv", b"", 3),
        ("empty.mcap", b"", 3),
        (
            "cut.csv",
            b"# contract: 1\n# motor_id: m\n# test: spin_down\nt_s,iq_a,id_a\n0,1,2\n1,2",
            3,
        ),
        ("notes.txt", b"hello\n", 0),
        ("strange.csv", b"Time;RPM\n0;1\n1;2\n2;3\n", 0),
    ],
)
def test_inspect_ends_as_a_run_of_the_file_would(
    tmp_path: Path, name: str, content: bytes, code: int, capsys: pytest.CaptureFixture[str]
) -> None:
    """Expected: exit 3 and one line for what `run` refuses, 0 for what it leaves alone."""
    (tmp_path / name).write_bytes(content)
    assert main(["inspect", str(tmp_path / name)]) == code
    lines = capsys.readouterr().err.splitlines()
    assert [line.startswith(f"refused: {name}") for line in lines] == [True] * (code == 3)


def test_little_memory_reads_a_small_file(folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """The threads of the libraries are begun before the limit is, and panic at none."""
    assert main(["inspect", str(folder / "whole.csv"), LITTLE]) == 0
    assert not capfd.readouterr().err


def test_inspect_ends_where_the_reader_hangs(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A time that no reading keeps: tried twice, then one line and exit 3."""
    assert main(["inspect", str(folder / "whole.csv"), "read_seconds=0.000001"]) == 3
    assert "took too long, twice" in capsys.readouterr().err
