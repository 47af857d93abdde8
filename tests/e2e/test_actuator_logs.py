"""Logs that drives write, in their published forms: first look, answers, constants of the motor."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from pipeline.__main__ import main

PAIRS, R_OHM, L_H, PSI_WB = 7, 0.12, 6e-5, 3.1e-3
J_KGM2, COULOMB_NM, VISCOUS = 2.5e-3, 0.03, 2e-4
KE = PAIRS * PSI_WB
KT, STEP_S = 1.5 * KE, 1e-3
TRUE = {
    "r_phase_ohm": R_OHM,
    "ke_phase_peak_v_s_rad": KE,
    "psi_pm_wb": PSI_WB,
    "kv_ll_peak_rpm_v": 60.0 / (2.0 * np.pi * np.sqrt(3.0) * KE),
    "j_rotor_kgm2": J_KGM2,
    "torque_coulomb_nm": COULOMB_NM,
    "ks_v": R_OHM * COULOMB_NM / KT,
    "kv_v_s_rad": KE + R_OHM * VISCOUS / KT,
    "ka_v_s2_rad": R_OHM * J_KGM2 / KT,
}
Columns = Mapping[str, np.ndarray]


def driven(seconds: float = 40.0) -> Columns:
    """A free flywheel under q current that swings through both senses; every STEP_S."""
    t = np.arange(0.0, seconds, STEP_S)
    iq = 9.0 * np.sin(2.0 * np.pi * t / 7.3) + 4.0 * np.sin(2.0 * np.pi * t / 2.9)
    theta, omega = np.zeros(t.size), np.zeros(t.size)
    for k in range(t.size - 1):
        omega[k + 1] = omega[k] + STEP_S * _acceleration(KT * iq[k], omega[k])
        theta[k + 1] = theta[k] + 0.5 * STEP_S * (omega[k] + omega[k + 1])
    return {
        "t": t,
        "theta": theta,
        "omega": omega,
        "iq": iq,
        "id": 0.0 * t,
        "vq": R_OHM * iq + KE * omega + L_H * np.gradient(iq, t),
        "vd": -PAIRS * omega * L_H * iq,
    }


def fed(seconds: float = 20.0) -> Columns:
    """The same motor under q voltage, as an open loop has it; the current is not logged."""
    t = np.arange(0.0, seconds, STEP_S)
    vq = 1.2 * np.sign(np.sin(2.0 * np.pi * t / 5.0)) + 0.8 * np.sin(2.0 * np.pi * t / 3.1)
    theta, omega = np.zeros(t.size), np.zeros(t.size)
    for k in range(t.size - 1):
        current = (vq[k] - KE * omega[k]) / R_OHM
        omega[k + 1] = omega[k] + STEP_S * _acceleration(KT * current, omega[k])
        theta[k + 1] = theta[k] + 0.5 * STEP_S * (omega[k] + omega[k + 1])
    return {"t": t, "theta": theta, "omega": omega, "vq": vq}


def _acceleration(torque: float, omega: float) -> float:
    sense = np.sign(omega) or np.sign(torque)
    if omega == 0.0 and abs(torque) <= COULOMB_NM:
        return 0.0
    return float(torque - COULOMB_NM * sense - VISCOUS * omega) / J_KGM2


def _every(found: Columns, period_s: float, seed: int) -> list[dict[str, float]]:
    """Rows of a log, with the noise of shunts and of an encoder of 16384 steps."""
    rng, step = np.random.default_rng(seed), round(period_s / STEP_S)
    rows = {name: column[::step].copy() for name, column in found.items()}
    for name, u in (("iq", 0.02), ("id", 0.02), ("omega", 0.05), ("vq", 2e-3), ("vd", 2e-3)):
        if name in rows:
            rows[name] = rows[name] + u * rng.standard_normal(rows[name].size)
    rows["theta"] = np.round(rows["theta"] / (2 * np.pi) * 16384) / 16384 * 2 * np.pi
    return [
        dict(zip(rows, map(float, values), strict=True))
        for values in zip(*rows.values(), strict=True)
    ]


def moteus() -> str:
    """Registers as the `csv_output` example of moteus writes them, those of a dq log asked for."""
    head = "time,MODE,POSITION,VELOCITY,TORQUE,Q_CURRENT,D_CURRENT,VOLTAGE,"
    lines = [head + "MOTOR_TEMPERATURE,TEMPERATURE,VOLTAGEDQ_D,VOLTAGEDQ_Q,FAULT"]
    lines += [
        f"{r['t'] + 3.1:.6f},5,{r['theta'] / (2 * np.pi):.6f},{r['omega'] / (2 * np.pi):.5f},"
        f"{KT * r['iq']:.4f},{r['iq']:.3f},{r['id']:.3f},24.5,25.0,31.0,{r['vd']:.5f},"
        f"{r['vq']:.5f},0"
        for r in _every(driven(), 0.01, 1)
    ]
    return "\n".join([*lines, ""])


def vesc() -> str:
    """The real-time log of VESC Tool: 50 Hz, its clock and voltages in few digits."""
    names = (
        "ms_today;input_voltage;temp_mos_max;temp_mos_1;temp_mos_2;temp_mos_3;temp_motor;"
        "current_motor;current_in;d_axis_current;q_axis_current;erpm;duty_cycle;amp_hours_used;"
        "amp_hours_charged;watt_hours_used;watt_hours_charged;tachometer;tachometer_abs;"
        "encoder_position;fault_code;vesc_id;d_axis_voltage;q_axis_voltage;"
    )
    lines = [names]
    for r in _every(driven(), 0.02, 2):
        erpm = r["omega"] * 60.0 / (2 * np.pi) * PAIRS
        tach = r["theta"] / (2 * np.pi) * PAIRS * 6
        lines.append(
            f"{86390000 + 1000.0 * r['t']:.0f};24.5;30.1;30.1;0;0;25.0;{r['iq']:.4f};0.5;"
            f"{r['id']:.4f};{r['iq']:.4f};{erpm:.2f};0.05;0;0;0;0;{tach:.0f};{abs(tach):.0f};0;"
            f"FAULT_CODE_NONE;17;{r['vd']:.5f};{r['vq']:.5f};"
        )
    return "\n".join([*_over_midnight(lines), ""])


def _over_midnight(lines: list[str]) -> list[str]:
    """Milliseconds of the day start again at midnight."""
    parted = [line.partition(";") for line in lines[1:]]
    return [lines[0], *(f"{int(ms) % 86400000};{rest}" for ms, _, rest in parted)]


def simplefoc() -> str:
    """Lines of `motor.monitor()` with all seven variables: tabs, milliamperes, no clock."""
    rows = _every(driven(), 0.01, 3)
    lines = (
        f"{r['iq']:.4f}\t{r['vq']:.4f}\t{r['vd']:.4f}\t{1e3 * r['iq']:.4f}\t{1e3 * r['id']:.4f}\t"
        f"{r['omega']:.4f}\t{r['theta']:.4f}"
        for r in rows
    )
    return "\n".join([*lines, ""])


def odrive() -> str:
    """The characterisation of labmrd's firmware: a counter that wraps, a buffer not filled."""
    head = ["%Motor characterization data", "%Timestep increments at 8kHz", "", "%Operator:"]
    head += ["%Date:,29/04/2021", "", "%timestep (8Hz),voltage,position,velocity"]
    head += ["%[#],[V],[turns],[turns/s]", "nan,nan,nan,nan;"]
    turn = 2 * np.pi
    rows = [
        f"{round(8000 * r['t'] + 31) % 56000:.1f},{r['vq']!r},{r['theta'] / turn!r},"
        f"{r['omega'] / turn!r};"
        for r in _every(fed(), 0.006, 4)
    ]
    rest = rows[-1].split(",", 2)[2]
    return "\n".join([*head, *rows, *[f"0.0,0.0,{rest}"] * 11, ""])


