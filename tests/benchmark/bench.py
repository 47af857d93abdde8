"""The motors and the test programme that every case of the benchmark is recorded with."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from types import MappingProxyType
from typing import Any

from pipeline.io.storage.plain_yaml import load_plain
from pipeline.settings import configuration_folder
from pipeline.simulator.catalogue import bench_from, motor_from
from pipeline.simulator.design import EXACT, Bench, Motor, Recording

MOTORS = ("gimbal-5208", "joint-11p", "servo-ipm")
Step = tuple[str, str, Mapping[str, Any]]

FLUX_STEPS = {
    "id_levels": (-0.4, 0.0),
    "iq_levels": (-0.9, -0.45, 0.0, 0.45, 0.9),
}
DRIVE = {"segments": 6}
PLAN: tuple[Step, ...] = (
    ("resistance_ab", "resistance", {"pair": "ab"}),
    ("resistance_bc", "resistance", {"pair": "bc"}),
    ("resistance_ca", "resistance", {"pair": "ca"}),
    *(
        (f"current_step_{axis}_{k}", "current_step", {"theta_elec_deg": angle, "level": level})
        for axis, angle in (("d", -30.0), ("q", 60.0))
        for k, level in enumerate((0.15, 0.45, 0.9))
    ),
    ("lcr", "lcr", {}),
    ("open_circuit_0", "open_circuit", {}),
    ("open_circuit_1", "open_circuit", {"levels": (-0.25, -0.5, -0.8), "temp_magnet_degc": 58.0}),
    ("cogging_cw", "cogging", {"direction": 1}),
    ("cogging_ccw", "cogging", {"direction": -1}),
    ("torque_map_0", "torque_map", {"speed": 0.2}),
    ("torque_map_1", "torque_map", {"speed": 0.7, **FLUX_STEPS}),
    ("torque_map_2", "torque_map", {"speed": -0.45, **FLUX_STEPS}),
    ("spin_down_0", "spin_down", {"direction": 1}),
    ("spin_down_1", "spin_down", {"direction": -1, "level": 0.8}),
    ("heat_run_0", "heat_run", {}),
    ("drive_0", "drive", DRIVE),
    ("drive_1", "drive", {**DRIVE, "temp_winding_degc": 55.0, "temp_magnet_degc": 42.0}),
)
STEMS = tuple(stem for stem, _, _ in PLAN)


@dataclass(frozen=True, slots=True)
class Station:
    """A motor without effects but those every motor has, its bench, and how tests are done on it.

    `plan` fixes what a test would otherwise choose from the motor's behaviour, so that captures
    with and without an effect share one clock.
    """

    motor: Motor
    bench: Bench
    plan: tuple[Step, ...]

    @property
    def quiet(self) -> Bench:
        """The bench without noise, gain errors or visible resolution."""
        return replace(self.bench, noise_scale=0.0, instruments=EXACT, adc_bits=44, encoder_bits=44)


@cache
def station(name: str) -> Station:
    """The station of a design of `conf/motor/`, the design's own effects left out."""
    document = load_plain(
        (configuration_folder() / "motor" / f"{name}.yaml").read_bytes(), f"{name}.yaml"
    )
    if not isinstance(document, dict):
        raise TypeError(f"conf/motor/{name}.yaml holds no keys")
    motor = replace(motor_from(document), effects=MappingProxyType({}))
    bench = replace(bench_from(document.get("bench") or {}), station="bench-1")
    return Station(motor, bench, tuple(_settled(motor, step) for step in PLAN))


def _settled(motor: Motor, step: Step) -> Step:
    """A step whose sampling rate does not hang on how long the motor coasts."""
    stem, test, how = step
    if test != "spin_down":
        return step
    from pipeline.simulator.standing import nice_rate

    slope = motor.b_visc_nm_s_rad * motor.speed_rated_rad_s / 2.0 + motor.torque_coulomb_nm
    coast_s = motor.j_rotor_kgm2 * motor.speed_rated_rad_s / slope
    return stem, test, {**how, "rate_hz": nice_rate(900.0 / coast_s)}


def recorded(
    motor: Motor, bench: Bench, plan: tuple[Step, ...], seed: int, keep: Iterable[str] = STEMS
) -> list[Recording]:
    """The campaign of a motor, captures not in `keep` left out without changing the others."""
    from pipeline.simulator.bench import campaign

    wanted = set(keep)
    if wanted >= {stem for stem, _, _ in plan}:
        return campaign(motor, bench, seed, plan)
    import numpy as np

    from pipeline.simulator.bench import record

    first, *rest = np.random.SeedSequence(seed).spawn(1 + len(plan))
    fixed = replace(bench, instruments=bench.drawn(np.random.default_rng(first)))
    done = []
    for child, (stem, test, how) in zip(rest, plan, strict=True):
        if stem in wanted:
            made = record(test, motor, fixed, np.random.default_rng(child), **how)
            done.append(replace(made, stem=stem))
    return done
