"""Numbers that captures do not determine were published; each test bears the name of one."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from pipeline.__main__ import main
from pipeline.io.storage.write_capture import Format, write_capture
from pipeline.simulator.bench import campaign
from pipeline.simulator.design import Bench
from pipeline.simulator.truth import truth
from tests.simulated import design

COASTS = (
    ("spin_down_forward", "spin_down", {"direction": 1}),
    ("spin_down_backward", "spin_down", {"direction": -1, "level": 0.8}),
)
WINDING = (("resistance_ab", "resistance", {}), ("step", "current_step", {}))
CURRENT_MAP = (("holding_current", "holding_current", {}),)
SLOW = (("cw", "cogging", {"direction": 1}), ("ccw", "cogging", {"direction": -1}))
TRUE = truth(design("gimbal-5208"))["constants"]
J, PSI = TRUE["j_rotor_kgm2"], TRUE["psi_pm_wb"]
DRY, VISCOUS = TRUE["torque_coulomb_nm"], TRUE["b_visc_nm_s_rad"]
DRY_NAME = "coulomb_friction.torque_nm"
DYNAMIC = ("j_kgm2", "b_nm_s_rad", "psi_wb", "r_ohm")
REACH = 1.96
QUICK = ("recordings=false", "report=false", "residual_test=false")


def recorded(folder: Path, plan: Any, **effects: Any) -> Path:
    """Captures of a plan, and nothing else, of a simulated gimbal motor with `effects`."""
    motor = design("gimbal-5208").having(**effects)
    for one in campaign(motor, Bench(), 3, plan):
        write_capture(folder, one.stem, one.meta, one.tables, Format("json", compression="lz4"))
    return folder


def made(folder: Path, command: str, *words: str) -> Mapping[str, Any]:
    """The one JSON document that a command writes of a folder's captures."""
    output = folder.parent / f"{command}-{folder.name}"
    assert main([command, f"input={folder}", f"output={output}", *words]) in (0, 1, 4)
    kind = {"compare": "comparison", "diagnose": "diagnosis", "run": "datasheets"}[command]
    (path,) = (output / kind).glob("*.json")
    document: Mapping[str, Any] = json.loads(path.read_bytes())
    return document


def holds(one: Mapping[str, Any], true: float) -> bool:
    return abs(one["value"] - true) <= REACH * one["u"]


def parameters(document: Mapping[str, Any]) -> dict[str, Any]:
    told: dict[str, Any] = document["model"]["parameters"]
    return told


def combined(document: Mapping[str, Any]) -> dict[str, Any]:
    home = document["model"] if "parameters" in document["model"] else document
    return {one["expression"]: one for one in home["combinations"]}


def test_j_13000_times_too_small_from_coasts_alone(tmp_path, capsys):
    """`compare` gave J = 6.4e-5 ± 2.5e-7 kg·m² (true 0.85) and Tc = 63 N·m: coasts hold Tc/J and
    b/J, and nothing else.
    """
    document = made(recorded(tmp_path / "coasts", COASTS), "compare")
    for name in (*DYNAMIC, DRY_NAME):
        one = parameters(document)[name]
        assert (one["value"], one["u"], one["status"]) == (None, None, "not_identifiable")
    found = combined(document)
    assert set(found) == {"b_nm_s_rad/j_kgm2", f"{DRY_NAME}/j_kgm2"}
    assert holds(found["b_nm_s_rad/j_kgm2"], VISCOUS / J)
    assert holds(found[f"{DRY_NAME}/j_kgm2"], DRY / J)
    assert found[f"{DRY_NAME}/j_kgm2"]["u"] < 1e-3 * DRY / J
    said = capsys.readouterr().out
    assert "not identifiable from these captures" in said
    assert f"but {DRY_NAME}/j_kgm2 = 152." in said


def test_j_from_coasts_alone_is_in_no_datasheet(tmp_path):
    """`run` on the same captures."""
    sheet = made(recorded(tmp_path / "coasts", COASTS), "run", *QUICK)
    for name in ("j_rotor_kgm2", "torque_coulomb_nm", "b_visc_nm_s_rad", "kt_peak_nm_a"):
        assert sheet["constants"][name]["status"] == "not_identifiable"
        assert sheet["constants"][name]["value"] is None
        assert sheet["constants"][name]["note"]


def test_psi_7000_times_too_large_from_a_current_map(tmp_path):
    """`compare` gave ψ = 34.9 ± 0.2 Wb (true 0.005): a current that holds a rotor tells friction
    over ψ, and with a model that misses its cogging by 17 noise floors not even that.
    """
    folder = recorded(tmp_path / "map", CURRENT_MAP)
    for words in ((), ("model.effects=[cogging]",)):
        document = made(folder, "compare", *words)
        for name in (*DYNAMIC, DRY_NAME):
            assert parameters(document)[name]["value"] is None
        told = [
            one for one in combined(document).values() if set(one["of"]) == {DRY_NAME, "psi_wb"}
        ]
        assert len(told) == len(words)
        assert all(holds(one, DRY / PSI) for one in told)


