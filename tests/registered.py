"""Datasheets to register, and what a writer's own process does."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from multiprocessing.connection import Connection
from typing import Any

from pipeline.io.registry.store import Registry
from pipeline.records.datasheet import AWAITS_APPROVAL, CaptureReference, Datasheet, DatasheetStatus
from pipeline.records.estimate import Estimate, not_identifiable
from pipeline.records.uncertainty import type_a, type_b

NOON = datetime(2026, 3, 1, 12, 0, 0, 123456, tzinfo=UTC)
HOUR = timedelta(hours=1)


def version_of(motor_id: str, number: int) -> str:
    """A digest, as versions are."""
    return hashlib.sha256(f"{number} {motor_id}".encode("utf-8", "surrogatepass")).hexdigest()


def document(
    motor_id: str,
    number: int,
    *,
    status: DatasheetStatus = "provisional",
    why: Sequence[str] = (AWAITS_APPROVAL,),
    lot: str | None = "A",
    motor_type: str | None = "gimbal",
    stations: Sequence[str | None] = ("rig-1",),
    r_ohm: float | None = None,
) -> dict[str, Any]:
    """A datasheet of one measured and one unknown constant; R grows by 1 mohm a number."""
    value = 0.3 + 0.001 * number if r_ohm is None else r_ohm
    budget = type_a("scatter:resistance:r", 3e-4, 40.0) + type_b("voltage@rig-1", 4e-4)
    sheet = Datasheet(
        motor_id=motor_id,
        motor_type=motor_type,
        lot=lot,
        version=version_of(motor_id, number),
        status=status,
        why=tuple(why),
        captures=tuple(
            CaptureReference(f"{k}.csv", f"{k:064x}", "resistance", "verified", station)
            for k, station in enumerate(stations)
        ),
        config_sha256="c" * 64,
        code_version="0.1.0+0123456789ab",
        constants={
            "r_phase_ohm": Estimate("r_phase_ohm", value, "ohm", "measured", "resistance", budget),
            "j_rotor_kgm2": not_identifiable("j_rotor_kgm2", "kg·m²", "spin_down", "record one"),
        },
        alternatives=(),
        checks=(),
    )
    return sheet.document()


def write(place: str, motors: Sequence[str], numbers: Sequence[int], said: Connection) -> None:
    """Registers each number of all motors in one commit, and says each that is acknowledged."""
    registry = Registry(place)
    for number in numbers:
        registry.publish([document(motor, number) for motor in motors], NOON)
        said.send(number)
