"""A robot's log of a SysId routine: from the first look to kS, kV, kA and the delay."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import numpy as np
import pytest

from pipeline.__main__ import main

R_OHM, KE, J_KGM2, COULOMB_NM, VISCOUS = 0.12, 0.0185, 0.0025, 0.02, 2e-5
STEP_S, EVERY, LATE_S = 2e-4, 100, 0.02
TRUE = {
    "ks_v": R_OHM * COULOMB_NM / KE,
    "kv_v_s_rad": KE + R_OHM * VISCOUS / KE,
    "ka_v_s2_rad": R_OHM * J_KGM2 / KE,
    "voltage_delay_s": LATE_S,
}
ROUTINE = {
    "quasistatic-forward": (1.0, 0.0, 7.0),
    "quasistatic-reverse": (-1.0, 0.0, 7.0),
    "dynamic-forward": (0.0, 7.0, 3.0),
    "dynamic-reverse": (0.0, -7.0, 3.0),
}


class _Log:
    """WPILib Data Log File Format 1.0: an entry a name, its unit in the metadata."""

    def __init__(self) -> None:
        self.parts = [b"WPILOG", struct.pack("<HI", 0x0100, 0)]
        self.entries: dict[str, int] = {}

    def record(self, entry: int, time_s: float, payload: bytes) -> None:
        head = struct.pack("<BBHI", 0b0110100, entry, len(payload), round(time_s * 1e6))
        self.parts.append(head + payload)

    def write(self, name: str, kind: str, unit: str, time_s: float, payload: bytes) -> None:
        if name not in self.entries:
            self.entries[name] = len(self.entries) + 1
            texts = (text.encode() for text in (name, kind, unit))
            told = b"".join(struct.pack("<I", len(text)) + text for text in texts)
            self.record(0, time_s, struct.pack("<BI", 0, self.entries[name]) + told)
        self.record(self.entries[name], time_s, payload)


def _coasts(ramp: float, step: float, seconds: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Voltage, angle and speed of a brushed equivalent that starts at rest."""
    count = round(seconds / STEP_S)
    volts = step + ramp * STEP_S * np.arange(count)
    theta, omega = np.zeros(count), np.zeros(count)
    for k in range(count - 1):
        torque = KE * (volts[k] - KE * omega[k]) / R_OHM
        sense = np.sign(omega[k]) or np.sign(torque)
        stands = omega[k] == 0.0 and abs(torque) <= COULOMB_NM
        gain = 0.0 if stands else (torque - COULOMB_NM * sense - VISCOUS * omega[k]) / J_KGM2
        omega[k + 1] = omega[k] + STEP_S * gain
        theta[k + 1] = theta[k] + 0.5 * STEP_S * (omega[k] + omega[k + 1])
    return volts, theta, omega


def _routine() -> bytes:
    """Four tests with pauses, 50 Hz that jitters, an encoder of 4096 steps that is read late."""
    rng, log, start, turned = np.random.default_rng(4), _Log(), 12.3, 0.0
    for state, how in ROUTINE.items():
        volts, theta, omega = _coasts(*how)
        late = round(LATE_S / STEP_S)
        for k in np.arange(0, volts.size, EVERY) + rng.integers(0, 4, -(-volts.size // EVERY)):
            at, seen = start + STEP_S * k, max(k - late, 0)
            turns = np.round((turned + theta[seen]) / (2 * np.pi) * 4096) / 4096
            rate = np.round(omega[seen] / (2 * np.pi) * 600) / 600
            for name, unit, value, after in (
                ("voltage", "Volt", volts[k], 1e-5),
                ("position", "Rotation", turns, 3e-5),
                ("velocity", "Rotation per Second", rate, 6e-5),
            ):
                full = f"{name}-wheel-shooter"
                log.write(full, "double", unit, at + after, struct.pack("<d", value))
            log.write("sysid-test-state-shooter", "string", "", at + 9e-5, state.encode())
        start, turned = start + how[2] + 4.0, turned + theta[-1]
    return b"".join(log.parts)


def test_from_the_first_look_to_a_datasheet(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The log keeps the name that the robot gave it; nothing but the serial number is stated."""
    folder, output = tmp_path / "logs", tmp_path / "out"
    folder.mkdir()
    (folder / "FRC_20240301_181530.wpilog").write_bytes(_routine())
    assert main(["inspect", str(folder)]) == 0
    told = capsys.readouterr().out
    assert "read by the source map sysid" in told
    assert "motor_id" in told and "181530" not in told.replace("FRC_20240301_181530", "")
    (folder / "FRC_20240301_181530.meta.yaml").write_text("motor_id: neo\n")
    main(
        [
            "run",
            f"input={folder}",
            f"output={output}",
            "recordings=false",
            "report=false",
            "residual_test=false",
        ]
    )
    told = {f["code"] for f in json.loads((output / "findings.json").read_text())["findings"]}
    assert told == {"one_test_only"}
    sheet = json.loads((output / "datasheets" / "neo.json").read_text())
    assert sheet["status"] == "provisional"
    constants = sheet["constants"]
    for name, true in TRUE.items():
        one = constants[name]
        assert abs(one["value"] - true) <= 2.0 * one["u"], name
        assert one["u"] < max(0.03 * true, 3e-3), name
    for name in ("r_phase_ohm", "psi_pm_wb", "j_rotor_kgm2"):
        assert constants[name]["status"] == "not_identifiable"
    main(["compare", f"input={folder}", f"output={output}"])
    document = json.loads((output / "comparison" / "neo.json").read_text())
    together = {c["expression"].split(" ")[0]: c for c in document["model"]["combinations"]}
    assert together.keys() == TRUE.keys() - {"voltage_delay_s"}
    for name in together:
        true = TRUE[name]
        assert abs(together[name]["value"] - true) <= 2.5 * together[name]["u"], name
    parameters = document["model"]["parameters"]
    assert {one["status"] for one in parameters.values()} == {"not_identifiable"}
