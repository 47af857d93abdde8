"""Mains hum: found where it is, not taken from the shaft, and no longer in the way."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.criticism.data.segment import Instrument, Sensors
from pipeline.criticism.machine.model import Model
from pipeline.criticism.regression.linearise import absorb, linearise
from pipeline.criticism.regression.mains_hum import Hum, hum_notes, hum_of, with_hum
from pipeline.criticism.regression.noise_floors import Floor
from pipeline.criticism.regression.noise_propagation import noise_floor
from pipeline.numerics.projection import projection
from tests.unit.criticism.machines import BASE, log, machine

PLAIN = Model(machine(), ())


def with_line(segment, name, rms, freq, phase):
    time = np.arange(segment.size) * segment.ts_s
    wave = np.sqrt(2.0) * rms * np.sin(2.0 * np.pi * freq * time + phase)
    return replace(segment, recorded={**segment.recorded, name: segment.recorded[name] + wave})


def recording(n=8000, seed=5):
    """A log in white noise, of a capture of its own."""
    return replace(log(n, seed, 1.0), capture=f"{seed}.mcap")


def logs(rms=0.0, freq=50.0, count=3, n=8000):
    return [
        with_line(recording(n, seed), "vq_v", rms, freq, 0.7 * seed) for seed in range(5, 5 + count)
    ]


def test_a_line_is_found_with_its_size_in_the_signal_that_has_it():
    (hum,) = hum_of(logs(rms=0.02), PLAIN, BASE)
    assert (hum.kind, hum.signal, hum.freq_hz) == ("dq", "vq_v", 50.0)
    assert hum.rms == pytest.approx(0.02, rel=0.15)
    assert hum_notes([hum]) == ("mains hum in vq_v at 50 Hz, 0.02 rms: taken as noise",)


@pytest.mark.parametrize("freq", [40.0, 73.0])
def test_no_other_line_is_the_mains(freq):
    assert hum_of(logs(rms=0.02, freq=freq), PLAIN, BASE) == ()


@pytest.mark.slow
def test_white_noise_hums_in_none_of_forty_programmes():
    for first in range(0, 120, 3):
        recorded = [recording(seed=first + n) for n in range(3)]
        assert hum_of(recorded, PLAIN, BASE) == ()


def test_two_captures_alone_do_not_make_a_building():
    assert hum_of(logs(rms=0.02, count=2), PLAIN, BASE) == ()
    twice = [one for one in logs(rms=0.02, count=2) for _ in range(3)]
    assert hum_of(twice, PLAIN, BASE) == ()


def test_captures_of_any_signal_make_a_building():
    """Two drive logs and two spins of an open winding have it in signals of their own."""
    made = [*logs(rms=0.02, count=2), *(spin(n, 0.02) for n in range(2))]
    lines = hum_of(made, PLAIN, TURNED)
    assert {("dq", "vq_v"), ("open", "vbc_v")} <= {(one.kind, one.signal) for one in lines}


def test_once_a_turn_of_a_steady_shaft_is_not_taken_for_it():
    """A shaft at 3000 rpm has its own line at 50 Hz."""
    made = []
    for one in logs(rms=0.02):
        theta = 2.0 * np.pi * 50.0 * np.arange(one.size) * one.ts_s
        made.append(replace(one, recorded={**one.recorded, "theta_mech_rad": theta}))
    assert not [h for h in hum_of(made, PLAIN, BASE) if h.freq_hz == 50.0]


def cut_to_windows(segment, rate_hz, kept=120):
    """The log thinned to windows that come at an even rate; its angle goes on between them."""
    step = round(1.0 / (rate_hz * segment.ts_s))
    rows = (np.arange(0, segment.size - kept, step)[:, None] + np.arange(kept)).ravel()
    signals = {name: column[rows] for name, column in segment.recorded.items()}
    return replace(segment, recorded={**signals, "t_s": rows * segment.ts_s})


@pytest.mark.parametrize("rate_hz", [50.0, 60.0])
def test_what_a_thinned_log_leaves_between_its_windows_is_no_hum(rate_hz):
    """The flux has moved on over every gap: spikes of the back-EMF's size, at the windows' rate."""
    recorded = [cut_to_windows(recording(seed=n), rate_hz) for n in range(4)]
    assert hum_of(recorded, PLAIN, BASE) == ()


def test_hum_is_found_in_a_thinned_log():
    """On the log's own clock: where a third of every 30 ms is left out, cycles are left out."""
    long = logs(0.1, n=40_000)
    recorded = [cut_to_windows(one, 33.0, 400) for one in long]
    (hum,) = hum_of(recorded, PLAIN, BASE)
    assert (hum.signal, hum.freq_hz) == ("vq_v", 50.0)
    assert hum.rms == pytest.approx(0.1, rel=0.02)


