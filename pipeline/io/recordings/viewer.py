"""The Rerun viewer as a program: a window or a web page, on loopback only."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from urllib.parse import quote

from pipeline.io.recordings.fleet import write_layouts
from pipeline.io.recordings.motor import APPLICATION
from pipeline.io.recordings.readback import fleet_shape
from pipeline.records.errors import MachineError

HERE = "127.0.0.1"
MEMORY = "75%"
_SCREENS = ("DISPLAY", "WAYLAND_DISPLAY")


def free_port() -> int:
    """A port on loopback that nobody listens on."""
    with socket.socket() as probe:
        probe.bind((HERE, 0))
        port: int = probe.getsockname()[1]
    return port


def viewer_command(*words: str) -> list[str]:
    """The viewer that was installed with this interpreter, else the one on the path.

    Raises MachineError where there is none.
    """
    beside = Path(sys.executable).parent
    found = shutil.which("rerun", path=f"{beside}{os.pathsep}{os.environ.get('PATH', os.defpath)}")
    if found is None:
        raise MachineError("the Rerun viewer is not installed", "install rerun-sdk anew")
    return [found, *words]


def silence() -> None:
    """Turns the viewer's analytics off, once and for all for this user."""
    command = viewer_command("analytics", "disable")
    subprocess.run(command, check=False, capture_output=True, stdin=subprocess.DEVNULL)  # noqa: S603


def has_screen() -> bool:
    """Whether a window can be opened at all."""
    return sys.platform != "linux" or any(os.environ.get(name) for name in _SCREENS)


def window(sources: Sequence[str], port: int) -> int:
    """Opens a window on files or addresses and waits until it is closed; its exit code."""
    words = ["--bind", HERE, "--port", str(port), "--hide-welcome-screen", *sources]
    return _wait(viewer_command(*words))


def web_page(sources: Sequence[str], page_port: int, data_port: int) -> int:
    """Serves the web viewer, and files to it, until it is interrupted; its exit code."""
    words = ["--serve-web", "--bind", HERE, "--port", str(data_port), "--hide-welcome-screen"]
    words += ["--web-viewer-port", str(page_port), "--server-memory-limit", MEMORY, *sources]
    return _wait(viewer_command(*words))


def page_address(page_port: int, sources: Sequence[str]) -> str:
    """What to open in a browser."""
    words = "&".join(f"url={quote(source, safe='')}" for source in sources)
    return f"http://{HERE}:{page_port}/?{words}"


def proxy_address(data_port: int) -> str:
    """Where a viewer finds the files that are being served."""
    return f"rerun+http://{HERE}:{data_port}/proxy"


@contextmanager
def catalogue(motors: Sequence[Path], port: int) -> Iterator[str]:
    """Serves recordings of motors as a table, a row each; gives the address of the table.

    The layouts are handed over through a folder that lasts as long as the server.
    """
    from rerun.catalog import CatalogClient
    from rerun.server import Server
    from rerun_bindings import CatalogClientInternal

    with TemporaryDirectory() as folder:
        shape = fleet_shape(motors)
        table, motor = write_layouts(Path(folder), shape.signals, shape.captures)
        with Server(host=HERE, port=port, datasets={APPLICATION: list(motors)}) as server:
            # The public constructor asks for datafusion, of which nothing here makes use.
            inner = CatalogClientInternal(server.url(), None, None)
            dataset = CatalogClient._from_internal(inner).get_dataset(APPLICATION)
            dataset.register_blueprint(table.as_uri(), segment_table=True)
            dataset.register_blueprint(motor.as_uri())
            yield f"{server.url()}/dataset/{dataset.id}"


def _wait(command: Sequence[str]) -> int:
    """Waits for a program; an interrupt ends both."""
    process = subprocess.Popen(command, stdin=subprocess.DEVNULL)  # noqa: S603
    try:
        return process.wait()
    except KeyboardInterrupt:
        process.terminate()
        process.wait()
        raise
    finally:
        if process.poll() is None:
            process.kill()
