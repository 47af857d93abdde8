"""Two motors under one motor_id, from files to a datasheet: named, and nothing of them released."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from pipeline.__main__ import main

PAIRS = 7


def spin(psi_wb: float, seed: int) -> str:
    """Line voltages and angle of a rotor driven at four speeds, 2 kHz."""
    noise = np.random.default_rng(seed)
    speed = np.repeat([30.0, 60.0, -60.0, 90.0], 1000)
    t_s = 5e-4 * np.arange(speed.size)
    angle = np.cumsum(speed) * 5e-4
    phases = [
        -PAIRS * speed * psi_wb * np.sin(PAIRS * angle - k * 2.0 * np.pi / 3.0) for k in (0, 1, 2)
    ]
    lines = [phases[k] - phases[(k + 1) % 3] + noise.normal(0.0, 2e-3, t_s.size) for k in (0, 1)]
    columns = {"t_s": t_s, "vab_v": lines[0], "vbc_v": lines[1], "theta_mech_rad": angle}
    return _csv("open_circuit", "", columns)


def ohms(r_ll_ohm: float, seed: int) -> str:
    """Six levels of current through the pair ab."""
    noise = np.random.default_rng(seed)
    level = 0.5 * (np.arange(600) // 100 + 1) * (-1.0) ** (np.arange(600) // 100)
    columns = {"t_s": 0.01 * np.arange(600), "vab_v": r_ll_ohm * level + noise.normal(0, 1e-4, 600)}
    columns |= {"ia_a": level + noise.normal(0, 1e-4, 600), "temp_winding_degc": np.full(600, 25.0)}
    return _csv("resistance", "# pair: ab\n", columns)


def _csv(
    test: str, more: str, columns: dict[str, np.ndarray], angle: np.ndarray | None = None
) -> str:
    if angle is not None:
        columns = columns | {"theta_mech_rad": angle}
    head = f"# contract: 1\n# motor_id: M-1\n# test: {test}\n# station: north\n{more}"
    head += (
        "# ambient_degc: 25\n# u_rel_voltage: 0.002\n# u_rel_current: 0.002\n# u_temp_degc: 0.5\n"
    )
    rows = np.column_stack(list(columns.values()))
    return (
        head
        + ",".join(columns)
        + "\n"
        + "".join(",".join(f"{value:.9g}" for value in row) + "\n" for row in rows)
    )


def run(folder: Path, files: dict[str, str]) -> tuple[int, dict, list[dict]]:
    (folder / "in").mkdir()
    for name, text in files.items():
        (folder / "in" / name).write_text(text)
    words = [f"input={folder / 'in'}", f"output={folder / 'out'}", "workers=1", "report=false"]
    words += ["recordings=false", "registry=null", "residual_test=false", "release=auto"]
    code = main(["run", *words])
    sheet = json.loads((folder / "out" / "datasheets" / "M-1.json").read_text())
    return code, sheet, json.loads((folder / "out" / "findings.json").read_text())["findings"]


OWN = {
    "spin_0.csv": spin(0.0100, 1),
    "spin_1.csv": spin(0.0100, 2),
    "ohms_0.csv": ohms(1.20, 3),
    "ohms_1.csv": ohms(1.20, 4),
}


@pytest.mark.workers
def test_a_mean_of_two_motors_was_published(tmp_path: Path) -> None:
    """Published: psi between the two motors', with a convention as the suspect.

    The odd one differs by 4 % in flux and 17 % in resistance.
    """
    odd = {"x_spin.csv": spin(0.0104, 5), "x_ohms.csv": ohms(1.40, 6)}
    code, sheet, findings = run(tmp_path, OWN | odd)
    assert code == 1
    assert sheet["status"] == "refused"
    (told,) = [f for f in findings if f["code"] == "captures_disagree"]
    assert "x_ohms.csv, x_spin.csv (2 files) agree with each other" in told["message"]
    assert "not with the other 4" in told["message"]
    failed = {c["name"]: c for c in sheet["checks"] if c["status"] == "fail"}
    assert {"kt_vs_ke", "resistance_balance"} <= set(failed)
    for check in failed.values():
        assert "x_" in check["suspect"]
        assert "six-step" not in check["suspect"]


@pytest.mark.workers
def test_one_motor_recorded_twice_is_one_motor(tmp_path: Path) -> None:
    """A warm afternoon in between: 0.4 % less flux, 1 % more resistance."""
    again = {"y_spin.csv": spin(0.00996, 5), "y_ohms.csv": ohms(1.212, 6)}
    code, sheet, findings = run(tmp_path, OWN | again)
    assert code == 4  # too little to check, and nothing that fails
    assert not [f for f in findings if f["code"] == "captures_disagree"]
    assert not [c for c in sheet["checks"] if c["status"] == "fail"]
