"""Torque maps of which a log keeps every twentieth row: steps of the current fall between two."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import pipeline
from pipeline.criticism.data.traces import pad_of, thinned
from pipeline.criticism.policy.policy import DEFAULT
from pipeline.criticism.signals.true_state import _speed
from pipeline.simulator.bench import CAMPAIGN, campaign
from pipeline.simulator.design import EXACT, Bench
from pipeline.simulator.effects import parameters
from tests.simulated import campaign_of, design

KEPT = 20


def found(tests: tuple[str, ...], dyno_hz: float, **effects: float) -> pipeline.Diagnosis:
    """The diagnosis of a servo by an encoder of 12 bits, its torque maps thinned to 1 kHz."""
    motor = replace(design("servo-ipm"), effects={}).having(**effects)
    bench = Bench(instruments=EXACT, dyno_hz=dyno_hz, encoder_bits=12, pwm_hz=20e3, noise_scale=0.3)
    plan = tuple(p for p in CAMPAIGN if p[0] in (*tests, "open_circuit_forward"))
    made = campaign_of(campaign(motor, bench, 2, plan))
    captures = tuple(
        replace(c, tables=(c.tables[0].gather_every(KEPT),)) if c.meta.test == "torque_map" else c
        for c in made.captures
    )
    whole = replace(made, captures=captures)
    return pipeline.diagnose(pipeline.Recordings({"m": whole}))["m"]


@pytest.mark.parametrize(
    ("test", "dyno_hz"),
    [
        ("torque_map_backward", 3.0),
        pytest.param("torque_map_slow", 0.0, marks=pytest.mark.slow),
    ],
)
def test_a_sound_motor_is_quiet_whatever_falls_between_two_rows(test, dyno_hz) -> None:
    """A dynamometer that gives way takes the torque of a step as acceleration, at an instant that
    no row shows: 85 floors. One that does not leaves the pulse of the voltage: 26.
    """
    diagnosis = found((test,), dyno_hz)
    assert (diagnosis.verdict, diagnosis.missing) == ("insufficient", ())
    assert diagnosis.ladder[-1].held_out < 1.1
    assert any("of one PWM period each" in note for note in diagnosis.notes)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["saturation", "iron_eddy", "load_dependent_friction", "windage"])
def test_what_a_thinned_map_shows_is_still_named(name) -> None:
    size = parameters(name, replace(design("servo-ipm"), effects={}))["size"]
    maps = ("torque_map_slow", "torque_map_fast", "torque_map_backward", "resistance_ab")
    diagnosis = found(maps, 3.0, **{name: size})
    assert (diagnosis.verdict, diagnosis.missing) == ("missing", (name,))
    assert diagnosis.ladder[0].held_out > 1.5 * diagnosis.ladder[-1].held_out


@pytest.mark.parametrize("rate_hz", [1e3, 10e3, 40e3, 100e3])
def test_a_speed_inside_a_window_is_that_of_the_whole_log(rate_hz: float) -> None:
    """At 40 kHz a speed is a mean of 81 rows, and 24 were kept beside a window."""
    policy, period = DEFAULT.cutting, 1.0 / rate_hz
    theta = 40.0 * np.sin(np.linspace(0.0, 30.0, 8000))
    columns = {"theta": theta, "row": np.arange(theta.size, dtype=np.float64)}
    kept, length = np.ones(theta.size, dtype=bool), 100
    cut, starts = thinned(columns, kept, length, 8, pad_of(period, policy))
    assert cut["theta"].size < theta.size
    inside = (starts[:, None] + np.arange(length)).ravel()
    whole = _speed(theta, period, 1, policy)[cut["row"][inside].astype(int)]
    assert _speed(cut["theta"], period, 1, policy)[inside] == pytest.approx(whole)
