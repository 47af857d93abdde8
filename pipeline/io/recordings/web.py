"""The viewer as a web page on loopback that serves this machine alone.

The page that comes with the viewer sends usage statistics, asks for newer versions and loads fonts
from elsewhere. It is handed on with a content security policy under which the browser refuses all
of that, together with the recordings themselves.
"""

from __future__ import annotations

import shutil
import subprocess
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from http import HTTPStatus
from http.client import HTTPConnection, HTTPException
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import quote, urlsplit

from pipeline.io.recordings.viewer import HERE, cannot_serve, free_port, viewer_command
from pipeline.records.errors import MachineError

PREFIX = "/recordings/"
WAIT_S = 60.0
_HOSTS = (HERE, "localhost")
_PASSED_ON = ("content-type", "content-encoding", "content-length")


def policy(further: Sequence[str]) -> str:
    """Nothing is loaded from, or sent to, any other place than this page and `further` origins.

    Parameters
    ----------
    further
        Origins that are allowed beside the page's own.

    """
    places = " ".join(["'self'", *further])
    return (
        "default-src 'self' 'unsafe-inline' 'unsafe-eval' 'wasm-unsafe-eval' data: blob:; "
        f"connect-src {places} data: blob:"
    )


def recording_address(port: int, place: int, path: Path) -> str:
    """Where the page finds a recording.

    Parameters
    ----------
    port
        Of the page.
    place
        Number of the recording.
    path
        Its file.

    """
    return f"http://{HERE}:{port}{PREFIX}{place}/{quote(path.name)}"


@contextmanager
def page_server(
    recordings: Sequence[Path], port: int, origins: Sequence[str] = ()
) -> Iterator[PageServer]:
    """Serves the viewer's page and recordings on loopback.

    Parameters
    ----------
    recordings
        The .rrd files.
    port
        Port of loopback.
    origins
        Origins that the page may connect to as well.

    Yields
    ------
    PageServer
        It ends with the block.

    Raises
    ------
    MachineError
        The port is taken, or the viewer does not start.

    """
    inner, other = free_port(), free_port()
    words = ["--serve-web", "--bind", HERE, "--port", str(other), "--web-viewer-port", str(inner)]
    process = subprocess.Popen(  # noqa: S603
        viewer_command(*words),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        _await(inner)
        try:
            server = PageServer(port, recordings, inner, policy(origins))
        except OSError as error:
            raise cannot_serve(port, error.strerror or str(error)) from error
        with server:
            yield server
    finally:
        process.terminate()
        with suppress(subprocess.TimeoutExpired):
            process.wait(timeout=10)
        if process.poll() is None:
            process.kill()


def _await(port: int) -> None:
    """Waits until the viewer's own page answers."""
    deadline = time.monotonic() + WAIT_S
    while time.monotonic() < deadline:
        with suppress(OSError, HTTPException):
            connection = HTTPConnection(HERE, port, timeout=5)
            connection.request("HEAD", "/")
            connection.getresponse()
            connection.close()
            return
        time.sleep(0.1)
    raise MachineError("the viewer's page did not start", "run it again, or install rerun-sdk anew")


class PageServer(ThreadingHTTPServer):
    """What a handler answers from: recordings by number, the viewer's own page, the policy."""

    daemon_threads = True

    def __init__(
        self, port: int, recordings: Sequence[Path], inner: int, content_policy: str
    ) -> None:
        self.recordings, self.inner, self.content_policy = tuple(recordings), inner, content_policy
        super().__init__((HERE, port), PageHandler)


class PageHandler(BaseHTTPRequestHandler):
    """GET and HEAD: recordings from the disk, all else from the viewer's own page."""

    server: PageServer

    def do_GET(self) -> None:
        """Answers with head and body."""
        self._answer(body=True)

    def do_HEAD(self) -> None:
        """Answers with the head alone."""
        self._answer(body=False)

    def log_message(self, *_: object) -> None:
        """Says nothing: the console is the user's."""

    def _answer(self, *, body: bool) -> None:
        host = self.headers.get("Host", "").rsplit(":", 1)[0]
        path = urlsplit(self.path).path
        if host not in _HOSTS:  # a foreign name that was pointed at loopback
            self.send_error(HTTPStatus.FORBIDDEN)
        elif path.startswith(PREFIX):
            self._recording(path.removeprefix(PREFIX).split("/", 1)[0], body=body)
        else:
            self._page(path, body=body)

    def _recording(self, number: str, *, body: bool) -> None:
        recordings = self.server.recordings
        if not number.isdecimal() or int(number) >= len(recordings):
            self.send_error(HTTPStatus.NOT_FOUND)
            return
        path = recordings[int(number)]
        with path.open("rb") as stream:
            self._head(HTTPStatus.OK, {"content-length": str(path.stat().st_size)})
            if body:
                shutil.copyfileobj(stream, self.wfile)

    def _page(self, path: str, *, body: bool) -> None:
        connection = HTTPConnection(HERE, self.server.inner, timeout=WAIT_S)
        connection.request("GET", path)
        answer = connection.getresponse()
        headers = {name.lower(): value for name, value in answer.getheaders()}
        self._head(answer.status, {name: headers[name] for name in _PASSED_ON if name in headers})
        if body:
            shutil.copyfileobj(answer, self.wfile)
        connection.close()

    def _head(self, status: int, headers: dict[str, str]) -> None:
        self.send_response(status)
        for name, value in headers.items():
            self.send_header(name, value)
        self.send_header("Content-Security-Policy", self.server.content_policy)
        self.send_header("Referrer-Policy", "no-referrer")
        self.end_headers()
