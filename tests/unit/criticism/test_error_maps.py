"""Error maps: a planted error is found in its cell, at its angle, and nowhere else."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pipeline.criticism.data.segment import Sensors
from pipeline.criticism.library.registry import effects
from pipeline.criticism.machine.model import Model
from pipeline.criticism.policy.policy import DEFAULT
from pipeline.criticism.regression.fit import Fit, floors
from pipeline.criticism.regression.linear_system import linear_system
from pipeline.criticism.residuals.residual import residual
from pipeline.criticism.validation.error_maps import (
    Errors,
    angle_maps,
    curve,
    direction,
    disjoint,
    histograms,
    speed_current_map,
    window_errors,
)
from pipeline.numerics.projection import projection
from tests.unit.criticism.machines import BASE, log, machine

N = 3000


def scattered(planted: float, seed: int = 2) -> Errors:
    """Windows all over speed and current, with an error planted in one corner of the map."""
    rng = np.random.default_rng(seed)
    speed, current = rng.uniform(-200, 200, N), rng.uniform(-12, 12, N)
    sigma = np.full(N, 0.02)
    inside = (speed > 150) & (current < -10)
    return Errors(
        "vq_v",
        sigma * rng.normal(size=N) + planted * inside,
        sigma,
        np.repeat(np.arange(6), N // 6),
        np.arange(N) % (N // 6),
        {"omega_mech_rad_s": speed, "iq_a": current, "t_s": np.tile(np.linspace(0, 1, N // 6), 6)},
    )


def test_a_planted_error_is_found_in_its_corner():
    one = speed_current_map(scattered(0.05), DEFAULT.validation)
    assert one is not None
    assert one.y is not None
    assert int(one.count.sum()) == N
    row, column = np.unravel_index(int(np.nanargmin(one.p_value)), one.p_value.shape)
    assert one.x.edges[column] >= 149.0
    assert one.y.edges[row + 1] <= -9.9
    assert one.p_map < 1e-6
    sure = one.p_value * one.p_value.size < 1e-3
    for r, c in zip(*np.nonzero(sure), strict=True):
        assert one.x.edges[c + 1] > 150
        assert one.y.edges[r] < -10
        assert one.mean[r, c] == pytest.approx(0.05, abs=0.02)


def test_noise_marks_no_cell_and_depends_on_nothing():
    errors = scattered(0.0)
    one = speed_current_map(errors, DEFAULT.validation)
    assert one is not None
    assert np.nanmin(one.p_value) * one.p_value.size > 0.01
    curves = (curve(errors, name, DEFAULT.validation) for name in ("t_s", "iq_a"))
    for told in (one, *curves, direction(errors)):
        assert told is not None
        assert told.p_map > 1e-3
        assert told.explained < 0.1


def test_cells_of_one_variable_hold_equal_shares_and_the_sense_has_two():
    errors = scattered(0.0)
    one, sense = curve(errors, "omega_mech_rad_s", DEFAULT.validation), direction(errors)
    assert one is not None
    assert sense is not None
    assert np.ptp(one.count) <= 2
    assert sense.count.tolist() == [
        int((errors.at["omega_mech_rad_s"] < 0).sum()),
        int((errors.at["omega_mech_rad_s"] > 0).sum()),
    ]
    assert curve(errors, "temp_magnet_degc", DEFAULT.validation) is None


def test_a_map_of_a_fit_knows_speed_and_current_of_its_windows():
    """The closed-form log: speed and mean current of every window, and the residual in volts."""
    segment, model = log(noise=1.0), Model(machine(), ())
    system = linear_system(Fit((segment,), model, dict(BASE), floors([segment], model, BASE), BASE))
    errors = {e.signal: e for e in window_errors(system, system.residual)}
    assert set(errors) == {"vd_v", "vq_v", "torque_shaft_nm"}
    one = errors["vq_v"]
    middle = (segment.weak.starts + segment.weak.length / 2) * 5e-5
    assert one.at["omega_mech_rad_s"] == pytest.approx(-60 + 400 * middle, abs=0.2)
    assert one.at["iq_a"] == pytest.approx(6 * np.cos(25 * middle) + 1, abs=0.1)
    left = residual(segment, model, BASE)[1]
    means = segment.weak.means(left[None])[0]
    # a sensor's offset is absorbed as far as its prior goes
    assert one.error == pytest.approx(means, abs=0.5 * 0.01)
    assert np.corrcoef(one.error, means)[0, 1] > 0.99
    for spread in histograms(tuple(errors.values()), DEFAULT.validation):
        assert sum(spread.count) == segment.weak.starts.size


def test_a_harmonic_shows_over_the_electrical_angle_with_its_size():
    """A cogging torque that the model lacks stands in the mechanical map with its amplitude, and is
    gone with the effect in the model.
    """
    segment, plain = log(noise=0.2), Model(machine(), ())
    theta = segment.recorded["theta_mech_rad"]
    segment.recorded["torque_shaft_nm"] -= 0.01 * np.sin(12 * theta)
    maps = {
        (m.signal, m.x.variable): m
        for m in angle_maps(Fit((segment,), plain, dict(BASE), (), BASE))
    }
    seen = maps["torque_shaft_nm", "theta_mech_rad"]
    middle = 0.5 * (np.array(seen.x.edges[1:]) + np.array(seen.x.edges[:-1]))
    wave = np.nan_to_num(seen.mean) @ np.sin(12 * middle) / (np.sin(12 * middle) ** 2).sum()
    assert wave == pytest.approx(-0.01, rel=0.1)
    effect = effects()["cogging"]
    model = plain.with_effects(effect)
    names = [f"cogging.{p.name}" for p in effect.parameters_of(model.machine)]
    values = {**BASE, **dict.fromkeys(names, 0.0), "cogging.sin_12_nm": 0.01}
    left = angle_maps(Fit((segment,), model, values, (), values))
    after = next(
        m for m in left if (m.signal, m.x.variable) == ("torque_shaft_nm", "theta_mech_rad")
    )
    rest = np.nan_to_num(after.mean) @ np.sin(12 * middle) / (np.sin(12 * middle) ** 2).sum()
    assert abs(rest) < 0.1 * abs(wave)


def test_windows_that_share_samples_are_counted_once():
    assert disjoint(np.array([0, 5, 10, 12, 25]), 10).tolist() == [0, 10, 25]
    assert math.isclose(disjoint(np.array([3]), 10)[0], 3)


@pytest.mark.parametrize("zero_rad", [0.0, 2.0])
def test_an_open_circuit_spin_is_mapped_over_the_motor_s_own_angle(zero_rad):
    """The bench's encoder has another zero than the drive's, by which the fit knows it."""
    n, speed, at_rad = 8000, 40.0, 1.0
    eps = 7 * speed * 5e-5 * np.arange(n)
    voltage = 1j * 7 * speed * BASE["psi_wb"] + 0.05 * np.cos(eps - at_rad)
    stationary = voltage * np.exp(1j * eps)
    a, b, c = ((stationary * np.exp(-2j * np.pi * k / 3)).real for k in range(3))
    theta = (eps + zero_rad) / 7
    spin = replace(
        log(n),
        kind="open",
        test="open_circuit",
        recorded={"vab_v": a - b, "vbc_v": b - c, "vca_v": c - a, "theta_mech_rad": theta},
        sensors=Sensors({"vab_v": 1e-3, "vbc_v": 1e-3, "vca_v": 1e-3, "theta_mech_rad": 1e-6}),
        channels=("vd_v", "vq_v"),
        weak=projection(theta, np.arange(40, n - 440, 200), 400, ()),
    )
    values = {**BASE, "bench_angle_rad": zero_rad}
    model = Model(machine(), ())
    fit = Fit((spin,), model, values, floors((spin,), model, values), values)
    made = {(one.signal, one.x.variable): one for one in angle_maps(fit)}
    one = made["vd_v", "theta_elec_rad"]
    middle = 0.5 * (np.array(one.x.edges[1:]) + np.array(one.x.edges[:-1]))
    assert one.mean == pytest.approx(0.05 * np.cos(middle - at_rad), abs=2e-3)
