"""What the equations of each kind of segment can tell of constants, hooks and sensors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from pipeline.criticism.data.segment import Kind, Segment
from pipeline.criticism.effect import Effect

_VOLTAGES = (
    "r_ohm",
    "ld_h",
    "lq_h",
    "ripple_slope",
    "ripple_mean",
    "ripple_edge",
    "ripple_shift",
    "ripple_torque",
    "ripple_held",
)


@dataclass(frozen=True, slots=True)
class Hearing:
    """The `constants` of the base that are in the equations of a kind of segment; of effects, the
    `hooks` (`flux`, `drop`, `torque`), and the sensors whose errors are (`angle`, `current`,
    `voltage`, `load`, `clock`).
    """

    constants: tuple[str, ...]
    hooks: frozenset[str]
    sensors: frozenset[str]


def _hears(constants: tuple[str, ...], hooks: str, sensors: str) -> Hearing:
    return Hearing(constants, frozenset(hooks.split()), frozenset(sensors.split()))


HEARS: Mapping[Kind, Hearing] = {
    "dq": _hears(
        (*_VOLTAGES, "psi_wb", "j_kgm2", "b_nm_s_rad"),
        "flux drop torque",
        "angle current voltage load clock",
    ),
    "q": _hears(("r_ohm", "lq_h", "psi_wb"), "flux drop", "angle current voltage clock"),
    "shaft": _hears(("j_kgm2", "b_nm_s_rad"), "torque", "angle load clock"),
    "motion": _hears(("psi_wb", "j_kgm2", "b_nm_s_rad"), "flux torque", "angle current clock"),
    "open": _hears(("psi_wb", "bench_angle_rad"), "flux", "angle voltage clock"),
    "terminal": _hears(("r_ohm", "ld_h", "lq_h"), "flux drop", "current voltage clock"),
    "flux_map": _hears(("ld_h", "lq_h", "psi_wb"), "flux", "current voltage"),
    "steady": _hears(("r_ohm", "ld_h", "psi_wb"), "flux drop", "current voltage"),
    "standing": _hears(("psi_wb",), "flux torque", "current"),
    "lcr": _hears(("r_ohm", "ld_h", "lq_h"), "", ""),
}
"""An LCR meter is an instrument of its own, and what it reads of an effect is in no hook alone: its
columns are computed without asking here."""


def hears_sensor(segment: Segment, sensor: str) -> bool:
    """Whether an error of a sensor is in a segment's equations."""
    if sensor == "load" and "torque_shaft_nm" not in segment.channels:
        return False
    return sensor in HEARS[segment.kind].sensors


def hears(segment: Segment, effect: Effect) -> bool:
    """Whether what an effect does is in a segment's equations at all."""
    if effect.hook == "sensor":
        return any(hears_sensor(segment, sensor) for sensor in _sensors_of(effect))
    without_torque = segment.kind == "dq" and "torque_shaft_nm" not in segment.channels
    if effect.hook == "torque" and without_torque:
        return False
    return effect.hook in HEARS[segment.kind].hooks


def _sensors_of(effect: Effect) -> tuple[str, ...]:
    hooks = {
        "angle": (effect.angle,),
        "current": (effect.current,),
        "voltage": (effect.voltage,),
        "load": (effect.load, effect.shaft),
        "clock": (effect.clock,),
    }
    return tuple(name for name, any_of in hooks.items() if any(h is not None for h in any_of))
