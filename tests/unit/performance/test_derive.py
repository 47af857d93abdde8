"""What a sheet says, what it leaves blank, and what it is said at."""

from __future__ import annotations

import json
import math
from functools import cache

import numpy as np
import polars as pl
import pytest

from pipeline.io.storage.publish import canonical_json
from pipeline.performance.conditions import operation_of
from pipeline.performance.derive import performance_of
from pipeline.records.capture import Campaign, Capture, CaptureMeta
from pipeline.records.errors import UsageError
from pipeline.records.estimate import not_identifiable
from pipeline.records.model_verdict import FoundEffect, ModelVerdict
from pipeline.records.performance import Operation, Performance
from tests.contracts.test_json_schema import complaints
from tests.unit.performance.constants import estimate, salient
from tests.unit.performance.sheets import sheet_of

OPERATION = Operation(24.0, 30.0, 25.0, 25.0, 25.0, 105.0)
LIMIT_V = 24.0 / math.sqrt(3.0)


@cache
def plain() -> Performance:
    """Of the motor as it is; tests that ask different things of it share it."""
    return told()


def told(**other: object) -> Performance:
    return performance_of(sheet_of(salient(**other)), OPERATION)  # type: ignore[arg-type]


def test_no_load_is_where_the_voltage_ends() -> None:
    found = plain()
    speed, current = found.number("omega_no_load_rad_s"), found.number("current_no_load_a")
    assert speed is not None
    assert current is not None
    drag = 0.02 + 1e-5 * speed.value
    assert current.value == pytest.approx(drag / (6.0 * 0.01))
    w = 4.0 * speed.value
    volts = math.hypot(w * 2e-4 * current.value, 0.05 * current.value + w * 0.01)
    assert volts == pytest.approx(LIMIT_V, rel=1e-6)
    half = 0.5 * (speed.high - speed.low) / speed.value
    assert half == pytest.approx(1.96 * 1e-3, rel=0.15), "the voltage gain's, of the flux alone"


def test_continuous_stall_torque_is_that_of_the_heat_balance() -> None:
    """(105 - 25) K over 1.5 K/W in 1.5 R I² at 105 degC; the magnet between 25 and 105 degC."""
    found = plain().number("torque_continuous_stall_nm")
    assert found is not None
    r = 0.05 * (1.0 + 0.0039 * 80.0)
    current = math.sqrt(80.0 / 1.5 / (1.5 * r))
    psi = 0.01 * (1.0 - 0.001 * 40.0)
    d = (psi - math.sqrt(psi**2 + 8e-8 * current**2)) / 4e-4
    q = math.sqrt(current**2 - d**2)
    assert found.value == pytest.approx(6.0 * (psi * q - 1e-4 * d * q) - 0.02, rel=1e-4)
    assert (found.high - found.low) / found.value > 0.03, "what the magnet may be at is in it"


def test_stall_current_is_what_the_link_can_drive() -> None:
    low = Operation(1.0, 30.0, 25.0, 25.0, 25.0, 105.0)
    found = performance_of(sheet_of(salient()), low).number("current_stall_a")
    assert found is not None
    assert found.value == pytest.approx(1.0 / math.sqrt(3.0) / 0.05)


@pytest.mark.parametrize(
    ("name", "blank", "test"),
    [
        ("lq_h", "torque_speed", "current_step"),
        ("psi_pm_wb", "torque_speed", "open_circuit"),
        ("torque_coulomb_nm", "no_load_speed_rad_s", "spin_down"),
        ("rth_winding_k_w", "torque_continuous_nm", "heat_run"),
    ],
)
def test_what_cannot_be_known_is_blank_and_names_its_test(name: str, blank: str, test: str) -> None:
    lacking = not_identifiable(name, "1", "hand", "no capture")
    found = told(**{name: lacking})
    (one,) = (b for b in found.blanks if b.name == blank)
    assert name in one.why
    assert test in one.test
    assert (found.curve("torque_peak") is None) == (blank == "torque_speed")
    assert (found.curve("torque_continuous") is None) == (blank != "no_load_speed_rad_s")


def test_losses_that_no_capture_parts_are_blank() -> None:
    names = {one.name for one in plain().blanks}
    assert names == {
        "iron_loss_w", "additional_load_loss_w", "inverter_w", "inverter_switching_w"
    }  # fmt: skip
    assert all(cell.inverter_w is None for cell in plain().cells)
    stated = Operation(24.0, 30.0, 25.0, 25.0, 25.0, 105.0, drop_v=0.7)
    found = performance_of(sheet_of(salient()), stated)
    assert "inverter_w" not in {one.name for one in found.blanks}
    assert all((cell.inverter_w or 0.0) > 0.0 for cell in found.cells)


