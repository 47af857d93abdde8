"""That an effect is there does not rest on shapes that refine its form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.criticism.library.registry import effects
from pipeline.criticism.regression.cross_validation import leave_out
from pipeline.criticism.regression.gauss_newton import gauss_newton
from pipeline.criticism.regression.identifiability import product_nonzero, significantly_nonzero
from pipeline.criticism.regression.linear_system import LinearSystem, linear_system
from pipeline.criticism.selection.acceptance import sure_amplitudes
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
