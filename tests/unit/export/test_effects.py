"""Effects that are known of a motor: as tables, and in the formats that can hold them."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from dataclasses import replace
from xml.etree import ElementTree as Xml

import jsonschema
import numpy as np
import pytest

from pipeline.contracts.json_schema import export_schema
from pipeline.criticism.library.effect_tables import effect_tables
from pipeline.estimation.registry import estimators
from pipeline.export.curves import bump_of, drag_polynomial, waves
from pipeline.export.protocol import Source
from pipeline.export.registry import exporters
from pipeline.physics.glossary import CONSTANTS
from pipeline.records.diagnosis import ReportedParameter
from pipeline.records.effect_table import EffectTable
from pipeline.records.model_verdict import ModelVerdict
from tests.unit.export.test_exporters import LD, LQ, PAIRS, PSI, VALUES, R, estimate, source

SCALES = {"current_a": 10.0, "voltage_v": 20.0, "speed_rad_s": 300.0, "freq_hz": 334.0}
SCALES |= {"torque_nm": 0.7, "period_s": 1e-4, "flux_wb": PSI}
BASE = {"r_ohm": R, "ld_h": LD, "lq_h": LQ, "psi_wb": PSI}
COULOMB = 0.004
STRIBECK = {"excess_nm": 0.003, "speed_rad_s": 4.0, "exponent": 2.0, "tail": 0.0}


def known(**effects: Mapping[str, float | None]) -> Source:
    """A motor whose model was fitted with these effects."""
    fitted = {
        name: {short: ReportedParameter(value, 1e-5, "N·m") for short, value in parameters.items()}
        for name, parameters in effects.items()
    }
    model = ModelVerdict("adequate", effects=tuple(effects), fitted=fitted, scales=SCALES)
    plain = source(torque_coulomb_nm=estimate("torque_coulomb_nm", COULOMB))
    sheet = replace(plain.sheet, model=model)
    return replace(plain, sheet=sheet, effects=effect_tables(model, BASE, PAIRS))


def curve(effect: str, **parameters: float) -> EffectTable:
    (table,) = known(**{effect: parameters}).effects.tables
    return table


def test_a_friction_curve_is_over_speed_and_odd() -> None:
    table = curve("stribeck", **STRIBECK)
    assert (table.quantity, table.variables) == ("torque_nm", ("omega_mech_rad_s",))
    speed, drag = np.array(table.axes["omega_mech_rad_s"]), np.array(table.values)
    assert drag == pytest.approx(0.003 * np.exp(-((speed / 4.0) ** 2)) * np.sign(speed))
    assert speed.max() == 300.0


def test_cogging_is_over_a_turn_of_the_shaft() -> None:
    table = curve("cogging", sin_84_nm=0.002, cos_84_nm=-0.001)
    theta = np.array(table.axes["theta_mech_rad"])
    made = 0.002 * np.sin(84 * theta) - 0.001 * np.cos(84 * theta)
    assert np.array(table.values) == pytest.approx(made, abs=1e-12)
    (wave,) = waves([table])
    assert wave.order == 84
    # the torque on the shaft is minus the drag
    shaft = wave.amplitude_nm * np.sin(84 * theta + wave.phase_rad)
    assert shaft == pytest.approx(-made, abs=1e-12)


def test_saturation_is_flux_over_both_currents() -> None:
    tables = known(saturation={"q_fall": 0.2, "d_odd": 0.1}).effects.tables
    by_name = {table.quantity: np.reshape(table.values, (21, 21)) for table in tables}
    grid = np.array(tables[0].axes["iq_a"])
    assert by_name["psi_q_wb"][3] == pytest.approx(-LQ * 0.2 * grid * (grid / 10.0) ** 2)
    assert by_name["psi_d_wb"][:, 3] == pytest.approx(-LD * 0.1 * grid**2 / 10.0)


@pytest.mark.parametrize(
    ("effect", "parameters", "why"),
    [
        ("angle_eccentricity", {"sine_rad": 0.003}, "sensors or the drive"),
        ("load_dependent_friction", {"share": 0.02}, "more than a table"),
        ("dead_time", {"loss_v": 0.1, "width_a": 0.1}, "more than a table"),
        ("windage", {"drag_nm": None}, "not identifiable"),
        ("own_effect", {"size": 1.0}, "not in this library"),
    ],
)
def test_an_effect_without_a_table_says_why(
    effect: str, parameters: Mapping[str, float | None], why: str
) -> None:
    found = known(**{effect: parameters})
    assert not found.effects.tables
    assert why in found.effects.without[effect]
    for name in ("mujoco", "simscape", "moteus"):
        assert any(line.startswith(f"{effect}: ") for line in exporters()[name].omits(found))
    assert exporters()["json"].omits(found) == ()


def test_an_effect_that_was_asked_for_and_not_fitted_is_listed() -> None:
    model = ModelVerdict("missing", effects=("windage", "-coulomb_friction"), scales=SCALES)
    assert list(effect_tables(model, BASE, PAIRS).without) == ["windage"]
    assert effect_tables(None, BASE, PAIRS).tables == ()


def test_an_iron_loss_holds_without_current_alone() -> None:
    table = curve("iron_eddy", drag_nm=0.01, parallel=1.0)
    assert table.note == "at no current"
    assert max(table.values) == pytest.approx(0.01)


def test_drag_that_grows_is_a_polynomial_and_friction_that_falls_is_a_bump() -> None:
    windage, stribeck = curve("windage", drag_nm=0.004), curve("stribeck", **STRIBECK)
    assert bump_of(windage) is None
    assert drag_polynomial(stribeck) is None
    bump, found = bump_of(stribeck), drag_polynomial(windage)
    assert bump is not None
    assert found is not None
    assert (bump.excess_nm, bump.speed_rad_s) == pytest.approx((0.003, 4.0), rel=0.02)
    speed = np.array([30.0, 150.0, 300.0])
    made = found[0] * speed + found[1] * speed**2 + found[2] * speed**3
    assert made == pytest.approx(0.004 * (speed / 300.0) ** 2, abs=2e-4)


def test_a_drag_of_one_sense_has_no_form() -> None:
    table = curve("stribeck", **STRIBECK)
    onesided = replace(table, values=tuple(abs(value) for value in table.values))
    assert bump_of(onesided) is None
    assert drag_polynomial(onesided) is None


def dcmotor(found: Source, **options: str) -> tuple[dict[str, str], dict[str, str], str]:
    text = exporters()["mujoco"].render(found, options)
    root = Xml.fromstring(text)
    motor, joint = root.find("actuator/dcmotor"), root.find("worldbody/body/joint")
    assert motor is not None
    assert joint is not None
    return dict(motor.attrib), dict(joint.attrib), text


def test_mujoco_takes_friction_cogging_drag_and_travel() -> None:
    found = known(
        stribeck=STRIBECK,
        windage={"drag_nm": 0.004},
        presliding={"torque_nm": 0.002, "travel_rad": 5e-4},
        cogging={"sin_84_nm": 0.002, "cos_84_nm": 0.0, "sin_168_nm": 0.0004},
        sample_delay={"delay_s": 5e-5},
    )
    motor, joint, text = dcmotor(found)
    stiff, _, dry, static, slow = map(float, motor["lugre"].split())
    assert (stiff, dry) == (COULOMB / 5e-4, COULOMB)
    assert (static, slow) == pytest.approx((COULOMB + 0.003, 4.0), rel=0.02)
    assert "frictionloss" not in joint
    height, order, phase = map(float, motor["cogging"].split())
    assert (height, order, abs(phase)) == pytest.approx((0.002, 84.0, math.pi))
    assert len(joint["damping"].split()) == 3
    (further,) = Xml.fromstring(text).findall("actuator/dcmotor")[1:]
    height, order, _ = map(float, further.attrib["cogging"].split())
    assert (height, order, further.attrib["input"]) == (pytest.approx(0.0004), 168.0, "none")
    assert "not in here: sample_delay" in text
    assert "not in here: stribeck: it" not in text
    assert re.search(r"stribeck: lugre misses its curve by [\d.]+ [mµn]N·m", text)


def test_mujoco_has_dry_friction_of_the_joint_and_heat_where_they_are_known() -> None:
    terms = {term.name: term for one in estimators() for term in one.terms} | dict(CONSTANTS)
    heat = {"rth_winding_k_w": 1.8, "cth_winding_j_k": 24.0, "temp_coeff_copper_1_k": 0.0038}
    plain = source(
        torque_coulomb_nm=estimate("torque_coulomb_nm", COULOMB),
        **{name: estimate(name, value, terms[name].unit) for name, value in heat.items()},
    )
    motor, joint, _ = dcmotor(replace(plain, terms=terms), ambient_degc="30")
    assert float(joint["frictionloss"]) == COULOMB
    assert float(joint["armature"]) == VALUES["j_rotor_kgm2"]
    assert [float(x) for x in motor["thermal"].split()] == [1.8, 24.0, 0.0, 0.0038, 25.0, 30.0]
    # three phases in one winding: power v i is 1.5 v_q i_q
    assert float(motor["resistance"]) == pytest.approx(R / 1.5)
    assert float(motor["inductance"].split()[0]) == pytest.approx(LQ / 1.5)
    assert float(motor["motorconst"].split()[0]) == pytest.approx(PAIRS * PSI)
    assert "thermal" not in dcmotor(source())[0]


def vector(text: str, name: str) -> np.ndarray:
    found = re.search(rf"motor\.{name} = \[(.*?)\];", text, re.DOTALL)
    assert found is not None
    return np.array([float(word) for word in found[1].replace("...", " ").split()])


def test_simscape_has_flux_over_currents_friction_and_the_delay() -> None:
    found = known(
        saturation={"q_fall": 0.2},
        stribeck=STRIBECK,
        windage={"drag_nm": 0.004},
        sample_delay={"delay_s": 5e-5},
    )
    text = exporters()["simscape"].render(found, {})
    currents = vector(text, "iq_a")
    psi_q = vector(text, "psi_q_wb").reshape(21, 21)
    assert psi_q[5] == pytest.approx(LQ * currents * (1.0 - 0.2 * (currents / 10.0) ** 2))
    psi_d = vector(text, "psi_d_wb").reshape(21, 21)
    assert psi_d[:, 5] == pytest.approx(PSI + LD * currents)
    torque = vector(text, "torque_table_nm").reshape(21, 21)
    expected = 1.5 * PAIRS * (psi_d * currents - psi_q * currents[:, None])
    assert torque == pytest.approx(expected, rel=1e-6, abs=1e-9)
    speed, drag = vector(text, "friction_omega_mech_rad_s"), vector(text, "friction_nm")
    made = np.sign(speed) * (0.003 * np.exp(-((speed / 4.0) ** 2)) + 0.004 * (speed / 300.0) ** 2)
    assert drag == pytest.approx(made, rel=1e-6, abs=1e-9)
    assert "motor.voltage_delay_s = 5e-05;" in text


def test_json_holds_its_schema_and_every_table() -> None:
    found = known(stribeck=STRIBECK, saturation={"q_fall": 0.2}, angle_offset={"offset_rad": 0.01})
    document = json.loads(exporters()["json"].render(found, {}))
    jsonschema.validate(document, export_schema())
    assert [table["quantity"] for table in document["tables"]] == [
        "torque_nm",
        "psi_d_wb",
        "psi_q_wb",
    ]
    assert set(document["without_table"]) == {"angle_offset"}
    by_name = {one["effect"]: one["parameters"] for one in document["effects"]}
    assert by_name["stribeck"]["excess_nm"] == {"value": 0.003, "u": 1e-5, "unit": "N·m"}


def test_json_keeps_any_serial_number() -> None:
    odd = 'x*/ --> \n"; rm -rf'
    assert json.loads(exporters()["json"].render(source(odd), {}))["motor_id"] == odd


@pytest.mark.parametrize("name", ["c-header", "csv", "ssv"])
def test_formats_of_every_constant_hold_the_parameters_of_effects(name: str) -> None:
    exporter = exporters()[name]
    found = known(stribeck=STRIBECK, angle_offset={"offset_rad": -0.01})
    values = exporter.read(exporter.render(found, {}))
    assert values["stribeck_excess_nm"] == 0.003
    assert values["angle_offset_offset_rad"] == -0.01
    assert exporter.omits(found) == ()