def test_a_coefficient_that_was_not_measured_is_assumed_and_said() -> None:
    lacking = not_identifiable("temp_coeff_magnet_1_k", "1/K", "hand", "no warm spin")
    hot = Operation(24.0, 30.0, 25.0, 125.0, 25.0, 105.0)
    wide = performance_of(sheet_of(salient(temp_coeff_magnet_1_k=lacking)), hot)
    sure = performance_of(sheet_of(salient()), hot)
    assert any("Temp_coeff_magnet_1_k" in note for note in wide.notes)
    for one in ("torque_peak_nm", "omega_no_load_rad_s"):
        assumed, known = wide.number(one), sure.number(one)
        assert assumed is not None
        assert known is not None
        assert assumed.high - assumed.low > 3.0 * (known.high - known.low)


def test_saturation_lowers_the_peak_torque() -> None:
    rated = estimate("lq_rated_h", 1.6e-4, "H", {"iq_a": 30.0, "id_a": 0.0})
    bent, straight = told(lq_rated_h=rated), plain()
    for name in ("torque_peak_nm", "omega_corner_rad_s"):
        one, other = bent.number(name), straight.number(name)
        assert one is not None
        assert other is not None
        assert (one.value < other.value) == (name == "torque_peak_nm")


def test_the_model_that_lacks_something_is_told() -> None:
    model = ModelVerdict("missing", missing={"cogging": FoundEffect({})}, residual=9.0)
    found = performance_of(sheet_of(salient(), model), OPERATION)
    assert any("lacks cogging" in note for note in found.notes)
    sound = performance_of(sheet_of(salient(), ModelVerdict("adequate", residual=1.0)), OPERATION)
    assert sound.notes == ()


def test_the_document_is_as_published_and_the_same_again() -> None:
    document = json.loads(canonical_json(plain().document()))
    assert complaints("motor-performance", document) == []
    assert canonical_json(told().document()) == canonical_json(plain().document())
    bare = performance_of(sheet_of({}), None)
    assert complaints("motor-performance", json.loads(canonical_json(bare.document()))) == []
    assert [one.name for one in bare.blanks] == ["operation"]
    document["numbers"][0]["value"] = "0.9"
    assert "$.numbers[0].value" in complaints("motor-performance", document)


def campaign(**columns: np.ndarray) -> Campaign:
    table = pl.DataFrame({"t_s": np.arange(100) / 100.0, **columns})
    meta = CaptureMeta("m", "drive")
    return Campaign("m", (Capture("a.csv", "0", "verified", meta, (table,)),))


def test_conditions_are_those_of_the_captures_unless_stated() -> None:
    rng = np.random.default_rng(1)
    angle = rng.uniform(0.0, 2.0 * np.pi, 100)
    seen = campaign(
        id_a=9.0 * np.cos(angle), iq_a=9.0 * np.sin(angle),
        vd_v=12.0 * np.cos(angle), vq_v=12.0 * np.sin(angle),
    )  # fmt: skip
    found = operation_of(seen, {})
    assert found is not None
    assert (found.current_a, found.vdc_v) == (9.0, 20.8)
    assert (found.temp_ambient_degc, found.temp_limit_degc) == (40.0, 120.0)
    assert "captures" in found.origin["vdc_v"]
    stated = operation_of(seen, {"vdc_v": 48.0, "temp_limit_degc": 90.0})
    assert stated is not None
    assert (stated.vdc_v, stated.current_a, stated.temp_limit_degc) == (48.0, 9.0, 90.0)
    assert stated.origin["vdc_v"] == "stated"
    assert operation_of(campaign(), {}) is None
    alone = operation_of(campaign(), {"vdc_v": 48.0, "current_a": 5.0})
    assert alone is not None


@pytest.mark.parametrize(
    ("stated", "message"),
    [
        ({"vdc_v": 0.0}, "not above 0"),
        ({"current_a": -1.0}, "not above 0"),
        ({"voltage_share": 1.2}, "more than an inverter gives"),
        ({"drop_v": -0.1}, "negative"),
        ({"temp_limit_degc": 30.0}, "not above the ambient"),
        ({"temp_winding_degc": 900.0}, "no motor's"),
        ({"vdc_v": math.nan}, "no number"),
    ],
)
def test_conditions_that_no_motor_is_operated_at(stated: dict[str, float], message: str) -> None:
    with pytest.raises(UsageError, match=message):
        operation_of(campaign(), stated)
