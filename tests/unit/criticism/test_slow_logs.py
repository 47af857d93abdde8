"""Logs in which the rotor turns far from sample to sample: what a mean of the voltage contains."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.criticism.data.segment import projected, row_index
from pipeline.criticism.library.registry import effects
from pipeline.criticism.machine.model import Model, Pieces, zero
from pipeline.criticism.machine.sample_period import mean_current
from pipeline.criticism.operating import ShaftState
from pipeline.criticism.regression.noise_propagation import noise_floor
from pipeline.criticism.residuals.residual import operate, residual
from pipeline.criticism.signals.shaft import sensed_torque
from pipeline.criticism.signals.true_current import ripples
from pipeline.criticism.signals.true_state import averaging, motion_of
from pipeline.criticism.signals.true_state import operating as state_of
from pipeline.criticism.signals.voltage import mean_voltage, rotor_voltage
from tests.unit.criticism.machines import (
    BASE,
    columns_and_changes,
    in_frame_of,
    log,
    machine,
    operating,
    unit_floor,
)

LIBRARY = effects()
PLAIN = Model(machine(), ())
PAIRS, SIZE = 7, 400


def slow_log(turn_rad: float, timing: str = "centred"):
    """A log of a steady current at 1 kHz under 20 kHz PWM; the rotor turns so far in a sample."""
    period = 1e-3
    omega = turn_rad / (PAIRS * period)
    current = -2.0 + 5.0j
    psi = BASE["psi_wb"] + BASE["ld_h"] * current.real + 1j * BASE["lq_h"] * current.imag
    volts = BASE["r_ohm"] * current + 1j * PAIRS * omega * psi
    # vectors that the stationary frame holds for a period of the PWM, in the rotor's
    volts *= np.sinc(turn_rad * 0.05 / (2.0 * np.pi))
    held = np.ones(SIZE)
    segment = replace(log(), ts_s=period, weak=None, channels=("vd_v", "vq_v"))
    return replace(
        segment,
        instrument=replace(segment.instrument, timing=timing),
        fixed={**segment.fixed, "pwm_s": 5e-5, "vdc_v": 24.0},
        recorded={
            "id_a": current.real * held,
            "iq_a": current.imag * held,
            "vd_v": volts.real * held,
            "vq_v": volts.imag * held,
            "theta_mech_rad": omega * period * np.arange(SIZE) + 0.3,
            "temp_winding_degc": 25.0 * held,
            "temp_magnet_degc": 25.0 * held,
        },
    )


def as_cut(segment):
    return replace(segment, instrument=averaging(segment, PLAIN.machine))


@pytest.mark.parametrize("points", [8, 16])
def test_a_mean_over_a_sample_is_that_of_the_closed_form(points):
    """ψ = ψ_m + a e^{j6ε}: v = jω ψ_m + 7jω a e^{j6ε}, whose mean over a turn φ is a sinc."""
    turn, period, a = 0.8, 1e-3, 1e-4
    at = np.arange(SIZE * points) / points
    eps = turn * at
    psi = BASE["psi_wb"] + a * np.exp(6j * eps)
    nothing = np.zeros(eps.size)
    pieces = Pieces(psi, nothing, np.full(eps.size, 0.4 + 0j), nothing)
    samples = turn * np.arange(SIZE)
    for ahead, middle in ((False, 0.0), (True, 0.5 * turn)):
        share = np.sinc(3.0 * turn / np.pi)
        exact = 7j * turn / period * a * share * np.exp(6j * (samples + middle))
        exact = exact + 0.4 + 1j * turn / period * BASE["psi_wb"]
        mean = mean_voltage(pieces, eps, points, period, ahead=ahead)
        wave = 7.0 * turn / period * a * share
        assert np.abs(mean - exact)[1:-1].max() < 0.02 * wave
    instants = Pieces(psi[::points], nothing, pieces.drop_v[::points], nothing)
    sampled = rotor_voltage(instants, np.full(SIZE, turn / period), period)
    exact = exact * 0 + 7j * turn / period * a * share * np.exp(6j * samples)
    exact = exact + 0.4 + 1j * turn / period * BASE["psi_wb"]
    assert np.abs(sampled - exact)[1:-1].max() > 0.3 * wave


def test_a_dead_time_is_in_a_mean_as_its_mean():
    """The loss of each leg by the sign of its current, averaged at 2,000 instants a sample."""
    loss, width, turn = 0.2, 0.05, 2.3
    segment = as_cut(slow_log(turn))
    effect = LIBRARY["dead_time"]
    model = PLAIN.with_effects(effect)
    values = {**BASE, **zero(effect, model)}
    values |= {"dead_time.loss_v": loss, "dead_time.width_a": width, "dead_time.ripple": 0.0}
    recorded = dict(segment.recorded)
    current = recorded["id_a"][0] + 1j * recorded["iq_a"][0]
    part = turn * ((np.arange(2000) + 0.5) / 2000 - 0.5)
    eps = PAIRS * recorded["theta_mech_rad"][:, None] + part[None, :]
    lost = np.zeros(eps.shape, dtype=complex)
    for k in range(3):
        axis = np.exp(2j * np.pi * k / 3.0)
        phase = (current * np.exp(1j * eps) * np.conj(axis)).real
        lost += 2.0 / 3.0 * loss * np.tanh(phase / width) * axis
    mean = (lost * np.exp(-1j * eps)).mean(axis=1)
    recorded["vd_v"] = recorded["vd_v"] + mean.real
    recorded["vq_v"] = recorded["vq_v"] + mean.imag
    averaged, sampled = (
        residual(replace(segment, recorded=recorded, instrument=one), model, values)[:2, 5:-5]
        for one in (segment.instrument, replace(segment.instrument, points=1))
    )
    assert segment.instrument.points > 1
    assert averaged.std() < 0.05 * loss
    assert np.abs(averaged.mean(axis=1)).max() < 0.005 * loss
    assert sampled.std() > 0.1 * loss, "an instant of the loss is not its mean"


@pytest.mark.parametrize("known", [True, False])
def test_a_snapshot_is_held_whether_its_pwm_is_known(known):
    """As if it changed at once, the current's ripple of a fast motor was a delay."""
    segment = slow_log(2.3, "instant")
    if not known:
        fixed = {name: value for name, value in segment.fixed.items() if name != "pwm_s"}
        segment = replace(segment, fixed=fixed)
    segment = as_cut(segment)
    assert segment.instrument.snapshots
    assert np.isfinite(residual(segment, PLAIN, BASE)).all()


