"""A cluster that somebody else started: over TLS, and with a scheduler that is lost."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.faults.fleet import ROOT, command, make_fleet, simulated
from tests.faults.kills import results

pytestmark = pytest.mark.slow
WORDS = ("report=false", "recordings=false", "diagnose=false")
# What docs/fleet.md tells everybody who starts a cluster to say.
SAFE = ("--no-dashboard", "--dashboard-address", "127.0.0.1:0")


@dataclass
class Started:
    """A scheduler, its address, and its workers."""

    scheduler: subprocess.Popen[bytes]
    address: str


@contextmanager
def cluster(scratch: Path, options: Sequence[str] = ()) -> Iterator[Started]:
    """A scheduler and two workers on loopback, started by Dask's own commands; ended afterwards."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "1"}
    note = scratch / "scheduler.json"

    def start(*words: str) -> subprocess.Popen[bytes]:
        line = [sys.executable, "-m", "dask", *words, *options, *SAFE]
        return subprocess.Popen(line, env=environment, cwd=scratch, stderr=subprocess.DEVNULL)

    started = [
        start("scheduler", "--host", "127.0.0.1", "--port", "0", "--scheduler-file", str(note))
    ]
    try:
        deadline = time.monotonic() + 60.0
        while not note.is_file() or not note.read_text().endswith("}"):
            assert started[0].poll() is None and time.monotonic() < deadline
            time.sleep(0.05)
        address = json.loads(note.read_text())["address"]
        workers = ("--host", "127.0.0.1", "--nworkers", "2", "--nthreads", "1")
        started.append(start("worker", address, *workers))
        yield Started(started[0], address)
    finally:
        for process in reversed(started):
            process.terminate()
            process.wait(timeout=60)


def run(folder: Path, output: Path, *words: str) -> subprocess.Popen[bytes]:
    environment = {
        **os.environ,
        "PYTHONPATH": str(ROOT),
        "XDG_CACHE_HOME": str(output.parent / "home"),
    }
    line = command("run", f"input={folder}", f"output={output}", *WORDS, *words)
    return subprocess.Popen(line, cwd=ROOT, env=environment, stderr=subprocess.PIPE)


def told(process: subprocess.Popen[bytes]) -> str:
    return process.communicate(timeout=300)[1].decode()


@pytest.fixture(scope="module")
def one(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return simulated(tmp_path_factory.mktemp("motor") / "one")


def test_a_cluster_over_tls_gives_the_same_bytes_and_takes_no_stranger(
    one: Path, tmp_path: Path
) -> None:
    """Certificates of one authority are let in; those of another end the run with 5, in one line.

    A client without any is refused before it tries.
    """
    import trustme

    folder = make_fleet(one, tmp_path / "in", 2)
    ours = written(trustme.CA(), tmp_path / "ours")
    others = written(trustme.CA(), tmp_path / "others")
    files = [f"--{name.replace('_', '-')}" for name in ("tls_ca_file", "tls_cert", "tls_key")]
    node = [word for pair in zip(files, ours["node"], strict=True) for word in pair]
    with cluster(tmp_path, ["--protocol", "tls", *node]) as there:
        assert there.address.startswith("tls://")
        dask = ("executor=dask", f"scheduler={there.address}")
        process = run(folder, tmp_path / "dask", *dask, *said(ours["client"]))
        assert process.wait(timeout=300) in (0, 1, 4), told(process)
        process = run(folder, tmp_path / "stranger", *dask, *said(others["client"]))
        error = told(process)
        assert process.returncode == 5
        assert error.startswith("error: ") and len(error.splitlines()) == 1
        process = run(folder, tmp_path / "nobody", *dask)
        assert "tls_ca" in told(process)
        assert process.returncode == 2
    process = run(folder, tmp_path / "local")
    assert process.wait(timeout=300) in (0, 1, 4)
    assert results(tmp_path / "dask") == results(tmp_path / "local")
    assert not (tmp_path / "stranger" / "datasheets").exists()


def written(authority: object, folder: Path) -> dict[str, tuple[str, str, str]]:
    """The authority's, the certificate's and the key's file of a node and of a client."""
    folder.mkdir()
    ca = folder / "ca.pem"
    authority.cert_pem.write_to_path(str(ca))  # type: ignore[attr-defined]
    made = {}
    for who in ("node", "client"):
        issued = authority.issue_cert("127.0.0.1", "localhost")  # type: ignore[attr-defined]
        certificate, key = folder / f"{who}.pem", folder / f"{who}-key.pem"
        certificate.write_bytes(b"".join(blob.bytes() for blob in issued.cert_chain_pems))
        issued.private_key_pem.write_to_path(str(key))
        made[who] = (str(ca), str(certificate), str(key))
    return made


def said(files: tuple[str, str, str]) -> list[str]:
    return [f"{k}={v}" for k, v in zip(("tls_ca", "tls_cert", "tls_key"), files, strict=True)]


def test_a_lost_scheduler_loses_no_finished_motor(one: Path, tmp_path: Path) -> None:
    """It is killed while motors are worked on: exit 5 in one line, what was finished is kept.

    The same command on local workers goes on, does none of that again, and gives the bytes of a
    run that was never disturbed.
    """
    folder, output = make_fleet(one, tmp_path / "in", 12), tmp_path / "out"
    with cluster(tmp_path) as there:
        process = run(folder, output, "executor=dask", f"scheduler={there.address}")
        while process.poll() is None and not finished(output):
            time.sleep(0.02)
        there.scheduler.send_signal(signal.SIGKILL)
        error = told(process)
    assert process.returncode == 5
    assert len(error.splitlines()) == 1, error
    line = error
    assert "the scheduler was lost" in line and "run the same command again" in line
    kept = finished(output)
    assert 0 < len(kept) < 12
    sheets = {p: p.stat().st_mtime_ns for p in (output / "datasheets").glob("*.json")}
    process = run(folder, output)
    assert process.wait(timeout=300) in (0, 1, 4)
    assert {path: path.stat().st_mtime_ns for path in sheets if path.stem in kept} == {
        path: stamp for path, stamp in sheets.items() if path.stem in kept
    }
    process = run(folder, tmp_path / "clean", "cache=false")
    assert process.wait(timeout=300) in (0, 1, 4)
    assert results(output) == results(tmp_path / "clean")


def finished(output: Path) -> set[str]:
    """Motors that are noted as finished."""
    return {path.stem for path in output.glob(".cache/motors/*.json")}
