"""Pictures of the workspaces for the docs: `make screenshots`, after `make demo`.

Dark ones come from the viewer without a window, light ones from its web page in Chromium, which
follows the browser's colour scheme. Both draw in software, so they take a minute or two.
"""

from __future__ import annotations

import argparse
import io
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from pipeline.__main__ import main as pipeline
from pipeline.io.recordings.viewer import catalogue, free_port, page_address
from pipeline.io.recordings.web import page_server, recording_address
from tests.viewing import Browser, Viewer

MOTOR = "G52-1402"
BEFORE, AFTER = "2026-W06", "2026-W14"
SIZE = (1700, 1000)
NARROW_PX = 1000
VIEWS = (0.036, 0.747)  # from the tabs to the panel of time, shares of a ladder's height
NOTICES_S = 15.0
LIGHT_PATIENCE_S = 600.0


def main(words: list[str] | None = None) -> int:
    """Takes every picture, or those whose names are given."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, default=Path("reports/demo"))
    parser.add_argument("--into", type=Path, default=Path("docs/images"))
    parser.add_argument("--dark", action="store_true", help="the dark ones only")
    chosen = parser.parse_args(words)
    _complete(chosen.output)
    chosen.into.mkdir(parents=True, exist_ok=True)
    _dark(chosen.output, chosen.into)
    if not chosen.dark:
        _light(chosen.output, chosen.into)
    return 0


def _complete(output: Path) -> None:
    """The ladder of the faulty motor and the comparison of the two lots, where they are missing."""
    where = f"output={output}"
    if not (output / f"recordings/ladder-{MOTOR}.rrd").is_file():
        pipeline(["diagnose", f"input=data/demo/{MOTOR}", "model.name=ideal", where])
    if not list((output / "recordings").glob("lots-*.rrd")):
        pipeline(["regress", f"baseline=lot:{BEFORE}", f"candidate=lot:{AFTER}", where])


def _workspaces(output: Path) -> dict[str, Path]:
    recordings = output / "recordings"
    return {
        "capture": recordings / MOTOR / MOTOR / "drive_1_warm.mcap.rrd",
        "ladder": recordings / f"ladder-{MOTOR}.rrd",
        "motor": recordings / f"motor-{MOTOR}.rrd",
        "lots": next(iter(sorted(recordings.glob("lots-*.rrd")))),
    }


def _dark(output: Path, into: Path) -> None:
    places = _workspaces(output)
    with Viewer(size=f"{SIZE[0]}x{SIZE[1]}") as viewer:
        viewer.show(places["capture"])
        viewer.client.set_time("t", duration=0.4325)
        _keep(into, "capture", viewer.picture())
        viewer.tab(1)
        _keep(into, "maps", viewer.picture())
        state = viewer.show(places["ladder"])
        last = next(line for line in state.recordings[-1].timelines if line.name == "step").end
        steps = []
        for name, step in (("ladder-first", 0), ("ladder-last", last or 0)):
            viewer.client.set_time("step", sequence=step)
            steps.append(viewer.picture())
            _keep(into, name, steps[-1])
        (into / "ladder.png").write_bytes(_under_each_other(steps))
        for name in ("motor", "lots"):
            viewer.show(places[name])
            _keep(into, name, viewer.picture())
    motors = sorted((output / "recordings").glob("motor-*.rrd"))
    with catalogue(motors, 0) as address, Viewer(address, size=f"{SIZE[0]}x{SIZE[1]}") as viewer:
        time.sleep(NOTICES_S)  # previews come one by one, and notices about the machine go
        _keep(into, "fleet", viewer.picture())


def _under_each_other(pictures: list[bytes]) -> bytes:
    """Their views as one PNG, narrow enough for a page."""
    from PIL import Image

    whole_ones = [Image.open(io.BytesIO(png)).convert("RGB") for png in pictures]
    top, bottom = (round(share * whole_ones[0].height) for share in VIEWS)
    images = [one.crop((0, top, one.width, bottom)) for one in whole_ones]
    height = round(images[0].height * NARROW_PX / images[0].width)
    whole = Image.new("RGB", (NARROW_PX, height * len(images)))
    for place, image in enumerate(images):
        whole.paste(image.resize((NARROW_PX, height)), (0, place * height))
    made = io.BytesIO()
    whole.save(made, "PNG", optimize=True)
    return made.getvalue()


def _light(output: Path, into: Path) -> None:
    places = _workspaces(output)
    for name in ("capture", "ladder", "lots"):
        with _page([places[name]]) as address, Browser(SIZE) as browser:
            _keep(into, f"{name}-light", _settled(browser, address))
    motors = sorted((output / "recordings").glob("motor-*.rrd"))
    with catalogue(motors, 0) as table:
        origin = table.replace("rerun+", "").split("/dataset")[0]
        with page_server([], port := free_port(), [origin]) as server:
            _run(server)
            with Browser(SIZE) as browser:
                shown = _settled(browser, page_address(port, [table]))
                _keep(into, "fleet-light", shown)
            server.shutdown()


@contextmanager
def _page(paths: list[Path]) -> Iterator[str]:
    port = free_port()
    with page_server(paths, port) as server:
        _run(server)
        addresses = [recording_address(port, n, path) for n, path in enumerate(paths)]
        yield page_address(port, addresses)
        server.shutdown()


def _run(server: object) -> None:
    import threading

    threading.Thread(target=server.serve_forever, daemon=True).start()  # type: ignore[attr-defined]


def _settled(browser: Browser, address: str) -> bytes:
    """The page once three pictures in a row are equal and show more than its frame."""
    session = browser.page(address)
    deadline, seen = time.monotonic() + LIGHT_PATIENCE_S, [b"", b"x", b"y"]
    while time.monotonic() < deadline:
        with suppress(RuntimeError):  # the page is being loaded
            seen = [*seen[1:], browser.picture(session)]
        if len(set(seen)) == 1 and len(seen[-1]) > 80_000:
            return seen[-1]
        time.sleep(2)
    raise TimeoutError(f"{address} does not come to rest")


def _keep(into: Path, name: str, png: bytes) -> None:
    (into / f"review-{name}.png").write_bytes(png)


if __name__ == "__main__":
    raise SystemExit(main())
