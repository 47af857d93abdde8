"""Executors: processes of this machine or a Dask cluster, both as `concurrent.futures`."""

from __future__ import annotations

import logging
import os
import signal
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Executor, ProcessPoolExecutor
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from multiprocessing.context import SpawnContext, SpawnProcess
from typing import Any

from pipeline.execution.workers.task import begin_worker
from pipeline.records.errors import MachineError, UsageError

NEEDED = ("tls_ca", "tls_cert", "tls_key")
NOISY_LOGGERS = ("distributed", "tornado", "asyncio")


@dataclass(frozen=True, slots=True)
class Pool:
    """An executor and how it fails. `died` are the errors of a future whose worker died.

    `lost` are the errors of an executor without any worker. `isolates_crashes` is True where the
    death of one worker leaves the others running.
    """

    executor: Executor
    died: tuple[type[BaseException], ...]
    lost: tuple[type[BaseException], ...] = ()
    isolates_crashes: bool = False


OpenPool = Callable[[int], AbstractContextManager[Pool]]
"""Opens a pool of the given number of workers."""


@dataclass(frozen=True, slots=True)
class Cluster:
    """Address of a Dask cluster (None: a local one on loopback), and its TLS files."""

    address: str | None = None
    tls_ca: str | None = None
    tls_cert: str | None = None
    tls_key: str | None = None


def open_pool(executor: str, cluster: Cluster) -> OpenPool:
    """How to open a pool of a kind, `local` or `dask`.

    Parameters
    ----------
    executor
        `local` or `dask`.
    cluster
        Address and certificates of a Dask cluster.

    Raises
    ------
    UsageError
        Any other.

    """
    if executor == "local":
        if cluster != Cluster():
            raise UsageError("a scheduler or TLS file is named", "add executor=dask")
        return local_pool
    if executor == "dask":
        _require_dask()
        _check(cluster)
        return _Dask(cluster)
    raise UsageError(f"executor={executor!r} is unknown", "it is local or dask")


def _require_dask() -> None:
    """Raises UsageError where Dask is not installed; asked before any work is done."""
    if find_spec("distributed") is None:
        raise UsageError(
            "executor=dask takes the package distributed, which is not installed",
            "pip install 'motor-datasheets[dask]'",
        )


def core_count() -> int:
    """Cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@contextmanager
def local_pool(workers: int) -> Iterator[Pool]:
    """Spawned processes of this machine; the driver itself reads no untrusted file.

    Parameters
    ----------
    workers
        Number of processes.

    """
    share = str(max(1, core_count() // max(workers, 1)))
    context = _Context()
    executor = ProcessPoolExecutor(workers, context, begin_worker, (share,))
    try:
        yield Pool(executor, (BrokenExecutor,))
    except KeyboardInterrupt:
        for process in context.started:
            process.terminate()
        raise
    finally:
        executor.shutdown(wait=True, cancel_futures=True)


class _Context(SpawnContext):
    """Spawned processes that leave a Ctrl-C to the driver, which ends them; `started` are all."""

    def __init__(self) -> None:
        super().__init__()
        self.started: list[SpawnProcess] = []

    def Process(  # type: ignore[override] # noqa: N802 - a class there, made by calling it
        self, *args: Any, **kwargs: Any
    ) -> SpawnProcess:
        """A process that has not been started yet."""
        process = _Process(*args, **kwargs)
        self.started.append(process)
        return process


class _Process(SpawnProcess):
    def start(self) -> None:
        """Starts with SIGINT blocked, which the process inherits; one that comes now waits."""
        if not hasattr(signal, "pthread_sigmask"):
            super().start()
            return
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            super().start()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _check(cluster: Cluster) -> None:
    if cluster.address is None:
        if cluster != Cluster():
            raise UsageError("TLS files without a scheduler", "add scheduler=tls://HOST:PORT")
        return
    stated = [name for name in NEEDED if getattr(cluster, name)]
    if cluster.address.startswith("tls://"):
        missing = [name for name in NEEDED if name not in stated]
        if missing:
            raise UsageError(f"{cluster.address} needs {', '.join(missing)}", "name the files")
        return
    host = cluster.address.removeprefix("tcp://").rsplit(":", 1)[0]
    if host not in ("127.0.0.1", "localhost", "[::1]"):
        raise UsageError(
            f"scheduler={cluster.address} is open to everyone on its network",
            "start it with TLS and name tls://HOST:PORT, tls_ca, tls_cert and tls_key",
        )


class _Dask:
    """A Dask cluster as pools; several pools share the same workers."""

    def __init__(self, cluster: Cluster) -> None:
        self.cluster = cluster

    @contextmanager
    def __call__(self, workers: int) -> Iterator[Pool]:
        from concurrent.futures import CancelledError

        from distributed import KilledWorker
        from distributed.client import FutureCancelledError
        from distributed.comm.core import CommClosedError

        with _silenced(), _client(self.cluster, workers) as client:
            executor = client.get_executor(pure=False)
            lost = (CancelledError, FutureCancelledError, CommClosedError)
            yield Pool(executor, (KilledWorker,), lost, isolates_crashes=True)


@contextmanager
def _silenced() -> Iterator[None]:
    """Silences the tracebacks of Dask's own threads; the driver reports failures in one line."""
    names = [n for n in logging.root.manager.loggerDict if n.split(".")[0] in NOISY_LOGGERS]
    before = {logger: logger.level for logger in map(logging.getLogger, names)}
    for logger in before:
        logger.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        for logger, level in before.items():
            logger.setLevel(level)


