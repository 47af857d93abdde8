"""The exported motor runs in MuJoCo: torque, friction, cogging and current are the datasheet's."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from pipeline.export.registry import exporters
from tests.unit.export.test_effects import COULOMB, STRIBECK, known
from tests.unit.export.test_exporters import LQ, PAIRS, PSI, R

mujoco: Any = pytest.importorskip("mujoco", reason="group worlds is not installed")
FLYWHEEL_KGM2 = 1e5
COGGING = {"sin_84_nm": 0.002, "cos_84_nm": -0.001}


def rotor(effects: Mapping[str, Mapping[str, float]], **options: str) -> Any:
    """The exported model on a flywheel, which keeps its speed whatever acts on it."""
    text = exporters()["mujoco"].render(known(**effects), options)
    heavy = re.sub(r'armature="[^"]*"', f'armature="{FLYWHEEL_KGM2!r}"', text)
    return mujoco.MjModel.from_xml_string(heavy)


def brake(model: Any, omega: float, seconds: float = 0.3) -> float:
    """Torque against the motion after a while at a speed, with the voltage of no current [N·m]."""
    data = mujoco.MjData(model)
    data.qvel[0], data.ctrl[0] = omega, PAIRS * PSI * omega
    mujoco.mj_step(model, data, round(seconds / model.opt.timestep))
    total = data.qfrc_passive[0] + data.qfrc_actuator[0] + data.qfrc_constraint[0]
    return -float(total)


@pytest.mark.parametrize("omega", [0.5, 3.0, 40.0, -3.0])
def test_lugre_friction_is_the_curve_of_stribeck_on_coulomb(omega: float) -> None:
    size = COULOMB + 0.003 * np.exp(-((omega / 4.0) ** 2))
    assert brake(rotor({"stribeck": STRIBECK}), omega) == pytest.approx(
        np.sign(omega) * size, abs=0.02 * 0.003
    )


@pytest.mark.parametrize("omega", [50.0, 300.0, -300.0])
def test_drag_that_grows_is_in_the_damping(omega: float) -> None:
    drag = 0.004 * (omega / 300.0) ** 2 + COULOMB
    found = brake(rotor({"windage": {"drag_nm": 0.004}}), omega)
    assert found == pytest.approx(np.sign(omega) * drag, abs=0.03 * 0.004)


def test_cogging_is_the_torque_of_the_table() -> None:
    model = rotor({"cogging": COGGING})
    data = mujoco.MjData(model)
    for theta in np.linspace(0.0, 0.1, 12):
        data.qpos[0] = theta
        mujoco.mj_forward(model, data)
        drag = 0.002 * np.sin(84 * theta) - 0.001 * np.cos(84 * theta)
        assert data.qfrc_actuator[0] == pytest.approx(-drag, abs=1e-6)


def test_a_step_of_the_q_voltage_makes_the_current_and_torque_of_the_q_axis() -> None:
    model = rotor({})
    data = mujoco.MjData(model)
    data.ctrl[0] = 1.0
    tau, rows = LQ / R, []
    for _ in range(40):
        mujoco.mj_step(model, data)
        rows.append((data.time, data.act[0] / 1.5, data.qfrc_actuator[0]))
    t, amps, torque = np.array(rows).T
    assert amps == pytest.approx(-np.expm1(-t / tau) / R, rel=1e-3)
    # the force of a step is that of the current which the step ends with
    assert torque == pytest.approx(1.5 * PAIRS * PSI * amps, rel=1e-4)
