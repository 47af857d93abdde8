"""Residuals against closed forms, columns against recomputed residuals, floors against scatter."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.criticism.data.segment import Sensors, projected, row_index, slow_orders
from pipeline.criticism.data.sensors import sensor_noise
from pipeline.criticism.library.registry import effects
from pipeline.criticism.machine.model import Model
from pipeline.criticism.machine.sample_period import mean_current
from pipeline.criticism.operating import ShaftState
from pipeline.criticism.policy.policy import DEFAULT
from pipeline.criticism.regression.noise_floors import reading_error
from pipeline.criticism.regression.noise_propagation import noise_floor
from pipeline.criticism.residuals.residual import residual
from pipeline.criticism.signals.shaft import averaged
from pipeline.criticism.signals.true_state import finer_of
from pipeline.numerics.projection import projection
from tests.unit.criticism.machines import (
    BASE,
    coasting,
    columns_and_changes,
    log,
    machine,
    operating,
)

LIBRARY = effects()
PLAIN = Model(machine(), ())


def test_a_machine_that_obeys_the_equations_leaves_nothing():
    """The closed-form log: what is left is the stencil's own error, 1e-6 of the voltage."""
    left = np.abs(projected(log(), residual(log(), PLAIN, BASE)))
    gain = log().weak.functions[0, 0].sum()
    assert (left / gain)[0].max() < 1e-5 * 8.0
    assert (left / gain)[1].max() < 1e-5 * 8.0
    assert (left / gain)[2].max() < 1e-6


@pytest.mark.parametrize(
    ("constant", "channel", "closed"),
    [
        ("r_ohm", 0, lambda s: -s["id_a"]),
        ("r_ohm", 1, lambda s: -s["iq_a"]),
        ("b_nm_s_rad", 2, lambda s: np.gradient(s["theta_mech_rad"], 5e-5)),
    ],
)
def test_a_wrong_constant_shows_as_its_own_signal(constant, channel, closed):
    segment = log()
    moved = {**BASE, constant: BASE[constant] * 1.1}
    change = residual(segment, PLAIN, moved)[channel] - residual(segment, PLAIN, BASE)[channel]
    expected = 0.1 * BASE[constant] * closed(segment.recorded)
    assert change[60:-60] == pytest.approx(expected[60:-60], rel=1e-3, abs=1e-6)


@pytest.mark.parametrize("name", LIBRARY)
def test_a_column_is_the_change_of_the_whole_residual(name):
    """The hook's own column against a residual computed anew with the effect in the model."""
    sigma = noise_floor(log(), PLAIN, BASE, 1)
    for column, change in columns_and_changes(log(), LIBRARY[name], sigma):
        size = np.abs(change).max()
        assert column == pytest.approx(change, abs=0.02 * size + 1e-12)


def one_period(turn: float) -> tuple[np.ndarray, float]:
    """Currents [n] through one period in which the inverter holds its voltage while the machine
    turns by `turn` at steady speed, and that speed: integrated, and begun so that it closes.
    """
    b, ts, steps = BASE, 5e-5, 4000
    omega_e, h = turn / ts, ts / steps
    held = 0.31 * (-6 + 10j) + 1j * omega_e * (9.4e-3 + 2.1e-4 * -6 + 1j * 2.9e-4 * 10)

    def through(current: complex, volt: complex, psi_pm: float) -> np.ndarray:
        psi, found = b["ld_h"] * current.real + 1j * b["lq_h"] * current.imag, []
        for k in range(steps):
            now = psi.real / b["ld_h"] + 1j * psi.imag / b["lq_h"]
            found.append(now)
            v = volt * np.exp(-1j * omega_e * ((k + 0.5) * h - 0.5 * ts))
            slope = v - b["r_ohm"] * now - 1j * omega_e * (psi + psi_pm)
            # the midpoint's current
            mid = psi + 0.5 * h * slope
            now = mid.real / b["ld_h"] + 1j * mid.imag / b["lq_h"]
            psi = psi + h * (v - b["r_ohm"] * now - 1j * omega_e * (mid + psi_pm))
        return np.array([*found, psi.real / b["ld_h"] + 1j * psi.imag / b["lq_h"]])

    def parts(z: complex) -> np.ndarray:
        return np.array([z.real, z.imag])

    forced = parts(through(0j, held, b["psi_wb"])[-1])
    free = np.column_stack([parts(through(z, 0j, 0.0)[-1]) for z in (1 + 0j, 1j)])
    start = np.linalg.solve(np.eye(2) - free, forced)
    return through(complex(*start), held, b["psi_wb"]), omega_e / 7.0


