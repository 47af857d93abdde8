"""How coarse a recording is, and what that makes of a noise floor."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from pipeline.criticism.data.encoder_noise import readings_and_noise, shared_noise
from pipeline.criticism.data.machine_scale import encoder_step
from pipeline.criticism.data.rounding import (
    coarse_step,
    is_rounded,
    readings_error,
    resolution,
    rounding_error,
    rounding_step,
    smoothed,
)
from pipeline.criticism.data.segment import Sensors, projected, row_index
from pipeline.criticism.data.sensors import sensor_noise, slow_noise
from pipeline.criticism.machine.model import Model
from pipeline.criticism.policy.policy import DEFAULT
from pipeline.criticism.regression.fit import Fit, current_floors_grown, floors
from pipeline.criticism.regression.goodness import floor_factors
from pipeline.criticism.regression.linear_system import linear_system
from pipeline.criticism.regression.noise_propagation import noise_floor
from pipeline.criticism.residuals.residual import residual
from pipeline.criticism.residuals.segments import _by_encoder
from pipeline.records.capture import Campaign, Capture, CaptureMeta
from tests.unit.criticism.machines import BASE, coasting, in_frame_of, log, machine

SENSORS = DEFAULT.sensor_noise


def rounded(step, sigma, seed=3, n=6000):
    """A slow signal with noise, in whole steps."""
    t = np.linspace(0.0, 1.0, n)
    signal = 5.0 + 0.4 * np.sin(7.0 * t) + np.random.default_rng(seed).normal(0.0, sigma, n)
    return np.round(signal / step) * step


@pytest.mark.parametrize("step", [2.0**-7, 0.01, 1.0 / 3.0])
def test_the_resolution_of_a_signal_is_the_step_of_its_values(step):
    assert resolution(rounded(step, 0.3), SENSORS) == pytest.approx(step, rel=1e-6)


@pytest.mark.parametrize(("step", "decimals", "rise"), [(0.0313, 2, 0.7), (1.0 / 64.0, 3, 0.1)])
def test_a_slow_signal_in_steps_that_a_file_rounded_once_more_has_them_still(step, decimals, rise):
    """A winding that warms, its voltage in steps and decimals: 3.8 and 12.6 times the floor."""
    warming = 5.75 + rise * (1.0 - np.exp(-np.linspace(0.0, 3.0, 4000)))
    written = np.round(step * np.round(warming / step), decimals)
    assert resolution(written, SENSORS) == pytest.approx(step, rel=0.05)
    assert coarse_step(written, 0.0, SENSORS) > 0.9 * step


def test_numbers_of_no_step_have_no_resolution():
    random = np.random.default_rng(1)
    assert resolution(np.full(100, 3.0), SENSORS) == 0.0
    assert resolution(random.choice([0.0, 1.0, np.pi, np.e * 3, 7.3], 200), SENSORS) == 0.0


@pytest.mark.parametrize(
    ("share", "coarse"), [(0.0, True), (0.2, True), (0.8, False), (3.0, False)]
)
def test_a_signal_is_coarse_where_its_noise_does_not_dither_it(share, coarse):
    signal = rounded(0.02, 0.02 * share)
    assert coarse_step(signal, sensor_noise(signal, SENSORS), SENSORS) == pytest.approx(
        0.02 if coarse else 0.0
    )


@pytest.mark.parametrize("file_step", [0.0, 2.0**-18])
@pytest.mark.parametrize("noise", [0.0, 0.2])
@pytest.mark.parametrize("counts", [2000, 2400, 4000, 4096, 5000, 8000, 10_000, 2**14, 2**17])
def test_an_encoder_s_counts_a_turn_are_told_whether_powers_of_two_or_not(counts, noise, file_step):
    """Line encoders are within 0.05 bit of 2^n, and a step 0.1 % off is out of step in a turn."""
    step, random = 2.0 * np.pi / counts, np.random.default_rng(1)
    t = np.arange(20_000) * 1e-4
    moved = 48.0 * np.sin(2.5 * t) + noise * step * random.normal(size=t.size)
    theta = np.round(moved / step) * step
    theta = np.round(theta / file_step) * file_step if file_step else theta
    told = rounding_step(theta, SENSORS)
    assert 2.0 * np.pi / told == pytest.approx(counts, rel=1e-9)
    assert is_rounded(theta, told, SENSORS)


def test_a_shaft_that_turns_by_nearly_whole_steps_a_sample_shows_its_step():
    """Most third differences are then what the file's digits round."""
    step, t = 2.0 * np.pi / 10_000, np.arange(8000) * 5e-5
    moved = 1.0 + 11.97 * step / 5e-5 * t + 0.01 * np.sin(2.0 * np.pi * 7.0 * t)
    theta = np.round(np.round(moved / step) * step, 8)
    assert np.median(np.abs(np.diff(theta, 3))) < 1e-3 * step
    assert rounding_step(theta, SENSORS) == pytest.approx(step, rel=1e-9)


