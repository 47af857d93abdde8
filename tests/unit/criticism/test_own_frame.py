"""Open terminals without an encoder, beside logs whose encoder is off its centre."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.criticism.data.machine_scale import machine_of
from pipeline.criticism.diagnosis import diagnose
from pipeline.criticism.library.registry import effects
from pipeline.criticism.machine.model import Model
from pipeline.criticism.regression.gauss_newton import start_values
from pipeline.criticism.residuals.residual import residual
from pipeline.criticism.residuals.segments import segments
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants
from pipeline.simulator.bench import campaign
from pipeline.simulator.design import Bench
from tests.simulated import campaign_of, design

MOTOR = replace(design("gimbal-5208"), effects={})
PLAN = (
    ("open_circuit", "open_circuit", {}),
    ("drive_0", "drive", {"load": 0.0}),
    ("drive_1", "drive", {"load": 0.0}),
    ("spin_down", "spin_down", {}),
)
ENCODER = ("theta_mech_rad", "omega_mech_rad_s")


def telemetry(motor):
    """A drive's logs without a transducer, a coast, and terminals that a scope alone recorded."""
    whole = campaign_of(campaign(motor, Bench(), 4, PLAN))
    captures = []
    for one in whole.captures:
        gone = ["torque_shaft_nm", *(ENCODER if one.meta.test == "open_circuit" else ())]
        captures.append(replace(one, tables=tuple(t.drop(gone, strict=False) for t in one.tables)))
    return replace(whole, captures=tuple(captures))


@pytest.mark.parametrize("name", ["angle_eccentricity", "angle_offset"])
def test_no_error_of_an_encoder_is_in_the_frame_of_the_voltage(name):
    part = telemetry(MOTOR)
    machine = machine_of(part, Constants())
    model = Model(machine, (effects()[name],))
    plain = start_values(model, machine)
    amplitude = next(key for key in plain if key.startswith(name))
    for segment in segments(part, machine):
        change = residual(segment, model, {**plain, amplitude: 0.01}) - residual(
            segment, model, plain
        )
        assert bool(np.any(change)) == (segment.test != "open_circuit")


@pytest.mark.slow
def test_an_encoder_off_its_centre_is_found_beside_a_scope():
    found = diagnose(telemetry(MOTOR.having(angle_eccentricity=0.01)), ModelSpec(), Constants())
    assert found.missing == ("angle_eccentricity",)
    size = np.hypot(
        *(
            found.ladder[-1].parameters[f"angle_eccentricity.{one}_rad"][0]
            for one in ("sine", "cosine")
        )
    )
    assert size == pytest.approx(0.01, rel=0.03)