@pytest.mark.parametrize(("place", "part"), [(0, 1 / 12), (2000, -1 / 24)])
def test_a_free_shaft_is_turned_by_the_mean_of_a_period(place, part):
    """Currents sampled where the voltage changes, or half a period from there."""
    current, omega = one_period(0.2)
    psi = BASE["psi_wb"] + BASE["ld_h"] * current.real + 1j * BASE["lq_h"] * current.imag
    mean = np.mean(10.5 * (np.conj(psi) * current).imag[:-1])
    signals = {name: np.zeros(400) for name in log().recorded}
    signals |= {
        "id_a": np.full(400, current[place].real),
        "iq_a": np.full(400, current[place].imag),
        "theta_mech_rad": omega * np.arange(400) * 5e-5,
        "torque_shaft_nm": np.full(400, mean - BASE["b_nm_s_rad"] * omega),
    }
    segment = replace(log(), recorded=signals)
    told = [
        residual(segment, PLAIN, {**BASE, "ripple_mean": share})[2, 100:300].mean()
        for share in (0.0, part)
    ]
    assert abs(told[0]) > 4e-4 * mean
    assert abs(told[1]) < 0.02 * abs(told[0])
    held = replace(segment, test="torque_map")
    assert residual(held, PLAIN, {**BASE, "ripple_mean": part})[2, 200] == pytest.approx(told[0])


def test_what_a_period_leaves_of_the_mean_current_is_within_what_is_known_of_it():
    """From −1/24 to 1/12, wherever a log samples its period: no free constant."""
    center, u = PLAIN.priors()["ripple_mean"]
    assert all(abs(part - center) < 2.0 * u for part in (1 / 12, -1 / 24))
    assert abs(0.3 - center) > 5.0 * u


