"""Optimal currents against closed forms of textbook machines."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pipeline.performance.efficiency import point_cells
from pipeline.performance.envelope import current_for, most_torque, regime_of
from pipeline.performance.machine import (
    Machine,
    copper_w,
    drag_nm,
    inductances_h,
    inverter_w,
    torque_nm,
    voltage_v,
)
from pipeline.records.performance import Operation

ONE = np.ones(1)
SALIENT = Machine(
    pole_pairs=4.0, r_ohm=0.05 * ONE, psi_wb=0.01 * ONE, ld_h=1e-4 * ONE, lq_h=2e-4 * ONE,
    ld_slope_h_a=0.0 * ONE, lq_slope_h_a2=0.0 * ONE, within_d_a=math.inf, within_q_a=math.inf,
    beyond=0.0 * ONE,
    coulomb_nm=0.02 * ONE, viscous_nm_s_rad=1e-5 * ONE,
)  # fmt: skip
ROUND = replace(SALIENT, lq_h=SALIENT.ld_h)
OPERATION = Operation(24.0, 50.0, 25.0, 25.0, 25.0, 105.0)


def joined(*machines: Machine) -> Machine:
    """Machines of one draw each as one of several."""
    fields = {
        name: np.concatenate([getattr(one, name) for one in machines])
        for name in Machine.__dataclass_fields__
        if isinstance(getattr(machines[0], name), np.ndarray)
    }
    return replace(machines[0], **fields)


@pytest.mark.parametrize("current", [5.0, 50.0, 200.0])
def test_most_torque_per_ampere(current: float) -> None:
    """i_d = (ψ - √(ψ² + 8 ΔL² I²))/(4 ΔL), ΔL = L_q - L_d (Morimoto 1990, eq. 8)."""
    found = most_torque(SALIENT, current * ONE, math.inf, 0.0)
    psi, step = 0.01, 1e-4
    d = (psi - math.sqrt(psi**2 + 8.0 * step**2 * current**2)) / (4.0 * step)
    q = math.sqrt(current**2 - d**2)
    assert found.id_a[0] == pytest.approx(d, abs=1e-3 * current)
    assert found.torque_nm[0] == pytest.approx(6.0 * (psi * q - step * d * q), rel=1e-6)
    assert regime_of(SALIENT, found, current, 1e6, 0.0) == "MTPA"


def test_a_round_rotor_wants_q_current_alone() -> None:
    found = most_torque(ROUND, 20.0 * ONE, math.inf, 0.0)
    assert found.id_a[0] == pytest.approx(0.0, abs=1e-9)
    assert found.torque_nm[0] == pytest.approx(1.5 * 4 * 0.01 * 20.0)


def test_field_weakening_lies_where_both_limits_meet() -> None:
    """Without resistance: (ψ + L_d i_d)² + (L_q i_q)² = (V/ω)² and i_d² + i_q² = I²."""
    bare = replace(SALIENT, r_ohm=0.0 * ONE)
    omega, limit_v, current = 450.0, 24.0 / math.sqrt(3.0), 50.0
    found = most_torque(bare, current * ONE, limit_v, omega)
    assert regime_of(bare, found, current, limit_v, omega) == "field weakening"
    assert math.hypot(found.id_a[0], found.iq_a[0]) == pytest.approx(current)
    flux = math.hypot(0.01 + 1e-4 * found.id_a[0], 2e-4 * found.iq_a[0])
    assert flux == pytest.approx(limit_v / (4.0 * omega), rel=1e-3)


def test_most_torque_per_volt() -> None:
    """Where the current would allow more: L_d i_d = -ψ - Δψ, with
    Δψ = (-L_q ψ + √((L_q ψ)² + 8 (L_q - L_d)² (V/ω)²))/(4 (L_q - L_d)) (Morimoto 1990, eq. 15).
    """
    bare = replace(SALIENT, r_ohm=0.0 * ONE)
    omega, limit_v, current = 3000.0, 24.0 / math.sqrt(3.0), 400.0
    found = most_torque(bare, current * ONE, limit_v, omega)
    assert regime_of(bare, found, current, limit_v, omega) == "MTPV"
    psi, ld, lq, flux = 0.01, 1e-4, 2e-4, limit_v / (4.0 * omega)
    more = (-lq * psi + math.sqrt((lq * psi) ** 2 + 8.0 * (lq - ld) ** 2 * flux**2)) / (
        4.0 * (lq - ld)
    )
    assert found.id_a[0] == pytest.approx((-psi - more) / ld, rel=5e-3)


def test_no_current_is_allowed_where_the_magnet_alone_exceeds_the_voltage() -> None:
    weak = most_torque(ROUND, 5.0 * ONE, 5.0, 3000.0)
    assert np.isnan(weak.torque_nm[0])
    assert regime_of(ROUND, weak, 5.0, 5.0, 3000.0) == "none"


def test_draws_are_each_their_own() -> None:
    """Two draws at once are the two alone."""
    weaker = replace(SALIENT, psi_wb=0.009 * ONE)
    both = joined(SALIENT, weaker)
    found = most_torque(both, 50.0 * np.ones(2), 10.0, 300.0)
    for draw, one in enumerate((SALIENT, weaker)):
        alone = most_torque(one, 50.0 * ONE, 10.0, 300.0)
        assert found.torque_nm[draw] == alone.torque_nm[0]


def test_saturation_bends_its_own_axis_and_stops_where_it_was_measured() -> None:
    bent = replace(
        SALIENT,
        lq_slope_h_a2=-1e-8 * ONE,
        ld_slope_h_a=2e-7 * ONE,
        within_q_a=50.0,
        within_d_a=30.0,
    )
    ld, lq = inductances_h(bent, np.array([[-10.0, -90.0]]), np.array([[50.0, 500.0]]))
    assert ld[0] == pytest.approx([1e-4 - 2e-6, 1e-4 - 6e-6])
    assert lq[0] == pytest.approx([2e-4 - 2.5e-5] * 2)
    further = inductances_h(replace(bent, beyond=ONE), np.array([[-90.0]]), np.array([[-500.0]]))
    assert further[0][0] == pytest.approx([1e-4 - 18e-6]), "as it went on"
    assert further[1][0] == pytest.approx([2e-4 - 2.5e-3])
    # the voltage limit holds for the bent flux, not for the straight one
    found = most_torque(bent, 60.0 * ONE, 10.0, 500.0)
    volts = voltage_v(bent, found.id_a, found.iq_a, np.array([500.0]))
    assert volts[0] <= 10.0 * (1.0 + 1e-3)


def test_current_for_a_torque_is_the_least_one() -> None:
    wanted = np.array([0.5, 2.0])
    d, q = current_for(SALIENT, wanted, 60.0, 1e3, np.array([100.0, 100.0]))
    assert torque_nm(SALIENT, d[None], q[None])[0] == pytest.approx(wanted, rel=1e-9)
    for torque, id_a, iq_a in zip(wanted, d, q, strict=True):
        best = most_torque(SALIENT, math.hypot(id_a, iq_a) * ONE, math.inf, 0.0).torque_nm[0]
        assert best == pytest.approx(torque, rel=1e-5)
    beyond, _ = current_for(SALIENT, np.array([50.0]), 60.0, 1e3, np.array([100.0]))
    assert np.isnan(beyond[0])


def test_power_in_is_power_out_and_losses() -> None:
    """v·i at the terminals is shaft power, copper loss and drag: nothing is lost twice."""
    omega, id_a, iq_a = np.array([200.0]), np.array([-12.0]), np.array([30.0])
    (cell,) = point_cells(joined(SALIENT, SALIENT), OPERATION, omega, id_a, iq_a)
    w = 4.0 * 200.0
    v_d = 0.05 * -12.0 - w * 2e-4 * 30.0
    v_q = 0.05 * 30.0 + w * (1e-4 * -12.0 + 0.01)
    terminals = 1.5 * (v_d * -12.0 + v_q * 30.0)
    out = cell.torque_shaft_nm * 200.0
    assert out + cell.copper_w + cell.rotation_w == pytest.approx(terminals)
    assert cell.efficiency == pytest.approx(out / terminals)
    assert cell.inverter_w is None
    assert cell.copper_w == pytest.approx(copper_w(SALIENT, id_a[None], iq_a[None])[0, 0])
    assert drag_nm(SALIENT, omega)[0, 0] == pytest.approx(0.02 + 2e-3)


def test_conduction_loss_is_the_mean_over_a_turn() -> None:
    """Three sines of 10 A through devices of 0.8 V and 5 mΩ, by the sum over a turn."""
    theta = np.linspace(0.0, 2.0 * np.pi, 3600, endpoint=False)
    i = 10.0 * np.sin(theta)
    loss = 3.0 * np.mean(0.8 * np.abs(i) + 5e-3 * i**2)
    assert inverter_w(0.8, 5e-3, np.array(10.0)) == pytest.approx(loss, rel=1e-6)
