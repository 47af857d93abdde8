"""That an effect is there does not rest on shapes that refine its form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.criticism.library.registry import effects
from pipeline.criticism.regression.cross_validation import leave_out
from pipeline.criticism.regression.gauss_newton import gauss_newton
from pipeline.criticism.regression.identifiability import significantly_nonzero
from pipeline.criticism.regression.linear_system import linear_system
from pipeline.criticism.selection.acceptance import sure_amplitudes
from tests.unit.criticism.machines import fitted, with_drag


def bump(omega: np.ndarray, _: object) -> np.ndarray:
    """Dry friction and a bump of 1 mN·m below 8 rad/s."""
    return np.tanh(2.0 * omega) * (0.02 + 0.001 * np.exp(-(np.abs(omega / 8.0) ** 0.8)))


def test_a_bump_is_there_whatever_its_exponent() -> None:
    """With exponent and tail free, its height at standstill is not known."""
    fit = fitted([with_drag(bump, seed) for seed in (5, 6, 7)])
    bare, stribeck = effects()["coulomb_friction"], effects()["stribeck"]
    start = {"coulomb_friction.torque_nm": 0.02, "stribeck.excess_nm": 0.001}
    start |= {"stribeck.speed_rad_s": 8.0, "stribeck.exponent": 0.8, "stribeck.tail": 0.0}
    begun = replace(
        fit, model=fit.model.with_effects(bare, stribeck), values={**fit.values, **start}
    )
    system = linear_system(gauss_newton(begun).fit)
    held_out = leave_out(system)
    least = system.policy.selection.least_u
    assert "stribeck.excess_nm" not in significantly_nonzero(system, held_out, least)
    assert [p.name for p in sure_amplitudes(system, held_out, stribeck)] == ["excess_nm"]
