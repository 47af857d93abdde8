"""Why a constant is missing, in words that name the file or the test to record."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.estimation.electrical.terminals import pair_of, voltage_columns
from pipeline.estimation.estimators import (
    cogging,
    current_step,
    feedforward,
    hand_turn,
    holding_current,
    open_circuit,
    resistance,
    torque_table,
)
from pipeline.estimation.mechanical.shaft_rows import DRIVE, _windows
from pipeline.estimation.mechanical.torque_constant import torque_constant
from pipeline.numerics.weak_rows import LEAST_SAMPLES
from pipeline.records.constants import Constants
from tests.unit.estimation.signals import capture, estimates, known_value
from tests.unit.estimation.test_scales import campaign

TURN = 2.0 * np.pi


def held(rows: int, order: int, noise: float = 0.0) -> list:
    """A turn each way of a held rotor: cogging of one order, and friction by direction."""
    found = []
    for number, sense in enumerate((1.0, -1.0)):
        theta = sense * np.linspace(0.0, (1.0 + 2.0 / rows) * TURN, rows)
        rng = np.random.default_rng(number)
        amps = 0.2 * np.cos(order * theta) + 0.05 * sense + noise * rng.standard_normal(rows)
        found.append(capture("holding_current", f"way_{number}", theta_mech_rad=theta, iq_a=amps))
    return found


def test_a_held_rotor_without_a_torque_constant_gives_orders_in_amperes() -> None:
    """0.2 A of order 12; times 0.1 N.m/A it is 0.02 N.m."""
    found = estimates(holding_current.ESTIMATOR, *held(800, 12, 1e-3))
    assert found["cogging_order"].number == 12
    assert "0.2 A of order 12; a torque constant" in found["cogging_amplitude_nm"].note
    known = Constants((known_value("kt_peak_nm_a", 0.1, 1e-4, "N·m/A"),))
    found = estimates(holding_current.ESTIMATOR, *held(800, 12, 1e-3), known=known)
    assert found["cogging_amplitude_nm"].number == pytest.approx(0.02, rel=2e-3)
    parts = {p.source: p.u for p in found["cogging_amplitude_nm"].budget}
    assert parts["test:kt_peak_nm_a"] == pytest.approx(0.2 * 1e-4, rel=2e-3)
    assert parts["current@s"] == pytest.approx(0.02 * 0.002, rel=2e-3)


def test_a_held_rotor_without_cogging_says_what_it_would_have_seen() -> None:
    rng = np.random.default_rng(5)
    flat = []
    for number, sense in enumerate((1.0, -1.0, 1.0, -1.0)):
        theta = sense * np.linspace(0.0, 1.02 * TURN, 800)
        amps = 0.05 * sense + 0.01 * rng.standard_normal(800)
        flat.append(capture("holding_current", f"way_{number}", theta_mech_rad=theta, iq_a=amps))
    found = estimates(holding_current.ESTIMATOR, *flat)
    assert found["cogging_order"].settled
    assert "no order found" in found["cogging_amplitude_nm"].note
    # half of the sectors each, at the noise of the readings and nothing else
    assert found["holding_residual_a"].number == pytest.approx(0.01, rel=0.1)


@pytest.mark.parametrize("seed", range(4))
def test_friction_by_sense_and_what_both_senses_share(seed: int) -> None:
    """0.05 A against motion, 0.02 A of a load or a zero; in N·m with a torque constant."""
    rng, turns = np.random.default_rng(seed), []
    for number, sense in enumerate((1.0, -1.0, 1.0, -1.0)):
        theta = sense * np.linspace(0.0, 1.02 * TURN, 1500)
        # friction that varies from place to place by itself
        rough = np.repeat(0.02 * rng.standard_normal(75), 20)
        amps = 0.05 * sense + 0.02 + 0.2 * np.cos(12 * theta + 0.3) + rough
        turns.append(capture("holding_current", f"w{number}", theta_mech_rad=theta, iq_a=amps))
    known = Constants((known_value("kt_peak_nm_a", 0.1, 1e-3, "N·m/A"),))
    found = estimates(holding_current.ESTIMATOR, *turns, known=known)
    true = {
        "holding_friction_a": 0.05, "holding_offset_a": 0.02, "holding_friction_nm": 0.005,
        "cogging_amplitude_a": 0.2,
    }  # fmt: skip
    for name, value in true.items():
        low, high = found[name].interval()
        assert low < value < high, name
        assert found[name].u < 0.15 * value, name
    one_way = estimates(holding_current.ESTIMATOR, turns[0], turns[2])
    assert not one_way["holding_friction_a"].known
    assert "one sense alone" in one_way["holding_friction_a"].note


def test_a_turn_of_few_angles_holds_no_sectors_out() -> None:
    """An offset a direction and four readings a column at least: below it there is no figure."""
    many, few = (
        estimates(holding_current.ESTIMATOR, *held(rows, 3))["holding_residual_a"]
        for rows in (24, 16)
    )
    assert many.known
    assert not few.known
    assert "densely enough to hold sectors out" in few.note


def test_the_torque_constant_is_measured_else_from_the_flux_else_from_ke() -> None:
    """1.5 Ke in the amplitude-invariant frame, with the relative u of Ke."""
    kt = known_value("kt_peak_nm_a", 0.3, 0.001, "N·m/A")
    flux = known_value("kt_from_ke_nm_a", 0.31, 0.002, "N·m/A")
    ke = known_value("ke_phase_peak_v_s_rad", 0.2, 0.001, "V·s/rad")
    assert torque_constant(Constants()) is None
    for known, value, u in (
        ((kt, flux, ke), 0.3, 0.001),
        ((flux, ke), 0.31, 0.002),
        ((ke,), 0.3, 0.0015),
    ):
        found = torque_constant(Constants(known))
        assert found is not None
        assert found.number == pytest.approx(value)
        assert found.u == pytest.approx(u)


def test_the_pair_is_stated_or_the_only_voltage_there_is() -> None:
    t = np.arange(3.0)
    assert pair_of(capture("resistance", t_s=t, vbc_v=t)) == "bc"
    assert pair_of(capture("resistance", t_s=t, vbc_v=t, vca_v=t)) is None
    assert pair_of(capture("resistance", t_s=t)) is None
    assert pair_of(capture("resistance", pair="ca", t_s=t, vbc_v=t)) == "ca"
    assert voltage_columns(capture("resistance", t_s=t, va_v=t, vb_v=t), "ab") == ("va_v", "vb_v")
    assert voltage_columns(capture("resistance", t_s=t, va_v=t), "ab") == ()


def test_a_resistance_of_no_known_pair_is_named_and_the_others_are_used() -> None:
    made = campaign("resistance")
    whole = estimates(resistance.ESTIMATOR, *made.captures)
    first = made.captures[0]
    columns = [n for n in first.tables[0].columns if n.startswith("v")]
    blind = replace(
        first,
        path="0",
        meta=replace(first.meta, pair=None),
        tables=(first.tables[0].drop(columns),),
    )
    deaf = replace(first, path="1", tables=(first.tables[0].drop(columns),))
    found = estimates(resistance.ESTIMATOR, blind, deaf, *made.captures)
    assert found["r_phase_ohm"].number == pytest.approx(whole["r_phase_ohm"].number)
    assert "0: which terminal pair is not stated" in found["r_phase_ohm"].note
    assert "1: no voltage and current of pair" in found["r_phase_ohm"].note


def test_steps_on_one_axis_give_that_axis_and_ask_for_the_other() -> None:
    steps = campaign("current_step").captures
    angle = steps[0].meta.theta_elec_deg
    found = estimates(current_step.ESTIMATOR, *(c for c in steps if c.meta.theta_elec_deg == angle))
    known = [n for n, e in found.items() if e.known]
    assert len(known) == 1
    other = "lq_h" if known == ["ld_h"] else "ld_h"
    assert f"no step with enough current on the {other[1]} axis" in found[other].note


def test_files_without_a_voltage_are_named() -> None:
    t = np.arange(500) * 1e-3
    for estimator in (hand_turn.ESTIMATOR, open_circuit.ESTIMATOR):
        made = capture(estimator.tests[0], "deaf", t_s=t, theta_mech_rad=t)
        found = estimates(estimator, made)
        assert all("deaf: n" in e.note and estimator.experiment in e.note for e in found.values())


def test_slow_turns_without_an_angle_or_a_torque_are_no_turns() -> None:
    t = np.arange(500) * 1e-2
    found = estimates(cogging.ESTIMATOR, capture("cogging", t_s=t, torque_shaft_nm=t))
    assert all(e.note.startswith("0 whole turns") for e in found.values())


def test_a_clamped_shaft_without_torque_has_no_torque_constant() -> None:
    """A transducer that is not connected reads exactly nought."""
    amps = np.linspace(-10.0, 10.0, 21)
    made = capture("torque_table", iq_a=amps, id_a=0.0 * amps, torque_shaft_nm=0.0 * amps)
    assert not estimates(torque_table.ESTIMATOR, made)["kt_peak_nm_a"].known


def test_a_drive_whose_angle_is_noisy_in_all_windows_has_the_longest() -> None:
    """0.08 s of 1 ms rows, with both ends."""
    t = np.arange(4000) * 1e-3
    rng = np.random.default_rng(2)
    quiet = np.sin(20.0 * t)
    for noise, rows in ((0.0, 21), (0.3, 81)):
        weak = _windows(t, quiet + noise * rng.standard_normal(t.size), DRIVE)
        assert abs(int(weak.sizes[0]) - rows) <= 1


@pytest.mark.parametrize(("rows", "there"), [(3 * LEAST_SAMPLES - 1, False), (200, True)])
def test_a_log_of_a_few_rows_is_left_out(rows: int, there: bool) -> None:
    t = np.arange(rows) * 0.01
    made = capture("drive", t_s=t, vq_v=np.sin(t), theta_mech_rad=np.sin(t))
    assert (feedforward._part(made) is not None) is there
