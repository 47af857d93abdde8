"""The exported motor, run in MuJoCo on a drive log that its datasheet was not made from.

MuJoCo gets the log's q voltage and load, and is held against what the project's own model makes of
the same, with the same constants and effects. Neither knows the gains of the bench's instruments,
as no datasheet holds them. MuJoCo's motor has no d current: what that of the log does to voltage
and torque is applied from outside.
"""

from __future__ import annotations

import json
import math
import shutil
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline.__main__ import main
from pipeline.criticism.data.machine_scale import machine_of
from pipeline.criticism.library.named_models import model_of
from pipeline.criticism.residuals.segments import segments
from pipeline.criticism.selection.requested_model import fit_of
from pipeline.criticism.validation.free_run import SPEED, Run, free_run
from pipeline.execution.tasks.start import start_constants
from pipeline.records.capture import Capture
from pipeline.records.comparison import ModelSpec
from pipeline.stages.steps.campaigns import campaigns

mujoco: Any = pytest.importorskip("mujoco", reason="group worlds is not installed")
DEMO = Path(__file__).parents[2] / "data" / "demo"
MOTOR, HELD = "G52-0601", "drive_0.mcap"
SIGNALS = ("iq_a", SPEED)
STEP_S = 1e-5
NAMES = {
    "r_phase_ohm": "r_ohm",
    "ld_h": "ld_h",
    "lq_h": "lq_h",
    "psi_pm_wb": "psi_wb",
    "j_rotor_kgm2": "j_kgm2",
    "b_visc_nm_s_rad": "b_nm_s_rad",
    "torque_coulomb_nm": "coulomb_friction.torque_nm",
}


def error(run: Run) -> float:
    """Means of current and speed over the windows, in noise floors, root mean square."""
    each = [np.mean((run.errors(name) / run.floor[name]) ** 2) for name in SIGNALS]
    return math.sqrt(float(np.mean(each)))


def in_mujoco(model: Any, run: Run, log: Capture, values: Mapping[str, float], p: int) -> Run:
    """The same windows from the same start, by MuJoCo."""
    names = ("t_s", "vq_v", "id_a", "torque_shaft_nm", "theta_mech_rad")
    t, vq, d_current, load, theta = (log.arrays(*names)[name] for name in names)
    made = {name: np.zeros(run.t_s.shape) for name in SIGNALS}
    data, early = mujoco.MjData(model), np.arange(24)
    # the winding's current is the last state of the motor, after its temperature
    amps = model.actuator_actadr[0] + model.actuator_actnum[0] - 1
    for window, times in enumerate(run.t_s):
        mujoco.mj_resetData(model, data)
        speed = run.simulated[SPEED][window, early]
        data.qpos[0] = np.interp(times[0], t, theta)
        data.qvel[0] = np.polyval(np.polyfit(early, speed, 3), 0.0)
        data.act[amps] = 1.5 * run.simulated["iq_a"][window, 0]
        for n, now in enumerate(times):
            made["iq_a"][window, n], made[SPEED][window, n] = data.act[amps] / 1.5, data.qvel[0]
            for at in now + STEP_S * (0.5 + np.arange(round((times[1] - times[0]) / STEP_S))):
                id_a, iq_a = np.interp(at, t, d_current), data.act[amps] / 1.5
                data.ctrl[0] = vq[np.searchsorted(t, at - 0.5 * (t[1] - t[0]))]
                data.ctrl[0] -= p * data.qvel[0] * values["ld_h"] * id_a
                reluctance = 1.5 * p * (values["ld_h"] - values["lq_h"]) * id_a * iq_a
                data.qfrc_applied[0] = reluctance - np.interp(at, t, load)
                mujoco.mj_step(model, data)
    return replace(run, simulated={**run.simulated, **made})


def test_mujoco_predicts_a_drive_as_well_as_the_projects_own_model(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, output = tmp_path / "in", tmp_path / "out"
    shutil.copytree(DEMO / MOTOR, folder, ignore=shutil.ignore_patterns(HELD, "truth.json"))
    where, out = f"input={folder}", f"output={output}"
    fast = ("report=false", "recordings=false")
    assert main(["run", where, out, "model.effects=[cogging]", *fast]) == 0
    assert main(["registry", "approve", MOTOR, "revision=1", "by=T", "why=test", out]) == 0
    assert main(["export", "mujoco", MOTOR, f"options.timestep_s={STEP_S}", out]) == 0
    capsys.readouterr()
    (document,) = (output / "export").glob("*.xml")
    sheet = json.loads((output / "datasheets" / f"{MOTOR}.json").read_text())["constants"]

    ((campaign,), *_) = campaigns(str(folder))
    machine = machine_of(campaign, start_constants(campaign))
    model = model_of(ModelSpec("standard", ("cogging",)), machine)
    fitted = fit_of(segments(campaign, machine), model).system.fit
    values = {
        name: 0.0 if name.startswith(("gain_", "offset_")) else value
        for name, value in fitted.values.items()
    }
    values |= {own: sheet[name]["value"] for name, own in NAMES.items()}
    ((whole,), *_) = campaigns(str(DEMO / MOTOR))
    (log,) = (one for one in whole.captures if one.path.endswith(HELD))
    (segment,) = segments(replace(whole, captures=(log,)), machine)
    own = free_run(segment, fitted.model, values)
    assert own is not None
    theirs = in_mujoco(
        mujoco.MjModel.from_xml_path(str(document)), own, log, values, machine.pole_pairs
    )
    assert error(theirs) < 1.1 * error(own)
    slow = replace(theirs, simulated={**theirs.simulated, SPEED: 1.01 * theirs.simulated[SPEED]})
    assert error(slow) > 2.0 * error(own), "a hundredth of the speed would be seen"