def test_a_shaft_that_turns_by_half_a_step_more_or_less_has_no_step_of_two():
    """Its counts go 103, 104, 103, 104: third differences are whole multiples of two, but a few."""
    step, row = 2.0 * np.pi / 4096, np.arange(1651)
    theta = np.round(103.49 * row + 1e-4 * row**1.2) * step
    third = np.round(np.diff(theta, 3) / step)
    assert np.mean(third % 2 == 0) > 0.95
    assert rounding_step(theta, SENSORS) == pytest.approx(step, rel=1e-9)


def test_a_shaft_that_jerks_by_many_steps_a_row_shows_them():
    """Third differences of a light rotor in rows of a millisecond are thirty steps, and no beat."""
    step, random = 2.0 * np.pi / 2**11, np.random.default_rng(3)
    moved = np.cumsum(np.cumsum(0.03 * random.normal(size=1000)))
    theta = np.round(moved / step) * step
    assert np.std(np.diff(theta, 3)) > 10.0 * step
    assert rounding_step(theta, SENSORS) == pytest.approx(step, rel=1e-9)
    assert rounding_step(moved, SENSORS) == 0.0


def test_rows_that_lack_their_angle_hide_no_step():
    """What is read between two rows is in halves of a step; over a gap the angle moves by more."""
    step, random = 2.0 * np.pi / 2**14, np.random.default_rng(2)
    t = np.arange(12_000) * 1e-3
    moved = 200.0 * np.sin(0.5 * t) * t + 1e-4 * random.normal(size=t.size)
    theta = np.round(moved / step) * step
    theta[random.uniform(size=t.size) < 0.05] = np.nan
    assert rounding_step(theta, SENSORS) == pytest.approx(step, rel=1e-9)
    table = pl.DataFrame({"t_s": t, "theta_mech_rad": theta})
    for test in ("drive", "spin_down"):
        meta = CaptureMeta("m", test, pole_pairs=7)
        capture = Capture("one.mcap", "0", "verified", meta, (table,))
        found = encoder_step(Campaign("m", (capture,)), DEFAULT)
        assert found == pytest.approx(step, rel=1e-9), test


@pytest.mark.parametrize("pace", [0.03, 0.94, 47.2])
def test_digits_of_a_file_beneath_the_steps_are_no_step(pace):
    """A long spin in seven digits has 1e-5 rad at its end, a fortieth of the encoder's step."""
    step = 2.0 * np.pi / 2**14
    theta = step * (np.floor(pace * np.arange(5000)) + 0.5) + 20.0
    told = rounding_step(np.array([float(f"{angle:.7g}") for angle in theta]), SENSORS)
    assert told == pytest.approx(step, rel=1e-9)


def test_a_step_of_nearly_twice_a_file_s_decimal_is_no_half():
    """Seven digits of hundreds of rad are 1e-4: two of them are half of a step, but for 4 %."""
    step, t = 2.0 * np.pi / 2**14, np.arange(20000) * 2e-4
    moved = (
        75.0 * t
        + 0.02 * np.sin(2.0 * np.pi * 9.0 * t)
        + 1e-4 * np.random.default_rng(3).standard_normal(t.size)
    )
    theta = [float(f"{angle:.7g}") for angle in np.round(moved / step) * step]
    assert rounding_step(np.array(theta), SENSORS) == pytest.approx(step, rel=1e-9)


