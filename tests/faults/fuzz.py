"""Fuzzing of the readers: damaged recordings and tables in, samples or a refusal out.

`python -m tests.faults.fuzz --minutes 10` draws files with hypothesis until the time is up. Any
other end than samples or a CaptureError keeps the input under `tests/faults/kept`, and exit 1.
"""

from __future__ import annotations

import argparse
import hashlib
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pipeline.io.ingest import read_capture, survey
from pipeline.io.source_map import SourceMap, load_source_maps
from pipeline.records.errors import CaptureError
from pipeline.settings import configuration_folder
from tests.faults.test_random_damage import FILES, TEXTS
from tests.unit.io.recordings import small_capture

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
        return bool(found.entries)
    finally:
        place.unlink()


def fuzz(minutes: float, examples: int = 100_000_000) -> tuple[int, list[Path]]:
    """How many files were read, and those that were kept."""
    maps = load_source_maps(configuration_folder() / "source")
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


def main() -> int:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=10.0)
    counted, kept = fuzz(parser.parse_args().minutes)
    sys.stdout.write(f"{counted} files read, {len(kept)} kept in {KEPT}\n")
    return 1 if kept else 0


if __name__ == "__main__":
    sys.exit(main())