@pytest.mark.parametrize(("frame", "lead"), [(0.0, 0.0), (0.5, 0.0), (0.0, 1.5)])
def test_a_snapshot_of_a_wave_is_its_mean_over_the_hold_of_one_vector(frame, lead):
    """ψ = ψ_m + ψ_m a e^{j6ε} by the harmonics of a back-EMF, whose mean over a turn is a sinc. A
    command acts `lead` periods later: by differences between rows, which turn the wave by 14 rad,
    its harmonic was left in the voltage, and the motor was unknown.
    """
    turn, hold_s, a = 2.3, 5e-5, 0.004
    segment = slow_log(turn, "instant")
    instrument = replace(segment.instrument, frame=frame, meter="gain_commanded")
    segment = as_cut(replace(segment, instrument=instrument))
    omega, held = turn / segment.ts_s, turn * hold_s / segment.ts_s
    eps = PAIRS * segment.recorded["theta_mech_rad"] + (frame + lead) * held
    share = np.sinc(3.0 * held / np.pi)
    middle = 0.5 * (np.exp(6j * (eps + 0.5 * held)) + np.exp(6j * (eps - 0.5 * held)))
    wave = 1j * omega * BASE["psi_wb"] * a * (6.0 * share * np.exp(6j * eps) + middle)
    turned = wave * np.exp(1j * frame * held)
    recorded = dict(segment.recorded)
    clean = recorded["vd_v"] + 1j * recorded["vq_v"]
    # what a held vector of the still machine is at the middle of its hold, in the frame of a sample
    clean = clean / np.sinc(held / (2.0 * np.pi)) * np.exp(1j * frame * held)
    recorded |= {"vd_v": (clean + turned).real, "vq_v": (clean + turned).imag}
    effect = LIBRARY["bemf_harmonics"]
    model = PLAIN.with_effects(effect)
    values = {**BASE, **zero(effect, model)}
    # a e^{j6ε} is a cos on the d axis and a sin on the q axis
    values |= {"bemf_harmonics.d6_cos": a, "bemf_harmonics.q6_sin": a, "command_lead": lead}
    segment = replace(segment, recorded=recorded)
    left = residual(segment, model, values)[:2, 5:-5]
    size = np.abs(wave).mean()
    assert np.abs(left).max() < 0.02 * size
    plain = replace(segment, instrument=replace(segment.instrument, snapshots=False))
    assert np.abs(residual(plain, model, values)[:2, 5:-5]).max() > 0.5 * size


