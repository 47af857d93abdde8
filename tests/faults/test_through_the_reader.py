"""Whole files through reader and contract: bad ones are refused one by one, healthy ones pass."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.contracts.motor import agree
from pipeline.contracts.validate import validate
from pipeline.io.ingest.capture_reader import read_capture, survey
from pipeline.io.maps.map_file import load_source_maps
from pipeline.records.capture import Campaign, Capture
from pipeline.records.errors import CaptureError
from pipeline.records.finding import Finding
from pipeline.settings import configuration_folder

DATA = Path(__file__).parents[3] / "shared" / "data"

HEAD = "# contract: 1\n# motor_id: m\n# test: spin_down\n"
ROWS = "".join(f"{0.01 * k:.2f},{100.0 - 0.4 * k:.1f}\n" for k in range(200))
GOOD = f"{HEAD}t_s,omega_mech_rad_s\n{ROWS}"


def everything(folder: Path) -> tuple[list[Capture], list[Finding]]:
    """Captures that came through, and all findings, of a folder."""
    maps = load_source_maps(configuration_folder() / "source")
    seen = survey(folder, maps)
    captures, findings = [], list(seen.findings)
    for entry in seen.entries:
        try:
            capture, found = validate(read_capture(folder, entry), {})
        except CaptureError as error:
            findings.append(Finding.refusal(entry.path, error))
        else:
            captures.append(capture)
            findings.extend(found)
    motors = sorted({capture.meta.motor_id for capture in captures})
    for motor in motors:
        own = tuple(c for c in captures if c.meta.motor_id == motor)
        findings.extend(agree(Campaign(motor, own)))
    return captures, findings


@pytest.mark.parametrize(
    ("text", "code", "rows", "words"),
    [
        (GOOD.replace("spin_down", "burn_in"), "unknown_test", None, "burn_in"),
        (GOOD.replace("_rad_s", "_rpm"), "unknown_unit", None, "omega_mech_rpm"),
        (GOOD.replace("omega_mech_rad_s", "vab_v"), "missing_column", None, "omega_mech_rad_s"),
        (GOOD.replace("\n0.05,", "\nNaN,"), "time_not_finite", (5, 5), "t_s"),
        (GOOD.replace("\n0.05,", "\n0.04,"), "time_not_increasing", (5, 5), "t_s"),
        (GOOD.replace(",98.0\n", ",980000.0\n"), "implausible_value", (5, 5), "980000"),
        (f"{HEAD}t_s,omega_mech_rad_s\n", "no_rows", None, ""),
    ],
    ids=["test", "unit", "column", "nan time", "repeated time", "implausible", "no rows"],
)
def test_a_bad_file_is_refused_and_the_rest_is_done(
    tmp_path: Path, text: str, code: str, rows: tuple[int, int] | None, words: str
) -> None:
    """Refused: that file alone, in one line with its rows and a remedy; its neighbour passes."""
    (tmp_path / "bad.csv").write_text(text)
    (tmp_path / "good.csv").write_text(GOOD)
    captures, findings = everything(tmp_path)
    assert [capture.path for capture in captures] == ["good.csv"]
    refusals = [finding for finding in findings if finding.severity == "refused"]
    assert [(f.file, f.code, f.rows) for f in refusals] == [("bad.csv", code, rows)]
    assert words in refusals[0].message
    assert refusals[0].remedy
    assert "\n" not in refusals[0].line()


@pytest.mark.parametrize(
    "campaign",
    [
        "P0",
        pytest.param("P1", marks=pytest.mark.slow),
        pytest.param("P2", marks=pytest.mark.slow),
        pytest.param("P3", marks=pytest.mark.slow),
        "P4",
    ],
)
def test_nothing_is_said_of_the_rig(campaign: str) -> None:
    """Not one warning on 23 captures of a bench that this project did not make, in any encoding."""
    folder = DATA / "rig" / campaign
    if not folder.is_dir():
        pytest.skip("the shared rig data is not beside this checkout")
    captures, findings = everything(folder)
    assert len(captures) == 23
    assert findings == []
    assert all(capture.masks == () for capture in captures)


def test_nothing_is_said_of_a_real_bench() -> None:
    """Not one warning on a real drive log with jittering time stamps, and on its hold points."""
    folder = DATA / "real" / "laas_solo"
    if not folder.is_dir():
        pytest.skip("the shared recording is not beside this checkout")
    captures, findings = everything(folder)
    assert sorted(capture.meta.test for capture in captures) == ["drive", "holding_current"]
    assert findings == []
