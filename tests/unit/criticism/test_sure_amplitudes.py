"""That an effect is there does not rest on shapes that refine its form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline import Recordings, diagnose
from pipeline.criticism.library.registry import effects
from pipeline.criticism.regression.cross_validation import leave_out
from pipeline.criticism.regression.gauss_newton import gauss_newton
from pipeline.criticism.regression.identifiability import product_nonzero, significantly_nonzero
from pipeline.criticism.regression.linear_system import LinearSystem, linear_system
from pipeline.criticism.selection.acceptance import sure_amplitudes
from pipeline.simulator.bench import CAMPAIGN, campaign
from pipeline.simulator.design import Bench
from pipeline.simulator.effects import parameters
from tests.simulated import campaign_of, design
from tests.unit.criticism.machines import fitted, with_drag


def bump(omega: np.ndarray, _: object) -> np.ndarray:
    """Dry friction and a bump of 1 mN·m below 8 rad/s."""
    return np.tanh(2.0 * omega) * (0.02 + 0.001 * np.exp(-(np.abs(omega / 8.0) ** 0.8)))


def with_bump() -> LinearSystem:
    """Around the fit of three logs with the bump."""
    fit = fitted([with_drag(bump, seed) for seed in (5, 6, 7)])
    bare, stribeck = effects()["coulomb_friction"], effects()["stribeck"]
    start = {"coulomb_friction.torque_nm": 0.02, "stribeck.excess_nm": 0.001}
    start |= {"stribeck.speed_rad_s": 8.0, "stribeck.exponent": 0.8, "stribeck.tail": 0.0}
    model, values = fit.model.with_effects(bare, stribeck), {**fit.values, **start}
    return linear_system(gauss_newton(replace(fit, model=model, values=values)).fit)


def test_a_bump_is_there_whatever_its_exponent() -> None:
    """With exponent and tail free, its height at standstill is not known."""
    system = with_bump()
    held_out = leave_out(system)
    least = system.policy.selection.least_u
    assert "stribeck.excess_nm" not in significantly_nonzero(system, held_out, least)
    sure = sure_amplitudes(system, held_out, effects()["stribeck"])
    assert [p.name for p in sure] == ["excess_nm"]


def test_what_shows_as_a_product_only_is_there() -> None:
    """Rows in which one stands for the other, as share and twist of a stiff spring do."""
    system = with_bump()
    names = "coulomb_friction.torque_nm", "stribeck.speed_rad_s"
    one, other = ([c.name for c in system.columns].index(name) for name in names)
    matrix = system.matrix.copy()
    matrix[:, other] = matrix[:, one] * system.fit.values[names[0]] / system.fit.values[names[1]]
    tied = replace(system, matrix=matrix)
    held_out = leave_out(tied)
    assert not significantly_nonzero(tied, held_out, 2.0) & set(names)
    assert product_nonzero(tied, held_out, names, 2.0)
    assert not product_nonzero(tied, held_out, names, 1e4)
    assert not product_nonzero(tied, held_out, (names[0], "compliance.share"), 2.0)


@pytest.mark.slow
def test_inductances_that_fall_by_an_unknown_share_fall() -> None:
    """Torque maps show L_d - L_q alone, so what part of an inductance is lost stays open."""
    motor = design("joint-11p")
    size = {"cross_saturation": parameters("cross_saturation", motor)["size"]}
    plan = tuple(p for p in CAMPAIGN if p[0].startswith(("open_circuit_f", "torque_map_")))
    made = campaign(replace(motor, effects={}).having(**size), Bench(noise_scale=0.3), 5, plan)
    logs = campaign_of(made)
    kept = [one.tables[0].drop("vd_v", "vq_v", strict=False) for one in logs.captures]
    captures = (replace(c, tables=(t,)) for c, t in zip(logs.captures, kept, strict=True))
    blind = replace(logs, captures=tuple(captures))
    found = diagnose(Recordings({blind.motor_id: blind}))[blind.motor_id]
    assert (found.verdict, found.missing) == ("missing", ("cross_saturation",))
    assert found.ladder[0].held_out > 5.0
    assert found.ladder[-1].held_out < 1.0
