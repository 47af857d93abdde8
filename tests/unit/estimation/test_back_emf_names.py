"""One log under current gives Ke by all its names, and what follows of it."""

from __future__ import annotations

from dataclasses import replace

import polars as pl
import pytest

from pipeline.estimation.registry import fit_all
from pipeline.physics.coupling import coupling_as
from pipeline.records.capture import Campaign
from pipeline.simulator.truth import truth
from tests.simulated import design
from tests.unit.estimation.mechanical import recorded

MOTOR = replace(design("gimbal-5208"), effects={})
TRUE = truth(MOTOR)["constants"]
KE = MOTOR.pole_pairs * MOTOR.psi_pm_wb


def alone(test: str, pole_pairs: int | None = MOTOR.pole_pairs) -> Campaign:
    whole = recorded()
    own = (replace(c, meta=replace(c.meta, pole_pairs=pole_pairs)) for c in whole.of(test))
    return replace(whole, captures=tuple(own))


@pytest.mark.parametrize("test", ["drive", "torque_map"])
def test_a_log_under_current_alone(test: str) -> None:
    """Neither psi, KV nor Kt was given, though each is Ke in other units; a map gave no Ke."""
    constants = fit_all(alone(test), {})[0]
    for name, true in {
        "ke_phase_peak_v_s_rad": KE,
        "psi_pm_wb": MOTOR.psi_pm_wb,
        "ke_ll_rms_v_s_rad": coupling_as("ke_ll_rms_v_s_rad", KE),
        "kv_ll_peak_rpm_v": coupling_as("kv_ll_peak_rpm_v", KE),
        "kt_from_ke_nm_a": 1.5 * KE,
        "r_phase_ohm": MOTOR.r_phase_ohm,
    }.items():
        one = constants.best(name)
        assert one is not None, name
        low, high = one.interval()
        assert low <= true <= high, name
        switches = name == "r_phase_ohm"  # a commanded voltage holds them and the leads
        assert one.u < (0.04 if switches else 0.02) * true, name


def test_the_flux_needs_pole_pairs() -> None:
    constants = fit_all(alone("drive", pole_pairs=None), {})[0]
    assert constants.best("kv_ll_peak_rpm_v") is not None
    assert constants.best("psi_pm_wb") is None
    assert any("state pole_pairs" in one.note for one in constants.all_of("psi_pm_wb"))


def test_an_open_spin_keeps_its_own_names() -> None:
    """They are not computed again, as if by another method."""
    whole = replace(recorded(tests=("open_circuit", "drive")), motor_id="m")
    constants = fit_all(whole, {})[0]
    (own,) = (one for one in constants.all_of("kv_ll_peak_rpm_v") if one.known)
    assert own.method == "open_circuit"


def test_a_current_in_the_wrong_unit_does_not_pass() -> None:
    """Torque over milliamperes gave a Kt a thousand times too large; the voltages speak against it.

    And what a map does not vary leaves no scatter, over which `inductance_rated` broke.
    """
    whole = alone("torque_map")
    wrong = [
        replace(c, tables=tuple(t.with_columns(pl.col("iq_a", "id_a") * 1e-3) for t in c.tables))
        for c in whole.captures
    ]
    constants, _, failures = fit_all(replace(whole, captures=tuple(wrong)), {})
    assert failures == ()
    assert constants.best("kt_peak_nm_a") is None
    assert any("methods disagree" in one.note for one in constants.all_of("kt_peak_nm_a"))
