"""`review` and what it shows: every workspace in the viewer itself, refusals before anything opens.

One viewer serves the whole module. The motors are two of `data/demo`: one healthy, one with a poor
joint in a phase. Ladder and comparison of lots are those of the unit tests, since a diagnosis of
the demo takes minutes; `test_every_workspace_of_the_demo` does it with nothing left out.
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from pipeline.__main__ import main
from pipeline.io.recordings.capture import recording_bytes
from pipeline.io.recordings.capture_traces import LONG_ROWS
from pipeline.io.recordings.fleet_columns import SHOWN
from pipeline.io.recordings.font import RANGES, SINGLE, drawable
from pipeline.io.recordings.ladder import ladder_bytes
from pipeline.io.recordings.lots import lots_bytes, lots_name
from pipeline.io.recordings.readback import entities, recording_property
from pipeline.io.recordings.seal import SEAL, seal_of, write_checksummed
from pipeline.io.recordings.viewer import catalogue
from pipeline.io.recordings.views import MEASURED, MODEL, PALETTE, RESIDUAL
from pipeline.records.capture import Capture, CaptureMeta
from tests.unit.ladders import make_diagnosis
from tests.unit.regressions import make_regression
from tests.viewing import Browser, Viewer, browser_path, count, need_viewer, pixels

ROOT = Path(__file__).parents[2]
HEALTHY, FAULTY = "G52-0601", "G52-1402"
FILES = (
    "cogging_ccw.mcap",
    "cogging_cw.mcap",
    "current_step_d_0.mcap",
    "current_step_q_0.mcap",
    "drive_0.mcap",
    "lcr.csv",
    "open_circuit_forward.mcap",
    "resistance_ab.mcap",
    "resistance_bc.mcap",
    "resistance_ca.mcap",
)
COLD, WARM, NEUTRAL = (33, 102, 172), (178, 24, 43), (247, 247, 247)


@pytest.fixture(scope="module")
def output(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("review")
    for motor in (HEALTHY, FAULTY):
        (folder / "in" / motor).mkdir(parents=True)
        for name in FILES:
            shutil.copy(ROOT / "data/demo" / motor / name, folder / "in" / motor / name)
    words = [f"input={folder / 'in'}", f"output={folder / 'out'}", "report=false", "workers=1"]
    words += ["registry=null", "diagnose=false", "residual_test=false"]
    assert main(["run", *words]) == 1
    recordings = folder / "out" / "recordings"
    write_checksummed(recordings / f"ladder-{FAULTY}.rrd", ladder_bytes(make_diagnosis()))
    write_checksummed(recordings / lots_name(make_regression()), lots_bytes(make_regression()))
    return folder / "out"


@pytest.fixture(scope="module")
def viewer() -> Iterator[Viewer]:
    need_viewer()
    with Viewer() as running:
        yield running


def sheet(output: Path, motor: str) -> dict[str, Any]:
    told: dict[str, Any] = json.loads((output / "datasheets" / f"{motor}.json").read_bytes())
    return told


def drawn(told: dict[str, Any]) -> Iterator[str]:
    """Addresses that the views of a blueprint ask for, without patterns."""
    for path, archetypes in told.items():
        if path.startswith("/view/") and path.endswith("/ViewContents"):
            for query in archetypes["ViewContents"]["query"]:
                for line in str(query).splitlines():
                    yield line.strip().removeprefix("+").strip()


@pytest.mark.parametrize(
    "name",
    [
        f"{HEALTHY}/{HEALTHY}/cogging_cw.mcap.rrd",
        pytest.param(f"{FAULTY}/{FAULTY}/current_step_d_0.mcap.rrd", marks=pytest.mark.slow),
        pytest.param(f"{FAULTY}/{FAULTY}/lcr.csv.rrd", marks=pytest.mark.slow),
        f"motor-{FAULTY}.rrd",
        pytest.param(f"ladder-{FAULTY}.rrd", marks=pytest.mark.slow),
        lots_name(make_regression()),
    ],
)
def test_a_workspace_opens_without_a_complaint_and_every_view_has_data(
    name: str, output: Path, viewer: Viewer
) -> None:
    path = output / "recordings" / name
    viewer.show(path)
    picture = pixels(viewer.picture())
    assert viewer.reports() == []
    assert picture.std() > 10  # something is drawn
    held = entities(path)
    asked = set(drawn(viewer.client.get_blueprint("recording").blueprint))
    concrete = {line for line in asked if line.startswith("/") and "*" not in line}
    assert concrete
    missing = {line for line in concrete if not any(h.startswith(line) for h in held)}
    assert missing == set()


def test_traces_are_drawn_in_their_colours(output: Path, viewer: Viewer) -> None:
    viewer.show(output / "recordings" / HEALTHY / HEALTHY / "drive_0.mcap.rrd")
    picture = pixels(viewer.picture())
    for colour in (MODEL, RESIDUAL):
        assert count(picture, colour) > 200
    assert count(picture, MEASURED, 30) > 200
    assert viewer.reports() == []


def test_a_long_capture_is_drawn_from_its_pack(tmp_path: Path, viewer: Viewer) -> None:
    t_s = np.arange(LONG_ROWS + 1) * 5e-5
    speed, current = 100.0 + 5.0 * np.sin(3.0 * t_s), 4.0 * np.sin(40.0 * t_s)
    frame = pl.DataFrame({"t_s": t_s, "omega_mech_rad_s": speed, "iq_a": current})
    capture = Capture("m/l.mcap", "0" * 64, "verified", CaptureMeta("m", "drive"), (frame,))
    (tmp_path / "long.rrd").write_bytes(recording_bytes(capture, ()))
    viewer.show(tmp_path / "long.rrd")
    for name in ("shaft speed [rad/s]", "i_q [A]"):
        picture = pixels(viewer.picture(name))
        assert count(picture, PALETTE[0], 30) > 1000
    viewer.tab(1)
    viewer.picture()
    views = {view.name for view in viewer.client.get_state().views}
    assert views >= {"Samples, one row in 6", "All samples"}
    assert viewer.reports() == []


def test_the_ladders_map_has_colour_below_and_none_at_the_top(output: Path, viewer: Viewer) -> None:
    """Step 0 lacks dead time: errors of opposite sign at opposite currents. Step 1 has it."""
    viewer.show(output / "recordings" / f"ladder-{FAULTY}.rrd")
    seen = []
    for step in (0, 1):
        viewer.client.set_time("step", sequence=step)
        view = next(v.name for v in viewer.client.get_state().views if "mean error, full" in v.name)
        picture = pixels(viewer.picture(view))
        map_only = picture[:, : int(0.53 * picture.shape[1])]  # the colour bar is at the right
        seen.append({c: count(map_only, c, 40) for c in (COLD, WARM, NEUTRAL)})
    assert min(seen[0][COLD], seen[0][WARM]) > 1000
    assert max(seen[1][COLD], seen[1][WARM]) < 20
    assert seen[1][NEUTRAL] > 2 * seen[0][NEUTRAL]


def test_the_fleets_table_shows_the_refused_motor_first_and_red(output: Path) -> None:
    need_viewer()
    motors = sorted((output / "recordings").glob("motor-*.rrd"))
    with catalogue(motors, 0) as address, Viewer(address, size="1700x700") as table:
        picture = pixels(table.picture())
        rows = np.array_split(picture[200:], 2)
        red, grey = ([count(row, c, 30) for row in rows] for c in (RESIDUAL, MEASURED))
        assert red[0] > 50
        assert grey[1] > 50
        state = table.show(f"{address}?segment_id={FAULTY}")
        names = {view.name for view in state.views}
        assert {"Datasheet", "Checks", "Constants", "which capture"} <= names
        table.picture()
        assert table.reports() == []


def test_values_read_back_are_the_datasheets(output: Path) -> None:
    from rerun.chunk import RrdReader

    for motor in (HEALTHY, FAULTY):
        path = output / "recordings" / f"motor-{motor}.rrd"
        told = sheet(output, motor)
        chunks = RrdReader(str(path)).stream().filter(content="/constants", is_static=False)
        rows = [row for chunk in chunks for row in chunk.to_record_batch().to_pylist()]
        back = {row["name"][0]: row for row in rows}
        assert set(back) == set(told["constants"])
        for name, constant in told["constants"].items():
            for key in ("value", "u"):
                cell = back[name][key]
                assert (cell[0] if cell else None) == constant[key]
            assert back[name]["unit"] == [constant["unit"]]
        assert recording_property(path, "motor", "verdict") == [told["status"]]
        assert recording_property(path, "motor", "id") == [motor]
        assert recording_property(path, "motor", "lot") == [told["lot"]]
        for one in SHOWN:
            value = told["constants"][one.constant]["value"]
            shown = recording_property(path, "shown", one.key)
            assert shown == ([] if value is None else [pytest.approx(value * one.factor, rel=1e-3)])


def texts(path: Path) -> Iterator[str]:
    """Every text in a recording."""
    import pyarrow as pa
    from rerun.chunk import RrdReader

    for chunk in RrdReader(str(path)).stream():
        yield str(chunk.entity_path)
        for column in chunk.to_record_batch().columns:
            if pa.types.is_list(column.type) and pa.types.is_string(column.type.value_type):
                yield from (text for row in column.to_pylist() if row for text in row if text)


def test_no_text_has_a_character_that_the_font_lacks(output: Path) -> None:
    paths = sorted((output / "recordings").rglob("*.rrd"))
    assert len(paths) == 2 * len(FILES) + 4
    odd = {c for path in paths for text in texts(path) for c in text if drawable(c) != c}
    assert odd == set()


def test_the_viewer_draws_every_character_that_is_let_through(
    tmp_path: Path, viewer: Viewer
) -> None:
    """A character outside its font would end the viewer."""
    from pipeline.io.recordings.stream import recording, send_page
    from pipeline.io.recordings.views import page_view, workspace

    every = [chr(code) for first, last in RANGES for code in range(first, last + 1)] + [*SINGLE]
    page = page_view("/page", "every character")
    with recording("font", ("font",), workspace(page, timeline=None)) as made:
        send_page(made.stream, "/page", " ".join(c for c in every if c not in "`*_#|<>~[]()\\!"))
    (tmp_path / "font.rrd").write_bytes(made.content)
    viewer.show(tmp_path / "font.rrd")
    viewer.picture()
    assert viewer.alive
    assert drawable("motor 🛞✘") == "motor ‹1F6DE›‹2718›"


def review(*words: object) -> int:
    return main(["review", *map(str, words)])


def copied(output: Path, tmp_path: Path) -> Path:
    shutil.copytree(output, tmp_path / "out")
    return tmp_path / "out"


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ("truncated", "truncated or changed"),
        ("one byte changed", "truncated or changed"),
        ("another file in its place", "this is no Rerun recording"),
        ("no seal", "seal"),
        ("another recording in its place", "truncated or changed"),
    ],
)
def test_a_recording_that_cannot_be_verified_is_refused_with_one_line(
    fault: str,
    words: str,
    output: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Reaction: exit code 3 and one line that names the file; nothing is opened."""
    place = copied(output, tmp_path)
    victim = place / "recordings" / FAULTY / FAULTY / "drive_0.mcap.rrd"
    whole = victim.read_bytes()
    if fault == "truncated":
        victim.write_bytes(whole[:-1000])
    elif fault == "one byte changed":
        middle = len(whole) // 2
        victim.write_bytes(whole[:middle] + bytes([whole[middle] ^ 1]) + whole[middle + 1 :])
    elif fault == "another file in its place":
        victim.write_text("these are words\n")
    elif fault == "no seal":
        seal_of(victim).unlink()
    else:
        shutil.copy(place / "recordings" / HEALTHY / HEALTHY / "drive_0.mcap.rrd", victim)
    assert review(f"output={place}", f"motor={FAULTY}", "web=true") == 3
    seen = capsys.readouterr()
    assert seen.out == ""
    (line,) = seen.err.splitlines()
    assert line.startswith(f"refused: recordings/{FAULTY}/{FAULTY}/drive_0.mcap.rrd: ")
    assert words in line
    assert line.endswith("[recording_unverified]")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["output={out}/nowhere"], "is no folder"),
        (["output={out}", "motor=X-1"], "no recordings of motor X-1"),
        (["output={out}", "lot=1999-W01"], "no recordings of lot 1999-W01"),
        (["output={out}/datasheets"], "no recordings in"),
    ],
)
def test_what_is_not_there_is_wrong_usage(
    words: list[str], said: str, output: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert review(*(word.format(out=output) for word in words)) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert said in line


def test_without_a_screen_it_says_how_to_go_on(
    output: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("pipeline.stages.review.has_screen", lambda: False)
    assert review(f"output={output}") == 5
    (line,) = capsys.readouterr().err.splitlines()
    assert "web=true" in line


class Served:
    """`review web=true` as a user starts it; a context that interrupts it."""

    def __init__(self, output: Path, home: Path, *words: str) -> None:
        environment = {**os.environ, "HOME": str(home), "PYTHONPATH": str(ROOT)}
        command = [sys.executable, "-m", "pipeline", "review", f"output={output}", "web=true"]
        self.process = subprocess.Popen(
            [*command, *words], cwd=ROOT, env=environment, stdout=subprocess.PIPE, text=True
        )
        assert self.process.stdout is not None
        self.lines = [self.process.stdout.readline().strip() for _ in range(4)]
        self.address = self.lines[1].removeprefix("open ")
        self.code: int | None = None

    def __enter__(self) -> Served:
        return self

    def __exit__(self, *_: object) -> None:
        self.process.send_signal(signal.SIGINT)
        self.code = self.process.wait(timeout=60)


def listens(host: str, port: int) -> bool:
    with socket.socket() as probe:
        probe.settimeout(2)
        return probe.connect_ex((host, port)) == 0


def test_the_page_is_served_on_loopback_alone_and_lets_nothing_out(
    output: Path, tmp_path: Path
) -> None:
    with Served(output, tmp_path, f"motor={FAULTY}") as served:
        assert (
            served.lines[0] == f"{len(FILES) + 2} recordings verified; analytics off, loopback only"
        )
        port = int(served.address.split("127.0.0.1:", 1)[1].split("/", 1)[0])
        assert f"ssh -N -L {port}:127.0.0.1:{port} " in served.lines[2]
        base = f"http://127.0.0.1:{port}"
        with urllib.request.urlopen(base) as answer:
            allowed = answer.headers["Content-Security-Policy"]
        assert "connect-src 'self'" in allowed
        assert "https:" not in allowed
        with urllib.request.urlopen(f"{base}/recordings/0/x.rrd") as answer:
            first = answer.read()
        recorded = [p.read_bytes() for p in (output / "recordings").rglob("*.rrd")]
        assert first in recorded
        for wrong in ("/recordings/999/x.rrd", "/recordings/..%2f..%2fetc/passwd"):
            with pytest.raises(urllib.error.HTTPError, match="404"):
                urllib.request.urlopen(base + wrong)
        foreign = urllib.request.Request(base, headers={"Host": "rebound.example"})
        with pytest.raises(urllib.error.HTTPError, match="403"):
            urllib.request.urlopen(foreign)
        others = {info[4][0] for info in socket.getaddrinfo(socket.gethostname(), None)}
        for host in others - {"127.0.0.1", "127.0.1.1", "::1"}:
            assert not listens(str(host), port)
    assert served.code == 0


@pytest.mark.slow
def test_the_web_viewer_shows_a_motor_in_chromium_and_speaks_to_this_machine_alone(
    output: Path, tmp_path: Path
) -> None:
    browser_path()
    with Served(output, tmp_path, f"motor={FAULTY}") as served, Browser((1000, 640)) as browser:
        session = browser.page(served.address)
        png = settled(browser, session)
        picture = pixels(png)
        assert browser.asked() == {"127.0.0.1"}
        assert count(picture, (255, 255, 255), 4) > 0.4 * picture.shape[0] * picture.shape[1]
        # colours that the layout gives to curves: by itself the viewer would choose others;
        # which of the recordings lies on top is the order in which they came
        given = (MEASURED, RESIDUAL, PALETTE[1])
        assert max(count(picture, colour, 24) for colour in given) > 300


def settled(browser: Browser, session: str) -> bytes:
    """The page once it stands still and shows more than its frame."""
    deadline, last = time.monotonic() + 240, b""
    while time.monotonic() < deadline:
        now = b""
        with suppress(RuntimeError):  # the page is being loaded
            now = browser.picture(session)
        if now == last and len(now) > 60_000:
            return now
        last = now
        time.sleep(1)
    raise TimeoutError("the page does not come to rest")


@pytest.mark.slow
def test_every_workspace_of_the_demo(tmp_path: Path) -> None:
    """All of `data/demo`, with the diagnosis and the comparison of one motor: no view complains."""
    need_viewer()
    where = [f"output={tmp_path}"]
    assert main(["run", "input=data/demo", *where, "report=false"]) == 1
    one = [f"input=data/demo/{FAULTY}", *where]
    assert main(["compare", *one, "model.name=ideal"]) == 0
    assert main(["diagnose", *one, "model.name=ideal"]) == 0
    paths = sorted((tmp_path / "recordings").rglob("*.rrd"))
    assert len(paths) == 6 * 27 + 2
    assert all((path.parent / (path.name + SEAL)).is_file() for path in paths)
    with Viewer() as running:
        for path in paths:
            running.show(path)
            assert running.reports() == [], path.name
            running.client.close("all")
