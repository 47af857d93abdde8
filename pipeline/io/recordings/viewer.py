"""The Rerun viewer as a program: a window or a web page, on loopback only."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from urllib.parse import quote

from pipeline.io.recordings.fleet import write_layouts
from pipeline.io.recordings.fleet_columns import APPLICATION
from pipeline.io.recordings.readback import fleet_shape
from pipeline.records.errors import MachineError

HERE = "127.0.0.1"
_SCREENS = ("DISPLAY", "WAYLAND_DISPLAY")


def free_port() -> int:
    """A port on loopback that nobody listens on."""
    with socket.socket() as probe:
        probe.bind((HERE, 0))
        port: int = probe.getsockname()[1]
    return port


def require_free(port: int) -> None:
    """Refuses a port of loopback that cannot be served.

    Parameters
    ----------
    port
        The port.

    Raises
    ------
    MachineError
        Another program has it, or it is not for this user.

    """
    with socket.socket() as probe:
        # as servers bind: a connection that was just closed does not hold the port
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((HERE, port))
            probe.listen()
        except OSError as error:
            raise cannot_serve(port, error.strerror or str(error)) from error


def cannot_serve(port: int, why: str) -> MachineError:
    """The error for a port that cannot be served.

    Parameters
    ----------
    port
        The port.
    why
        What the operating system says.

    """
    return MachineError(
        f"port {port} cannot be served: {why}", "name another with port=, or leave it out"
    )


def viewer_command(*words: str) -> list[str]:
    """The command line of the viewer's own program.

    Parameters
    ----------
    *words
        Its arguments.

    Returns
    -------
    list of str
        The program itself, since the `rerun` on the path would outlive its end as a child.

    Raises
    ------
    MachineError
        It is not installed.

    """
    package = find_spec("rerun_cli")
    places = [] if package is None else list(package.submodule_search_locations or ())
    for place in places:
        for name in ("Rerun.app/Contents/MacOS/Rerun", "rerun", "rerun.exe"):
            program = Path(place) / name
            if program.is_file():
                return [str(program), *words]
    raise MachineError("the Rerun viewer is not installed", "install rerun-sdk anew")


def silence() -> None:
    """Turns the viewer's analytics off, once and for all for this user."""
    command = viewer_command("analytics", "disable")
    subprocess.run(command, check=False, capture_output=True, stdin=subprocess.DEVNULL)  # noqa: S603


def has_screen() -> bool:
    """Whether a window can be opened at all."""
    return sys.platform != "linux" or any(os.environ.get(name) for name in _SCREENS)


def window(sources: Sequence[str], port: int) -> int:
    """Opens a window on files or addresses and waits until it is closed.

    Parameters
    ----------
    sources
        Files or addresses.
    port
        Port of loopback for the viewer.

    Returns
    -------
    int
        Exit code of the viewer.

    """
    words = ["--bind", HERE, "--port", str(port), "--hide-welcome-screen", *sources]
    return _wait(viewer_command(*words))


def page_address(page_port: int, sources: Sequence[str]) -> str:
    """What to open in a browser.

    Parameters
    ----------
    page_port
        Port of the page.
    sources
        Addresses of recordings.

    """
    words = "&".join(f"url={quote(source, safe='')}" for source in sources)
    return f"http://{HERE}:{page_port}/?{words}"


@contextmanager
def catalogue(motors: Sequence[Path], port: int) -> Iterator[str]:
    """Serves recordings of motors as a table, one row each.

    Parameters
    ----------
    motors
        Their recordings.
    port
        Port of loopback.

    Yields
    ------
    str
        Address of the table; the server ends with the block.

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
