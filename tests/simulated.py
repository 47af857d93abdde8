"""Captures and campaigns in memory, straight from the simulator: no file in between."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import fields
from functools import cache

import polars as pl

from pipeline.io.storage.plain_yaml import load_plain
from pipeline.records.capture import Campaign, Capture, CaptureMeta
from pipeline.settings import configuration_folder
from pipeline.simulator.catalogue import motor_from
from pipeline.simulator.design import EXACT, Bench, Motor, Recording

QUIET = Bench(noise_scale=0.0, instruments=EXACT, adc_bits=44, encoder_bits=44)
"""A bench without noise, gain errors or visible resolution."""

WHOLE = {"pole_pairs", "slots"}
REAL = {
    "ambient_degc",
    "theta_elec_deg",
    "pwm_hz",
    "vdc_v",
    "u_rel_current",
    "u_rel_voltage",
    "u_rel_torque",
    "u_temp_degc",
    "u_rel_clock",
}
IGNORED = {"contract"}


@cache
def design(name: str) -> Motor:
    """A motor of `conf/motor/`."""
    path = configuration_folder() / "motor" / f"{name}.yaml"
    return motor_from(load_plain(path.read_bytes(), path.name))


def meta_of(words: Mapping[str, str]) -> CaptureMeta:
    """Metadata as records hold it, from the words of a recording."""
    known = {field.name for field in fields(CaptureMeta)} - {"extra"}
    values: dict[str, object] = {}
    extra: dict[str, str] = {}
    for key, word in words.items():
        if key in WHOLE:
            values[key] = int(word)
        elif key in REAL:
            values[key] = float(word)
        elif key in known:
            values[key] = word
        elif key not in IGNORED:
            extra[key] = word
    return CaptureMeta(**values, extra=extra)  # type: ignore[arg-type]


def capture_of(recording: Recording) -> Capture:
    """A recording as the reader would hand it on, `verified`, its stem as the path."""
    return Capture(
        path=f"{recording.stem}.mcap",
        sha256=recording.stem.encode().hex().ljust(64, "0")[:64],
        integrity="verified",
        meta=meta_of(recording.meta),
        tables=tuple(pl.DataFrame(table) for table in recording.tables),
    )


def campaign_of(recordings: Iterable[Recording]) -> Campaign:
    """Recordings of one motor as a campaign, sorted by path; stems must differ."""
    captures = sorted((capture_of(r) for r in recordings), key=lambda c: c.path)
    paths = {c.path for c in captures}
    if len(paths) != len(captures):
        raise ValueError("two recordings share a stem; dataclasses.replace(r, stem=...) parts them")
    motors = {c.meta.motor_id for c in captures}
    if len(motors) != 1:
        raise ValueError(f"a campaign is of one motor, not {sorted(motors)}")
    return Campaign(motors.pop(), tuple(captures))
