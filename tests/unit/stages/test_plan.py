"""`plan` on an output folder, and datasheets read back as they were written."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from pipeline.__main__ import main as command_line
from pipeline.crosscheck.plan import Known, settling_tests
from pipeline.estimation.registry import estimators, fit_all
from pipeline.io.storage.datasheets import datasheet_of, read_datasheets
from pipeline.io.storage.publish import canonical_json
from pipeline.physics.glossary import CONSTANTS, TESTS
from pipeline.records.capture import Campaign
from pipeline.records.datasheet import CaptureReference, Check, Datasheet
from pipeline.records.errors import UsageError
from pipeline.records.estimate import Estimate, not_identifiable
from pipeline.records.uncertainty import type_a, type_b
from pipeline.settings import PlanSettings
from pipeline.stages.plan import main, plan_of, ways_of

DEMO = Path(__file__).parents[3] / "data" / "demo" / "G52-0601"


def sheet(motor_id: str, constants: dict[str, Estimate], *tests: str) -> Datasheet:
    captures = tuple(CaptureReference(f"{t}.csv", "0" * 64, t, "verified") for t in tests)
    check = Check("kt_vs_ke", "not_evaluated", "needs a torque_map for Kt")
    alternatives = tuple(constants.values())[:1]
    return Datasheet(
        motor_id=motor_id,
        motor_type="made-up",
        lot=None,
        version="a" * 64,
        status="provisional",
        why=("missing",),
        captures=captures,
        config_sha256="b" * 64,
        code_version="0.1.0+1",
        constants=constants,
        alternatives=alternatives,
        checks=(check,),
    )


@pytest.fixture
def resistance_alone() -> Datasheet:
    budget = type_a("scatter:resistance:fit", 1e-4, 40.0) + type_a("scatter:soak:fit", 2e-4, 40.0)
    r = Estimate(
        "r_phase_ohm",
        0.31,
        "ohm",
        "measured",
        "resistance",
        (*budget, *type_b("voltage@rig-1", 3e-4)),
        {"temp_degc": 25.0},
        ("a.csv",),
        "",
        (0.0, 1e3),
    )
    j = not_identifiable("j_rotor_kgm2", "kg·m²", "spin_down", "record a spin_down")
    return sheet("r-only", {"r_phase_ohm": r, "j_rotor_kgm2": j}, "resistance")


def write(folder: Path, *sheets: Datasheet) -> None:
    (folder / "datasheets").mkdir(parents=True)
    for one in sheets:
        path = folder / "datasheets" / f"{one.motor_id}.json"
        path.write_bytes(canonical_json(one.document()))


def test_a_datasheet_comes_back_as_it_was_written(resistance_alone: Datasheet) -> None:
    document = json.loads(canonical_json(resistance_alone.document()))
    again = datasheet_of(document)
    assert json.loads(canonical_json(again.document())) == document


def two_scatters() -> Estimate:
    """Ten points' scatter, a hundred rows' scatter and an instrument, all three alike."""
    parts = (*type_a("points", 1.0, 10.0), *type_a("rows", 1.0, 100.0), *type_b("gain", 1.0))
    return Estimate("r_phase_ohm", 50.0, "ohm", "measured", "resistance", parts)


def test_the_freedom_of_a_datasheet_follows_from_its_contributions() -> None:
    """Welch-Satterthwaite by hand: u^4 = 9 over 1/10 + 1/100; what has no end is null."""
    written = two_scatters().document()
    assert [part["dof"] for part in written["budget"]] == [10.0, 100.0, None]
    assert written["dof"] == pytest.approx(9.0 / 0.11)
    document = sheet("r-only", {"r_phase_ohm": two_scatters()}).document()
    again = datasheet_of(json.loads(canonical_json(document))).constants["r_phase_ohm"]
    assert again.budget == two_scatters().budget


def test_a_datasheet_whose_contributions_tell_no_freedom_keeps_its_total() -> None:
    """As the registry holds them from before."""
    document = json.loads(
        canonical_json(sheet("r-only", {"r_phase_ohm": two_scatters()}).document())
    )
    for said in (document["constants"]["r_phase_ohm"], *document["alternatives"]):
        for part in said["budget"]:
            del part["dof"]
    again = datasheet_of(document).constants["r_phase_ohm"]
    assert again.dof == pytest.approx(9.0 / 0.11)


def reasons(text: str) -> set[str]:
    """The names that the steps of a printed plan are for."""
    lines = [line[7:].split(":")[0] for line in text.splitlines() if line.startswith("   for ")]
    return {name for line in lines for name in line.split(", ")}


def test_plan_of_a_motor_with_one_test(tmp_path: Path, resistance_alone: Datasheet) -> None:
    """Resistance is there and good: never again. A loaded drive settles most, Kt and pole pairs
    among it; steps, open circuit and, for saturation and the check of Kt, a torque map follow.
    """
    write(tmp_path, resistance_alone)
    outcome = main(PlanSettings(output=str(tmp_path), motor="r-only"))
    assert outcome.exit_code == 0
    heads = [line for line in outcome.text.splitlines() if line[:1].isdigit()]
    tests = [line.split(". ")[1].split(":")[0].split(",")[0] for line in heads]
    assert set(tests) <= set(TESTS)
    assert tests[0] == "drive"
    assert {"torque_map", "current_step", "open_circuit"} <= set(tests)
    assert "psi_pm_wb" in reasons(outcome.text)
    assert "r_phase_ohm" not in reasons(outcome.text)


def test_plan_keeps_to_the_limits_that_are_named(
    tmp_path: Path, resistance_alone: Datasheet
) -> None:
    """What a file of limits asks for comes first; without one, what the default asks for."""
    write(tmp_path, resistance_alone)
    limits = tmp_path / "warm.yaml"
    limits.write_text("required: [rth_winding_k_w]\n")
    planned = main(PlanSettings(output=str(tmp_path), limits=str(limits))).text
    assert planned == plan_of(resistance_alone, frozenset({"rth_winding_k_w"})).text()
    assert planned != main(PlanSettings(output=str(tmp_path))).text
    with pytest.raises(UsageError, match="no limits file 'none'"):
        main(PlanSettings(output=str(tmp_path), limits="none"))


def test_plan_from_captures_is_that_of_a_run_of_them(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The contract has `plan` read captures as well: no run has to come first."""
    folder, output = tmp_path / "in", tmp_path / "out"
    folder.mkdir()
    for path in DEMO.glob("resistance*"):
        shutil.copyfile(path, folder / path.name)
    assert command_line(["plan", f"motor={DEMO.name}", f"input={folder}"]) == 0
    planned, _, command = capsys.readouterr().out.partition("next: ")
    assert command.endswith(f"run input={folder}\n")
    quiet = ["report=false", "recordings=false", "registry=null", "workers=1"]
    command_line(["run", f"input={folder}", f"output={output}", *quiet])
    capsys.readouterr()
    assert command_line(["plan", f"output={output}"]) == 0
    assert planned == capsys.readouterr().out
    assert "open_circuit" in planned
    assert command_line(["plan", "motor=other", f"input={folder}"]) == 2
    assert f"known are {DEMO.name}" in capsys.readouterr().err