def test_the_state_between_rows_has_the_waves_of_the_current():
    segment = as_cut(slow_log(1.6))
    eps = PAIRS * np.interp(
        np.arange(SIZE * segment.instrument.points) / segment.instrument.points,
        np.arange(SIZE),
        segment.recorded["theta_mech_rad"],
    )
    current = -2.0 + 5.0j + 0.3 * np.exp(6j * eps)
    rows = current[:: segment.instrument.points]
    recorded = {**segment.recorded, "id_a": rows.real, "iq_a": rows.imag}
    segment = replace(segment, recorded=recorded)
    x = operate(segment, recorded, PLAIN, BASE)
    inside = slice(segment.instrument.points, -2 * segment.instrument.points)
    assert x.i_a[inside] == pytest.approx(current[inside], abs=0.01)
    assert ripples(segment)
    lines = replace(segment, instrument=replace(segment.instrument, waves=False))
    x = operate(lines, recorded, PLAIN, BASE)
    assert np.abs(x.i_a[inside] - current[inside]).max() > 0.1


@pytest.mark.parametrize(
    ("turn", "timing", "many"),
    [
        (2.3, "centred", True),
        (2.3, "held", True),
        (2.3, "instant", False),
        (1e-3, "centred", False),
    ],
)
def test_only_means_over_a_far_turn_need_more_points_than_samples(turn, timing, many):
    assert (averaging(slow_log(turn, timing), PLAIN.machine).points > 1) == many


def test_a_log_as_fast_as_its_pwm_holds_one_vector_a_sample():
    segment = slow_log(2.3)
    fast = replace(segment, fixed={**segment.fixed, "pwm_s": segment.ts_s})
    assert averaging(fast, PLAIN.machine) == fast.instrument


@pytest.mark.parametrize("timing", ["centred", "held"])
def test_a_sound_machine_leaves_nothing_in_a_slow_log(timing):
    segment = as_cut(slow_log(2.3, timing))
    left = residual(segment, PLAIN, BASE)[:2, 5:-5]
    assert np.abs(left).max() < 1e-6 * np.abs(segment.recorded["vq_v"]).max()
    x = operate(segment, segment.recorded, PLAIN, BASE)
    assert x.sampled().theta_rad == pytest.approx(segment.recorded["theta_mech_rad"])


@pytest.mark.parametrize("name", LIBRARY)
def test_a_column_of_a_slow_log_is_the_change_of_its_residual(name):
    """With a torque channel and windows, at several points a sample."""
    segment = log()
    slow = replace(
        segment,
        instrument=replace(segment.instrument, timing="centred", points=4),
        fixed={**segment.fixed, "pwm_s": 1e-5, "vdc_v": 24.0},
    )
    for column, change in columns_and_changes(slow, LIBRARY[name], unit_floor(slow)):
        size = np.abs(change).max()
        assert column == pytest.approx(change, abs=0.02 * size + 1e-12)


