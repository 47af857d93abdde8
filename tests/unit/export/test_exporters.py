"""Exporters: conventions, refusals, and every number back again to 1e-9."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from xml.etree import ElementTree as Xml

import pytest

from pipeline.export.protocol import Source
from pipeline.export.registry import exporters
from pipeline.physics.glossary import CONSTANTS
from pipeline.records.datasheet import Datasheet
from pipeline.records.errors import UsageError
from pipeline.records.estimate import Estimate, not_identifiable
from pipeline.records.uncertainty import type_a

PAIRS, R, LD, LQ, PSI = 7, 0.4226755974217538, 1.8916410291151e-4, 2.3393023563603e-4, 7.0529e-3
KV = 60.0 / (2.0 * math.pi * math.sqrt(3.0) * PAIRS * PSI)
KT = 1.5 * PAIRS * PSI
VALUES: dict[str, float | int] = {
    "pole_pairs": PAIRS,
    "r_phase_ohm": R,
    "r_ll_ohm": 2.0 * R,
    "ld_h": LD,
    "lq_h": LQ,
    "psi_pm_wb": PSI,
    "kv_ll_peak_rpm_v": KV,
    "kt_peak_nm_a": KT,
    "kt_from_ke_nm_a": KT * 1.001,
    "temp_coeff_magnet_1_k": -1.1e-3,
    "motor_constant_nm_sqrt_w": 0.0928,
    "j_rotor_kgm2": 3.57525e-5,
}


def estimate(name: str, value: float | int, unit: str | None = None) -> Estimate:
    return Estimate(
        name,
        value,
        unit or CONSTANTS[name].unit,
        "measured",
        "test",
        type_a(f"scatter:{name}", abs(value) * 1e-3),
        {"temp_winding_degc": 25.0},
    )


def source(motor_id: str = "G52-0601", **changed: Estimate | None) -> Source:
    constants = {name: estimate(name, value) for name, value in VALUES.items()}
    constants |= {name: one for name, one in changed.items() if one is not None}
    for name, one in changed.items():
        if one is None:
            del constants[name]
    sheet = Datasheet(
        motor_id, "gimbal", "A", "ab" * 32, "released", (), (), "c" * 64, "0.1.0", constants, (), ()
    )
    return Source(sheet, 3)


@pytest.mark.parametrize("name", sorted(exporters()))
def test_round_trip(name: str) -> None:
    """What a reader gets back is what the datasheet says, to 1e-9."""
    exporter = exporters()[name]
    found = exporter.read(exporter.render(source(), {}))
    if name == "odrive":
        assert found.pop("mean_inductance_h") == pytest.approx((LD + LQ) / 2.0, rel=1e-9)
    assert len(found) >= 3
    for constant, value in found.items():
        assert value == pytest.approx(VALUES[constant], rel=1e-9, abs=0.0), constant


def test_formats_of_the_contract() -> None:
    expected = {"moteus", "odrive", "vesc", "simplefoc", "c-header", "ssv", "csv"}
    assert set(exporters()) == expected | {"json", "mujoco", "simscape"}


def test_whole_formats_hold_every_constant() -> None:
    for name in ("c-header", "ssv", "csv", "json", "simscape"):
        exporter = exporters()[name]
        assert set(exporter.read(exporter.render(source(), {}))) == set(VALUES)


def test_moteus_lines() -> None:
    """Poles are twice the pairs; Kv gives the firmware Kt = 8.27/Kv = 1.5 p psi."""
    lines = exporters()["moteus"].render(source(), {}).splitlines()
    said = dict(line.split()[2:] for line in lines if line.startswith("conf set "))
    assert said["motor.poles"] == "14"
    assert float(said["motor.resistance_ohm"]) == R
    assert float(said["motor.inductance_d_H"]) == LD
    assert float(said["motor.inductance_q_H"]) == LQ
    assert 8.27 / float(said["motor.Kv"]) == pytest.approx(KT, rel=1e-4)


def test_odrive_settings() -> None:
    said = json.loads(exporters()["odrive"].render(source(), {"current_max_a": "12"}))
    motor = {path.rpartition(".")[2]: value for path, value in said.items()}
    assert all(path.startswith("axis0.config.motor.") for path in said)
    assert motor["pole_pairs"] == 7
    assert motor["phase_resistance"] == R
    assert motor["phase_inductance"] == pytest.approx((LD + LQ) / 2.0)
    assert motor["phase_resistance_valid"] is True
    assert motor["torque_constant"] == KT
    assert motor["current_soft_max"] == 12.0
    assert "current_soft_max" not in exporters()["odrive"].render(source(), {})


def test_odrive_falls_back_to_the_back_emf() -> None:
    """Without a torque test, Kt is 1.5 p psi."""
    unknown = not_identifiable("kt_peak_nm_a", "N·m/A", "torque_map", "record a torque_map")
    said = json.loads(exporters()["odrive"].render(source(kt_peak_nm_a=unknown), {}))
    assert said["axis0.config.motor.torque_constant"] == KT * 1.001


def test_vesc_fields() -> None:
    text = exporters()["vesc"].render(
        source(), {"current_bandwidth_rad_s": "1000", "config_version": "6", "current_max_a": "30"}
    )
    root = Xml.fromstring(text)
    said = {child.tag: child.text for child in root if isinstance(child.tag, str)}
    assert root.tag == "MCConfiguration"
    assert float(said["foc_motor_l"]) == pytest.approx((LD + LQ) / 2.0)
    assert float(said["foc_motor_ld_lq_diff"]) == pytest.approx(LQ - LD)
    assert float(said["foc_motor_flux_linkage"]) == PSI
    assert said["si_motor_poles"] == "14"
    assert float(said["foc_current_kp"]) == pytest.approx(1000.0 * (LD + LQ) / 2.0)
    assert float(said["foc_current_ki"]) == pytest.approx(1000.0 * R)
    assert said["ConfigVersion"] == "6"
    assert "foc_current_kp" not in exporters()["vesc"].render(source(), {})
    assert "b9d287b" in text


def test_simplefoc_call() -> None:
    """R between two phases, KV line-line peak, Lq before Ld."""
    text = exporters()["simplefoc"].render(source(), {})
    assert (
        text.splitlines()[-1]
        == f"BLDCMotor motor = BLDCMotor(7, {2 * R!r}, {KV!r}, {LQ!r}, {LD!r});"
    )


def test_c_header() -> None:
    text = exporters()["c-header"].render(source(), {})
    assert f"#define MOTOR_R_PHASE_OHM {R!r} /*" in text
    assert "#define MOTOR_POLE_PAIRS 7 /*" in text
    assert "#define MOTOR_TEMP_COEFF_MAGNET_1_K (-0.0011) /*" in text


def test_ssv_units_are_declared() -> None:
    root = Xml.fromstring(exporters()["ssv"].render(source(), {}))
    ssv = "{http://ssp-standard.org/SSP1/SystemStructureParameterValues}"
    ssc = "{http://ssp-standard.org/SSP1/SystemStructureCommon}"
    assert root.tag == f"{ssv}ParameterSet"
    assert root.attrib["version"] == "1.0"
    used = {real.attrib["unit"] for real in root.iter(f"{ssv}Real") if "unit" in real.attrib}
    declared = {unit.attrib["name"]: unit[0].attrib for unit in root.iter(f"{ssc}Unit")}
    assert used == set(declared)
    assert declared["ohm"] == {"kg": "1", "m": "2", "s": "-3", "A": "-2"}


@pytest.mark.parametrize("name", ["moteus", "odrive", "vesc", "simplefoc", "mujoco", "simscape"])
def test_a_missing_constant_is_refused(name: str) -> None:
    unknown = not_identifiable("lq_h", "H", "lcr", "record an lcr table")
    with pytest.raises(UsageError, match="lq_h is not_identifiable"):
        exporters()[name].render(source(lq_h=unknown), {})
    with pytest.raises(UsageError, match="r_phase_ohm is missing"):
        exporters()[name].render(source(r_phase_ohm=None), {})


def test_an_assumed_constant_is_refused() -> None:
    assumed = replace(estimate("ld_h", LD), status="assumed")
    with pytest.raises(UsageError, match="ld_h is assumed"):
        exporters()["moteus"].render(source(ld_h=assumed), {})


@pytest.mark.parametrize("name", ["c-header", "ssv", "csv", "json", "simscape"])
def test_an_unknown_convention_is_refused(name: str) -> None:
    """A torque constant that does not say of which ampere, and a resistance in another unit."""
    strange = estimate("kt_nm_a", KT, "N·m/A")
    with pytest.raises(UsageError, match="convention of kt_nm_a is unknown"):
        exporters()[name].render(source(kt_nm_a=strange), {})
    other = estimate("r_phase_ohm", 422.0, "mohm")
    with pytest.raises(UsageError, match="r_phase_ohm is unknown, it is stated in mohm"):
        exporters()[name].render(source(r_phase_ohm=other), {})


@pytest.mark.parametrize("name", sorted(set(exporters()) - {"json"}))
def test_a_serial_number_ends_no_comment(name: str) -> None:
    exporter = exporters()[name]
    text = exporter.render(source('x*/ --> \n"; rm -rf'), {})
    head = text.split("conf set")[0]
    assert "x*/" not in head.replace("*/\n", "\n").replace(" */", "")
    assert exporter.read(text)["pole_pairs"] == 7.0
    if name in ("vesc", "ssv", "mujoco"):
        Xml.fromstring(text)


@pytest.mark.parametrize("text", ["-1", "many", "inf", "0"])
def test_options_are_checked(text: str) -> None:
    with pytest.raises(UsageError, match="positive number"):
        exporters()["odrive"].render(source(), {"current_max_a": text})
