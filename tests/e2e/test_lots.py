"""From captures of two lots to the verdict: `simulate`, `run`, `regress`, as CI would do it."""

from __future__ import annotations

import json
from pathlib import Path
from xml.etree import ElementTree as Xml

import pytest

from pipeline.__main__ import main

NEW_ORDER = "cogging_order_12"


def regressed(folder: Path, fleet: str) -> tuple[int, dict]:  # type: ignore[type-arg]
    """Simulates a fleet of `conf/fleet/`, works it through, compares its two lots."""
    captures, output = folder / "captures", folder / "out"
    assert main(["simulate", f"output={captures}", f"fleet={fleet}"]) == 0
    words = [f"input={captures}", f"output={output}", "report=false", "recordings=false"]
    words.append("diagnose=false")
    assert main(["run", *words]) in (0, 4)
    code = main(["regress", "baseline=lot:2026-W20", "candidate=lot:2026-W24", f"output={output}"])
    return code, json.loads((output / "regression" / "report.json").read_bytes())


@pytest.mark.slow
def test_weak_magnets_and_a_new_cogging_order_fail_the_lot(tmp_path: Path) -> None:
    """Twelve motors a lot, the second with 4 % weaker magnets and cogging once a slot: both named,
    nothing else.
    """
    code, said = regressed(tmp_path, "two-lots")
    assert code == 1
    assert said["verdict"] == "fail"
    failed = {one["name"] for one in said["constants"] if one["verdict"] == "fail"}
    assert failed == {"psi_pm_wb", "kt_peak_nm_a"}
    assert {e["name"] for e in said["effects"] if e["verdict"] == "fail"} == {NEW_ORDER}
    assert "psi_pm_wb" in said["headline"]
    assert NEW_ORDER in said["headline"]
    psi = next(one for one in said["constants"] if one["name"] == "psi_pm_wb")
    assert psi["effect"]["relative"] == pytest.approx(-0.04, abs=0.006)
    order = next(one for one in said["effects"] if one["name"] == NEW_ORDER)
    assert (order["baseline_shown"], order["candidate_shown"]) == (0, 12)
    assert order["candidate_amplitude"] == pytest.approx(0.3 * 0.0085, rel=0.1)
    root = Xml.fromstring((tmp_path / "out" / "regression" / "report.xml").read_bytes())
    named = {
        case.attrib["name"] for case in root.iter("testcase") if case.find("failure") is not None
    }
    assert named == {"verdict", "psi_pm_wb", "kt_peak_nm_a", f"datasheet: {NEW_ORDER}"}


@pytest.mark.slow
def test_the_same_lots_unchanged_pass(tmp_path: Path) -> None:
    """The same fleet without the two changes: exit code 0 from one baseline lot."""
    code, said = regressed(tmp_path, "two-lots-alike")
    assert code == 0
    assert said["verdict"] == "pass"
    assert said["history"] == "INSUFFICIENT_HISTORY"
    assert all(one["verdict"] in ("pass", "not_evaluated") for one in said["constants"])
    assert sum(one["verdict"] == "pass" for one in said["constants"]) == 9