def test_windows_of_a_thinned_log_may_overlap():
    """Rows come twice then, and from one window to the next no time goes by."""
    recorded = [cut_to_windows(one, 50.0, 401) for one in logs(0.1)]
    assert min(np.diff(recorded[0].recorded["t_s"])) == 0.0
    found = hum_of(recorded, PLAIN, BASE)
    assert [(hum.signal, hum.freq_hz) for hum in found] == [("vq_v", 50.0)]


def with_bump(one, middle_s, width_s):
    """The log with 50 Hz in vq_v that comes and goes."""
    time = np.arange(one.size) * one.ts_s
    bump = np.exp(-0.5 * ((time - middle_s) / width_s) ** 2) * np.sin(2.0 * np.pi * 50.0 * time)
    return replace(one, recorded={**one.recorded, "vq_v": one.recorded["vq_v"] + 0.1 * bump})


def test_what_swells_with_the_recording_is_no_hum():
    """A line of no one size is the machine's: a fault that grows with speed or current."""
    assert hum_of([with_bump(one, 0.1, 1.0) for one in logs()], PLAIN, BASE)
    assert hum_of([with_bump(one, 0.1, 0.022) for one in logs()], PLAIN, BASE) == ()


def test_what_every_step_of_a_test_begins_with_is_no_hum():
    """Steps come at round rates; what is left of a current's settling comes at theirs."""
    made = []
    for one in logs():
        settling = 0.2 * np.exp(-(np.arange(one.size) % 400) / 40.0)
        signals = {**one.recorded, "vq_v": one.recorded["vq_v"] + settling}
        made.append(cut_to_windows(replace(one, recorded=signals), 50.0, 300))
    assert hum_of(made, PLAIN, BASE) == ()


def test_hum_of_the_size_of_the_signals_is_no_instrument_s():
    assert hum_of(logs(rms=0.15), PLAIN, BASE)
    assert hum_of(logs(rms=0.25), PLAIN, BASE) == ()


def missed(segment, lines):
    """χ²/n of vq_v where the lines `lines` are known."""
    sigma = noise_floor(segment, PLAIN, BASE, 1)
    (known,) = with_hum([segment], lines, PLAIN, BASE)
    rows = linearise(known, PLAIN, BASE, [], Floor(sigma, BASE))
    mine = [n for n, (channel, _) in enumerate(rows.groups) if channel == "vq_v"]
    return float((rows.residual[np.isin(rows.group, mine)] ** 2).mean())


def test_a_line_that_is_known_no_longer_misses_the_floor():
    (segment,) = logs(rms=0.05, count=1)
    assert missed(segment, []) > 5.0
    assert missed(segment, [Hum("dq", "vq_v", 50.0, 0.05)]) < 1.5


