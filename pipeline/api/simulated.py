"""Recordings of a simulated motor with chosen effects, in memory."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import polars as pl

from pipeline.api.options import check_options
from pipeline.api.recordings import Options, Recordings
from pipeline.contracts.validate import validate
from pipeline.io.ingest.metadata import capture_meta
from pipeline.io.storage.plain_yaml import load_plain
from pipeline.records.capture import Campaign, Capture
from pipeline.records.errors import CaptureError, UsageError
from pipeline.records.finding import Finding
from pipeline.records.naming import file_stem
from pipeline.settings import RunSettings, SimulateSettings, named_file
from pipeline.simulator.bench import CAMPAIGN, campaign
from pipeline.simulator.catalogue import bench_from, fleet_from, motor_from, seed_of, with_effects
from pipeline.simulator.design import EXACT, Bench, Motor, Recording
from pipeline.simulator.outside import with_unknown
from pipeline.simulator.truth import truth

Plan = tuple[tuple[str, str, Mapping[str, Any]], ...]
Job = tuple[str, Motor, Bench, int, Plan]
"""Subfolder, motor, bench, seed, captures to record (all of the campaign where empty)."""


def simulate(
    motor: str = "gimbal-5208",
    effects: str | Sequence[str] = (),
    *,
    outside: str | None = None,
    seed: int = 1,
    motor_id: str | None = None,
    exact: bool = False,
    gates: Options | None = None,
) -> Recordings:
    """Simulates the laboratory campaign of one motor; nothing is written.

    The simulator shares no code with the models that estimate and diagnose.

    Parameters
    ----------
    motor : str
        Design in `conf/motor/`.
    effects : str or sequence of str
        Hidden effects: `"cogging"` at its typical size, `"dead_time=0.3"` at another
        [units in docs/simulator.md].
    outside : str, optional
        A term that no model of the library has, for instance `"eddy_brake"`.
    seed : int
        Seed of every random draw; the same seed gives the same recordings.
    motor_id : str, optional
        Serial number; without it, the design and the seed.
    exact : bool
        Instruments without gain errors; noise remains.
    gates : mapping of mapping, optional
        Options by gate [units in the gate's file].

    Returns
    -------
    Recordings
        Validated like those of `read`; `truth` holds the true parameters.

    Raises
    ------
    UsageError
        For an unknown design, effect, gate or option, or an impossible size.

    Examples
    --------
    >>> import pipeline
    >>> recordings = pipeline.simulate("gimbal-5208", ["stribeck"], seed=3)
    >>> recordings.motors
    ('gimbal-5208-3',)

    """
    check_options(RunSettings(gates=dict(gates or {})))
    words = effects if isinstance(effects, str) else f"[{','.join(effects)}]"
    settings = SimulateSettings(
        output="-", motor=motor, effects=words, outside=outside, seed=seed, exact=exact
    )
    settings.motor_id = motor_id
    if seed < 0:
        raise UsageError(f"simulate: seed={seed}", "it must be 0 or more")
    try:
        ((_, design, bench, _, plan),) = single(settings)
    except (ValueError, KeyError) as error:
        raise UsageError(f"simulate: {error}", "correct it") from error
    recorded, true = simulated(design, bench, seed, plan)
    name = design.motor_id
    captures, findings = [], []
    for recording in recorded:
        try:
            capture, doubts = validate(_capture(recording), gates or {})
        except CaptureError as error:
            findings.append(Finding.refusal(recording.stem, error))
        else:
            captures.append(capture)
            findings += doubts
    found_captures = Campaign(name, tuple(sorted(captures, key=lambda capture: capture.path)))
    return Recordings({name: found_captures}, tuple(findings), {name: true})


def _capture(recording: Recording) -> Capture:
    """A recording as a capture; its digest is of its columns, for there is no file."""
    digest = hashlib.sha256()
    for table in recording.tables:
        for name, column in table.items():
            digest.update(name.encode() + b"\0" + column.tobytes())
    return Capture(
        path=recording.stem,
        sha256=digest.hexdigest(),
        integrity="verified",
        meta=capture_meta(recording.meta),
        tables=tuple(pl.DataFrame(dict(table)) for table in recording.tables),
    )


def single(settings: SimulateSettings) -> Iterable[Job]:
    """The one motor that the settings ask for.

    Parameters
    ----------
    settings
        Name of the motor's file, effects, unknown structure, seed, and whether instruments are
        exact.

    Yields
    ------
    Job
        Subfolder (the output folder itself), motor, bench, seed, and an empty plan: the whole
        campaign.

    Raises
    ------
    ValueError
        An effect or a parameter is not one that can be simulated.
    KeyError
        The motor's file lacks a key.

    """
    document = _document("motor", settings.motor, settings.config_dir)
    motor = motor_from(document)
    name = settings.motor_id or f"{settings.motor}-{settings.seed}"
    motor = with_effects(replace(motor, lot=settings.lot, motor_id=name), settings.effects)
    if settings.outside is not None:
        motor = with_unknown(motor, settings.outside)
    bench = bench_from(document.get("bench") or {})
    if settings.exact:
        bench = replace(bench, instruments=EXACT)
    yield "", motor, bench, settings.seed, ()


def fleet(settings: SimulateSettings) -> Iterable[Job]:
    """Every motor of a fleet, measured on one station.

    Parameters
    ----------
    settings
        Name of the fleet's file, and whether instruments are exact.

    Yields
    ------
    Job
        Subfolder, motor, bench, seed and tests of each motor. The gains of the station's
        instruments are drawn once, from the seed of the fleet; the seed of a motor follows from
        that and its name, so that a motor is the same in a fleet of any size.

    Raises
    ------
    ValueError
        A test of the plan is none of the campaign's.

    """
    words = _document("fleet", str(settings.fleet), settings.config_dir)
    document = _document("motor", str(words.get("motor")), settings.config_dir)
    many = fleet_from(words, document)
    settled = {**(document.get("bench") or {}), **(words.get("bench") or {})}
    bench = replace(bench_from(settled), station=many.station)
    plan = _plan(many.tests)
    drawn = EXACT if settings.exact else bench.drawn(np.random.default_rng(many.seed))
    for motor in many.motors:
        there = replace(bench, instruments=drawn, started_at=many.started_at[motor.motor_id])
        yield (
            file_stem(motor.motor_id),
            motor,
            there,
            seed_of(many.seed, motor.motor_id),
            plan,
        )


def _plan(tests: Sequence[str]) -> Plan:
    """The steps of the campaign of these names; raises ValueError for one that it has not."""
    known = [stem for stem, _, _ in CAMPAIGN]
    if stray := set(tests) - set(known):
        raise ValueError(f"no test {', '.join(sorted(stray))}; there are {', '.join(known)}")
    return tuple(step for step in CAMPAIGN if step[0] in tests)


def _document(kind: str, name: str, config_dir: str | None) -> dict[str, Any]:
    path = named_file(kind, name, config_dir)
    document = load_plain(path.read_bytes(), f"{kind}/{name}.yaml")
    if not isinstance(document, dict):
        raise UsageError(f"conf/{kind}/{name}.yaml holds no keys", "write `key: value` lines")
    return document


def simulated(
    motor: Motor, bench: Bench, seed: int, plan: Plan
) -> tuple[list[Recording], dict[str, Any]]:
    """The recordings of one simulated motor, and what is true of it.

    Parameters
    ----------
    motor
        The motor with its effects.
    bench
        The station that measures it.
    seed
        Of the noise of its instruments.
    plan
        The captures to record; the whole campaign where empty.

    Returns
    -------
    tuple of list of Recording and dict
        Recordings in the order of the plan, and the true parameters [SI] by name.

    Raises
    ------
    UsageError
        A size cannot be simulated.

    """
    try:
        return campaign(motor, bench, seed, plan), truth(motor)
    except ValueError as error:
        raise UsageError(f"simulate: {motor.motor_id}: {error}", "choose another size") from error
