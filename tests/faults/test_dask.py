"""Dask: the same bytes as local workers, on loopback only, and a lost worker or scheduler."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from pathlib import Path

import pytest

from pipeline.__main__ import main
from pipeline.execution.workers.pools import Cluster, open_pool
from pipeline.records.errors import UsageError
from tests.faults.fleet import ROOT, command, family, make_fleet, simulated
from tests.faults.kills import results

WORDS = ("report=false", "recordings=false", "diagnose=false")


def listening(processes: list[int]) -> set[str]:
    """Addresses at which processes wait for anyone (Linux), as /proc writes them."""
    sockets = set()
    for process in processes:
        try:
            for link in Path(f"/proc/{process}/fd").iterdir():
                sockets.add(str(link.readlink()))
        except OSError:
            continue
    found = set()
    for table in ("tcp", "tcp6"):
        for line in Path(f"/proc/net/{table}").read_text().splitlines()[1:]:
            words = line.split()
            if words[3] == "0A" and f"socket:[{words[9]}]" in sockets:
                found.add(words[1].rsplit(":", 1)[0])
    return found


@pytest.mark.slow
def test_dask_gives_the_bytes_of_local_workers_and_opens_nothing_to_the_network(
    tmp_path: Path,
) -> None:
    one = simulated(tmp_path / "one")
    folder = make_fleet(one, tmp_path / "in", 6)
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "XDG_CACHE_HOME": str(tmp_path / "home")}
    seen: set[str] = set()
    for executor in ("local", "dask"):
        words = (f"input={folder}", f"output={tmp_path / executor}", f"executor={executor}")
        process = subprocess.Popen(command("run", *words, *WORDS), cwd=ROOT, env=environment)
        while process.poll() is None:
            found = listening(family(process.pid))
            assert found <= {"0100007F"}
            assert executor == "dask" or not found
            seen |= found
            time.sleep(0.05)
        assert process.returncode in (0, 1, 4)
    assert seen == {"0100007F"}
    assert results(tmp_path / "dask") == results(tmp_path / "local")


@pytest.mark.slow
def test_a_lost_dask_worker_costs_nothing(tmp_path: Path) -> None:
    """One worker is killed while it works; the batch is finished all the same."""
    one = simulated(tmp_path / "one")
    folder = make_fleet(one, tmp_path / "in", 8)
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "XDG_CACHE_HOME": str(tmp_path / "home")}
    output = tmp_path / "out"
    words = (f"input={folder}", f"output={output}", "executor=dask", "workers=2", *WORDS)
    process = subprocess.Popen(command("run", *words), cwd=ROOT, env=environment)
    while process.poll() is None and not list(output.glob("datasheets/*.json")):
        time.sleep(0.02)
    workers = [p for p in family(process.pid) if listening([p]) and p != process.pid]
    os.kill(workers[-1], signal.SIGKILL)
    assert process.wait() in (0, 1, 4)
    assert len(list(output.glob("datasheets/*.json"))) == 8


@pytest.mark.parametrize(
    ("executor", "cluster"),
    [
        ("cloud", Cluster()),
        ("local", Cluster("tcp://127.0.0.1:8786")),
        ("dask", Cluster(None, "ca.pem")),
        ("dask", Cluster("tcp://10.0.0.7:8786")),
        ("dask", Cluster("tls://10.0.0.7:8786", "ca.pem", "cert.pem")),
        ("dask", Cluster("10.0.0.7:8786")),
    ],
)
def test_a_cluster_that_is_open_or_half_named_is_usage(executor: str, cluster: Cluster) -> None:
    with pytest.raises(UsageError):
        open_pool(executor, cluster)


def test_an_unknown_executor_ends_before_any_work(tmp_path: Path) -> None:
    words = [f"input={tmp_path}", f"output={tmp_path / 'out'}", "executor=ray"]
    assert main(["run", *words]) == 2
    assert not (tmp_path / "out").exists()