def test_a_period_s_mean_is_that_of_an_earlier_instant():
    """Of a ramp at steady speed: current and electrical angle s T before the sample."""
    part, ts, omega = 0.4, 5e-5, 120.0

    def at(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return (2.0 - 300.0 * t) + 1j * (1.0 + 500.0 * t), 7 * omega * t

    t = ts * np.arange(60)
    current, eps = at(t)
    x = replace(
        operating(),
        id_a=current.real,
        iq_a=current.imag,
        eps_rad=eps,
        omega_rad_s=np.full(60, omega),
    )
    mean = mean_current(x, {**BASE, "ripple_slope": part})
    before, turned = at(t - part * ts)
    assert mean.eps_rad == pytest.approx(turned, abs=1e-12)
    assert mean.i_a[1:-1] == pytest.approx(before[1:-1], abs=1e-12)


def test_the_noise_floor_is_the_scatter_over_seeds():
    """chi²/n of a sound machine is 1 in every signal, over 6 logs of fresh noise."""
    total: dict[str, list[float]] = {}
    sigma = noise_floor(log(noise=1.0), PLAIN, BASE, 1)
    for seed in range(6):
        segment = log(noise=1.0, seed=seed)
        group, _, valid, groups = row_index(segment)
        weak = projected(segment, residual(segment, PLAIN, BASE))[valid] / sigma
        for place, (channel, _) in enumerate(groups):
            total.setdefault(channel, []).extend(weak[group[valid] == place] ** 2)
    for channel, squares in total.items():
        # windows overlap by half, and the floor itself has the scatter of two replicates
        spread = np.sqrt(2.0 / len(squares)) * 2.5
        assert np.mean(squares) == pytest.approx(1.0, abs=4 * spread), channel


def test_the_level_of_white_noise_is_found_under_a_moving_signal():
    t = np.arange(20000) * 1e-4
    rng = np.random.default_rng(8)
    signal = 5 * np.sin(30 * t) + np.where(t > 1.0, 3.0, 0.0) + rng.normal(0, 0.02, t.size)
    assert sensor_noise(signal, DEFAULT.sensor_noise) == pytest.approx(0.02, rel=0.06)


def test_a_quantised_ramp_has_its_rounding_noise():
    step = 2 * np.pi / 2**14
    ramp = np.round(np.linspace(0, 9.123, 20011) / step) * step
    assert sensor_noise(ramp, DEFAULT.sensor_noise) == pytest.approx(step / np.sqrt(12), rel=0.3)
    assert sensor_noise(np.linspace(0.0, 9.123, 20011), DEFAULT.sensor_noise) < 1e-12


@pytest.mark.parametrize("signal", ["vq_v", "torque_shaft_nm"])
def test_a_jump_is_known_to_a_quarter_of_a_sample(signal):
    """The weak sample of a step at k is its height times what stands behind k; a sample earlier or
    later changes that by height times the test function at k, of which a quarter is allowed.
    """
    model, segment = Model(machine(), ()), log()
    without = reading_error(segment, model, BASE)
    weak, jump, at = segment.weak, 5.0, 4000
    jumping, place = segment.recorded[signal].copy(), segment.channels.index(signal)
    jumping[at:] += jump
    stepped = replace(segment, recorded={**segment.recorded, signal: jumping})
    allowed = reading_error(stepped, model, BASE)[place, :, 0]
    over = (weak.starts <= at - 1) & (at - 1 < weak.starts + weak.length)
    told = np.zeros(weak.starts.size)
    told[over] = 0.25 * jump * weak.functions[0, 0][at - weak.starts[over]]
    assert over.sum() >= 2
    near = np.sqrt(np.maximum(allowed**2 - without[place, :, 0] ** 2, 0.0))
    assert near[over] == pytest.approx(np.abs(told[over]), rel=0.05, abs=0.02 * told.max())
    assert near[~over].max() < 0.1 * told.max(), "of the reading itself"


def test_an_instant_of_the_voltage_may_miss_what_a_jump_of_the_current_takes():
    """L Δi between two samples is in a mean over the time between them, not in an instant."""
    segment, jump, at = log(noise=1.0), 2.0, 4000
    weak, step = segment.weak, np.where(np.arange(8000) < at, 0.0, jump)
    current = segment.recorded["id_a"] + step
    jumping = replace(segment, recorded={**segment.recorded, "id_a": current})
    mean = replace(segment.instrument, timing="centred")
    smooth, instant = (reading_error(one, PLAIN, BASE)[0, :, 0] for one in (segment, jumping))
    of_mean = reading_error(replace(jumping, instrument=mean), PLAIN, BASE)[0, :, 0]
    inside = (weak.starts < at - 1) & (at < weak.starts + weak.length)
    beside = at - weak.starts[inside]
    functions = weak.functions[0, 0][beside - 1] + weak.functions[0, 0][beside]
    missed = BASE["ld_h"] * jump / (2.0 * segment.ts_s) * functions
    assert np.sqrt(instant[inside] ** 2 - smooth[inside] ** 2) == pytest.approx(missed, rel=0.05)
    assert instant[~inside] == pytest.approx(smooth[~inside]), "noise of a current is no jump"
    assert of_mean == pytest.approx(smooth)


@pytest.mark.parametrize("omega", [60.0, 120.0])
def test_a_line_of_the_encoder_s_error_is_a_torque_by_the_square_of_its_pace(omega):
    """θ + a cos kθ at a steady pace is J (kω)² a on order k, for an a of 0.03 steps."""
    step, theta = 1e-3, omega * 5e-5 * np.arange(8000)
    running = log()
    weak = projection(theta, running.weak.starts, running.weak.length, (14, 28, 42))
    running = replace(running, recorded={**running.recorded, "theta_mech_rad": theta}, weak=weak)
    noise = running.sensors.noise
    exact, coarse = (
        reading_error(
            replace(running, sensors=Sensors({**noise, "theta_mech_rad": u})), PLAIN, BASE
        )
        for u in (0.0, step / np.sqrt(12.0))
    )
    torque = running.channels.index("torque_shaft_nm")
    more = np.sqrt(coarse[torque] ** 2 - exact[torque] ** 2)
    assert more[:, 0] == pytest.approx(0.0, abs=1e-12)
    for place in np.flatnonzero(weak.orders):
        order = weak.orders[place]
        cosine = place == np.flatnonzero(weak.orders == order)[0]
        wave = np.cos(order * theta) if cosine else np.sin(order * theta)
        line = weak.project(BASE["j_kgm2"] * (order * omega) ** 2 * 0.03 * step * wave[None])
        valid = weak.valid[:, place]
        assert valid.any()
        assert more[valid, place] == pytest.approx(np.abs(line[0, valid, place]), rel=0.01)


def test_friction_at_rest_may_be_anything_between_both_its_senses():
    """A shaft that sticks for half a window: T/√3 there, what the log says of its sense aside."""
    running = log()
    rest = np.array(running.recorded["theta_mech_rad"])
    start, length = running.weak.starts[-1], running.weak.length
    rest[start + length // 2 :] = rest[start + length // 2]
    stuck = replace(running, recorded={**running.recorded, "theta_mech_rad": rest})
    friction = LIBRARY["coulomb_friction"]
    model = Model(machine(), (friction,))
    values = {**BASE, "coulomb_friction.torque_nm": 0.2}
    moving, resting = (reading_error(one, model, values)[2, :, 0] for one in (running, stuck))
    window = running.weak.functions[0, 0]
    smoothing = round(1e-3 / running.ts_s)
    late = window[length // 2 + smoothing :].sum()
    assert resting[-1] == pytest.approx(0.2 / 3**0.5 * late, rel=0.05)
    assert moving[-1] < 0.01 * resting[-1]
    # it passes through zero at the 3000th sample, and rests there no longer than 1.25 ms: friction
    # turns round there, at an instant that is known to half a sample
    at = 3000 - running.weak.starts
    over = (at > 0) & (at < length - 1)
    without = reading_error(running, Model(machine(), ()), BASE)[2, :, 0]
    turned = np.sqrt(moving[over] ** 2 - without[over] ** 2)
    assert turned == pytest.approx(0.5 * 2.0 * 0.2 * window[at[over]], rel=0.05, abs=1e-3 * late)
    assert moving[~over][:-2] == pytest.approx(without[~over][:-2])


def test_a_row_beside_a_rest_is_partly_of_it():
    """Its speed is a difference across the edge: friction may hold it too."""
    running = log()
    rest, weak = np.array(running.recorded["theta_mech_rad"]), running.weak
    first, past = weak.starts[-1] + 100, weak.starts[-1] + 280
    rest[first:past] = rest[first]
    rest[past:] += rest[first] - rest[past]
    stuck = replace(running, recorded={**running.recorded, "theta_mech_rad": rest})
    model = Model(machine(), (LIBRARY["coulomb_friction"],))
    values = {**BASE, "coulomb_friction.torque_nm": 0.2}
    allowed = reading_error(stuck, model, values)[2, -1, 0]
    smoothing = round(1e-3 / running.ts_s)
    slow = weak.functions[0, 0][100 + smoothing - 1 : 280 - smoothing + 1].sum()
    assert allowed == pytest.approx(0.2 / 3**0.5 * slow, rel=0.007)


def test_a_wave_that_turns_many_times_a_sample_averages_out_of_a_coasting_shaft():
    """Order 84 turns 133 times a sample at 2000 rad/s logged at 200 Hz: with waves at a few points
    a sample its mean is what they happen to beat to.
    """
    turned = np.linspace(0.0, 60 * 2000.0 * 5e-3 / 32, 60)
    x = replace(operating(), theta_rad=turned, inverter=False)
    for finer, most in ((32, 0.08), (1, 1.0)):
        cosine, sine = replace(x, shaft=ShaftState(finer=finer), cache={}).shaft_waves(84)
        assert np.hypot(cosine, sine).max() <= most + 1e-12
    assert np.hypot(cosine, sine).min() == pytest.approx(1.0)
    slow = replace(x, theta_rad=turned / 3e3, shaft=ShaftState(finer=32), cache={})
    assert np.hypot(*slow.shaft_waves(84)).min() > 0.999


@pytest.mark.parametrize("turn_rad", [0.15, 0.3, 2.0, 5.0, 9.0, 23.0, 31.0, 52.6, 68.0, 140.0])
def test_a_coasting_sample_is_averaged_over_parts_enough(turn_rad):
    """The mean of a wave under a triangle of two samples is sinc² of what it turns in one."""
    order = max(slow_orders(machine()))
    theta = np.arange(40) * turn_rad / order
    segment = replace(coasting(), recorded={"theta_mech_rad": theta})
    finer = finer_of(segment, machine(), DEFAULT.cutting.coast_parts)
    turned = np.arange(40 * finer) * turn_rad / order / finer
    x = replace(operating(), theta_rad=turned, inverter=False, shaft=ShaftState(finer=finer))
    mean = averaged(x.shaft_waves(order)[0], finer)
    true = np.sinc(turn_rad / (2 * np.pi)) ** 2 * np.cos(order * theta)
    assert mean[2:-2] == pytest.approx(true[2:-2], abs=0.004)
    assert finer <= max(8, np.ceil(turn_rad / 3.0))


def pulsed(voltage_v: complex, vdc_v: float, hold_s: float, r_ohm: float, l_h: float) -> complex:
    """Mean of the current over a period of centred pulses, less its sample between them [A]: in the
    steady state, of a machine at rest whose mean current is that of the voltage.
    """
    phases = np.exp(2j * np.pi / 3.0 * np.arange(3))
    wanted = (voltage_v * np.conj(phases)).real
    duty = 0.5 + (wanted - 0.5 * (wanted.max() + wanted.min())) / vdc_v
    steps = 6000
    h = hold_s / steps
    t = (np.arange(steps) + 0.5) * h - 0.5 * hold_s
    legs = vdc_v * (np.abs(t)[None, :] < 0.5 * hold_s * duty[:, None])
    volts = 2.0 / 3.0 * phases @ legs
    decay = np.exp(-r_ohm * h / l_h)
    forced = 0j
    for v in volts:
        forced = decay * forced + (1.0 - decay) * v / r_ohm
    now = forced / (1.0 - decay**steps)
    currents = []
    for v in volts:
        currents.append(now)
        now = decay * now + (1.0 - decay) * v / r_ohm
    return complex(np.mean(currents) - currents[steps // 2])


@pytest.mark.parametrize(("size_v", "least"), [(0.3, 1.5), (8.0, 0.3)])
def test_the_drop_of_a_ripple_is_within_what_a_drive_may_be_off_by(size_v, least):
    """Of little voltage R T² v/(96 L²), √3 of the allowance; of pulses that fill a period, less."""
    r_ohm, l_h, hold_s, vdc_v = 1.8, 1.1e-4, 5e-6, 24.0
    above = pulsed(size_v * np.exp(0.7j), vdc_v, hold_s, r_ohm, l_h)
    allowed = DEFAULT.noise_floors.pulses * r_ohm * (hold_s / l_h) ** 2 * size_v
    assert (above * np.exp(-0.7j)).real > 0.5 * abs(above)
    assert least < abs(above) / allowed < np.sqrt(3.0) * 1.05


def test_a_drive_is_allowed_the_drop_of_a_ripple_where_a_period_is_no_small_part_of_l_over_r():
    """T R/L of the base is a twentieth; at a tenth of the inductance it is a half."""
    segment = replace(log(), fixed={**log().fixed, "pwm_s": 5e-5})
    little = {**BASE, "lq_h": 0.1 * BASE["lq_h"]}
    usual, large = (reading_error(segment, PLAIN, v)[2, :, 0] for v in (BASE, little))
    speed = np.abs(np.gradient(segment.recorded["theta_mech_rad"], segment.ts_s)).max()
    emf = 7.0 * BASE["psi_wb"] * speed
    current = 0.006 * BASE["r_ohm"] * (5e-5 / little["lq_h"]) ** 2 * emf
    gain = segment.weak.functions[0, 0].sum()
    torque = 10.5 * BASE["psi_wb"] * current * gain
    assert large.max() == pytest.approx(torque, rel=0.2)
    assert usual.max() < 0.5 * large.max()


def test_a_pulse_that_is_sampled_off_its_middle_has_a_torque_in_proportion_to_speed():
    """K² τ ω/(1.5 L_q) of the EMF's own torque constant K, as the estimators know it. Without it a
    sampled current was held against a coast as exact, and a sound motor was unknown.
    """
    late_s, segment = 0.5e-6, log()
    model = Model(machine(), ())
    moved, still = (
        residual(segment, model, {**BASE, "ripple_sampled": value}) for value in (late_s, 0.0)
    )
    theta = segment.recorded["theta_mech_rad"]
    omega = np.gradient(theta, segment.ts_s)
    per_ampere = 1.5 * 7 * BASE["psi_wb"]
    expected = per_ampere**2 * late_s * omega / (1.5 * BASE["lq_h"])
    change = (still - moved)[2, 50:-50]
    # L_q i_d less L_d i_d is in the torque per ampere too
    assert np.abs(change - expected[50:-50]).max() < 0.15 * np.abs(expected).max()
    assert np.corrcoef(change, expected[50:-50])[0, 1] > 0.99
    assert (still - moved)[:2, 50:-50] == pytest.approx(0.0, abs=1e-12)