def test_psi_from_a_current_map_is_in_no_datasheet(tmp_path):
    folder = recorded(tmp_path / "map", CURRENT_MAP)
    sheet = made(folder, "run", *QUICK)
    known = {name for name, one in sheet["constants"].items() if one["value"] is not None}
    assert not known & {"psi_pm_wb", "kt_peak_nm_a", "torque_coulomb_nm", "cogging_peak_nm"}


def test_viscous_friction_700_times_too_large_from_slow_turns_alone(tmp_path):
    """`compare` gave b = 0.016 ± 0.0003 N·m·s/rad (true 2.2e-5) and no dry friction: two turns at
    one speed tell the sum of both drags.
    """
    document = made(recorded(tmp_path / "slow", SLOW), "compare")
    assert parameters(document)["b_nm_s_rad"]["value"] is None
    assert parameters(document)[DRY_NAME]["value"] is None
    (one,) = combined(document).values()
    assert set(one["of"]) == {"b_nm_s_rad", DRY_NAME}
    truths = {"b_nm_s_rad": VISCOUS, DRY_NAME: DRY}
    (first, _, second) = one["expression"].split(" ")
    factor, name = second.split("*")
    assert holds(one, truths[first] + float(factor) * truths[name])


@pytest.mark.slow
def test_one_torque_beside_the_coasts_makes_all_of_it_known(tmp_path):
    document = made(
        recorded(tmp_path / "both", COASTS + SLOW), "compare", "model.effects=[cogging]"
    )
    told = parameters(document)
    assert holds(told["j_kgm2"], J)
    assert holds(told[DRY_NAME], DRY)
    assert holds(told["b_nm_s_rad"], VISCOUS)
    assert combined(document) == {}


def test_windage_of_coasts_alone_is_named_without_a_size(tmp_path, capsys):
    """`diagnose` gave the drag in N·m, to 1 %, of a shaft of which no torque is known. That there
    is windage, and windage over inertia, is known; so is the design's own cogging.
    """
    size = 0.3 * DRY
    folder = recorded(tmp_path / "windage", COASTS + WINDING, windage={})
    document = made(folder, "diagnose")
    assert document["missing"] == ["windage", "cogging"]
    (ranked,) = (one for one in document["ranking"] if one["effect"] == "windage")
    assert {(p["value"], p["u"]) for p in ranked["parameters"].values()} == {(None, None)}
    step = document["ladder"][-1]["parameters"]
    assert step["windage.drag_nm"]["value"] is None
    assert step[DRY_NAME]["value"] is None
    assert combined(document)["windage.drag_nm/j_kgm2"]["value"] > size / J
    page = next((tmp_path / "diagnose-windage" / "diagnosis").glob("*.html")).read_text("utf-8")
    assert "not identifiable" in page
    assert "windage.drag_nm/j_kgm2" in page
    assert "windage.drag_nm/j_kgm2" in capsys.readouterr().out


@pytest.mark.slow
def test_cogging_of_coasts_is_named_over_the_inertia(tmp_path):
    """Coasts give no torque: the design's own cogging is known over the inertia alone."""
    document = made(recorded(tmp_path / "few", COASTS), "diagnose")
    assert (document["verdict"], document["missing"]) == ("missing", ["cogging"])
    sizes = [size for one in document["ranking"] for size in one["parameters"].values()]
    assert {(size["value"], size["u"]) for size in sizes} == {(None, None)}
    parts = [combined(document)[f"cogging.{part}_84_nm/j_kgm2"] for part in ("sin", "cos")]
    size = math.hypot(*(part["value"] for part in parts))
    true = design("gimbal-5208").effects["cogging"]["size"] / J
    assert abs(size - true) < REACH * math.hypot(*(part["u"] for part in parts))


def test_cogging_of_holding_currents_is_named_without_a_torque(tmp_path):
    """No constant makes torque of these currents: cogging is known over the flux linkage."""
    document = made(recorded(tmp_path / "few", CURRENT_MAP), "diagnose")
    assert (document["verdict"], document["missing"]) == ("missing", ["cogging"])
    sizes = [size for one in document["ranking"] for size in one["parameters"].values()]
    assert {(size["value"], size["u"]) for size in sizes} == {(None, None)}
    parts = [combined(document)[f"cogging.{part}_84_nm/psi_wb"]["value"] for part in ("sin", "cos")]
    true = design("gimbal-5208").effects["cogging"]["size"] / TRUE["psi_pm_wb"]
    assert math.hypot(*parts) == pytest.approx(true, rel=0.01)
