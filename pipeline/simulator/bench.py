"""Recording tests: one by name, or a whole campaign of one motor."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.simulator import driven, protocols, standing, turning
from pipeline.simulator.design import Bench, Motor, Recording
from pipeline.simulator.plant import plant_of
from pipeline.simulator.sensors import Session
from pipeline.simulator.truth import truth

__all__ = ["CAMPAIGN", "campaign", "record", "truth"]

Table = dict[str, NDArray[np.float64]]

_TESTS: Mapping[str, tuple[type, Callable[[Session, Any], Recording]]] = {
    "resistance": (protocols.Resistance, standing.resistance),
    "current_step": (protocols.CurrentStep, standing.current_step),
    "lcr": (protocols.Lcr, standing.lcr),
    "open_circuit": (protocols.OpenCircuit, turning.open_circuit),
    "hand_turn": (protocols.HandTurn, turning.hand_turn),
    "cogging": (protocols.Cogging, turning.cogging),
    "torque_map": (protocols.TorqueMap, driven.torque_map),
    "spin_down": (protocols.SpinDown, turning.spin_down),
    "heat_run": (protocols.HeatRun, standing.heat_run),
    "holding_current": (protocols.HoldingCurrent, standing.holding_current),
    "flux_map": (protocols.FluxMap, standing.flux_map),
    "torque_table": (protocols.TorqueTable, standing.torque_table),
    "drive": (protocols.Drive, driven.drive),
}

CAMPAIGN: tuple[tuple[str, str, Mapping[str, Any]], ...] = (
    ("resistance_ab", "resistance", {"pair": "ab"}),
    ("resistance_bc", "resistance", {"pair": "bc"}),
    ("resistance_ca", "resistance", {"pair": "ca"}),
    ("resistance_ab_warm", "resistance", {"pair": "ab", "temp_degc": 62.0}),
    *(
        (f"current_step_{axis}_{k}", "current_step", {"theta_elec_deg": angle, "level": level})
        for axis, angle in (("d", -30.0), ("q", 60.0))
        for k, level in enumerate((0.15, 0.45, 0.9))
    ),
    ("lcr", "lcr", {}),
    ("open_circuit_forward", "open_circuit", {}),
    (
        "open_circuit_backward_warm",
        "open_circuit",
        {"levels": (-0.25, -0.5, -0.8), "temp_magnet_degc": 58.0},
    ),
    ("hand_turn", "hand_turn", {}),
    ("cogging_cw", "cogging", {"direction": 1}),
    ("cogging_ccw", "cogging", {"direction": -1}),
    ("torque_map_slow", "torque_map", {"speed": 0.2}),
    (
        "torque_map_fast",
        "torque_map",
        {"speed": 0.7, "id_levels": (-0.4, 0.0), "iq_levels": (-0.9, -0.45, 0.0, 0.45, 0.9)},
    ),
    (
        "torque_map_backward",
        "torque_map",
        {"speed": -0.45, "id_levels": (-0.4, 0.0), "iq_levels": (-0.8, -0.4, 0.0, 0.4, 0.8)},
    ),
    ("spin_down_forward", "spin_down", {"direction": 1}),
    ("spin_down_backward", "spin_down", {"direction": -1, "level": 0.8}),
    ("heat_run", "heat_run", {}),
    ("holding_current", "holding_current", {}),
    ("flux_map", "flux_map", {}),
    ("drive_0", "drive", {}),
    ("drive_1_warm", "drive", {"temp_winding_degc": 55.0, "temp_magnet_degc": 42.0}),
)


def record(
    test: str, motor: Motor, bench: Bench, rng: np.random.Generator, **protocol: Any
) -> Recording:
    """One capture of a test of `contract/capture.md`.

    Parameters
    ----------
    test
        Its name.
    motor
        Design and effects.
    bench
        The station; its gains are drawn from `rng` unless `bench.instruments` fixes them.
    rng
        Source of gains, noise and start angle.
    protocol
        Fields of the test's dataclass in `protocols`; `changed`: constants of the motor [units of
        `design.Motor`] that are others in this capture, such as a magnet that has lost flux;
        `changed_from`: of a torque map or a drive the share of the capture [1] from which on;
        `friction_over_time`: of a coast, a torque map or a drive pairs of time [s] and of the share
        of its friction [1] that the motor then has, linear between them.

    Returns
    -------
    Recording
        Tables of one clock each.

    Raises
    ------
    ValueError
        There is no such test.
    TypeError
        There is no such field of the protocol.

    """
    if test not in _TESTS:
        raise ValueError(f"no test {test}; there are {', '.join(_TESTS)}")
    other = replace(motor, **protocol.pop("changed", {}))
    since = protocol.pop("changed_from", 0.0)
    if since > 0.0 and test not in ("torque_map", "drive"):
        raise ValueError(f"nothing changes within a {test}")
    course = tuple(protocol.pop("friction_over_time", ()))
    if course and test not in ("torque_map", "drive", "spin_down"):
        raise ValueError(f"no friction changes within a {test}")
    motor = motor if since > 0.0 else other
    protocol_of, recorded = _TESTS[test]
    how = protocol_of(**protocol)
    plants = plant_of(motor), plant_of(other)
    session = Session(motor, plants[0], bench, bench.drawn(rng), rng, plants[1], since, course)
    recording = recorded(session, how)
    if bench.temperature_hz is None:
        return recording
    return replace(recording, tables=_by_rate(recording.tables[0], bench.temperature_hz))


def _by_rate(table: Table, rate_hz: float) -> tuple[Table, ...]:
    """Thermometers on a slower clock of their own, first and last instant kept."""
    slow = [name for name in table if name.startswith("temp_")]
    if "t_s" not in table or not slow or len(slow) + 1 == len(table):
        return (table,)
    t_s = table["t_s"]
    stride = round(1.0 / (rate_hz * float(t_s[1] - t_s[0])))
    if stride < 2:
        return (table,)
    rows = np.unique(np.append(np.arange(0, t_s.size, stride), t_s.size - 1))
    fast = {name: column for name, column in table.items() if name not in slow}
    return fast, {name: table[name][rows] for name in ("t_s", *slow)}


def campaign(
    motor: Motor, bench: Bench, seed: int, plan: tuple[tuple[str, str, Mapping[str, Any]], ...] = ()
) -> list[Recording]:
    """All captures of one motor on one station, whose gains are drawn once.

    Parameters
    ----------
    motor
        Design and effects.
    bench
        The station.
    seed
        Of the station's gains and of each capture.
    plan
        File stem, test and protocol of each capture; `CAMPAIGN` where empty.

    Returns
    -------
    list of Recording
        In order of the plan. Each has a generator of its own, by its place there: another protocol
        of one changes no other.

    """
    steps = plan or CAMPAIGN
    first, *rest = np.random.SeedSequence(seed).spawn(1 + len(steps))
    fixed = replace(bench, instruments=bench.drawn(np.random.default_rng(first)))
    done = []
    for child, (stem, test, protocol) in zip(rest, steps, strict=True):
        recording = record(test, motor, fixed, np.random.default_rng(child), **protocol)
        done.append(replace(recording, stem=stem))
    return done
