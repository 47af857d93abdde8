"""A recording of lots against lots holds the record's numbers where its layout looks for them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import polars as pl
import pytest

from pipeline.io.recordings.font import in_headings
from pipeline.io.recordings.lots import (
    cogging_plan,
    drift_plan,
    lots_bytes,
    lots_name,
    verdict_markdown,
)
from pipeline.io.recordings.lots_traces import MOTORS, SIDES, constant_scale, drift, histogram
from pipeline.io.recordings.readback import entities, recording_property
from pipeline.io.recordings.seal import verify, write_checksummed
from pipeline.views.lots import compared
from tests.unit.regressions import AFTER, BEFORE, COGGING_NM, make_regression


@pytest.fixture(scope="module")
def lots(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("recordings") / lots_name(make_regression())
    write_checksummed(path, lots_bytes(make_regression()))
    return path


def read_back(path: Path, entity: str) -> pl.DataFrame:
    from rerun.chunk import RrdReader

    chunks = RrdReader(str(path)).stream().filter(content=entity, is_static=False)
    frame = pl.concat([pl.from_arrow(chunk.to_record_batch()) for chunk in chunks])
    return frame.drop("rerun.controls.RowId").sort("place").explode(pl.exclude("place"))


def test_it_is_sealed_and_says_which_lots_it_compares(lots: Path) -> None:
    verify(lots)
    assert recording_property(lots, "regression", "lots") == [*BEFORE, *AFTER]
    assert recording_property(lots, "regression", "verdict") == ["fail"]


def test_what_failed_comes_first() -> None:
    names = [one.name for one in compared(make_regression())]
    assert names == ["cogging_amplitude_nm", "r_phase_ohm"]


def test_every_motor_is_in_one_bin_of_its_side() -> None:
    for one in compared(make_regression()):
        edges, counts = histogram(one)
        assert {side: count.sum() for side, count in counts.items()} == {
            side: len(one.of(side)) for side in SIDES
        }
        shown = [constant_scale(one).shown(motor.value) for motor in one.motors]
        assert edges[0] <= min(shown)
        assert edges[-1] >= max(shown)


def test_cogging_bands_come_back_in_millinewtonmetres_by_tenths_of_degrees(lots: Path) -> None:
    for band in make_regression().cogging:
        back = read_back(lots, f"/cogging/{band.side}")
        np.testing.assert_allclose(back["mean"], 1e3 * np.array(band.mean_nm), rtol=1e-6)
        assert back["place"].to_list() == list(range(0, 3601, 10))
        peak = 1e3 * COGGING_NM[band.side]
        inner = back["fill_4"].to_numpy()
        assert back["mean"].max() == pytest.approx(peak, rel=0.01)
        assert ((inner >= back["low"].to_numpy()) & (inner <= back["high"].to_numpy())).all()


def test_drift_is_the_change_of_lot_means_from_the_baselines() -> None:
    cogging = compared(make_regression())[0]
    told = drift(cogging)
    assert told is not None
    change = 100 * (0.014 - 0.008) / np.mean([lot.mean for lot in cogging.lots[:3]])
    assert told["mean"].to_list() == pytest.approx([0, 0, 0, change], abs=1e-9)
    assert told["candidate"].is_nan().to_list() == [True, True, False, False]


def test_motors_stand_with_their_values(lots: Path) -> None:
    back = read_back(lots, MOTORS)
    assert back["baseline_or_candidate"].to_list() == ["baseline"] * 18 + ["candidate"] * 6
    first = compared(make_regression())[0]
    assert first.name == "cogging_amplitude_nm"
    shown = read_back(lots, f"{MOTORS}/{first.name}")["mN·m"]
    known = {m.motor_id: 1e3 * m.value for m in first.motors}
    found = dict(zip(back["motor_serial_number"], shown, strict=True))
    assert found == pytest.approx(known, rel=1e-4)


def test_a_heading_has_no_superscript_minus() -> None:
    """The monospaced font of the viewer's tables lacks it, and the viewer ends."""
    assert in_headings("×10⁻⁶ kg·m²") == "1e-6 kg·m²"
    assert in_headings("×10⁻³ K⁻¹") == "1e-3 K^-1"
    assert in_headings("mN·m") == "mN·m"


def test_every_curve_and_every_bar_that_is_drawn_is_there(lots: Path) -> None:
    held = entities(lots)
    plan = cogging_plan(make_regression())
    assert plan is not None
    plans = [plan, *map(drift_plan, compared(make_regression()))]
    for line in (line for plan in plans for line in plan.lines):
        assert line.entity in held
        assert line.component in read_back(lots, line.entity).columns
    for one in compared(make_regression()):
        assert {f"/hist/{one.name}/{side}" for side in SIDES} <= set(held)


def test_the_page_leads_with_the_verdict_and_marks_what_failed() -> None:
    text = verdict_markdown(make_regression()).replace("\\", "")
    assert text.startswith("# lot:2026-W0* → lot:2026-W14: fail")
    assert "| ✗ | **cogging_amplitude_nm** | 8.0" in text
    assert "**+75 ± 12 %**" in text
    assert "- 3: 2026-W14" in text
    assert "M3: r_phase_ohm 4 sd (M3/r.mcap)" in text
