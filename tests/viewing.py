"""The viewer and a browser as a test drives them: without a window, on loopback, nothing left over.

Where the programs are missing a test is skipped with the reason. In CI it fails instead: `.ci/run`
installs them and says so with `REQUIRE_VIEWER=true`.
"""

from __future__ import annotations

import base64
import io
import json
import os
import select
import shutil
import subprocess
import time
from abc import ABC, abstractmethod
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from types import TracebackType
from typing import Any, Self

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.io.recordings.viewer import HERE, free_port, viewer_command

VULKAN = (Path("/usr/share/vulkan/icd.d"), Path("/etc/vulkan/icd.d"))
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
PATIENCE_S = 240.0
LATE = "Wait timed out"  # a busy machine, no fault of the picture
Picture = NDArray[np.int16]


def need(there: bool, what: str) -> None:
    """Skips a test for want of a program; where `REQUIRE_VIEWER=true` that is a failure."""
    if not there and os.environ.get("REQUIRE_VIEWER") == "true":
        pytest.fail(f"no {what}, and REQUIRE_VIEWER=true")
    if not there:
        pytest.skip(f"there is no {what} here")


def need_viewer() -> None:
    """The headless viewer draws with a Vulkan driver in software."""
    there = any(folder.is_dir() and any(folder.glob("lvp*")) for folder in VULKAN)
    need(there, "software Vulkan driver (mesa-vulkan-drivers)")


def browser_path() -> str:
    """Chromium, or a relative of it."""
    found = next(filter(None, map(shutil.which, BROWSERS)), None)
    need(found is not None, "chromium")
    return str(found)


class Program(ABC):
    """A program that a test looks through; a context that ends it and leaves nothing over."""

    _process: subprocess.Popen[bytes]

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._ask_to_end()
        try:
            self._process.wait(timeout=20)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._tidy()

    def _ask_to_end(self) -> None:
        self._process.terminate()

    @abstractmethod
    def _tidy(self) -> None:
        """Removes what the program left."""


class Viewer(Program):
    """The viewer without a window."""

    def __init__(self, *sources: str, size: str = "1600x1000") -> None:
        self._home = TemporaryDirectory()
        own = {"HOME": self._home.name, "XDG_RUNTIME_DIR": self._home.name}
        environment = {**os.environ, **own}
        silent: dict[str, Any] = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.DEVNULL)
        subprocess.run(
            viewer_command("analytics", "disable"), env=environment, check=False, **silent
        )
        port = free_port()
        words = ["--headless", "--bind", HERE, "--port", str(port), "--window-size", size]
        self._process = subprocess.Popen(
            viewer_command(*words, "--hide-welcome-screen", *sources), env=environment, **silent
        )
        self.client = self._connected(f"rerun+http://{HERE}:{port}/proxy")

    def _tidy(self) -> None:
        self._home.cleanup()

    @property
    def alive(self) -> bool:
        """Whether it still runs: a character that its font lacks ends it."""
        return self._process.poll() is None

    def largest_memory(self) -> int:
        """The most memory that it has held at once [bytes], as Linux counts it."""
        status = Path(f"/proc/{self._process.pid}/status").read_text()
        line = next(line for line in status.splitlines() if line.startswith("VmHWM"))
        return int(line.split()[1]) * 1024

    def show(self, place: Path | str) -> Any:
        """Opens a file or an address and waits until its views are there; the viewer's state."""
        opened = self.client.open(str(place)).store_ids
        deadline = time.monotonic() + PATIENCE_S
        while time.monotonic() < deadline:
            state = self.client.get_state()
            if state.views and not state.loading and state.active_recording in opened:
                return state
            time.sleep(0.1)
        raise TimeoutError(f"{place} did not open")

    def tab(self, number: int) -> None:
        """Brings a tab of the workspace to the front."""
        told = self.client.get_blueprint("recording").blueprint
        root = told["/viewport"]["ViewportBlueprint"]["root_container"]
        container = told[f"/container/{root}"]["ContainerBlueprint"]
        container["active_tab"] = container["contents"][number]
        self.client.set_blueprint(told, "recording")

    def picture(self, view: str | None = None) -> bytes:
        """A PNG of the window, or of the view of this name, once two frames are equal."""
        deadline, last = time.monotonic() + PATIENCE_S, b""
        while time.monotonic() < deadline:
            # a busy machine may be too late for one frame, or still be laying the views out
            with suppress(TimeoutError, ConnectionError, StopIteration):
                now: bytes = self.client.take_screenshot(self._view(view))
                if now == last:
                    return now
                last = now
            time.sleep(0.2)
        raise TimeoutError("the picture does not come to rest")

    def _view(self, name: str | None) -> Any:
        """The view of a name; None, which is the window, for no name."""
        if name is None:
            return None
        return next(v.view_id for v in self.client.get_state().views if v.name == name)

    def reports(self) -> list[str]:
        """What views complain of, and errors in the viewer's own log."""
        told = [
            f"{view.name}: {report.severity}: {report.summary}"
            for view in self.client.get_state().views
            for report in view.reports
        ]
        logs = (entry for entry in self.client.get_logs() if entry.level == "ERROR")
        return [*told, *(entry.message for entry in logs if LATE not in entry.message)]

    def _connected(self, address: str) -> Any:
        from rerun.experimental import ViewerClient

        deadline = time.monotonic() + PATIENCE_S
        while True:
            try:
                client = ViewerClient.connect(address)
                client.get_state()
                return client
            except (RuntimeError, ConnectionError, TimeoutError):
                if time.monotonic() > deadline or not self.alive:
                    raise
                time.sleep(0.1)