@pytest.mark.parametrize("name", ["bemf_harmonics", "inductance_harmonics", "dead_time"])
def test_a_column_of_snapshots_is_the_change_of_its_residual(name):
    segment = log()
    instrument = replace(segment.instrument, timing="instant", frame=0.5, snapshots=True)
    fixed = {**segment.fixed, "pwm_s": 1e-5, "vdc_v": 24.0}
    far = {**segment.recorded, "theta_mech_rad": 20.0 * segment.recorded["theta_mech_rad"]}
    shots = replace(segment, instrument=instrument, fixed=fixed, recorded=far)
    for column, change in columns_and_changes(shots, LIBRARY[name], unit_floor(shots)):
        size = np.abs(change).max()
        assert column == pytest.approx(change, abs=0.02 * size + 1e-12)


def test_the_frame_of_a_coarse_encoder_is_in_the_noise_floor():
    """A drive turns its currents and voltages by the angle that its encoder rounds: at 512 counts
    a turn of a machine of seven pole pairs, by up to 2.5 degrees.
    """
    segment, step = log(), 2.0 * np.pi / 512.0
    theta = segment.recorded["theta_mech_rad"]
    coarse = np.round(theta / step) * step
    recorded = in_frame_of(coarse, segment.recorded)
    silent = dict.fromkeys(segment.sensors.noise, 0.0)
    sensors = replace(segment.sensors, angle_step_rad=step, noise=silent)
    rounded = replace(segment, recorded=recorded, sensors=sensors)
    group, _, valid, groups = row_index(rounded)
    rows = projected(rounded, residual(rounded, PLAIN, BASE))[valid]
    rows /= noise_floor(rounded, PLAIN, BASE, 1)
    for axis in ("vd_v", "vq_v"):
        left = rows[group[valid] == groups.index((axis, 0))]
        assert 0.2 < np.mean(left**2) < 2.0


def test_times_count_alike_at_one_point_a_sample_or_eight():
    """A ramp of current at steady speed: its mean of an earlier instant, and a loss with a lag."""
    at = np.arange(8 * 60) / 8.0
    ramp = 4.0 - 0.02 * at + 1j * (3.0 + 0.05 * at)
    theta = 2e-3 * at
    fine = replace(
        operating(8 * 60),
        id_a=ramp.real,
        iq_a=ramp.imag,
        theta_rad=theta,
        eps_rad=PAIRS * theta,
        omega_rad_s=np.full(at.size, 2e-3 / 5e-5),
        shaft=ShaftState(finer=8),
    )
    lagging = {**BASE, "ripple_slope": 0.4}
    means = [mean_current(x, lagging) for x in (fine, fine.sampled())]
    assert means[0].i_a[::8][1:-1] == pytest.approx(means[1].i_a[1:-1], abs=1e-9)
    assert means[0].eps_rad[::8] == pytest.approx(means[1].eps_rad, abs=1e-9)
    effect = LIBRARY["dead_time"]
    lost = {name.partition(".")[2]: v for name, v in zero(effect, PLAIN).items()}
    lost |= {"loss_v": 0.3, "width_a": 8.0, "lag_s": 4e-5, "ripple": 0.0}
    drops = [effect.drop(x, lost) for x in (fine, fine.sampled())]
    assert np.ptp(drops[1].real) > 1e-3
    assert drops[0][::8][1:-1] == pytest.approx(drops[1][1:-1], abs=1e-9)


@pytest.mark.parametrize(("timing", "share"), [("centred", None), ("held", 1.0)])
def test_a_held_shaft_s_torque_is_the_mean_of_a_row_of_means(timing, share):
    """Of a wave that turns by 5 rad in a row its mean is a quarter."""
    turn, order = 5.0 / 12.0, 84
    segment = as_cut(replace(slow_log(turn, timing), test="torque_map"))
    assert segment.instrument.points > 1
    motion = motion_of(segment, segment.recorded, PLAIN.machine, segment.instrument.points)
    current = np.zeros(motion.theta_rad.size, dtype=complex)
    values = {**BASE, "gain_torque": 0.0, "j_kgm2": 0.0}
    x = state_of(segment, segment.recorded, PLAIN, values, current, motion)
    wave = sensed_torque(segment, x, x.shaft_waves(order)[0], PLAIN, values)
    phase = order * segment.recorded["theta_mech_rad"]
    left = np.sinc(2.5 / np.pi) if share is None else share
    assert wave[2:-2] == pytest.approx(left * np.cos(phase)[2:-2], abs=0.04)
