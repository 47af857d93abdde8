"""A free shaft whose d current has one size throughout, in either sense."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.estimation.estimators.drive_voltage import ESTIMATOR as VOLTAGE
from pipeline.estimation.estimators.inertia import ESTIMATOR as INERTIA
from pipeline.estimation.mechanical.drag_forms import DRAG_FORMS
from pipeline.estimation.mechanical.shaft_rows import shaft_rows
from pipeline.estimation.mechanical.torque_share import is_apart
from pipeline.records.capture import Capture
from pipeline.records.constants import Constants
from tests.unit.estimation.signals import capture, estimates, known_value

PAIRS, R_OHM, L_H, PSI_WB = 14, 0.31, 2e-4, 0.008
J_KGM2, VISCOUS, COULOMB_NM, D_A = 1.2e-4, 2.5e-4, 0.022, 6.0
STEP_RAD = 2.0 * np.pi / 4096
KT_NM_A = 1.5 * PAIRS * PSI_WB


def drive(drop_v: float = 0.0, warms: float = 0.2) -> Capture:
    """A minute of small steps of the q current beside 6 A of d current; the winding warms by a
    fifth of its resistance, and nothing logs that. Voltmeter and torque bend by a percent.
    """
    rng, ts = np.random.default_rng(4), 2e-3
    t = np.arange(0.0, 60.0, ts)
    i_q = np.repeat(rng.uniform(-1.5, 1.5, t.size // 50), 50)
    i_q = np.convolve(i_q, np.ones(5) / 5.0, "same")
    i_d = np.repeat(D_A * (-1.0) ** np.arange(t.size // 500), 500)
    bent = i_q * (1.0 - 0.005 * i_q**2)
    speed, theta = np.zeros(t.size), np.zeros(t.size)
    for k in range(t.size - 1):
        drag = COULOMB_NM * np.tanh(speed[k] / 0.02) + VISCOUS * speed[k]
        speed[k + 1] = speed[k] + ts * (KT_NM_A * bent[k] - drag) / J_KGM2
        theta[k + 1] = theta[k] + 0.5 * ts * (speed[k] + speed[k + 1])
    size, resistance = np.hypot(i_d, i_q), R_OHM * (1.0 + warms * t / t[-1])
    omega = PAIRS * speed
    v_d = (resistance + drop_v / size) * i_d - omega * L_H * i_q
    magnet = PSI_WB * (1.0 - 0.05 * warms * t / t[-1])
    v_q = (resistance + drop_v / size) * i_q + 0.012 * i_q**3 + omega * (magnet + L_H * i_d)
    noise = 0.005 * rng.standard_normal((2, t.size))
    return capture(
        "drive",
        pole_pairs=PAIRS,
        voltage_kind="measured",
        vdc_v=36.0,
        t_s=t,
        vd_v=v_d + noise[0],
        vq_v=v_q + L_H * np.gradient(i_q, ts) + noise[1],
        id_a=i_d,
        iq_a=i_q,
        theta_mech_rad=np.floor(theta / STEP_RAD) * STEP_RAD,
    )


@pytest.mark.parametrize("drop_v", [0.0, 0.3])
def test_resistance_and_a_drop_of_the_inverter_are_one_column(drop_v: float) -> None:
    """R + V_0/|i|: what little parts the two was taken by the warming, as a drop of minus volts."""
    resistance = estimates(VOLTAGE, drive(drop_v))["r_phase_ohm"]
    if resistance.known:
        parts = {part.source: part.u for part in resistance.budget}
        assert parts["assumed:inverter_drop"] == pytest.approx(0.04 * 36.0 / 3**0.5 / 6.0, rel=0.1)
        assert abs(resistance.number - 1.1 * R_OHM - drop_v / D_A) < 0.5 * resistance.u
    assert "a drop of the inverter's is taken as 0" in resistance.note


@pytest.mark.parametrize(
    ("name", "counts"),
    [("d squared q current", False), ("q current cubed", True), ("viscous", True)],
)
def test_a_nuisance_that_is_the_torque_does_not_take_its_place(name: str, counts: bool) -> None:
    """With it 92 % of the acceleration "did not follow the current", or J was a quarter."""
    rows = shaft_rows((drive(),), DRAG_FORMS)
    assert rows is not None
    assert is_apart(rows, KT_NM_A * rows.q_current_a, name) == counts


def test_inertia_and_friction_beside_such_a_current() -> None:
    known = Constants().adding((known_value("kt_peak_nm_a", KT_NM_A, 1e-4, "N·m/A"),))
    found = estimates(INERTIA, drive(), known=known)
    assert found["j_rotor_kgm2"].number == pytest.approx(J_KGM2, rel=0.03)
    assert found["torque_coulomb_nm"].number == pytest.approx(COULOMB_NM, rel=0.05)
