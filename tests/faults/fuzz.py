"""Fuzzing of the readers: hostile recordings and tables in, samples or a refusal out.

`python -m tests.faults.fuzz --minutes 10` damages bytes with hypothesis for half of the time and
writes whole folders around hostile fields (`grammar`) for the other half, a share of them through
`run` itself. Any other end than samples or a refusal keeps the input under `tests/faults/kept`, and
exit 1. A refusal with the code of a reader or gate that broke counts as such an end: the border
behind the readers held, but a conversion in them is not guarded.
"""

from __future__ import annotations

import argparse
import hashlib
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict
from pathlib import Path

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pipeline.contracts.motor import agree
from pipeline.execution.tasks.captures import ReadTask, usable_captures
from pipeline.io.ingest.capture_reader import read_capture, survey
from pipeline.io.ingest.guard import READER_FAILED, ReadLimits
from pipeline.io.maps.map_file import load_source_maps
from pipeline.io.maps.source_map import SourceMap
from pipeline.io.storage.publish import canonical_json
from pipeline.records.capture import Campaign
from pipeline.records.errors import CaptureError
from pipeline.settings import configuration_folder
from tests.faults.forms import maps
from tests.faults.grammar import case
from tests.faults.test_random_damage import FILES, TEXTS
from tests.unit.io.recordings import small_capture

BROKEN = (READER_FAILED, "gate_failed")
"""Codes of refusals that are a fault of the code as well."""
ENDS = (0, 1, 3, 4)
"""Exit codes of a `run` over any input: done, a check failed, captures refused, too little data."""
FOLDERS = 2000
KEPT = Path(__file__).parent / "kept"
HEAD = b"# contract: 1\n# motor_id: fuzz\n# test: drive\n"
TABLE = HEAD + b"t_s,iq_a,vq_v\n" + b"".join(b"%d.5,1.25,-3e-2\n" % n for n in range(30))
SEEDS: dict[str, Callable[[], bytes]] = {
    **{f"{name}.mcap": make for name, make in FILES.items()},
    "checked.mcap": small_capture,
    "recovered.mcap": lambda: small_capture()[:-300],
    "table.csv": lambda: TABLE,
    **{f"foreign{n}.csv": lambda text=text: text.encode() for n, text in enumerate(TEXTS)},
}
SPLINTERS = st.sampled_from(
    [b"", b"\0", b"\xff" * 8, b"\n", b"\r", b'"', b",", b";", b"nan", b"1e999", b"\x7f\xff\xff\xff"]
)


@st.composite
def damaged(draw: st.DrawFn) -> tuple[str, bytes]:
    """The name of a seed, and its bytes after a few edits."""
    name = draw(st.sampled_from(sorted(SEEDS)))
    data = bytearray(SEEDS[name]())
    for _ in range(draw(st.integers(0, 5))):
        at = draw(st.integers(0, max(len(data) - 1, 0)))
        width = draw(st.integers(0, 12))
        with_ = draw(st.one_of(SPLINTERS, st.binary(max_size=12)))
        data[at : at + width] = with_
    return name, bytes(data)


def attempt(name: str, data: bytes, folder: Path, maps: dict[str, SourceMap]) -> bool:
    """Reads one file as `run` does; True where samples came out. Only CaptureError is expected."""
    place = folder / name
    place.write_bytes(data)
    try:
        found = survey(folder, maps, recover="recovered" in name)
        for entry in found.entries:
            try:
                read_capture(folder, entry)
            except CaptureError as fault:
                assert fault.code and fault.remedy
                assert fault.code not in BROKEN, fault
        return bool(found.entries)
    finally:
        place.unlink()


def attempt_folder(files: Mapping[str, bytes], folder: Path, maps: dict[str, SourceMap]) -> None:
    """Surveys, reads and validates a folder as a worker does.

    Raises:
        AssertionError: A reader or gate that broke, or a finding that no output can hold.

    """
    for name, data in files.items():
        (folder / name).write_bytes(data)
    try:
        found = survey(folder, maps)
        task = ReadTask("fuzz", str(folder), found.entries, ReadLimits())
        captures, findings = usable_captures(task)
        if captures:
            findings += agree(Campaign("fuzz", captures))
        for capture in captures:
            canonical_json(asdict(capture.meta))
        for finding in (*found.findings, *findings):
            assert finding.code not in BROKEN, finding.line()
            canonical_json(finding.document())
            finding.line().encode()
    finally:
        for name in files:
            (folder / name).unlink()