def test_the_step_of_a_drive_that_logs_means_of_readings_is_a_part_of_the_encoder_s():
    """A mean of 16 readings is in sixteenths of a step; a bench logs each of them."""
    step, segment = 2.0 * np.pi / 8192, log()
    theta = np.round(segment.recorded["theta_mech_rad"] / step) * step
    bench = replace(segment, recorded={**segment.recorded, "theta_mech_rad": theta})
    drive = replace(machine(), encoder_rad=step / 16.0)
    assert _by_encoder(bench, drive).sensors.angle_step_rad == pytest.approx(step, rel=1e-6)
    sixteenth = np.round(segment.recorded["theta_mech_rad"] / step * 16.0) * step / 16.0
    fine = replace(segment, recorded={**segment.recorded, "theta_mech_rad": sixteenth})
    assert _by_encoder(fine, drive).sensors.angle_step_rad == pytest.approx(step / 16.0, rel=1e-6)


def test_a_beat_of_steps_and_sampling_is_as_loud_when_the_angle_is_rounded_anew():
    """1.43 steps a sample: the seventh wave of the saw-tooth is seen at 1 % of the rate."""
    step, t, random = 2.0 * np.pi / 8192, np.arange(8000) * 5e-5, np.random.default_rng(4)
    moved = 1.43 * step / 5e-5 * t + 0.01 * np.sin(2.0 * np.pi * 7.0 * t)
    theta = np.round(moved / step) * step
    even = smoothed(theta, step, SENSORS)

    def beat(error):
        lines = np.abs(np.fft.rfft(error * np.hanning(error.size))) ** 2
        return lines[50:400].sum()

    anew = [beat(rounding_error(even, step, random.uniform(-0.5, 0.5))) for _ in range(20)]
    assert np.mean(anew) == pytest.approx(beat(theta - moved), rel=0.3)


def test_the_mean_of_rounded_readings_has_their_noise_and_not_that_of_its_fractions():
    """Six readings a sample of a shaft that turns tens of steps in it: q √(6/12), not q/√12."""
    coarse, t = 2.0 * np.pi / 4096.0, np.arange(48000) / 12000.0
    readings = 40.0 * np.sin(6.0 * t)
    rounded_readings = np.round(readings / coarse) * coarse
    theta, true = (one.reshape(-1, 6).mean(axis=1) for one in (rounded_readings, readings))
    noise = sensor_noise(theta, SENSORS)
    sensors = Sensors({"theta_mech_rad": noise})
    segment = replace(log(), recorded={"theta_mech_rad": theta}, sensors=sensors)
    found = _by_encoder(segment, replace(machine(), encoder_rad=coarse / 6.0)).sensors
    assert found.angle_step_rad == pytest.approx(coarse / 6.0)
    assert 4 <= found.readings <= 7
    anew = readings_error(true, coarse / 6.0, found.readings, 0.3)
    assert np.std(anew) == pytest.approx(np.std(theta - true), rel=0.15)
    assert np.std(anew) > 2.0 * coarse / 6.0 / np.sqrt(12.0)


@pytest.mark.parametrize("sigma", [0.6, 0.9])
@pytest.mark.parametrize("turns", [0.02, 3.0])
def test_noise_of_most_of_a_step_before_a_rounding_is_no_mean_of_readings(sigma, turns):
    """An encoder with its lowest bit in its noise has an error that is alike at every pace."""
    step, t = 2.0 * np.pi / 2**17, np.arange(6000) / 2000.0
    moved = turns * np.sin(6.0 * t) + step * np.random.default_rng(7).normal(0.0, sigma, t.size)
    theta = np.round(moved / step) * step
    sensors = Sensors({"theta_mech_rad": sensor_noise(theta, SENSORS, steady=True)})
    segment = replace(log(), recorded={"theta_mech_rad": theta}, sensors=sensors)
    found = _by_encoder(segment, replace(machine(), encoder_rad=step)).sensors
    assert found.readings == 1
    assert found.dither_rad == pytest.approx(sigma * step, rel=0.1)


def test_a_rounding_that_beats_with_the_sampling_is_no_mean_of_readings():
    """At a quarter of all paces its third differences are as loud as those of two readings' noise,
    next to half a step a sample as those of four.
    """
    step, rows, loud, means = 2.0 * np.pi / 1024, np.arange(6000), 0, 0
    paces = np.linspace(0.05, 12.03, 100)
    for pace in paces:
        theta = np.round(pace * rows + 0.013 * np.sin(0.003 * rows)) * step
        noise = sensor_noise(theta, SENSORS, steady=True)
        loud += 12.0 * (noise / step) ** 2 > 1.5
        sensors = Sensors({"theta_mech_rad": noise}, angle_step_rad=step)
        segment = replace(log(), recorded={"theta_mech_rad": theta}, sensors=sensors)
        means += _by_encoder(segment, machine()).sensors.readings > 1
    assert loud > 0.15 * paces.size
    assert means <= 0.03 * paces.size


