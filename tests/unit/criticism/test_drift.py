"""Instruments that wander, told from effects by what a slow random walk can make."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.criticism.data.segment import Sensors
from pipeline.criticism.discovery.unknown_structure import unknown_structure
from pipeline.criticism.machine.model import Model
from pipeline.criticism.policy.policy import DEFAULT
from pipeline.criticism.regression.fit import Fit, floors
from pipeline.criticism.regression.gauss_newton import gauss_newton
from pipeline.criticism.regression.goodness import remainder
from pipeline.criticism.regression.linearise import linearise
from pipeline.criticism.regression.noise_floors import Floor
from pipeline.criticism.selection.drift import drifting_segments, slowest, with_drift
from tests.unit.criticism.machines import BASE, log, machine


def walked(seed: int, test: str, size: float = 3.0):
    """A log whose voltages, currents and torque walk by `size` times their noise to its end."""
    segment = log(noise=1.0, seed=seed)
    rng = np.random.default_rng([seed, 7])
    n = segment.size
    noise = segment.sensors.noise
    moved = {
        name: column + size * noise[name] * rng.standard_normal(n).cumsum() / np.sqrt(n)
        for name, column in segment.recorded.items()
        if name.startswith(("v", "i", "torque"))
    }
    return replace(
        segment, test=test, capture=f"{test}.mcap", recorded={**segment.recorded, **moved}
    )


def fitted(segments):
    model = Model(machine(), ())
    start = Fit(segments, model, dict(BASE), floors(segments, model, BASE), BASE)
    system = gauss_newton(start)
    return system, remainder(system)


def test_the_slowest_sines_have_the_variance_of_a_random_walk():
    time = np.linspace(0.0, 1.0, 20_001)
    sines = slowest(3.0 + 7.0 * time, 8)
    assert (sines**2).sum(axis=0) == pytest.approx(time, abs=0.03)
    gram = np.trapezoid(sines[:, None] * sines[None], time)
    assert gram - np.diag(np.diag(gram)) == pytest.approx(np.zeros((8, 8)), abs=1e-6)


def test_a_walk_of_its_size_is_all_but_noise_once_it_is_known():
    """χ²/n of the torque before and after, over twenty walks; the faster tail of a walk is left."""
    model, over, known = Model(machine(), ()), [], []
    for seed in range(20):
        segment = walked(seed, "drive", 4.0)
        sigma = floors((segment,), model, BASE)[0]
        for one, found in ((segment, over), (with_drift(segment, model, BASE), known)):
            rows = linearise(one, model, BASE, [], Floor(sigma, BASE))
            mine = [n for n, (channel, k) in enumerate(rows.groups) if channel[0] == "t" and k == 0]
            found.append(float((rows.residual[np.isin(rows.group, mine)] ** 2).mean()))
    assert np.median(over) > 100.0
    assert np.median(known) < 10.0


@pytest.mark.slow
def test_wander_in_captures_of_two_tests_leaves_nothing():
    segments = (walked(5, "torque_map"), walked(6, "drive"))
    system, left = fitted(segments)
    assert len({one.capture for one in left}) == 2
    told = drifting_segments(system.fit, left)
    assert told is not None
    assert told[0].disturbances.lines.shape[0] == 5 * 8


def test_in_captures_of_one_test_it_may_be_the_machine():
    segments = (walked(5, "drive"), replace(walked(6, "drive"), capture="drive_1.mcap"))
    system, left = fitted(segments)
    assert left
    assert drifting_segments(system.fit, left) is None


@pytest.mark.slow
def test_wander_follows_no_state_of_the_machine_and_a_drag_does():
    """What tells the two apart, since a drag in logs as short as these is slow as well."""

    def dragged(segment):
        omega = np.gradient(log().recorded["theta_mech_rad"], segment.ts_s)
        torque = segment.recorded["torque_shaft_nm"] - 0.2 * np.sin(omega / 60.0)
        return replace(segment, recorded={**segment.recorded, "torque_shaft_nm": torque})

    pairs = ((5, "torque_map"), (6, "drive"), (8, "heat_run"))
    walks = tuple(walked(seed, test) for seed, test in pairs)
    drags = tuple(dragged(walked(seed, test, 0.0)) for seed, test in pairs)
    for segments, told in ((walks, False), (drags, True)):
        system, left = fitted(segments)
        assert left
        sketch, _ = unknown_structure(system, sorted({one.signal for one in left}))
        assert (sketch is not None) is told


@pytest.mark.slow
def test_a_walk_far_beyond_the_noise_stays_a_remainder():
    size = DEFAULT.selection.drift_size
    segments = (walked(5, "torque_map", 60 * size), walked(6, "drive", 60 * size))
    system, left = fitted(segments)
    assert drifting_segments(system.fit, left) is None


@pytest.mark.parametrize(("large", "noise"), [(False, True), (True, False)])
def test_what_is_small_for_the_machine_stops_no_wander(large: bool, noise: bool, monkeypatch):
    """At standstill half a per cent of R i is told, which an instrument's walk leaves as well."""
    segments = (walked(5, "torque_map"), walked(6, "drive"))
    system, left = fitted(segments)

    def still_left(*_, **asked):
        return left if large or not asked.get("large") else ()

    monkeypatch.setattr("pipeline.criticism.selection.drift.remainder", still_left)
    assert (drifting_segments(system.fit, left) is not None) is noise


def test_a_sensor_that_the_segment_does_not_hold_drifts_nowhere():
    segment = walked(5, "drive")
    more = replace(segment, sensors=Sensors({**segment.sensors.noise, "vdc_v": 0.1}))
    drifting = (with_drift(one, Model(machine(), ()), BASE) for one in (segment, more))
    assert np.array_equal(*(one.disturbances.lines for one in drifting))
