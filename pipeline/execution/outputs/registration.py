"""The datasheets of a run in the registry, each version once."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from pipeline.execution.jobs import MotorResult
from pipeline.execution.outputs.sheet_memory import SheetMemory
from pipeline.io.registry.store import Registry
from pipeline.records.errors import MachineError
from pipeline.records.ledger import Event
from pipeline.records.naming import printable

COMMITTED = 50
"""Datasheets in a commit of the registry, at most."""


@dataclass(frozen=True, slots=True)
class Registered:
    """The result of registering the datasheets: exit code, a line of text, error lines."""

    code: int = 0
    text: str = ""
    errors: tuple[str, ...] = ()


def register(
    registry: Registry | None, output: Path, results: Sequence[MotorResult], memory: SheetMemory
) -> Registered:
    """Publishes the datasheets that this registry object has not published before.

    They go in commits of limited size, so that memory stays bounded, those that were worked on
    first. A registry that fails leaves the outputs complete.

    Parameters
    ----------
    registry
        The registry; None for none.
    output
        The output folder of a run.
    results
        What each motor came to.
    memory
        Datasheets that were read before.

    """
    by_work = sorted(results, key=lambda result: not result.seconds)
    sheets = dict(_sheets(output, by_work, memory))
    if registry is None or not sheets:
        return Registered()
    due = registry.unsettled({key: sha256 for key, (_, sha256) in sheets.items()})
    names = [name for key, (name, _) in sheets.items() if key in due]
    added, known = 0, len(sheets) - len(names)
    errors: tuple[str, ...] = ()
    for first in range(0, len(names), COMMITTED):
        some = names[first : first + COMMITTED]
        try:
            receipt = registry.publish(((output / n).read_bytes() for n in some), datetime.now(UTC))
        except MachineError as error:
            return Registered(error.exit_code, errors=(*errors, f"error: {error}"))
        added, known = added + len(receipt.added), known + len(receipt.known)
        errors += tuple(_conflict(event, registry.place) for event in receipt.conflicts)
    text = f"registry {registry.place}: {added} new, {known} known"
    return Registered(1 if errors else 0, text, errors)


def _sheets(
    output: Path, results: Sequence[MotorResult], memory: SheetMemory
) -> Iterator[tuple[tuple[str, str], tuple[str, str]]]:
    """Motor and version of each datasheet, with the name and the digest of its file."""
    for name, sha256 in (file for result in results for file in result.finished.files):
        if name.startswith("datasheets/"):
            sheet = memory.sheet(output / name, sha256).datasheet
            yield (sheet.motor_id, sheet.version), (name, sha256)


def _conflict(event: Event, place: str) -> str:
    """The error line of a version that is registered with other content, with what to do."""
    motor, version = printable(event.motor_id), event.version[:12]
    return (
        f"error: motor {motor}: version {version} is registered with other content; the same work "
        "gave other bytes, so the registered one stays; if that one is wrong, "
        f"`registry revoke {shlex.quote(motor)} version={version} by=NAME why=REASON "
        f"registry={shlex.quote(place)}` and run again: the new bytes become a version of their own"
    )