def test_a_noisy_angle_has_no_step():
    theta = np.linspace(0.0, 9.0, 8000) + np.random.default_rng(2).normal(0.0, 1e-3, 8000)
    assert rounding_step(theta, SENSORS) == 0.0


def test_the_floor_holds_what_coarse_rounding_really_does():
    """A voltage in steps of 50 mV: of white noise a window would leave a fifteenth of q/√12."""
    step, segment = 0.05, log()
    fine = segment.recorded["vd_v"]
    model, orders = Model(machine(), ()), segment.weak.orders
    errors, told_floors = [], []
    for shift in (0.1, 0.3, 0.7):
        coarse = np.round(fine / step + shift) * step - shift * step
        error = segment.weak.project((coarse - fine)[None])[0][:, orders == 0]
        told = replace(
            segment,
            recorded={**segment.recorded, "vd_v": coarse},
            sensors=Sensors(
                {**segment.sensors.noise, "vd_v": step / np.sqrt(12.0)}, {"vd_v": step}
            ),
        )
        white = replace(told, sensors=replace(told.sensors, steps={}))
        errors.append(float(np.sqrt((error**2).mean())))
        told_floors.append([float(noise_floor(s, model, BASE, 1)[0]) for s in (told, white)])
    rounding, by_white = np.array(told_floors).T
    assert (rounding > 0.7 * np.array(errors)).all()
    assert (rounding < 4.0 * np.array(errors)).all()
    assert (by_white < 0.8 * np.array(errors)).all()


def test_a_rounded_angle_is_as_loud_in_each_window_as_its_pace_makes_it():
    """J θ″ of steps of 1.5 mrad as a shaft gathers speed, past one step a sample at 31 rad/s. There
    the error creeps, and is four times what it is elsewhere.
    """
    step, even = 2.0 * np.pi / 4096, log()
    group, _, valid, groups = row_index(even)
    mine = group[valid] == groups.index(("torque_shaft_nm", 0))
    model = Model(machine(), ())

    def weak(theta):
        recorded = {**even.recorded, "theta_mech_rad": theta}
        return projected(even, residual(even, model, BASE, recorded))[valid][mine]

    exact, true = even.recorded["theta_mech_rad"], weak(even.recorded["theta_mech_rad"])
    power = np.zeros(mine.sum())
    for shift in np.linspace(0.0, 1.0, 40, endpoint=False):
        theta = step * (np.round(exact / step + shift) - shift)
        power += (weak(theta) - true) ** 2 / 40.0
    quiet = dict.fromkeys(even.sensors.noise, 0.0)
    sensors = Sensors(quiet, angle_step_rad=step)
    rounded = {**even.recorded, "theta_mech_rad": step * np.round(exact / step)}
    segment = replace(even, recorded=rounded, sensors=sensors)
    floor = noise_floor(segment, model, BASE, 1)[mine]
    assert np.sqrt(power).max() > 4.0 * np.median(np.sqrt(power))
    assert floor.max() > 3.0 * np.median(floor)
    assert np.abs(np.log(floor / np.sqrt(power))).max() < np.log(3.0)
    assert np.mean(power / floor**2) == pytest.approx(1.0, abs=0.3)


@pytest.mark.parametrize("share", [0.0, 0.4, 1.0])
@pytest.mark.parametrize("pace", [0.01, 1.43, 13.8])
def test_noise_before_a_rounding_is_what_the_rounding_alone_does_not_make(pace, share):
    """Steps and sampling beat, so that the error of a rounding may pass for more noise than it is,
    or for less.
    """
    step, samples = 2.0 * np.pi / 2**14, np.arange(12000)
    moved = pace * samples + 3.0 * np.sin(samples / 400.0)
    noisy = moved + share * np.random.default_rng(5).standard_normal(samples.size)
    _, dither = readings_and_noise([step * np.round(noisy)], step, 1, SENSORS)
    assert dither / step == pytest.approx(share, abs=0.1)


