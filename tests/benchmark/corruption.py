"""What no model covers: drift, mains hum, and noise other than the bench states."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pipeline.simulator.design import Bench, Motor, Recording

Array = NDArray[np.float64]
MAINS_HZ = (50.0, 60.0)
STATED = ("u_rel_current", "u_rel_voltage", "u_rel_torque")


def corrupted(
    recordings: list[Recording], kind: str, motor: Motor, bench: Bench, rng: np.random.Generator
) -> list[Recording]:
    """The recordings with one kind of corruption on every voltage, current and torque.

    Raises ValueError for a kind that is not `clean`, `drift`, `hum` or `mis-stated noise`.
    """
    if kind == "clean":
        return recordings
    if kind not in ("drift", "hum", "mis-stated noise"):
        raise ValueError(f"no corruption {kind}")
    mains = float(rng.choice(MAINS_HZ))
    strength = float(rng.uniform(1.0, 4.0))
    shares = rng.uniform(0.5, 1.0, 3)
    done = []
    for recording in recordings:
        table = dict(recording.tables[0])
        for name, true in recording.tables[0].items():
            sigma = noise_of(name, motor, bench)
            if sigma == 0.0 or "t_s" not in table:
                continue
            size = sigma * strength * float(shares["vit".index(name[0])])
            table[name] = true + _added(kind, size, table["t_s"], mains, rng)
        meta = dict(recording.meta)
        if kind == "mis-stated noise":
            for key in STATED:
                meta[key] = f"{float(meta[key]) / strength:.4g}"
        done.append(replace(recording, meta=meta, tables=(table, *recording.tables[1:])))
    return done


def noise_of(column: str, motor: Motor, bench: Bench) -> float:
    """Sensor noise of a column that may be corrupted, 0 for all others [its unit]."""
    if column == "torque_shaft_nm":
        return bench.torque_noise_rel * motor.torque_rated_nm
    if column.startswith("v") and column.endswith("_v"):
        return bench.voltage_noise_rel * motor.vdc_v
    if column.startswith("i") and column.endswith("_a"):
        return bench.current_noise_rel * motor.current_rated_a
    return 0.0


def _added(kind: str, size: float, t_s: Array, mains_hz: float, rng: np.random.Generator) -> Array:
    n = t_s.size
    if kind == "drift":
        walk: Array = size * np.cumsum(rng.standard_normal(n)) / math.sqrt(n)
        return walk
    if kind == "hum":
        phase = rng.uniform(0.0, 2.0 * math.pi, 2)
        turn = 2.0 * math.pi * mains_hz * t_s
        wave: Array = size * (np.sin(turn + phase[0]) + 0.3 * np.sin(3.0 * turn + phase[1]))
        return wave
    noise: Array = size * rng.standard_normal(n)
    return noise
