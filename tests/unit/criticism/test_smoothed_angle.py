"""An acceleration that hides in the noise of a smoothed angle is no misfit of the torque."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.criticism.data.segment import UNSMOOTHED, Segment, row_index
from pipeline.criticism.design.experiments import planned
from pipeline.criticism.library.registry import effects
from pipeline.criticism.machine.model import BASE as CONSTANTS
from pipeline.criticism.machine.model import Model
from pipeline.criticism.regression.fit import Fit, floors
from pipeline.criticism.regression.noise_propagation import noise_floor
from tests.unit.criticism.machines import BASE, log, machine


def _of_groups(segment: Segment, rows: np.ndarray) -> dict[tuple[str, float], float]:
    """What the weak samples of each (channel, order) have in common."""
    group, _, valid, groups = row_index(segment)
    return {
        one: float(rows[group[valid] == place].mean())
        for place, one in enumerate(groups)
        if np.any(group[valid] == place)
    }


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
    change = noise_floor(rough, model, values, 1) ** 2 - noise_floor(segment, model, values, 1) ** 2
    added = _of_groups(segment, change)
    assert segment.weak is not None
    seen = segment.weak.project((values["j_kgm2"] * omega**2 * swing)[None])[0, :, 0]
    assert np.sqrt(added["torque_shaft_nm", 0]) == pytest.approx(
        np.sqrt(np.mean(seen**2)), rel=0.05
    )
    assert added["torque_shaft_nm", 84] < 0.01 * added["torque_shaft_nm", 0]


def test_the_slow_part_of_an_encoders_noise_stays_in_a_smoothed_angle() -> None:
    """A parabola of 21 samples, a millisecond, takes nothing from noise that is as slow as a
    window: the torque's floor at order 0 is that of the angle as it was, far above that of white
    noise as small as what is left.
    """
    model = Model(machine(), ())
    values = {c.name: BASE.get(c.name, 0.0) for c in CONSTANTS}
    segments = (log(),)
    fit = Fit(segments, model, values, floors(segments, model, values), values)
    plain = planned("torque_map", fit)[0]
    sigma = 1e-4

    def floor(size: float, parabola: int) -> float:
        noise = {**dict.fromkeys(plain.sensors.noise, 0.0), "theta_mech_rad": size}
        sensors = replace(plain.sensors, noise=noise, steps={}, parabola=parabola)
        found = noise_floor(replace(plain, sensors=sensors), model, values, 1)
        return _of_groups(plain, found)["torque_shaft_nm", 0]

    left = sigma * np.sqrt(2.25 / 21)
    assert floor(left, 21) == pytest.approx(floor(sigma, 1), rel=0.15)
    assert floor(left, 21) > 2.0 * floor(left, 1)
