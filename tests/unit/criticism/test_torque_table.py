"""A table of torque against current: Kt from it, what bends it, and what it says nothing of."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from pipeline.criticism.comparison import compare
from pipeline.criticism.data.machine_scale import machine_of
from pipeline.criticism.diagnosis import diagnose
from pipeline.criticism.machine.model import Model
from pipeline.criticism.regression.gauss_newton import first_fit, rough_fit
from pipeline.criticism.residuals.residual import operate, residual
from pipeline.criticism.residuals.segments import segments
from pipeline.records.capture import Campaign
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants
from pipeline.simulator.design import EXACT
from tests.recovery.simulated import BENCH, MOTOR, recorded

EXACTLY = replace(BENCH, instruments=EXACT)
KT_NM_A = 1.5 * MOTOR.pole_pairs * MOTOR.psi_pm_wb


def table(**protocol) -> Campaign:
    return recorded((("torque_table", "torque_table", protocol),), 3, bench=EXACTLY)[0]


def with_torque(campaign: Campaign, torque) -> Campaign:
    """The same table with a torque of its q current [A] and angle [rad]."""
    (capture,) = campaign.captures
    rows = capture.arrays("iq_a", "theta_mech_rad")
    column = pl.Series("torque_shaft_nm", torque(rows["iq_a"], rows["theta_mech_rad"]))
    changed = capture.tables[0].with_columns(column)
    return replace(campaign, captures=(replace(capture, tables=(changed,)),))


def fit_of(campaign: Campaign):
    machine = machine_of(campaign, Constants())
    found = segments(campaign, machine)
    return first_fit(rough_fit(found, Model(machine, ()))).fit


def test_its_slope_is_kt():
    """1.5 p psi, whatever the transducer's zero is."""
    fitted = fit_of(table())
    assert 1.5 * 7 * fitted.values["psi_wb"] == pytest.approx(KT_NM_A, rel=2e-3)
    moved = with_torque(table(), lambda iq, _: 0.2 + KT_NM_A * iq)
    assert 1.5 * 7 * fit_of(moved).values["psi_wb"] == pytest.approx(KT_NM_A, rel=1e-4)


def test_its_noise_is_the_scatter_about_a_curve_of_each_angle():
    random = np.random.default_rng(1)
    noisy = with_torque(
        table(),
        lambda iq, theta: (
            KT_NM_A * iq + 0.05 * np.sin(42 * theta + 1.0) + random.normal(0.0, 2e-3, iq.size)
        ),
    )
    (segment,) = segments(noisy, machine_of(noisy, Constants()))
    assert segment.sensors.noise["torque_shaft_nm"] == pytest.approx(2e-3, rel=0.25)
    assert segment.sensors.angle_step_rad == 0.0


def test_the_torque_of_its_d_currents_is_no_noise():
    """A foreign bench's made a noise floor of 8.86 N·m, where the model missed by 0.05."""
    random, campaign = np.random.default_rng(1), table()
    (capture,) = campaign.captures
    rows = capture.arrays("iq_a", "theta_mech_rad")
    direct = random.choice([0.0, -4.0, -8.0], rows["iq_a"].size)
    torque = (KT_NM_A - (0.02 + 5e-4 * direct) * direct) * rows["iq_a"]
    torque += random.normal(0.0, 2e-3, torque.size)
    columns = (pl.Series("id_a", direct), pl.Series("torque_shaft_nm", torque))
    changed = replace(capture, tables=(capture.tables[0].with_columns(columns),))
    motor = replace(campaign, captures=(changed,))
    (segment,) = segments(motor, machine_of(motor, Constants()))
    assert segment.sensors.noise["torque_shaft_nm"] == pytest.approx(2e-3, rel=0.25)


def test_state_and_transducer_are_in_the_prediction():
    """Electrical angle p theta, a shaft at rest, and 1 + gain of the transducer."""
    campaign = table()
    fitted = fit_of(campaign)
    (segment,) = segments(campaign, fitted.model.machine)
    x = operate(segment, segment.recorded, fitted.model, fitted.values)
    assert x.eps_rad == pytest.approx(7 * segment.recorded["theta_mech_rad"])
    assert not x.omega_rad_s.any()
    values = fitted.values | {"gain_torque": 0.0}
    louder = values | {"gain_torque": 0.1}
    plain, moved = (residual(segment, fitted.model, v) for v in (values, louder))
    shown = segment.recorded["torque_shaft_nm"] - plain
    assert plain - moved == pytest.approx(0.1 * shown)


def test_beside_a_drive_s_log_it_is_held_out_as_a_whole():
    plan = (("torque_table", "torque_table", {}), ("torque_map", "torque_map", {}))
    both = recorded(plan, 3, bench=EXACTLY)[0]
    assert [s.whole for s in segments_of(both) if s.kind == "torque_table"] == [True]
    assert [s.whole for s in segments_of(table())] == [False]


def segments_of(campaign: Campaign):
    return segments(campaign, machine_of(campaign, Constants()))


def test_too_few_levels_are_no_table():
    campaign = table(levels=(-1.0, 0.5, 1.0))
    assert segments(campaign, machine_of(campaign, Constants())) == ()


def test_a_sweep_without_levels_is_held_out_in_parts():
    current = np.linspace(-12.0, 12.0, 240)
    rows = {"iq_a": current, "torque_shaft_nm": KT_NM_A * current + 0.01 * np.cos(40 * current)}
    (capture,) = table().captures
    sweep = Campaign("m", (replace(capture, tables=(pl.DataFrame(rows),)),))
    (segment,) = segments_of(sweep)
    assert set(segment.blocks.tolist()) == set(range(12))
    assert 1.5 * 7 * fit_of(sweep).values["psi_wb"] == pytest.approx(KT_NM_A, rel=0.01)
    still = Campaign("m", (replace(capture, tables=(pl.DataFrame(rows).head(1),)),))
    assert segments_of(still) == ()


def test_diagnose_reads_it_beside_a_coast():
    """A coast says nothing of the magnet: its torque is the table's."""
    plan = (("spin_down", "spin_down", {}), ("torque_table", "torque_table", {}))
    both = recorded(plan, 3, bench=EXACTLY)[0]
    model = ModelSpec("standard", ())
    start = Constants()
    assert "torque_shaft_nm" in diagnose(with_pole_pairs(both), model, start).ladder[0].signals
    alone = replace(both, captures=tuple(c for c in both.captures if c.meta.test == "spin_down"))
    found = diagnose(with_pole_pairs(alone), model, start)
    assert found.verdict == "insufficient"
    assert set(found.ladder[0].signals) == {"alpha_mech_rad_s2"}


def with_pole_pairs(campaign: Campaign) -> Campaign:
    captures = (replace(c, meta=replace(c.meta, pole_pairs=7)) for c in campaign.captures)
    return replace(campaign, captures=tuple(captures))


def test_compare_maps_what_a_sagging_iron_takes_of_it():
    """12 % less torque at full current: q current takes of the flux along d."""
    sagging = with_torque(table(), lambda iq, _: KT_NM_A * iq * (1.0 - 8e-4 * iq**2))
    errors = []
    for effects in ((), ("cross_saturation",)):
        told = compare(sagging, ModelSpec("ideal", effects), Constants()).errors
        assert {(one.signal, one.capture) for one in told} == {
            ("torque_shaft_nm", "torque_table.mcap")
        }
        errors.append(max(one.rmse for one in told))
    plain, bent = errors
    assert plain > 0.003
    assert bent < 0.5 * plain