def every_map() -> dict[str, SourceMap]:
    """The shipped maps, and one for each reader of a form."""
    return load_source_maps(configuration_folder() / "source") | maps()


def fuzz_folders(numbers: Iterable[int]) -> tuple[int, list[Path]]:
    """How many folders of the grammar were read, and those that were kept."""
    maps = every_map()
    counted, kept = 0, []
    with tempfile.TemporaryDirectory() as scratch:
        for number in numbers:
            form, files = case(number)
            counted += 1
            try:
                attempt_folder(files, Path(scratch), maps)
            except Exception:  # noqa: BLE001 (that is what is looked for)
                kept.append(keep_folder(form, files))
    return counted, kept


def fuzz_command(numbers: Iterable[int], folder: Path, *words: str) -> tuple[int, list[str]]:
    """Exit code of one `run` over folders of the grammar, and lines that no refusal explains."""
    for number in numbers:
        form, files = case(number)
        place = folder / "in" / f"{number:06d}-{form}"
        place.mkdir(parents=True)
        for name, data in files.items():
            (place / name).write_bytes(data)
    said = [f"input={folder / 'in'}", f"output={folder / 'out'}", "workers=1", *words]
    ended = subprocess.run(
        [sys.executable, "-m", "pipeline", "run", *said],
        capture_output=True,
        check=False,
        cwd=Path(__file__).parents[2],
    )
    lines = ended.stderr.decode("utf-8", "replace").splitlines()
    expected = ("refused: ", "warning: ", "note: ", "undecided: ")
    odd = [line for line in lines if not line.startswith(expected)]
    return ended.returncode, odd + [line for line in lines if any(f"[{b}]" in line for b in BROKEN)]


def fuzz(minutes: float, examples: int = 100_000_000) -> tuple[int, list[Path]]:
    """How many files were read, and those that were kept."""
    maps = every_map()
    end = time.monotonic() + 60.0 * minutes
    counted, kept = 0, []

    with tempfile.TemporaryDirectory() as scratch:

        @settings(
            max_examples=min(examples, 2000),
            database=None,
            derandomize=False,
            deadline=None,
            suppress_health_check=list(HealthCheck),
        )
        @given(damaged())
        def once(drawn: tuple[str, bytes]) -> None:
            nonlocal counted
            if time.monotonic() > end:
                return
            counted += 1
            try:
                attempt(*drawn, Path(scratch), maps)
            except Exception:  # noqa: BLE001 (that is what is looked for)
                kept.append(keep(*drawn))

        while time.monotonic() < end and counted < examples:
            once()
    return counted, kept


def keep(name: str, data: bytes) -> Path:
    """Keeps an input as a file, named by its content."""
    digest = hashlib.sha256(data).hexdigest()[:16]
    path = KEPT / f"{digest}-{name.replace(' ', '-')}"
    path.write_bytes(data)
    return path


def keep_folder(form: str, files: Mapping[str, bytes]) -> Path:
    """Keeps a folder, named by its content."""
    digest = hashlib.sha256(b"".join(name.encode() + data for name, data in files.items()))
    path = KEPT / f"{digest.hexdigest()[:16]}-{form}"
    path.mkdir(exist_ok=True)
    for name, data in files.items():
        (path / name).write_bytes(data)
    return path


def main() -> int:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--first", type=int, default=0, help="number of the first folder")
    said = parser.parse_args()
    counted, kept = fuzz(said.minutes / 2.0)
    sys.stdout.write(f"{counted} files read, {len(kept)} kept in {KEPT}\n")
    end, at, odd = time.monotonic() + 30.0 * said.minutes, said.first, []
    while time.monotonic() < end:
        read, found = fuzz_folders(range(at, at + FOLDERS))
        kept += found
        with tempfile.TemporaryDirectory() as scratch:
            code, lines = fuzz_command(range(at, at + FOLDERS // 10), Path(scratch))
        odd += [f"folders from {at}: exit {code}"] * (code not in ENDS) + lines
        at += read
    sys.stdout.write(f"{at - said.first} folders from {said.first}, {len(kept)} kept in {KEPT}\n")
    sys.stdout.write("".join(f"{line}\n" for line in odd))
    return 1 if kept or odd else 0


if __name__ == "__main__":
    sys.exit(main())
