"""One motor's campaigns of different days merge into one datasheet."""

from __future__ import annotations

import json
import math
import shutil
from pathlib import Path
from typing import Any

import pytest
from scipy.stats import chi2

from pipeline.__main__ import main
from pipeline.estimation.electrical.step_budget import birge_ratio


def sheet_of(folder: Path, output: Path) -> dict[str, Any]:
    words = [
        "report=false",
        "recordings=false",
        "residual_test=false",
        "registry=null",
        "workers=1",
    ]
    assert main(["run", f"input={folder}", f"output={output}", *words]) in (0, 4)
    (path,) = (output / "datasheets").iterdir()
    sheet: dict[str, Any] = json.loads(path.read_bytes())
    return sheet


def test_what_one_day_lacks_the_other_gives(bench: Path, tmp_path: Path) -> None:
    """Steps and resistance on Monday, the spin on Tuesday: checks that need both are made."""
    for day, tests in (("monday", ("resistance", "current_step")), ("tuesday", ("open_circuit",))):
        (tmp_path / "in" / day).mkdir(parents=True)
        for path in sorted((bench / "one").iterdir()):
            if path.name.startswith(tests):
                shutil.copyfile(path, tmp_path / "in" / day / path.name)
    monday = sheet_of(tmp_path / "in" / "monday", tmp_path / "m")
    tuesday = sheet_of(tmp_path / "in" / "tuesday", tmp_path / "t")
    both = sheet_of(tmp_path / "in", tmp_path / "both")
    assert monday["constants"]["psi_pm_wb"]["status"] == "not_identifiable"
    assert tuesday["constants"]["ld_h"]["status"] == "not_identifiable"
    for name, day in (("ld_h", monday), ("r_phase_ohm", monday), ("psi_pm_wb", tuesday)):
        merged, alone = both["constants"][name], day["constants"][name]
        assert merged["value"] == pytest.approx(alone["value"], abs=0.2 * alone["u"])
    days = {capture["path"].split("/")[0] for capture in both["provenance"]["captures"]}
    assert days == {"monday", "tuesday"}
    assert len({monday["version"], tuesday["version"], both["version"]}) == 3


@pytest.mark.slow
def test_a_repeated_day_narrows_the_scatter_and_not_the_gain(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Steps recorded on two days with the same instruments: u_a falls by sqrt(2), u_b stays.

    What the captures scatter among themselves multiplies u_a by the Birge ratio. Of six captures
    and two axes it is chance, sqrt(chi²(4)/4) where that is above 1; so it is held apart here, and
    to what chance gives once in a thousand (with it these two seeds give 0.58 for 0.71).
    """
    birge: list[tuple[float, int]] = []

    def apart(solution: Any) -> float:
        birge.append((birge_ratio(solution), len(solution.model.records) - 2))
        return 1.0

    monkeypatch.setattr("pipeline.estimation.estimators.current_step.birge_ratio", apart)
    for seed, day in ((7, "one"), (8, "two")):
        words = ["motor=gimbal-5208", "motor_id=m", f"seed={seed}", "exact=true"]
        assert main(["simulate", f"output={tmp_path / 'all' / day}", *words]) == 0
        (tmp_path / "in" / day).mkdir(parents=True)
        for pattern in ("resistance_*", "current_step_*"):
            for path in sorted((tmp_path / "all" / day).glob(pattern)):
                shutil.copyfile(path, tmp_path / "in" / day / path.name)
    once = sheet_of(tmp_path / "in" / "one", tmp_path / "o")["constants"]["ld_h"]
    twice = sheet_of(tmp_path / "in", tmp_path / "b")["constants"]["ld_h"]
    assert twice["u_b"] == pytest.approx(once["u_b"], rel=0.05)
    assert twice["u_a"] == pytest.approx(once["u_a"] / math.sqrt(2.0), rel=0.03)
    assert len(twice["captures"]) == 2 * len(once["captures"])
    many = [(ratio, dof) for ratio, dof in birge if dof > 0]  # not of a capture alone
    assert {dof for _, dof in many} == {4, 10}
    assert all(1.0 <= ratio < math.sqrt(chi2.isf(0.001, dof) / dof) for ratio, dof in many)
