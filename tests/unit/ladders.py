"""A diagnosis of two steps with maps, as the page and the recording get it."""

from __future__ import annotations

import numpy as np

from pipeline.records.diagnosis import (
    Diagnosis,
    RankedEffect,
    Remainder,
    ReportedParameter,
    Signature,
    SketchTerm,
    StepError,
    StepRecord,
    Unexcited,
    UnknownStructure,
)
from pipeline.records.error_map import Bins, ErrorMap, Histogram

SPEED = Bins("omega_mech_rad_s", (-200.0, -100.0, 0.0, 100.0, 200.0))
CURRENT = Bins("iq_a", (-15.0, -5.0, 5.0, 15.0))
TURN = Bins("theta_elec_rad", tuple(np.linspace(0.0, 2 * np.pi, 9).tolist()))


def make_map(scale: float) -> ErrorMap:
    """Voltage errors that go with the current, in volts; one corner was never visited."""
    mean = scale * np.array(
        [[-0.2, -0.19, -0.2, -0.21], [0.0, 0.01, 0.0, 0.0], [0.2, 0.2, 0.19, 0]]
    )
    mean[2, 3] = np.nan
    count = np.where(np.isfinite(mean), 12, 0)
    p_value = np.where(np.abs(mean) > 0.1, 1e-9, 0.4)
    p_value[2, 3] = np.nan
    return ErrorMap("vq_v", "V", SPEED, CURRENT, count, mean, p_value, 0.9, 1e-12)


def make_turn(scale: float) -> ErrorMap:
    mean = scale * np.array([1.0, 0.5, -0.5, -1.0, -0.5, 0.25, 0.5, 0.75]) * 1e-3
    return ErrorMap(
        "vq_v", "V", TURN, None, np.full(8, 90), mean, np.full(8, 0.5), 0.1, float("nan")
    )


def make_signature() -> Signature:
    at = tuple(np.linspace(-15.0, 15.0, 11).tolist())
    before = tuple((0.18 * np.sign(np.array(at))).tolist())
    return Signature("vq_v", "V", "iq_a", "drive_0.mcap", at, before, (0.001,) * 11)


def make_step(effects: tuple[str, ...], scale: float) -> StepRecord:
    parameters = {"coulomb_friction.torque_nm": ReportedParameter(0.004, 1e-5, "N·m")}
    if effects:
        parameters["dead_time.loss_v"] = ReportedParameter(0.1799, 1.2e-4, "V")
    errors = {"vq_v": StepError(0.13 * scale, 2e-3, "V"), "v_pair_v": StepError(5e-4, 5e-4, "V")}
    edges = tuple(np.linspace(-8.0, 8.0, 9).tolist())
    return StepRecord(
        effects,
        20.5 * scale,
        {"vq_v": 0.13 * scale, "v_pair_v": 5e-4},
        errors,
        parameters,
        (make_map(scale), make_turn(scale)),
        (Histogram("vq_v", edges, (0, 1, 5, 20, 18, 6, 0, 2)),),
        make_signature() if effects else None,
    )


def make_diagnosis(motor_id: str = "joint-P1", *, unknown: bool = False) -> Diagnosis:
    found = RankedEffect(
        "dead_time",
        4321.0,
        0.93,
        1e-30,
        ("phase_imbalance",),
        "each phase loses V; offset at small current",
        "low-speed current steps",
        {"loss_v": ReportedParameter(0.1799, 1.2e-4, "V")},
        headline="voltage lost in the inverter, 179.90 ± 0.24 mV a phase",
    )
    other = RankedEffect("windage", -12.0, 0.0, 0.3, (), "c ω|ω|", "a spin-down", {})
    terms = (SketchTerm("at iq_a = 4", 0.12, "V"),)
    structure = UnknownStructure("vq_v", ("iq_a",), "odd in iq_a", terms)
    return Diagnosis(
        motor_id,
        "standard",
        "unknown" if unknown else "missing",
        ("dead_time",),
        (found, other),
        (make_step((), 1.0), make_step(("dead_time",), 0.02)),
        structure if unknown else None,
        (Remainder("drive_0.mcap", "vq_v", 0, 3.5, 4e-3),),
        (),
        (Unexcited("compliance", ("torque_map",), "a torque step"),),
    )
