"""From a sealed case to what the diagnosing side gets: captures that tell nothing but samples."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import polars as pl

from pipeline.io.ingest.metadata import capture_meta
from pipeline.records.capture import Campaign, Capture
from pipeline.simulator.design import Recording
from tests.benchmark.bench import recorded, station
from tests.benchmark.cases import Case
from tests.benchmark.corruption import corrupted

MOTOR_TYPE = "unit"


def blind_campaign(case: Case) -> Campaign:
    """The campaign of a case as the reader would hand it on, under a name that is a digest.

    Metadata says what a bench's does: test, nameplate, instruments; neither design nor seed.
    """
    place = station(case.motor)
    motor = replace(case.hidden_motor(), motor_id=blind_name(case), motor_type=MOTOR_TYPE)
    made = recorded(motor, place.bench, place.plan, case.seed, case.keep)
    rng = np.random.default_rng([case.seed, 1])
    made = corrupted(made, case.corruption, motor, place.bench, rng)
    return Campaign(motor.motor_id, captures(made))


def captures(made: Iterable[Recording]) -> tuple[Capture, ...]:
    """Recordings as the reader would hand them on, by path."""
    return tuple(sorted(map(_capture, made), key=lambda capture: capture.path))


def blind_name(case: Case) -> str:
    """A serial number that tells nothing: a digest of the case's key."""
    return "M" + hashlib.sha256(f"serial {case.key}".encode()).hexdigest()[:10]


def _capture(recording: Recording) -> Capture:
    digest = hashlib.sha256(recording.stem.encode())
    for table in recording.tables:
        for name, column in table.items():
            digest.update(name.encode())
            digest.update(np.ascontiguousarray(column).tobytes())
    return Capture(
        f"{recording.stem}.mcap",
        digest.hexdigest(),
        "verified",
        capture_meta(recording.meta),
        tuple(pl.DataFrame(table) for table in recording.tables),
    )
