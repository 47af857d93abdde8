"""Dry friction by the currents that hold a rotor on its way forward and back."""

from __future__ import annotations

import math

import numpy as np
import polars as pl
import pytest

from pipeline.estimation.registry import fit_all
from pipeline.records.capture import Campaign, Capture, CaptureMeta
from pipeline.records.estimate import Estimate

KT_NM_A, U_KT, FRICTION_NM, NOISE_A, POSITIONS = 0.08, 0.001, 0.006, 2e-4, 240


def held(share: float = 0.0, sign: float = 1.0, files: int = 1, kt: bool = True) -> Estimate:
    """Dry friction of a rotor with a cogging order, held at even angles there and back.

    A `share` of the friction, at most, is missing at an angle by chance.
    """
    rng = np.random.default_rng(5)
    once = np.arange(POSITIONS + 1) * 2.0 * np.pi / POSITIONS
    theta, sense = np.concatenate([once, once[::-1]]), np.repeat([1.0, -1.0], once.size)
    used = 1.0 - share * rng.uniform(0.0, 1.0, theta.size)
    torque = 0.01 * np.cos(24.0 * theta + 0.3) + sense * used * FRICTION_NM
    current = sign * torque / KT_NM_A + rng.normal(0.0, NOISE_A, theta.size)
    extra = {"kt_peak_nm_a": f"{KT_NM_A}", "u_kt_peak_nm_a": f"{U_KT}"} if kt else {}
    meta = CaptureMeta("m", "holding_current", u_rel_current=0.0, extra=extra)
    table = pl.DataFrame(
        {"t_s": 0.5 * np.arange(theta.size), "theta_mech_rad": theta, "iq_a": current}
    )
    size = theta.size // files
    parts = [table.slice(k * size, size) for k in range(files)]
    captures = tuple(
        Capture(f"{k}.csv", "0" * 64, "verified", meta, (part,)) for k, part in enumerate(parts)
    )
    known, _, _ = fit_all(Campaign("m", captures), {}, only=frozenset({"torque_coulomb_nm"}))
    found = known.all_of("torque_coulomb_nm")
    return next(e for e in found if e.method == "holding_current")


@pytest.mark.parametrize("files", [1, 2])
def test_half_of_what_both_senses_differ_by_is_friction(files: int) -> None:
    drag = held(files=files)
    assert drag.number == pytest.approx(FRICTION_NM, rel=0.005)
    # of the torque constant; of what the currents scatter, which friction may not use
    expected = math.hypot(U_KT / KT_NM_A * FRICTION_NM, KT_NM_A * NOISE_A)
    assert 0.95 * expected < drag.u < 1.4 * expected
    assert drag.at["omega_mech_rad_s"] == pytest.approx(2.0 * np.pi / (0.5 * POSITIONS), rel=0.02)


def test_friction_that_does_not_repeat_is_in_the_uncertainty() -> None:
    drag = held(share=0.6)
    assert 0.6 * FRICTION_NM < drag.number < 0.8 * FRICTION_NM
    assert abs(drag.number - FRICTION_NM) < 2.0 * drag.u


def test_a_current_against_the_motion_is_no_friction() -> None:
    drag = held(sign=-1.0)
    assert drag.status == "not_identifiable"
    assert "check its sign" in drag.note


def test_without_a_torque_constant_the_current_is_named() -> None:
    drag = held(kt=False)
    assert drag.status == "not_identifiable"
    assert "torque constant is missing" in drag.note
