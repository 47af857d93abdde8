"""`review`: what a run and its diagnoses recorded, in the Rerun viewer; on this machine only."""

from __future__ import annotations

import getpass
import json
import shlex
import socket
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from pipeline.execution.outputs.statuses import histories_of, status_now
from pipeline.io.recordings.readback import recording_property
from pipeline.io.recordings.seal import verify
from pipeline.io.recordings.viewer import (
    catalogue,
    free_port,
    has_screen,
    page_address,
    require_free,
    silence,
    window,
)
from pipeline.io.recordings.web import page_server, recording_address
from pipeline.io.registry.store import Registry
from pipeline.io.storage.datasheets import read_datasheet
from pipeline.records.errors import MachineError, RecordingError, UsageError
from pipeline.records.naming import file_stem, printable
from pipeline.records.outcome import Outcome
from pipeline.settings import ReviewSettings
from pipeline.views.status_text import status_lines

LAST_PORT = 65534
"""One less than there are, for the fleet's table is on the next."""
NO_SCREEN = "add web=true, or run it where there is a screen"


@dataclass(frozen=True, slots=True)
class Opened:
    """What is to be shown: motors as a table, other recordings as files."""

    table: tuple[Path, ...]
    files: tuple[Path, ...]

    @property
    def all(self) -> tuple[Path, ...]:
        """Every recording."""
        return (*self.table, *self.files)


def main(settings: ReviewSettings) -> Outcome:
    """Opens the fleet, one motor or one lot; refuses recordings that cannot be verified.

    Parameters
    ----------
    settings
        The keys of `review`.

    """
    output = Path(settings.output)
    if not 0 <= settings.port <= LAST_PORT:
        raise UsageError(f"port={settings.port} is none", f"0, or one of 1 to {LAST_PORT}")
    if not output.is_dir():
        raise UsageError(f"output={settings.output} is no folder", "name the output of a run")
    chosen = _chosen(output, settings)
    refused = _refused(chosen.all, output)
    if refused:
        return Outcome(3, errors=refused)
    if not settings.web and not has_screen():
        raise MachineError("there is no screen to open the viewer on", NO_SCREEN)
    silence()
    return _served(settings, chosen)


def _served(settings: ReviewSettings, chosen: Opened) -> Outcome:
    """Starts the servers and prints their addresses; then opens the window or serves the page."""
    first = settings.port
    page, table = (first, first + 1) if first else (free_port(), free_port())
    used = ([page] if settings.web else []) + ([table] if chosen.table else [])
    for port in used if settings.port else []:
        require_free(port)
    with ExitStack() as stack:
        catalogues = []
        if chosen.table:
            catalogues.append(stack.enter_context(catalogue(chosen.table, table)))
        server = None
        if settings.web:
            origin = f"http://127.0.0.1:{table}"
            server = stack.enter_context(page_server(chosen.files, page, [origin]))
        text = _text(settings, chosen, (page, table), catalogues)
        text = "\n".join([text, *_decided(Path(settings.output), chosen.all)])
        kept = stack.pop_all()

    def then() -> Outcome:
        with kept:
            if server is not None:
                server.serve_forever()
                return Outcome()
            code = window([*map(str, chosen.files), *catalogues], free_port())
        if code != 0:
            return Outcome(5, errors=(f"error: the viewer ended with code {code}; {NO_SCREEN}",))
        return Outcome()

    return Outcome(text=text, then=then)


def _chosen(output: Path, settings: ReviewSettings) -> Opened:
    """The recordings of the choice; UsageError where there are none."""
    folder = output / "recordings"
    if settings.motor is not None:
        return _of_motor(folder, settings.motor)
    motors = sorted(folder.glob("motor-*.rrd"))
    lots = sorted(folder.glob("lots-*.rrd"))
    if settings.lot is not None:
        stems = _stems_of_lot(output, settings.lot)
        motors = [path for path in motors if path.stem.removeprefix("motor-") in stems]
        lots = [path for path in lots if settings.lot in _lots_of(path)]
    if not motors and not lots:
        what = f" of lot {settings.lot}" if settings.lot is not None else ""
        raise UsageError(f"there are no recordings{what} in {output}", "run the pipeline first")
    return Opened(tuple(motors), tuple(lots))


def _of_motor(folder: Path, motor_id: str) -> Opened:
    stem = file_stem(motor_id)
    named = [folder / f"{kind}-{stem}.rrd" for kind in ("motor", "ladder", "comparison")]
    recordings = [*(path for path in named if path.is_file())]
    recordings += sorted((folder / stem).rglob("*.rrd"))
    if not recordings:
        raise UsageError(
            f"there are no recordings of motor {motor_id} in {folder.parent}",
            "run the pipeline on its captures first, or name another motor",
        )
    # The viewer shows what comes last: the motor.
    return Opened((), tuple(reversed(recordings)))


def _stems_of_lot(output: Path, lot: str) -> set[str]:
    stems = set()
    for path in (output / "datasheets").glob("*.json"):
        if json.loads(path.read_bytes()).get("lot") == lot:
            stems.add(path.stem)
    return stems


def _lots_of(path: Path) -> tuple[str, ...]:
    """The lots that a regression's recording compares; none where it cannot be read."""
    try:
        verify(path)
        return tuple(recording_property(path, "regression", "lots"))
    except RecordingError:
        return ()


def _refused(paths: Sequence[Path], output: Path) -> tuple[str, ...]:
    """One line a recording that cannot be verified."""
    lines = []
    for path in paths:
        try:
            verify(path)
        except RecordingError as error:
            lines.append(f"refused: {path.relative_to(output)}: {error} [recording_unverified]")
    return tuple(lines)


def _decided(output: Path, shown: Sequence[Path]) -> Iterator[str]:
    """Decisions on the shown motors, made after their recordings."""
    versions = histories_of(Registry((output / "registry").as_posix()))
    for path in sorted((output / "datasheets").glob("*.json")) if versions else ():
        parts = {path.stem, f"motor-{path.stem}"}
        if not any(parts & {one.stem, one.parent.name} for one in shown):
            continue
        sheet = read_datasheet(path)
        current = status_now(output, sheet, versions)
        statuses = "; ".join(status_lines(current))
        if statuses:
            yield f"{printable(sheet.motor_id)} is {current.status} now: {statuses}"


def _text(
    settings: ReviewSettings, chosen: Opened, ports: tuple[int, int], catalogues: Sequence[str]
) -> str:
    """The opened recordings, their addresses, and the command for another machine."""
    page, table = ports
    count = len(chosen.all)
    lines = [f"{count} recording{'s' if count != 1 else ''} verified; analytics off, loopback only"]
    host = f"{getpass.getuser()}@{socket.gethostname()}"
    used = ([page] if settings.web else []) + ([table] if chosen.table else [])
    tunnel = " ".join(f"-L {port}:127.0.0.1:{port}" for port in used)
    if settings.web:
        files = [recording_address(page, n, path) for n, path in enumerate(chosen.files)]
        lines.append(f"open {page_address(page, [*files, *catalogues])}")
        lines.append(f"on another machine: ssh -N {tunnel} {host}, then the same address there")
        lines.append("Ctrl-C ends it")
    elif chosen.table:
        lines.append(f"on another machine: ssh -N {tunnel} {host}, then rerun {catalogues[-1]}")
    if not settings.web and chosen.files:
        folder = shlex.quote(f"{host}:{chosen.files[-1].parent.resolve()}")
        lines.append(f"on another machine: scp -r {folder} review, then rerun review/*.rrd")
    return "\n".join(lines)