@contextmanager
def _client(cluster: Cluster, workers: int) -> Iterator[Any]:
    """A client of the named cluster, or of a local one on loopback without a dashboard."""
    import dask
    from distributed import Client, LocalCluster
    from distributed.security import Security

    if cluster.address is not None:
        security = Security(  # type: ignore[no-untyped-call]
            tls_ca_file=cluster.tls_ca,
            tls_client_cert=cluster.tls_cert,
            tls_client_key=cluster.tls_key,
            require_encryption=cluster.address.startswith("tls://"),
        )
        try:
            client = Client(  # type: ignore[no-untyped-call]
                cluster.address, security=security, timeout="20s", set_as_default=False
            )
        except (OSError, TimeoutError) as error:
            raise MachineError(
                f"no scheduler answers at {cluster.address}: {error}", "is it running?"
            ) from error
        with client:
            yield client
        return
    with (
        dask.config.set(OWN_CLUSTER),
        LocalCluster(  # type: ignore[no-untyped-call]
            n_workers=workers,
            threads_per_worker=1,
            processes=True,
            host="127.0.0.1",
            dashboard_address="127.0.0.1:0",
            worker_dashboard_address="127.0.0.1:0",
            memory_limit=0,
            silence_logs=50,
        ) as own,
        Client(own, set_as_default=False) as client,  # type: ignore[no-untyped-call]
    ):
        yield client


OWN_CLUSTER = {
    # A task that kills its worker is returned at once; the driver decides on a retry.
    "distributed.scheduler.allowed-failures": 0,
    # Nothing is served but the scheduler and its workers, on loopback.
    "distributed.scheduler.http.routes": [],
    "distributed.worker.http.routes": [],
    # Profiling the workers a hundred times a second costs a tenth of their time.
    "distributed.worker.profile.enabled": False,
    # There is one worker a core, so threads of its libraries would only compete. Dask's default
    # would also return every freed array to the system, and allocate it again.
    "distributed.nanny.pre-spawn-environ": dict.fromkeys(
        ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "POLARS_MAX_THREADS"), "1"
    ),
    # The default tick takes the interpreter lock from the work fifty times a second.
    "distributed.admin.tick.interval": "1s",
    "distributed.admin.system-monitor.interval": "10s",
}
