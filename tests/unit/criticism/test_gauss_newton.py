"""Where fits begin again."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import polars as pl
import pytest

from pipeline.criticism.data.machine_scale import machine_of
from pipeline.criticism.data.segment import rows_where
from pipeline.criticism.diagnosis import base_fit
from pipeline.criticism.library.named_models import model_of
from pipeline.criticism.library.registry import effects
from pipeline.criticism.machine.model import Model
from pipeline.criticism.regression.fit import Fit, floors, floors_grown
from pipeline.criticism.regression.gauss_newton import (
    first_fit,
    gauss_newton,
    rough_anew,
    summed_error,
)
from pipeline.criticism.regression.linear_system import LinearSystem, linear_system
from pipeline.criticism.residuals.segments import segments, sparse
from pipeline.criticism.selection.refit import floored_anew
from pipeline.criticism.selection.requested_model import fit_of
from pipeline.records.capture import Campaign, Capture, CaptureMeta
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants
from pipeline.simulator.bench import campaign
from pipeline.simulator.design import EXACT, Bench
from tests.simulated import campaign_of, design
from tests.unit.criticism.machines import BASE, coasting, fitted, log, machine, with_drag

STRIBECK = Model(machine(), (effects()["stribeck"],))


def astray(segments) -> Fit:
    """A fit with a thousandth of the inertia, and floors as they are with that."""
    values = {
        **BASE,
        "j_kgm2": 1e-3 * BASE["j_kgm2"],
        "stribeck.excess_nm": 0.5,
        "stribeck.speed_rad_s": 9.0,
        "stribeck.exponent": 2.0,
        "stribeck.tail": 0.0,
    }
    return Fit(segments, STRIBECK, values, floors(segments, STRIBECK, values), values)


@pytest.mark.slow
def test_a_fit_begun_anew_forgets_its_constants_and_keeps_its_shapes(monkeypatch):
    segments = tuple(log(seed=n, noise=1.0) for n in (1, 2))
    lost = replace(astray(segments), tolerance=tuple(np.full(12, 1e-3) for _ in segments))
    begun = []

    def watched(start, *more, **other):
        begun.append(start.values)
        return gauss_newton(start, *more, **other)

    monkeypatch.setattr("pipeline.criticism.regression.gauss_newton.gauss_newton", watched)
    system = first_fit(rough_anew(lost))
    fitted = system.fit
    assert begun[0]["stribeck.speed_rad_s"] == 9.0
    assert begun[0]["stribeck.excess_nm"] == 0.0
    assert begun[0]["j_kgm2"] != lost.values["j_kgm2"]
    assert fitted.values["j_kgm2"] == pytest.approx(BASE["j_kgm2"], rel=0.02)
    assert fitted.tolerance is lost.tolerance


def test_whichever_end_is_better_stays(monkeypatch):
    segments = tuple(log(seed=n, noise=1.0) for n in (1, 2))
    lost = astray(segments)
    monkeypatch.setattr(
        "pipeline.criticism.selection.refit.gauss_newton",
        linear_system,
    )
    found = floored_anew(lost)
    assert found.values["j_kgm2"] == pytest.approx(BASE["j_kgm2"], rel=0.02)
    assert floored_anew(found).values is found.values


def test_ends_with_other_floors_do_not_compare_by_their_deviance(monkeypatch):
    """Floors of the winding that were a twentieth higher, in thousands of windows, were worth an
    inertia of a hundredth: 1,220 floors of the torque in two windows.
    """
    winding = ("vd_v", "vq_v")
    segments = (
        replace(log(seed=1, noise=1.0), channels=winding),
        sparse(log(seed=2, noise=1.0), 2, 24),
    )
    lost = astray(segments)

    def louder(fit, before):
        of_winding = (rows_where(one, lambda channel, _: channel in winding) for one in segments)
        pairs = zip(fit.sigma, of_winding, strict=True)
        sigma = tuple(np.where(rows, 10.0 * sigma, sigma) for sigma, rows in pairs)
        return linear_system(replace(fit, sigma=sigma))

    monkeypatch.setattr("pipeline.criticism.selection.refit.gauss_newton", louder)
    monkeypatch.setattr("pipeline.criticism.selection.refit.floors_changed", lambda _: False)
    assert louder(lost, None).deviance < first_fit(rough_anew(lost)).deviance
    assert floored_anew(lost).values["j_kgm2"] == pytest.approx(BASE["j_kgm2"], rel=0.1)


@pytest.mark.parametrize(
    ("share", "times"), [pytest.param(1e-3, 1, marks=pytest.mark.slow), (0.7, 0), (3.0, 1)]
)
def test_a_fit_is_begun_anew_only_from_another_inertia(monkeypatch, share, times):
    """What is left over the floor may be no fault of the fit: two seconds a step for nothing."""
    segments = tuple(log(seed=n, noise=1.0) for n in (1, 2))
    values = {**astray(segments).values, "j_kgm2": share * BASE["j_kgm2"]}
    lost = Fit(segments, STRIBECK, values, floors(segments, STRIBECK, values), values)
    begun = []
    monkeypatch.setattr(
        "pipeline.criticism.selection.refit.first_fit",
        lambda near: begun.append(near) or first_fit(near),
    )
    monkeypatch.setattr(
        "pipeline.criticism.selection.refit.gauss_newton",
        linear_system,
    )
    floored_anew(lost)
    assert len(begun) == times


@pytest.mark.parametrize("start", [1e-13, -1e-13])
def test_viscous_friction_comes_back_from_next_to_nothing(start):
    """A rough fit may leave it there; steps of its own size then held it, and the equation of the
    coasting shaft was given up. A current that is sampled off its mean is a torque in proportion
    to speed, which these logs do not part from it.
    """
    segments = (log(noise=1.0), log(noise=1.0, seed=6))
    model = Model(machine(), ())
    near = Fit(segments, model, {**BASE, "b_nm_s_rad": start}, floors(segments, model, BASE), BASE)
    found = gauss_newton(near).fit
    per_ampere = 1.5 * 7 * BASE["psi_wb"]
    of_sample = per_ampere**2 / (1.5 * BASE["lq_h"]) * found.values["ripple_sampled"]
    viscous = found.values["b_nm_s_rad"] - of_sample
    assert viscous == pytest.approx(BASE["b_nm_s_rad"], rel=0.05)
    assert found.values["b_nm_s_rad"] > 0.5 * BASE["b_nm_s_rad"]


@pytest.mark.parametrize("share", [0.015, 0.1, 8.0])
def test_inertia_comes_back_from_where_a_missing_effect_left_it(share):
    """A step of its own size would not reach, and a floor that counts T / J by the fit's own J
    would make it well worth to stay: a coasting shaft may then do what it likes.
    """
    segments = (log(noise=1.0), coasting(), log(noise=1.0, seed=6))
    model = Model(machine(), ())
    near = Fit(segments, model, dict(BASE), floors(segments, model, BASE), BASE)
    lost = {**BASE, "j_kgm2": share * BASE["j_kgm2"], "b_nm_s_rad": share * BASE["b_nm_s_rad"]}
    found = gauss_newton(replace(near, values=lost)).fit
    assert found.values["j_kgm2"] == pytest.approx(BASE["j_kgm2"], rel=0.01)
    assert found.values["b_nm_s_rad"] == pytest.approx(BASE["b_nm_s_rad"], rel=0.05)


def test_reading_errors_do_not_grow_while_a_fit_makes_the_inertia_small():
    shaft = coasting()
    model = Model(machine(), ())
    sigma = floors((shaft,), model, BASE)
    light = {**BASE, "j_kgm2": 0.01 * BASE["j_kgm2"]}
    system = [linear_system(Fit((shaft,), model, v, sigma, BASE)) for v in (BASE, light)]
    assert system[1].row_weight == pytest.approx(system[0].row_weight)


@pytest.mark.parametrize("off", [0.95, 1.03])
def test_an_unexplained_torque_does_not_move_the_flux(off):
    """Noise weights alone would trade ψ for the torque equation's error.

    With no gain stated, ψ is known as the voltmeter reads it; the gains stay within 3 of their u.
    """

    def drag(omega, _):
        return 0.3 * np.tanh(omega / 20.0) ** 3

    segments = (with_drag(drag), with_drag(drag, 6))
    found = fitted(segments, psi_wb=off * BASE["psi_wb"])
    read = found.values["psi_wb"] * (1.0 + found.values["gain_voltage"])
    assert read == pytest.approx(BASE["psi_wb"], rel=2e-4)
    priors = found.model.priors()
    for name in ("gain_current", "gain_voltage", "gain_torque"):
        assert abs(found.values[name]) < 3.0 * priors[name][1]


def moved_by_current() -> Campaign:
    """Two seconds at 2 kHz of a light shaft that a noisy current turns either way."""
    step, pairs, psi, inertia, dry = 5e-4, 7, 0.01, 4e-5, 0.004
    random = np.random.default_rng(3)
    level = np.repeat(random.uniform(0.2, 0.6, 20) * np.tile((1.0, -1.0), 10), 200)
    omega = theta = 0.0
    angles = []
    for current in level:
        angles.append(theta)
        torque = 1.5 * pairs * psi * current - dry * np.tanh(omega)
        theta += step * (omega + 0.5 * step * torque / inertia)
        omega += step * torque / inertia
    table = pl.DataFrame(
        {
            "t_s": step * np.arange(level.size),
            "id_a": random.normal(0.0, 0.02, level.size),
            "iq_a": level + random.normal(0.0, 0.02, level.size),
            "theta_mech_rad": np.array(angles) + random.normal(0.0, 1e-5, level.size),
        }
    )
    capture = Capture(
        "drive.csv", "1", "verified", CaptureMeta("m", "drive", pole_pairs=7), (table,)
    )
    return Campaign("m", (capture,), {"psi_pm_wb": psi, "u_psi_pm_wb": 1e-3 * psi})


@pytest.mark.parametrize("share", [pytest.param(0.3, marks=pytest.mark.slow), 3.0])
def test_floors_are_those_of_the_fit_and_not_of_a_rough_one_far_from_it(share: float) -> None:
    """The noise of an acceleration is that of the current over the inertia: with three times the
    inertia a sound motor was nine times over it.
    """
    end = base_fit(moved_by_current(), ModelSpec(), Constants({})).system.fit
    inertia = end.values["j_kgm2"]
    system = first_fit(end.at({"j_kgm2": share * inertia}))
    assert system.fit.values["j_kgm2"] == pytest.approx(inertia, rel=0.02)
    assert np.concatenate(floors_grown(system.fit)) == pytest.approx(1.0, abs=0.2)
    assert float(system.reduced_chi2(system.residual).max()) < 1.5


def test_a_winding_is_not_given_up_for_what_a_drag_lacks() -> None:
    """χ²/n of 300 windows of motion and of 32 of each voltage, at two ends of one fit: by
    likelihood the second is better.
    """
    drag_lacks, winding_lost = (
        cast(
            "LinearSystem", SimpleNamespace(residual=None, reduced_chi2=lambda _, q=q: np.array(q))
        )
        for q in ([60.0, 0.5, 0.01], [4.0, 6300.0, 13000.0])
    )
    assert summed_error(drag_lacks) < summed_error(winding_lost)


def test_a_step_from_far_too_large_an_inertia_is_one_of_its_reciprocal():
    """The acceleration of a free shaft is linear in 1/J, b/J and Tc/J: one such step is exact."""
    model = Model(machine(), (effects()["coulomb_friction"],))
    names = ("j_kgm2", "b_nm_s_rad", "coulomb_friction.torque_nm")
    wanted, begun = np.array([4e-5, 2e-5, 8e-3]), np.array([9e-4, 1e-4, 1e-3])
    fit = Fit((), model, {**BASE, **dict(zip(names, begun, strict=True))}, (), BASE)
    over = np.concatenate([[1.0 / wanted[0]], wanted[1:] / wanted[0]])
    before = np.concatenate([[1.0 / begun[0]], begun[1:] / begun[0]])
    shrinks = -(begun[0] ** 2) * (over[0] - before[0])
    drags = begun[0] * (over - before)[1:] + begun[1:] * shrinks / begun[0]
    step = dict(zip(names, [shrinks, *drags], strict=True))
    moved = fit.moved_over_inertia(step)
    assert moved is not None
    assert [moved.values[name] for name in names] == pytest.approx(wanted.tolist())
    assert fit.moved_over_inertia({name: change / 100.0 for name, change in step.items()}) is None


def test_a_torque_beside_a_coast_is_a_whole_step_away_from_a_tenth_of_the_inertia():
    """A coast knows friction over inertia. Steps of the inertia's own size would need ten, and each
    seems to win next to nothing.
    """
    motor = replace(design("joint-11p"), effects={})
    plan = (("cogging", "cogging", {"direction": -1}), ("spin_down", "spin_down", {}))
    made = campaign_of(campaign(motor, Bench(instruments=EXACT, encoder_bits=12), 1, plan))
    parts = {"cogging": 0.3, "spin_down": 0.15}
    captures = (
        replace(one, tables=tuple(t.tail(int(parts[one.meta.test] * t.height)) for t in one.tables))
        for one in made.captures
    )
    short = replace(made, captures=tuple(captures))
    found = machine_of(short, Constants())
    cut = segments(short, found)
    sound = fit_of(cut, model_of(ModelSpec(), found)).system.fit
    shaft = ("j_kgm2", "b_nm_s_rad", "coulomb_friction.torque_nm")
    light = {**sound.values, **{name: 0.1 * sound.values[name] for name in shaft}}
    begun = Fit(cut, sound.model, light, floors(cut, sound.model, light), light)
    end = gauss_newton(begun).fit.values
    assert end["j_kgm2"] == pytest.approx(motor.j_rotor_kgm2, rel=0.05)


def moved_away(inertia: float) -> tuple[LinearSystem, Fit]:
    """A fit, and its start from another inertia."""
    noisy = tuple(log(seed=n, noise=1.0) for n in (1, 2))
    model = Model(machine(), ())
    end = gauss_newton(Fit(noisy, model, BASE, floors(noisy, model, BASE), BASE))
    return end, end.fit.at({"j_kgm2": inertia * end.fit.values["j_kgm2"]})


def test_a_fit_that_cannot_come_within_reach_is_left_where_it_began():
    end, start = moved_away(1.2)
    assert gauss_newton(start, within_reach=end.deviance).deviance == pytest.approx(
        end.deviance, abs=0.1
    )
    begun = linear_system(start)
    beyond = begun.deviance - 2.5 * (begun.deviance - end.deviance)
    left = gauss_newton(start, within_reach=beyond)
    assert left.fit.values == start.values
    assert left.deviance == begun.deviance


def test_a_refit_begins_with_the_columns_of_the_fit_beside_it():
    """Made anew at each start, they were most of what a search takes."""
    end, start = moved_away(1.02)
    again = gauss_newton(start, before=end)
    assert again.deviance < end.deviance + end.policy.fit.converged
    kept = [again.made_at[key] is values for key, values in end.made_at.items()]
    assert np.mean(kept) > 0.5
    far = gauss_newton(moved_away(1.5)[1], before=end)
    assert far.deviance < end.deviance + end.policy.fit.converged