def pixels(png: bytes) -> Picture:
    """RGB [height, width, 3] of a PNG."""
    from PIL import Image

    return np.asarray(Image.open(io.BytesIO(png)).convert("RGB")).astype(np.int16)


def count(picture: Picture, colour: Iterable[int], tolerance: int = 24) -> int:
    """How many pixels are close to a colour."""
    far = np.abs(picture - np.array(tuple(colour), dtype=np.int16)).max(axis=-1)
    return int((far <= tolerance).sum())


class Browser(Program):
    """Chromium without a window, driven through a pair of pipes; it finds no other machine."""

    def __init__(self, size: tuple[int, int] = (1600, 1000)) -> None:
        self._profile = TemporaryDirectory(ignore_cleanup_errors=True)
        inward, self._write = os.pipe()
        self._read, outward = os.pipe()

        def pipes() -> None:
            os.dup2(inward, 3)
            os.dup2(outward, 4)
            os.set_inheritable(3, True)
            os.set_inheritable(4, True)

        command = [
            browser_path(),
            "--headless=new",
            "--no-sandbox",
            "--no-first-run",
            "--remote-debugging-pipe",
            f"--user-data-dir={self._profile.name}",
            f"--window-size={size[0]},{size[1]}",
            "--disable-background-networking",
            "--disable-component-update",
            "--disable-sync",
            "--use-gl=angle",
            "--use-angle=swiftshader",
            "--enable-unsafe-swiftshader",
            "--ignore-gpu-blocklist",
            "--host-resolver-rules=MAP * ~NOTFOUND , EXCLUDE 127.0.0.1",
        ]
        self._process = subprocess.Popen(
            command,
            preexec_fn=pipes,  # noqa: PLW1509
            close_fds=False,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        os.close(inward)
        os.close(outward)
        self._number, self._rest = 0, b""
        self.events: list[dict[str, Any]] = []

    def _ask_to_end(self) -> None:
        with suppress(OSError, TimeoutError, EOFError):
            self.call("Browser.close")

    def _tidy(self) -> None:
        os.close(self._read)
        os.close(self._write)
        self._profile.cleanup()

    def page(self, address: str, dark: bool = False) -> str:
        """Opens an address in a tab; its session."""
        target = self.call("Target.createTarget", {"url": "about:blank"})["targetId"]
        attach = {"targetId": target, "flatten": True}
        session: str = self.call("Target.attachToTarget", attach)["sessionId"]
        for domain in ("Page", "Network"):
            self.call(f"{domain}.enable", session=session)
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.call("Emulation.setEmulatedMedia", {"features": [scheme]}, session)
        self.call("Page.navigate", {"url": address}, session)
        return session

    def press(self, session: str, x: float, y: float) -> None:
        """A click at a place of the page."""
        for kind in ("mousePressed", "mouseReleased"):
            where = {"type": kind, "x": x, "y": y, "button": "left", "clickCount": 1}
            self.call("Input.dispatchMouseEvent", where, session)

    def picture(self, session: str) -> bytes:
        """A PNG of the tab as it stands."""
        told = self.call("Page.captureScreenshot", {"format": "png"}, session)
        return base64.b64decode(told["data"])

    def asked(self) -> set[str]:
        """Hosts that an answer came from."""
        received = [e for e in self.events if e["method"] == "Network.responseReceived"]
        addresses = (event["params"]["response"]["url"] for event in received)
        return {
            address.split("/")[2].rsplit(":", 1)[0]
            for address in addresses
            if address.startswith("http")
        }

    def call(
        self, method: str, parameters: dict[str, Any] | None = None, session: str | None = None
    ) -> Any:
        """One request of the DevTools protocol; events that come meanwhile are kept."""
        self._number += 1
        message: dict[str, Any] = {"id": self._number, "method": method}
        message |= {"params": parameters or {}}
        message |= {} if session is None else {"sessionId": session}
        os.write(self._write, json.dumps(message).encode() + b"\0")
        deadline = time.monotonic() + PATIENCE_S
        while True:
            told = self._message(deadline)
            if told.get("id") == self._number:
                if "error" in told:
                    raise RuntimeError(f"{method}: {told['error']}")
                return told["result"]
            self.events.append(told)

    def _message(self, deadline: float) -> dict[str, Any]:
        while b"\0" not in self._rest:
            left = deadline - time.monotonic()
            if left <= 0 or not select.select([self._read], [], [], left)[0]:
                raise TimeoutError("the browser does not answer")
            more = os.read(self._read, 1 << 20)
            if not more:
                raise EOFError("the browser is gone")
            self._rest += more
        first, self._rest = self._rest.split(b"\0", 1)
        told: dict[str, Any] = json.loads(first)
        return told
