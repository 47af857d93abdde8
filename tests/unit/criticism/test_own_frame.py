"""Open terminals without an encoder, beside logs whose encoder is off its centre."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.criticism.data.machine_scale import machine_of
from pipeline.criticism.diagnosis import diagnose
from pipeline.criticism.equations.open_circuit import cut, measured
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
from tests.unit.criticism.machines import machine
from tests.unit.estimation.signals import capture

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
    known = machine_of(part, Constants())
    model = Model(known, (effects()[name],))
    plain = start_values(model, known)
    amplitude = next(key for key in plain if key.startswith(name))
    for segment in segments(part, known):
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


def test_a_resolver_that_errs_twice_an_electrical_turn_is_no_gain_of_a_phase():
    """Both make waves of twice the electrical angle; the gain was named, as sure as could be."""
    sound = replace(design("servo-ipm"), effects={})
    size, order = 5e-4, 2.0 * sound.pole_pairs
    motor = sound.having(angle_eccentricity={"size": size, "order": order})
    plan = (("drive_0", "drive", {"load": 0.0}), ("spin_down", "spin_down", {}))
    found = diagnose(campaign_of(campaign(motor, Bench(), 4, plan)), ModelSpec(), Constants())
    assert found.missing == ("angle_eccentricity",)
    last = found.ladder[-1].parameters
    waves = [
        last[f"angle_eccentricity.{one}2_elec_turn_rad"].value or 0.0 for one in ("sine", "cosine")
    ]
    assert np.hypot(*waves) == pytest.approx(size, rel=0.02)


def test_voltages_to_the_star_point_are_lines_without_their_third_harmonic():
    """`run` read them, and `diagnose` said that there were too few even samples."""
    t = np.arange(20_000) * 1e-4
    eps = 120.0 * t
    noise = 1e-3 * np.random.default_rng(2).standard_normal((3, t.size))
    phases = np.array([5.0 * np.cos(eps - 2.0 * np.pi / 3.0 * k) for k in range(3)]) + noise
    third = phases + 0.9 * np.cos(3.0 * eps)
    lines = phases - np.roll(phases, -1, axis=0)
    given = dict(zip(("vab_v", "vbc_v", "vca_v"), lines, strict=True))
    star = dict(zip(("va_v", "vb_v", "vc_v"), third, strict=True))
    known = machine(1)
    by_lines, by_star = (
        cut(capture("open_circuit", t_s=t, theta_mech_rad=eps, **columns), known)
        for columns in (given, star)
    )
    for name in ("vab_v", "vbc_v", "vca_v"):
        assert by_star.recorded[name] == pytest.approx(by_lines.recorded[name], abs=1e-9)
    assert cut(capture("open_circuit", t_s=t, theta_mech_rad=eps, va_v=third[0]), known) is None


def test_a_swing_of_the_shaft_is_no_voltage():
    """A swing by 0.05 rad electrical at 50 Hz, near the electrical frequency, to a tenth of it.

    Taken off by a mean over 20 ms it was all in v_d, as a voltage that nothing makes. A sixth wave
    of 1 % of the back-EMF stays in it, on a shaft that swings.
    """
    t = np.arange(20_000) * 5e-5
    eps = 2.0 * np.pi * 37.0 * t + 0.05 * np.sin(2.0 * np.pi * 50.0 * t)
    speed = np.gradient(eps, t)
    wave = 5e-3 * speed * np.exp(1j * eps) * (1j + 0.01 * np.sin(6.0 * eps))
    noise = 1e-4 * np.random.default_rng(5).standard_normal((3, t.size))
    turns = np.exp(2j * np.pi / 3.0 * np.arange(3))
    lines = [(wave * (np.conj(turns[k]) - np.conj(turns[(k + 1) % 3]))).real for k in range(3)]
    columns = dict(zip(("vab_v", "vbc_v", "vca_v"), np.array(lines) + noise, strict=True))
    made = cut(capture("open_circuit", t_s=t, **columns), machine(1))
    voltage = measured(made, made.recorded, Model(machine(1), ()), {"bench_angle_rad": 0.0})
    angle = made.recorded["theta_mech_rad"]
    at_sixth = 2.0 * np.mean(voltage[0] * np.exp(-6j * angle))
    left = voltage[0] - (at_sixth * np.exp(6j * angle)).real
    size = 5e-3 * 2.0 * np.pi * 37.0
    assert abs(at_sixth) == pytest.approx(0.01 * size, rel=0.15)
    assert np.std(left) < 0.1 * 0.05 * size


def test_harmonics_count_of_few_samples_a_turn():
    """Eight samples a cycle of the sixth wave: its bend is no noise, and its slope is resolved."""
    omega, psi, share, u = 300.0, 0.0094, 0.012, 2e-3
    t = 2.0 * np.pi / (48.0 * omega) * np.arange(4000)
    eps = omega * t
    flux = psi * (1.0 + share * np.cos(6.0 * eps))
    slope = -6.0 * omega * psi * share * np.sin(6.0 * eps)
    wave = np.exp(1j * eps) * (slope + 1j * omega * flux)
    turns = np.exp(2j * np.pi / 3.0 * np.arange(3))
    lines = [(wave * (np.conj(turns[k]) - np.conj(turns[(k + 1) % 3]))).real for k in range(3)]
    noise = u * np.random.default_rng(5).standard_normal((3, t.size))
    columns = dict(zip(("vab_v", "vbc_v", "vca_v"), np.array(lines) + noise, strict=True))
    made = cut(capture("open_circuit", t_s=t, theta_mech_rad=eps / 7.0, **columns), machine(7))
    assert made.sensors.noise["vab_v"] == pytest.approx(u, rel=0.25)
    assert 42 in made.weak.orders
    model = Model(machine(7), (effects()["bemf_harmonics"],))
    values = {**start_values(model, machine(7)), "psi_wb": psi, "bemf_harmonics.d6_cos": share}
    left = made.weak.project(residual(made, model, values))
    plain = made.weak.project(residual(made, model, {**values, "bemf_harmonics.d6_cos": 0.0}))
    sixth = made.weak.orders == 42
    assert np.std(left[:, :, sixth]) < 1.2 * u
    assert np.std(plain[:, :, sixth]) > 20.0 * u