@pytest.mark.parametrize("share", [0.2, 0.6])
@pytest.mark.parametrize("paces", [(5.44, 12.49, 14.43), (19.43, 19.25, 18.41)])
def test_noise_before_a_rounding_is_found_at_a_few_even_paces(share, paces):
    """A spin at three speeds: near half a step the steps alone are louder than with the noise."""
    step, random = 2.0 * np.pi / 2**13, np.random.default_rng(2)
    moved = np.cumsum(np.repeat(paces, 1400))
    noisy = moved + share * random.standard_normal(moved.size)
    _, dither = readings_and_noise([step * np.round(noisy)], step, 1, SENSORS)
    assert dither / step == pytest.approx(share, abs=0.04)


def test_noise_of_many_steps_is_found() -> None:
    """Of an encoder of 17 bits a noise of half a milliradian is ten of its steps."""
    step, random = 2.0 * np.pi / 2**17, np.random.default_rng(6)
    moved = 3.4 * np.arange(8000) + 10.0 * random.standard_normal(8000)
    _, noise = readings_and_noise([step * np.round(moved)], step, 1, SENSORS)
    assert noise / step == pytest.approx(10.0, rel=0.1)


def test_a_spin_has_the_noise_that_a_drive_shows_of_their_encoder() -> None:
    """At thirds of a step a sample a noise of a twentieth makes no other reading."""
    step, random = 2.0 * np.pi / 2**11, np.random.default_rng(7)
    rows = np.arange(5000)
    spin, drive = 4.0 / 3.0 * rows, 900.0 * np.sin(rows / 500.0)
    loud = drive + 2.0 * random.standard_normal(rows.size)
    paths = (spin, drive, loud)
    noisy = [one + 0.05 * random.standard_normal(rows.size) for one in paths]
    records = [[step * np.round(one)] for one in noisy]
    alone = [readings_and_noise(one, step, 1, SENSORS)[1] for one in records]
    assert alone[0] < 0.02 * step
    shared = shared_noise(records[:2], step, alone[:2], SENSORS)
    assert np.array(shared) / step == pytest.approx([0.05, 0.05], abs=0.02)
    of_each = shared_noise(records, step, alone, SENSORS)
    assert of_each[2] / step == pytest.approx(2.0, rel=0.1)


@pytest.mark.parametrize("turns", [0.0, 40.0])
def test_noise_that_a_filter_made_smooth_is_found_beside_a_motion(turns):
    """Of a filter with gain 1 a slow window sees the noise as it was before; samples do not."""
    white = 0.02 * np.random.default_rng(6).standard_normal(40000)
    speed, kept = np.zeros(white.size), 0.0
    for n, one in enumerate(white):
        kept += 0.2 * (one - kept)
        speed[n] = kept
    speed += turns * np.sin(np.arange(white.size) / 2000.0)
    assert sensor_noise(speed, SENSORS) < 0.3 * 0.02
    assert slow_noise(speed, 16.0, SENSORS) == pytest.approx(0.02, rel=0.25)
    assert slow_noise(white, 16.0, SENSORS) == pytest.approx(0.02, rel=0.1)


