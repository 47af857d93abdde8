"""What a segment's sensors recorded and the machine's true state behind it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pipeline.criticism.data.machine_scale import base_scales
from pipeline.criticism.data.segment import Instrument, Segment, Sensors, Unthinned
from pipeline.criticism.effect import Discrimination
from pipeline.criticism.library.registry import effects
from pipeline.criticism.machine.model import Model, evaluate, zero
from pipeline.criticism.operating import Operating, Values
from pipeline.criticism.parameter import Parameter
from pipeline.criticism.regression.columns import base_columns
from pipeline.criticism.regression.fit import Fit
from pipeline.criticism.regression.linear_system import LinearSystem, linear_system
from pipeline.criticism.residuals.residual import operate, residual
from pipeline.criticism.selection.discrimination import discriminate
from pipeline.numerics.projection import projection
from tests.unit.criticism.machines import BASE, log, machine, operating, unit_floor

LIBRARY = effects()
TS = 1e-4


def spin(bench_angle_rad: float, share: float) -> Segment:
    """An open-circuit spin whose bench reads the angle from a zero of its own, with a sixth
    harmonic of the d flux.
    """
    n, p, omega = 4000, 7, 60.0
    true_eps = p * omega * TS * np.arange(n) + 0.3
    theta = (true_eps + bench_angle_rad) / p
    # rotor frame: psi_d = psi (1 + share cos 6 eps), so that v = p omega (j psi + d psi/d eps)
    flux = BASE["psi_wb"] * (1.0 + share * np.cos(6 * true_eps))
    slope = -6.0 * share * BASE["psi_wb"] * np.sin(6 * true_eps)
    stationary = p * omega * (slope + 1j * flux) * np.exp(1j * true_eps)
    phases = [(stationary * np.exp(-2j * math.pi * k / 3)).real for k in range(3)]
    signals = {
        "vab_v": phases[0] - phases[1],
        "vbc_v": phases[1] - phases[2],
        "vca_v": phases[2] - phases[0],
        "theta_mech_rad": theta,
        "temp_magnet_degc": np.full(n, 25.0),
    }
    noise = dict.fromkeys(signals, 0.0)
    weak = projection(theta, np.arange(40, n - 440, 200), 400, ())
    fixed = {"ambient_k": 0.0}
    channels = ("vd_v", "vq_v")
    return Segment(
        capture="spin",
        test="open_circuit",
        kind="open",
        ts_s=TS,
        recorded=signals,
        channels=channels,
        weak=weak,
        instrument=Instrument("bench", "instant"),
        sensors=Sensors(noise),
        fixed=fixed,
    )


def test_the_bench_s_zero_of_the_angle_turns_the_harmonics_too():
    harmonics = LIBRARY["bemf_harmonics"]
    model = Model(machine(), (harmonics,))
    values = {**BASE, **zero(harmonics, model), "bemf_harmonics.d6_cos": 0.03}
    left = residual(spin(0.5, 0.03), model, {**values, "bench_angle_rad": 0.5})
    plain = residual(spin(0.5, 0.03), Model(machine(), ()), {**BASE, "bench_angle_rad": 0.5})
    inner = slice(20, -20)
    assert np.std(left[:, inner]) < 0.02 * np.std(plain[:, inner])


def test_back_emf_without_torque_ripple_is_one_of_the_forms():
    """`ripple_share` 0: the drag takes what the co-energy's slope gives, sample by sample."""
    harmonics = LIBRARY["bemf_harmonics"]
    model = Model(machine(), (harmonics,))
    values = {**BASE, **zero(harmonics, model), "bemf_harmonics.q6_sin": 0.03}
    turning, quiet = (
        evaluate(model, operating(), {**values, "bemf_harmonics.ripple_share": share})
        for share in (1.0, 0.0)
    )
    ripple = 1.5 * 7 * turning.slope_wb
    assert np.std(ripple) > 0.0 and not turning.drag_nm.std() > np.std(ripple)
    assert quiet.drag_nm - turning.drag_nm == pytest.approx(ripple, rel=1e-9)


@pytest.mark.parametrize("name", ["angle_offset", "angle_eccentricity"])
def test_an_angle_error_of_nothing_leaves_the_drive_s_own_speed(name: str):
    drive = log(noise=1.0)
    speed = np.gradient(drive.recorded["theta_mech_rad"], drive.ts_s) + 0.4
    signals = {**drive.recorded, "omega_mech_rad_s": speed}
    alone = replace(drive, kind="q", channels=("vq_v",), recorded=signals)
    model = Model(machine(), (LIBRARY[name],))
    values = {**BASE, **zero(LIBRARY[name], model)}
    assert operate(alone, signals, model, values).omega_rad_s == pytest.approx(speed, abs=1e-9)


def test_an_encoder_off_its_centre_does_not_make_the_speed_uneven():
    """Recorded ωt + a sin ωt, 12 turns: the true speed is ω, and the recorded one off it by a ω."""
    eccentric = LIBRARY["angle_eccentricity"]
    model = Model(machine(), (eccentric,))
    values = {**BASE, **zero(eccentric, model), "angle_eccentricity.sine_rad": 2e-3}
    true = 100.0 * 5e-5 * np.arange(8000)
    signals = {**log().recorded, "theta_mech_rad": true + 2e-3 * np.sin(true)}
    x = operate(replace(log(), recorded=signals), signals, model, values)
    inner = slice(60, -60)
    assert x.theta_rad[inner] == pytest.approx(true[inner], abs=1e-7)
    assert x.omega_rad_s[inner] == pytest.approx(100.0, abs=0.01 * 2e-3 * 100.0)