def test_in_a_log_thinned_to_its_windows_it_goes_on_between_them():
    """Taken for a log without gaps, hum of a torque map was left over and called unknown."""
    segment = log(seed=5, noise=1.0)
    time = np.arange(segment.size) * segment.ts_s
    time[segment.size // 2 :] += 0.0137
    wave = np.sqrt(2.0) * 0.05 * np.sin(2.0 * np.pi * 50.0 * time)
    signals = {**segment.recorded, "vq_v": segment.recorded["vq_v"] + wave, "t_s": time}
    assert missed(replace(segment, recorded=signals), [Hum("dq", "vq_v", 50.0, 0.05)]) < 1.5


def test_sensors_of_current_have_it_too_in_multiples_of_their_noise():
    segment = log(seed=5, noise=1.0)
    rms = 20.0 * segment.sensors.noise["iq_a"]
    told = Hum("dq", "vq_v", 50.0, 20.0 * segment.sensors.noise["vq_v"])
    humming = with_line(segment, "iq_a", rms, 50.0, 0.7)
    assert missed(humming, []) > 5.0
    assert missed(humming, [told]) < 1.5


def spin(seed, rms=0.0, freq=50.0, zero_rad=0.3, n=40_000, rad_s=43.7):
    """An open winding at speed in white noise, hum in one of its three line voltages."""
    random = np.random.default_rng(seed)
    time = 5e-5 * np.arange(n)
    theta = rad_s * time
    eps = 7 * theta - zero_rad
    stationary = 1j * 7 * rad_s * BASE["psi_wb"] * np.exp(1j * eps)
    a, b, c = ((stationary * np.exp(-2j * np.pi * k / 3)).real for k in range(3))
    lines = {"vab_v": a - b, "vbc_v": b - c, "vca_v": c - a}
    lines = {name: line + 5e-3 * random.standard_normal(n) for name, line in lines.items()}
    made = replace(
        log(n),
        capture=f"spin_{seed}.mcap",
        kind="open",
        instrument=Instrument("bench", "instant"),
        test="open_circuit",
        recorded={**lines, "theta_mech_rad": theta},
        sensors=Sensors({**dict.fromkeys(lines, 5e-3), "theta_mech_rad": 1e-6}),
        channels=("vd_v", "vq_v"),
        weak=projection(theta, np.arange(40, n - 440, 200), 400, ()),
    )
    return with_line(made, "vbc_v", rms, freq, seed)


TURNED = {**BASE, "bench_angle_rad": 0.3}


def test_hum_of_an_open_winding_is_that_of_its_lines():
    """In the rotor's frame it is two lines, at 50 Hz less and more than the field turns."""
    lines = hum_of([spin(n, 0.02) for n in range(3)], PLAIN, TURNED)
    assert {(one.kind, one.freq_hz) for one in lines} == {("open", 50.0)}
    loud = max(lines, key=lambda one: one.rms)
    # the mean of three lines is nothing: the one with hum keeps two thirds of it
    assert loud.signal == "vbc_v"
    assert loud.rms == pytest.approx(0.02 * 2 / 3, rel=0.1)
    assert hum_of([spin(n) for n in range(3)], PLAIN, TURNED) == ()


def test_an_open_winding_s_hum_no_longer_misses_the_floor():
    one = spin(4, 0.02)
    lines = hum_of([spin(n, 0.02) for n in range(3)], PLAIN, TURNED)
    sigma = noise_floor(one, PLAIN, TURNED, 1)
    spreads = []
    for (known,) in ((one,), with_hum([one], lines, PLAIN, TURNED)):
        rows = linearise(known, PLAIN, TURNED, [], Floor(sigma, TURNED))
        spreads.append(float((rows.residual**2).mean()))
    assert spreads[0] > 5.0
    assert spreads[1] < 1.5


def test_a_short_capture_tells_what_it_holds_eight_cycles_of():
    """150 ms are too short for 50 Hz and long enough for its third harmonic; of 60 Hz they hold
    nine cycles, but cannot tell it from 50.
    """
    short = logs(0.05, 150.0, n=3000)
    assert {one.freq_hz for one in hum_of(short, PLAIN, BASE)} == {150.0}
    assert hum_of(logs(0.05, 50.0, n=3000), PLAIN, BASE) == ()
    assert {one.freq_hz for one in hum_of(logs(0.05, 60.0, n=3000), PLAIN, BASE)} == {60.0}
    assert {one.freq_hz for one in hum_of(logs(0.05, 50.0, n=4000), PLAIN, BASE)} == {50.0}


def test_absorbed_rows_have_the_likelihood_of_their_covariance():
    """|z|² is r' (1 + N N')⁻¹ r, for disturbances that are not at right angles."""
    random = np.random.default_rng(3)
    unknown, rows = random.normal(size=(3, 12)), random.normal(size=(12, 2))
    covariance = np.eye(12) + unknown.T @ unknown
    expected = rows.T @ np.linalg.solve(covariance, rows)
    absorb(rows, list(unknown))
    assert rows.T @ rows == pytest.approx(expected)
