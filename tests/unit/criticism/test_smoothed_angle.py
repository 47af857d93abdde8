"""An acceleration that hides in the noise of a smoothed angle is no misfit of the torque."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.criticism.data.segment import UNSMOOTHED, row_index
from pipeline.criticism.design.planned_tests import planned
from pipeline.criticism.library.registry import effects
from pipeline.criticism.machine.model import BASE as CONSTANTS
from pipeline.criticism.machine.model import Model
from pipeline.criticism.regression.fit import Fit, floors
from pipeline.criticism.regression.noise_floors import noise_floor
from tests.unit.criticism.machines import BASE, log, machine


def test_what_smoothing_an_angle_changes_counts_as_noise_of_each_order() -> None:
    """A swing of 40 Hz was smoothed away: J times its acceleration is added in squares to the floor
    of the torque, as far as the windows see it, and nothing to speak of to orders far above it.
    """
    model = Model(machine(), (effects()["coulomb_friction"],))
    values = {c.name: BASE.get(c.name, 0.0) for c in CONSTANTS} | {
        "coulomb_friction.torque_nm": 0.01
    }
    segments = (log(),)
    fit = Fit(segments, model, values, floors(segments, model, values), values)
    segment = planned("torque_map", fit)[0]
    omega, size = 2.0 * np.pi * 40.0, 2e-5
    swing = size * np.sin(omega * segment.ts_s * np.arange(segment.size))
    theta = segment.recorded["theta_mech_rad"]
    rough = replace(segment, recorded={**segment.recorded, UNSMOOTHED: theta + swing})
    groups = row_index(segment)[3]
    added = dict(
        zip(
            groups,
            noise_floor(rough, model, values, 1) ** 2 - noise_floor(segment, model, values, 1) ** 2,
            strict=True,
        )
    )
    assert segment.weak is not None
    seen = segment.weak.project((values["j_kgm2"] * omega**2 * swing)[None])[0, :, 0]
    assert np.sqrt(added["torque_shaft_nm", 0]) == pytest.approx(
        np.sqrt(np.mean(seen**2)), rel=0.05
    )
    assert added["torque_shaft_nm", 84] < 0.01 * added["torque_shaft_nm", 0]