def test_every_constant_can_be_planned(tmp_path: Path) -> None:
    """From no usable capture at all, each constant that can be had is some step's business."""
    nothing = sheet("nothing", fit_all(Campaign("nothing", ()), {})[0].chosen())
    write(tmp_path, nothing)
    text = main(PlanSettings(output=str(tmp_path))).text
    given = {name for estimator in estimators() for name in estimator.gives} & set(CONSTANTS)
    assert given <= reasons(text)
    assert "what no further capture settles" not in text


def test_unknown_motor_and_empty_folder(tmp_path: Path, resistance_alone: Datasheet) -> None:
    write(tmp_path / "some", resistance_alone)
    with pytest.raises(UsageError, match="known are r-only"):
        main(PlanSettings(output=str(tmp_path / "some"), motor="other"))
    with pytest.raises(UsageError, match="no datasheets in"):
        main(PlanSettings(output=str(tmp_path / "none")))


@pytest.mark.parametrize(
    "content", [b"{}", b"[1]", b"no", b'{"schema": "findings/1"}', b"[" * 9999]
)
def test_a_file_that_is_no_datasheet(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "datasheets").mkdir()
    (tmp_path / "datasheets" / "x.json").write_bytes(content)
    with pytest.raises(UsageError, match=r"x\.json"):
        read_datasheets(tmp_path)


def test_friction_is_never_had_by_holding_the_rotor_still() -> None:
    """Whatever else is missing: what only refines the inertia is not recorded for its sake."""
    ways = ways_of()
    for tests in ((), ("spin_down",), ("drive",), ("drive", "spin_down"), ("drive", "resistance")):
        state = Known("m", {}, (), frozenset(tests))
        found = settling_tests("b_visc_nm_s_rad", state, ways)
        assert found
        assert not found & {"holding_current", "cogging"}, (tests, found)