def test_a_motion_and_the_gaps_between_windows_are_no_noise_of_an_encoder():
    """Windows of 60 samples of a shaft that swings by radians from one to the next."""
    step, even = 2.0 * np.pi / 2**14, log()
    sample = np.arange(even.size)
    time = even.ts_s * (sample + 300 * (sample // 60))
    swing = 2.0 * np.sin(2.0 * np.pi * 9.0 * time)
    recorded = {**even.recorded, "t_s": time, "theta_mech_rad": step * np.round(swing / step)}
    found = _by_encoder(replace(even, recorded=recorded), replace(machine(), encoder_rad=step))
    assert found.sensors.angle_step_rad == step
    assert found.sensors.dither_rad < 0.25 * step


def test_noise_of_an_encoder_counts_beside_its_rounding():
    """Steps of 0.38 mrad and noise of half of one, at a pace of which the steps alone make little:
    a hundredth of J θ″ of the whole.
    """
    step, even = 2.0 * np.pi / 2**14, log()
    group, _, valid, groups = row_index(even)
    mine = group[valid] == groups.index(("torque_shaft_nm", 0))
    model, random = Model(machine(), ()), np.random.default_rng(9)
    exact = step * 12.37 * np.arange(even.size)

    def weak(theta):
        recorded = {**even.recorded, "theta_mech_rad": theta}
        return projected(even, residual(even, model, BASE, recorded))[valid][mine]

    def read():
        return step * np.round(exact / step + 0.5 * random.standard_normal(exact.size))

    power = np.mean([(weak(read()) - weak(exact)) ** 2 for _ in range(20)])
    quiet = dict.fromkeys(even.sensors.noise, 0.0)
    noisy = {**even.recorded, "theta_mech_rad": read()}
    told = replace(even, recorded=noisy, sensors=Sensors(quiet, angle_step_rad=step))
    segment = _by_encoder(told, machine())
    assert segment.sensors.angle_step_rad == step
    floor = noise_floor(segment, model, BASE, 1)[mine]
    assert np.mean(floor**2) == pytest.approx(power, rel=0.4)
    alone = replace(segment, sensors=replace(segment.sensors, dither_rad=0.0))
    assert np.mean(noise_floor(alone, model, BASE, 1)[mine] ** 2) < 0.5 * power


def test_an_angle_that_hides_its_pace_is_as_loud_as_what_it_may_hide():
    """One step a sample, all along: the rounded angle is a straight line wherever it begins. The
    shaft may have been a step a window faster or slower, and its rounding then creeps.
    """
    step, even = 2.0 * np.pi / 4096, log()
    group, _, valid, groups = row_index(even)
    mine = group[valid] == groups.index(("torque_shaft_nm", 0))
    model, rows = Model(machine(), ()), np.arange(even.size)

    def weak(recorded):
        return projected(even, residual(even, model, BASE, recorded))[valid][mine]

    power, random = np.zeros(mine.sum()), np.random.default_rng(8)
    for _ in range(60):
        pace = 1.0 + random.uniform(-1.0, 1.0) / even.weak.length
        exact = pace * rows + random.uniform(0.0, 1.0)
        turned = {**even.recorded, "theta_mech_rad": step * exact}
        rounded = in_frame_of(step * np.round(exact), turned)
        power += (weak(rounded) - weak(turned)) ** 2 / 60.0
    quiet = dict.fromkeys(even.sensors.noise, 0.0)
    locked = {**even.recorded, "theta_mech_rad": step * rows}
    segment = replace(even, recorded=locked, sensors=Sensors(quiet, angle_step_rad=step))
    floor = noise_floor(segment, model, BASE, 1)[mine]
    assert np.sqrt(np.mean(floor**2) / np.mean(power)) == pytest.approx(1.0, abs=0.3)


def test_smoothing_keeps_a_parabola_to_both_ends_and_takes_the_steps_of_its_rounding():
    t = np.linspace(-1.0, 2.0, 1500)
    bent, step = 3.0 * t**2 - t, 0.01
    policy = DEFAULT.sensor_noise
    assert smoothed(bent, step, policy) == pytest.approx(bent, abs=1e-9)
    rounded = step * np.round(bent / step)
    left = smoothed(rounded, step, policy) - bent
    assert np.abs(left[200:-200]).max() < 0.2 * np.abs(rounded - bent).max()


def test_noise_of_a_current_counts_by_the_constants_that_it_goes_through():
    """Halved R and L halve what a current's noise does to a voltage: that is no better fit."""
    noise = {**log().sensors.noise, "vd_v": 1e-6, "vq_v": 1e-6, "id_a": 0.2, "iq_a": 0.2}
    segments = (replace(log(), sensors=Sensors(noise)), coasting())
    model = Model(machine(), ())
    halved = {**BASE, **{name: 0.5 * BASE[name] for name in ("r_ohm", "ld_h", "lq_h")}}
    fit = Fit(segments, model, halved, floors(segments, model, BASE), BASE)
    grown, free = current_floors_grown(fit)
    groups = row_index(segments[0])[3]
    volts = [n for n, (channel, _) in enumerate(groups) if channel != "torque_shaft_nm"]
    assert grown[volts] == pytest.approx(0.5, abs=0.05)
    assert np.array_equal(free, np.ones(free.size))
    system = linear_system(fit)
    factors = floor_factors(system)
    assert factors.min() >= 1.0 - 1e-9
    assert 1.2 < factors[volts].max() <= 4.0 + 1e-9


def _of_an_encoder(step, noise):
    """A drive's log whose angle is in steps, beside so much noise of its other columns."""
    even = log()
    noise = {**dict.fromkeys(even.sensors.noise, noise), "theta_mech_rad": 0.0}
    theta = step * np.round(even.recorded["theta_mech_rad"] / step)
    recorded = {**even.recorded, "theta_mech_rad": theta}
    return replace(even, recorded=recorded, sensors=Sensors(noise, angle_step_rad=step))


def test_a_rounding_below_the_noise_is_pooled_and_changes_no_floor():
    segment, plain = _of_an_encoder(2.0 * np.pi / 2**20, 0.1), Model(machine(), ())
    group, _, valid, groups = row_index(segment)
    mine = group[valid] == groups.index(("torque_shaft_nm", 0))
    each = replace(DEFAULT, noise_floors=replace(DEFAULT.noise_floors, unseen=0.0))
    pooled, exact = (
        noise_floor(segment, m, BASE, 1)[mine]
        for m in (plain, Model(replace(machine(), policy=each), ()))
    )
    assert np.ptp(pooled) == 0.0 < np.ptp(exact)
    assert pooled == pytest.approx(exact, rel=0.01)


def test_a_rounding_counts_by_the_inertia_that_it_goes_through():
    """Halved J halves what the steps of an angle do to a torque."""
    segment, model = _of_an_encoder(2.0 * np.pi / 4096, 0.0), Model(machine(), ())
    lighter = {**BASE, "j_kgm2": 0.5 * BASE["j_kgm2"], "psi_wb": 0.5 * BASE["psi_wb"]}
    fit = Fit((segment,), model, lighter, floors((segment,), model, BASE), BASE)
    group, _, valid, groups = row_index(segment)
    torque = group[valid] == groups.index(("torque_shaft_nm", 0))
    assert current_floors_grown(fit)[0][torque] == pytest.approx(0.5, rel=0.02)


@pytest.mark.parametrize("rows", [24, 50, 75])
def test_steps_in_every_block_are_no_noise(rows):
    """A rig that holds each level for fifty rows: no block of 48 differences is free of steps."""
    rng = np.random.default_rng(rows)
    levels = np.repeat(rng.normal(0.0, 10.0, 6000 // rows), rows)
    found = sensor_noise(levels + rng.normal(0.0, 0.1, levels.size), DEFAULT.sensor_noise)
    assert 0.09 < found < 0.14


def test_white_noise_is_as_loud_in_short_blocks():
    rng = np.random.default_rng(3)
    found = [sensor_noise(rng.normal(0.0, 1.0, 300), DEFAULT.sensor_noise) for _ in range(200)]
    assert np.mean(found) == pytest.approx(1.0, abs=0.05)


def test_a_creep_between_reversals_is_smoothed_by_a_parabola_of_its_own() -> None:
    """At nearly a step a row rounding is a slow saw-tooth: of one short length for a whole log, for
    the sake of its reversals, it stayed, and a sound motor was `backlash`.
    """
    step, size = 1.0, 2000
    row = np.arange(size)
    creep = 0.953 * row
    turning = creep[-1] + 40.0 * np.sin(row / 12.0)
    even = np.concatenate([creep, turning])
    found = smoothed(np.round(even / step), step, DEFAULT.sensor_noise)
    inside = slice(200, size - 200)
    assert (found - even)[inside].std() < 0.05 * step
    assert (found - even)[size + 200 : -200].std() < 0.5 * step


def test_the_step_of_a_signal_that_came_unevenly() -> None:
    """Currents of whole amperes, put on an even clock, counted as free of noise: sound drives were
    `unknown` at two floors.
    """
    rng = np.random.default_rng(4)
    even = np.arange(6000) * 1e-3
    came = even + 1e-4 * rng.uniform(-1.0, 1.0, even.size)
    wave = 12.0 * np.sin(2.0 * came)
    rounded = np.interp(even, came, np.round(wave))
    assert resolution(rounded, SENSORS) == pytest.approx(1.0)
    assert resolution(np.interp(even, came, wave), SENSORS) == 0.0
    switched_off = np.where(even < 3.0, 0.0, np.clip(np.interp(even, came, wave), -9.0, 9.0))
    assert resolution(switched_off, SENSORS) == 0.0