def test_a_finer_clock_keeps_reversals_in_their_place():
    n = 400
    at = np.arange(n) * 1e-3
    theta = 12.0 * np.abs(at - 0.2)
    run = (at >= 0.2).astype(float)
    signals = {
        "theta_mech_rad": theta,
        "iq_a": np.zeros(n),
        "run": run,
        "travel_rad": np.where(run > 0, 12.0 * (at - 0.2), np.inf),
    }
    sensors = Sensors({}, runs_rad=np.array([-2.4, 2.4]))
    coast = replace(log(), kind="motion", ts_s=1e-3, recorded=signals, sensors=sensors)
    x = operate(coast, signals, Model(machine(), ()), BASE)
    assert x.shaft.finer > 1 and x.shaft.run is not None
    assert np.array_equal(x.shaft.run[:: x.shaft.finer], run)
    late = x.theta_rad.size // 2 + 5 * x.shaft.finer
    assert x.travel_rad[late:] == pytest.approx(
        x.theta_rad[late:] - x.theta_rad[x.theta_rad.size // 2], abs=1e-9
    )
    assert np.isinf(x.travel_rad[: late - 6 * x.shaft.finer]).all()


def test_a_drop_may_ask_for_the_flux_whatever_the_ripple():
    def drop(x: Operating, q: Values) -> np.ndarray:
        return q["share"] * x.flux_wb

    flux_drop = (Parameter("share", "1", 0.1, 0.01),)
    own = replace(effects()["cogging"], name="flux_drop", parameters=flux_drop, expand=None)
    own = replace(own, torque=None, drop=drop)
    model = Model(machine(), (own,))
    values = {**BASE, "flux_drop.share": 0.1, "ripple_slope": 0.1}
    assert evaluate(model, operating(), values).drop_v.shape == (60,)


def test_columns_of_a_free_shaft_that_are_kept_go_by_the_new_inertia():
    coast = replace(log(), kind="motion", channels=("torque_shaft_nm",))
    columns = base_columns(machine(), base_scales(machine()))

    def around(values: dict[str, float], before: LinearSystem | None = None) -> LinearSystem:
        fit = Fit((coast,), Model(machine(), ()), values, sigma, BASE)
        return linear_system(fit, (), before)

    sigma = (unit_floor(coast),)
    heavier = {**BASE, "j_kgm2": 2.0 * BASE["j_kgm2"]}
    kept, fresh = around(heavier, around(dict(BASE))), around(heavier)
    for name in ("psi_wb", "b_nm_s_rad"):
        place = [column.name for column in columns].index(name)
        assert kept.matrix[:, place] == pytest.approx(fresh.matrix[:, place], rel=1e-3)


def test_a_closer_look_sees_the_torque_without_the_transducer_s_offset():
    seen = []

    def look(wholes, q):
        seen.append(wholes[0].shaft_nm)
        return Discrimination("compliance", {})

    offset, coupled = LIBRARY["torque_offset"], replace(LIBRARY["compliance"], discriminator=look)
    drive = log()
    whole = {**drive.recorded, "good": np.ones(drive.size)}
    model = Model(machine(), (offset, coupled))
    values = {**BASE, "torque_offset.offset_nm": 0.2, **zero(coupled, model)}
    discriminate(
        Fit((replace(drive, unthinned=Unthinned(whole)),), model, values, (), BASE), coupled
    )
    assert seen[0] == pytest.approx(drive.recorded["torque_shaft_nm"] - 0.2)


def test_the_electrical_angle_and_the_current_go_with_an_error_of_the_angle():
    """True angle p θ, and a current in the rotor frame of that: what hooks of 6ε are told."""
    segment, off = log(), LIBRARY["angle_offset"]
    model = Model(machine(), (off,))
    values = {**BASE, **zero(off, model), "angle_offset.offset_rad": 0.02}
    plain = operate(segment, segment.recorded, Model(machine(), ()), BASE)
    x = operate(segment, segment.recorded, model, values)
    p = machine().pole_pairs
    assert x.eps_rad == pytest.approx(p * x.theta_rad)
    assert x.eps_rad - plain.eps_rad == pytest.approx(np.full(segment.size, -0.02))
    assert x.i_a == pytest.approx(plain.i_a * np.exp(0.02j))


def test_the_complex_current_is_that_of_both_axes_of_a_copy():
    """It is made once for both arrays, and anew for a copy with another one of either."""
    x = operating(n=8)
    assert x.i_a is replace(x, theta_rad=x.theta_rad + 1.0).i_a
    for axis in ("id_a", "iq_a"):
        moved = replace(x, **{axis: getattr(x, axis) + 1.0})
        assert moved.i_a == pytest.approx(moved.id_a + 1j * moved.iq_a)
        assert np.abs(moved.i_a - x.i_a) == pytest.approx(np.ones(8))
