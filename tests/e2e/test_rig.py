"""The main job on captures of a bench that this project did not write, against its truth."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import Any

import pytest
from scipy.special import stdtrit

from pipeline.__main__ import main

RIG = Path(__file__).parents[3] / "shared" / "data" / "rig"
pytestmark = pytest.mark.skipif(not RIG.is_dir(), reason="../shared/data/rig is not here")

LIMITS = {
    "r_phase_ohm": 0.003,
    "ld_h": 0.01,
    "lq_h": 0.01,
    "psi_pm_wb": 0.002,
    "kt_peak_nm_a": 0.003,
    "j_rotor_kgm2": 0.01,
    "torque_coulomb_nm": 0.03,
}
JUDGED = (*LIMITS, "b_visc_nm_s_rad", "temp_coeff_copper_1_k", "temp_coeff_magnet_1_k")


@pytest.fixture(scope="module")
def sheet(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Datasheet of the motor with nothing hidden, without a test of the model, which takes three
    times as long as its constants; tests/unit/estimation/test_real_recordings.py has constants of
    the others.
    """
    return sheet_of("P0", tmp_path_factory.mktemp("P0"), "residual_test=false")


def sheet_of(folder: str, output: Path, *more: str) -> dict[str, Any]:
    words = [f"input={RIG / folder}", f"output={output}", "report=false", "recordings=false"]
    assert main(["run", *words, *more]) in (0, 1)
    (path,) = (output / "datasheets").iterdir()
    sheet: dict[str, Any] = json.loads(path.read_bytes())
    return sheet


def truth(folder: str) -> dict[str, Any]:
    constants: dict[str, Any] = json.loads((RIG / folder / "truth.json").read_bytes())["constants"]
    return constants


@pytest.mark.parametrize("name", LIMITS)
def test_relative_error_on_the_motor_with_nothing_hidden(sheet: dict[str, Any], name: str) -> None:
    value = sheet["constants"][name]["value"]
    assert value == pytest.approx(truth("P0")[name], rel=LIMITS[name])


@pytest.mark.parametrize("name", JUDGED)
def test_truth_lies_in_the_interval(sheet: dict[str, Any], name: str) -> None:
    """Every constant within its own 95 % interval (Student's t with its own dof)."""
    stated = sheet["constants"][name]
    reach = stdtrit(stated["dof"] or 1e9, 0.975) * stated["u"]
    assert abs(stated["value"] - truth("P0")[name]) <= reach
    assert math.isclose(stated["u"], math.hypot(stated["u_a"], stated["u_b"]), rel_tol=1e-9)


def test_pole_pairs_are_exact(sheet: dict[str, Any]) -> None:
    assert sheet["constants"]["pole_pairs"]["value"] == 10


def test_no_cogging_is_said_where_there_is_none(sheet: dict[str, Any]) -> None:
    order = sheet["constants"]["cogging_order"]
    assert (order["status"], order["value"]) == ("not_identifiable", None)
    assert order["note"]


def test_every_check_of_a_sound_motor_holds(sheet: dict[str, Any]) -> None:
    """Nothing but the cogging order, which is not there, and what nobody states stays unjudged."""
    statuses = {check["name"]: check["status"] for check in sheet["checks"]}
    assert statuses.pop("cogging_order_vs_slots") == "not_evaluated"
    assert statuses.pop("stated_constants") == "not_evaluated"
    assert set(statuses.values()) == {"pass"}
    assert len(statuses) == 10


@pytest.mark.slow
def test_the_motor_with_nothing_hidden_leaves_nothing_over_the_noise(tmp_path: Path) -> None:
    """Of a sound motor of the simulator tests/e2e/test_same_bytes.py says so by default."""
    model = sheet_of("P0", tmp_path)["model"]
    assert (model["verdict"], model["missing"], model["worst"]) == ("adequate", [], None)
    assert 0.4 < model["held_out"] < 1.0
    assert model["residual"] < math.sqrt(2.0)


@pytest.mark.slow
def test_a_motor_with_hidden_effects_names_them_with_their_sizes(tmp_path: Path) -> None:
    sheet = sheet_of("P1", tmp_path)
    model, why = sheet["model"], sheet["why"]
    found = {one["effect"]: one["parameters"] for one in model["missing"]}
    assert (model["verdict"], set(found)) == ("missing", {"cogging", "dead_time"})
    loss = found["dead_time"]["loss_v"]
    assert loss["value"] == pytest.approx(0.18, abs=3.0 * loss["u"])
    assert model["residual"] == model["worst"]["floors"] > 10.0
    (said,) = [one for one in why if one.startswith("model: ")]
    size = re.search(r"cogging torque of ([\d.]+) ± [\d.]+ mN·m", said)
    assert size is not None and float(size[1]) == pytest.approx(6.0, rel=0.002)
    assert "`run input=FOLDER 'model.effects=[dead_time,cogging]'` adds them" in said


@pytest.mark.slow
def test_released_with_76_noise_floors_left(tmp_path: Path) -> None:
    """An encoder off its centre and Stribeck friction: at most provisional, and `why` says where;
    with both in the model nothing is left, and the datasheet is released.
    """
    words = [f"input={RIG / 'P3'}", "report=true", "recordings=false", "release=auto"]
    assert main(["run", *words, f"output={tmp_path / 'plain'}"]) == 0
    (path,) = (tmp_path / "plain" / "datasheets").iterdir()
    sheet = json.loads(path.read_bytes())
    assert sheet["status"] == "provisional"
    assert sheet["model"]["held_out"] == pytest.approx(75.0, abs=3.0)
    (reason,) = sheet["why"]
    assert "noise floors" in reason
    (page,) = (tmp_path / "plain" / "report").glob("joint*.html")
    assert "Nothing was found wrong" not in page.read_text(encoding="utf-8")

    words.append("model.effects=[angle_eccentricity,stribeck]")
    assert main(["run", *words, f"output={tmp_path / 'whole'}"]) == 0
    (path,) = (tmp_path / "whole" / "datasheets").iterdir()
    sheet = json.loads(path.read_bytes())
    assert (sheet["status"], sheet["why"]) == ("released", [])
    (page,) = (tmp_path / "whole" / "report").glob("joint*.html")
    assert "Nothing was found wrong" in page.read_text(encoding="utf-8")