@dataclass(frozen=True)
class Log:
    """A form: its file, what answers it needs, and what must come out."""

    name: str
    text: Callable[[], str]
    source: str
    answers: tuple[str, ...]
    gives: tuple[str, ...]


OF_CURRENT = ("r_phase_ohm", "ke_phase_peak_v_s_rad", "j_rotor_kgm2", "torque_coulomb_nm")
LOGS = (
    Log("knee.csv", moteus, "moteus", ("pole_pairs=7",), (*OF_CURRENT, "psi_pm_wb")),
    Log("2024-03-01.csv", vesc, "vesc_tool", ("pole_pairs=7",), (*OF_CURRENT, "psi_pm_wb")),
    Log("simplefoc_1.txt", simplefoc, "simplefoc", ("increment_s=0.01",), OF_CURRENT),
    Log("noise1.csv", odrive, "odrive_characterization", (), ("ks_v", "kv_v_s_rad", "ka_v_s2_rad")),
)


@pytest.mark.parametrize("log", LOGS, ids=lambda log: log.source)
def test_from_the_first_look_to_constants(
    log: Log, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Two commands: what the log does not say is answered, and nothing is edited."""
    folder, made, output = tmp_path / "logs", tmp_path / "mine.yaml", tmp_path / "out"
    folder.mkdir()
    (folder / log.name).write_text(log.text())
    answers = ["motor_id=M1", *log.answers]
    code = main(["inspect", str(folder), f"map={made}", "check=true", *answers])
    told = capsys.readouterr()
    assert code == 0, told
    assert f"read by the source map {log.source}" in told.out
    quiet = ["recordings=false", "report=false", "residual_test=false"]
    code = main(["run", f"input={folder}", f"output={output}", f"source={made}", *quiet])
    assert code in (0, 4), capsys.readouterr()
    constants = json.loads((output / "datasheets" / "M1.json").read_text())["constants"]
    for name in log.gives:
        one = constants[name]
        assert one["status"] in ("measured", "derived"), (name, one)
        assert abs(one["value"] - TRUE[name]) <= 2.0 * one["u"], (name, one)
        assert one["u"] <= 0.2 * TRUE[name], (name, one["u"])
