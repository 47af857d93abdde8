"""World `maker`: this project's simulator, recorded by somebody who has a drive and a multimeter.

The plant is no one else's, but the programme is one that other worlds do not have: rows of a
millisecond of a drive that switches twenty times in one, between which the rotor turns by radians;
no torque, one resistance, one trace of a scope, one coast. Stations of even numbers log the mean of
the voltage about each row, those of odd numbers the vector of its instant.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from pipeline.records.capture import Campaign
from pipeline.simulator.bench import campaign as recorded
from pipeline.simulator.design import Bench, Motor
from pipeline.simulator.effects import parameters
from pipeline.simulator.outside import with_unknown
from tests.benchmark.bench import station
from tests.benchmark.sealing import MOTOR_TYPE, captures
from tests.benchmark.worlds.case import WorldCase
from tests.benchmark.worlds.lanes import Array

MOTORS = ("drone-2306", "gimbal-5208", "joint-11p")
EFFECTS: Mapping[str, tuple[str, ...]] = {
    "maker": (
        "dead_time",
        "cogging",
        "bemf_harmonics",
        "current_gain",
        "current_offset",
        "sample_delay",
        "angle_eccentricity",
        "stribeck",
        "windage",
        "unbalance",
        "iron_eddy",
    )
}
PAIRS = (("dead_time", "cogging"), ("bemf_harmonics", "stribeck"), ("current_offset", "windage"))
OUTSIDE = ("eddy_brake", "tight_spot")

PERIODS = 20
"""PWM periods a row."""
BENCH = Bench(
    station="desk-1",
    pwm_hz=20_000.0,
    adc_bits=14,
    encoder_bits=14,
    current_noise_rel=8e-4,
    u_rel_current=1e-2,
    u_rel_voltage=5e-3,
    u_temp_degc=1.5,
)
SPEEDS = (0.8, 0.3, 0.6, 0.04)
"""Top speed of each drive log [of the usable one]."""
PLAN: tuple[tuple[str, str, Mapping[str, Any]], ...] = (
    ("resistance_ab", "resistance", {"pair": "ab"}),
    ("open_circuit_0", "open_circuit", {"levels": (0.3, 0.6, 0.9)}),
    ("spin_down_0", "spin_down", {}),
    *(
        (f"drive_{k}", "drive", {"speed": speed, "load": 0.0, "segment_s": 0.7})
        for k, speed in enumerate(SPEEDS)
    ),
)


def campaign(case: WorldCase) -> Campaign:
    """The campaign of a case, as the reader would hand it on."""
    hidden = replace(_hidden(case), motor_id=f"M{case.key[:10]}", motor_type=MOTOR_TYPE)
    timing = ("centred", "instant")[case.seed % 2]
    plan = tuple(
        (stem, test, {**how, "voltage_timing": timing} if test == "drive" else how)
        for stem, test, how in PLAN
    )
    made = [
        replace(one, tables=(_telemetry(one.tables[0], timing),)) if "drive" in one.stem else one
        for one in recorded(hidden, BENCH, case.seed, plan)
    ]
    return Campaign(hidden.motor_id, captures(made))


def _hidden(case: WorldCase) -> Motor:
    """The motor of a case with what is hidden in it."""
    motor = station(MOTORS[case.seed % len(MOTORS)]).motor
    if case.outside:
        ((name, share),) = case.effects.items()
        return with_unknown(motor, name, share)
    sizes = {n: share * parameters(n, motor)["size"] for n, share in case.effects.items()}
    return motor.having(**sizes)


def _telemetry(table: Mapping[str, Array], timing: str) -> dict[str, Array]:
    """Every twentieth row of a log, its voltage there or the mean about it, without a torque."""
    rows = table["t_s"].size // PERIODS
    slow = {name: column[::PERIODS][:rows] for name, column in table.items()}
    if timing == "centred":
        for name in ("vd_v", "vq_v"):
            padded = np.pad(table[name], PERIODS // 2, mode="edge")
            slow[name] = padded[: rows * PERIODS].reshape(rows, PERIODS).mean(axis=1)
    return {name: column for name, column in slow.items() if name != "torque_shaft_nm"}
