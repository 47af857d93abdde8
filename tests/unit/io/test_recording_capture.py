"""A recording read back holds what the capture and the fit held, and its layout points at it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from pipeline.io.recordings.capture import identity, recording_bytes
from pipeline.io.recordings.capture_traces import (
    LONG_ROWS,
    TABLE_ROWS,
    capture_traces,
    fit_traces,
    own_evidence,
)
from pipeline.io.recordings.capture_views import further_views, loupe_views, main_views
from pipeline.io.recordings.datasheet_page import capture_markdown, sheet_markdown
from pipeline.io.recordings.readback import entities
from pipeline.io.recordings.seal import seal_of, verify, write_checksummed
from pipeline.io.recordings.stream import digest
from pipeline.records.capture import Capture, CaptureMeta
from pipeline.records.datasheet import Check, Datasheet
from pipeline.records.errors import MachineError
from pipeline.records.estimate import Estimate
from pipeline.records.evidence import Evidence, Series
from pipeline.records.finding import Finding
from pipeline.records.uncertainty import type_a

PATH = "joint-P0/current_step_0.mcap"
ROWS = 10_000


def make_capture(motor_id: str = "joint-P0") -> Capture:
    t_s = 0.25 + np.arange(ROWS) * 5e-5
    current = 10 * (1 - np.exp(-(t_s - 0.25) / 9.2e-4))
    noise = np.random.default_rng(5).normal(0, 0.02, ROWS)
    fast = pl.DataFrame({"t_s": t_s, "ia_a": current + noise, "vab_v": np.full(ROWS, 6.2)})
    slow = pl.DataFrame({"t_s": t_s[::1000], "temp_winding_degc": np.linspace(25, 26, 10)})
    slow[3, "temp_winding_degc"] = np.nan
    return Capture(PATH, "ab" * 32, "verified", CaptureMeta(motor_id, "current_step"), (fast, slow))


def make_evidence(capture: Capture) -> tuple[Evidence, ...]:
    t_s = capture.tables[0]["t_s"].to_numpy()
    fitted = 10 * (1 - np.exp(-(t_s - 0.25) / 9.2e-4))
    own = Series("", t_s, capture.tables[0]["ia_a"].to_numpy(), fitted)
    return (
        Evidence("step", "Step", "t_s", "ia_a", "line", (own,), capture.path),
        Evidence("step", "Other file", "t_s", "ia_a", "line", (own,), "joint-P0/other.mcap"),
        Evidence("step", "No time", "iq_a", "ia_a", "scatter", (own,), capture.path),
    )


def make_sheet() -> Datasheet:
    resistance = Estimate(
        "r_phase_ohm", 0.31, "ohm", "measured", "step", type_a("scatter:step:r", 4e-4), {}, (PATH,)
    )
    return Datasheet(
        motor_id="a|b *x*",
        motor_type=None,
        lot=None,
        version="5f" * 32,
        status="provisional",
        why=("not approved",),
        captures=(),
        config_sha256="",
        code_version="",
        constants={"r_phase_ohm": resistance},
        alternatives=(),
        checks=(Check("kt_vs_ke", "fail", "x | y", 1.15, 0.01, "1", "2/sqrt(3)"),),
    )


FINDINGS = (
    Finding(PATH, "warning", "gap", "12 samples are missing", "look at the cable", (400, 412)),
    Finding(PATH, "refused", "odd", "odd", "ask"),
)


def write_recording(
    capture: Capture,
    evidence: Sequence[Evidence],
    path: Path,
    datasheet: Datasheet | None = None,
    findings: Sequence[Finding] = (),
) -> None:
    write_checksummed(path, recording_bytes(capture, evidence, datasheet, findings))


def read_back(path: Path, entity: str) -> pl.DataFrame:
    from rerun.chunk import RrdReader

    chunks = RrdReader(str(path)).stream().filter(content=entity, is_static=False)
    frames = [pl.from_arrow(chunk.to_record_batch()) for chunk in chunks]
    index = next(name for name in ("t", "row") if name in frames[0].columns)
    whole = pl.concat(frames).drop("rerun.controls.RowId").sort(index)
    return whole.explode(pl.exclude(index))


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    capture = make_capture()
    path = tmp_path_factory.mktemp("recordings") / "joint-P0" / "step.rrd"
    write_recording(capture, make_evidence(capture), path, make_sheet(), FINDINGS)
    return path


def test_columns_come_back_as_float32_on_their_own_clock_to_the_nanosecond(recording: Path) -> None:
    capture = make_capture()
    for entity, table in zip(("/measured", "/measured_1"), capture.tables, strict=True):
        back = read_back(recording, entity)
        assert set(back.columns) == {"t", *table.columns} - {"t_s"}
        nanoseconds = np.rint(table["t_s"].to_numpy() * 1e9).astype(np.int64)
        np.testing.assert_array_equal(back["t"].to_physical().to_numpy(), nanoseconds)
        for name in table.columns[1:]:
            np.testing.assert_array_equal(
                back[name].to_numpy(), table[name].to_numpy().astype(np.float32)
            )


def test_residual_is_measured_less_fitted_and_only_this_captures_fits_are_there(
    recording: Path,
) -> None:
    series = make_evidence(make_capture())[0].series[0]
    back = read_back(recording, "/model/step/0_0")
    np.testing.assert_array_equal(
        back["residual"].to_numpy(), (series.measured - series.fitted).astype(np.float32)
    )
    np.testing.assert_array_equal(back["fitted"].to_numpy(), series.fitted.astype(np.float32))
    own = own_evidence(make_capture(), make_evidence(make_capture()))
    assert {trace.trace.entity for trace in fit_traces(own)} == {"/model/step/0_0"}


def long_capture() -> Capture:
    t_s = np.arange(LONG_ROWS + 1) * 5e-5
    noise = np.random.default_rng(7)
    frame = pl.DataFrame(
        {"t_s": t_s, "ia_a": noise.normal(0, 5, t_s.size), "vab_v": noise.normal(0, 20, t_s.size)}
    )
    return Capture("m/long.mcap", "cd" * 32, "verified", CaptureMeta("m", "drive"), (frame,))


def test_a_long_capture_is_packed_to_the_last_sample_and_has_a_table_of_fewer_rows(
    tmp_path: Path,
) -> None:
    capture = long_capture()
    write_recording(capture, (), tmp_path / "long.rrd")
    table = capture.tables[0]
    packed = read_back(tmp_path / "long.rrd", "/measured").unnest("samples")
    shown = read_back(tmp_path / "long.rrd", "/samples")
    step = -(-table.height // TABLE_ROWS)
    assert 0.5 * TABLE_ROWS < shown.height <= TABLE_ROWS
    for back, told in ((packed, table), (shown, table.gather_every(step))):
        assert back.height == told.height
        nanoseconds = np.rint(told["t_s"].to_numpy() * 1e9).astype(np.int64)
        np.testing.assert_array_equal(back["t"].to_physical().to_numpy(), nanoseconds)
        for name in ("ia_a", "vab_v"):
            np.testing.assert_array_equal(
                back[name].to_numpy(), told[name].to_numpy().astype(np.float32)
            )
    lines = [line for plan in main_views(list(capture_traces(capture)), ()) for line in plan.lines]
    assert {line.component for line in lines} == {"ia_a", "vab_v"}
    assert all(line.packed for line in lines)


def test_columns_of_odd_names_are_not_packed() -> None:
    """The viewer's selectors know plain names alone."""
    frame = long_capture().tables[0].rename({"vab_v": "shunt (mV)"})
    capture = Capture("o.csv", "cd" * 32, "verified", CaptureMeta("m", "drive"), (frame,))
    assert [trace.packed for trace in capture_traces(capture)] == [False]


def test_where_no_file_may_grow_the_same_is_made_in_the_streams_own_memory(
    recording: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("pipeline.io.recordings.stream._has_nameless_files", lambda: False)
    capture, other = make_capture(), tmp_path / "other.rrd"
    write_recording(capture, make_evidence(capture), other, make_sheet(), FINDINGS)
    assert entities(other) == entities(recording)
    for entity in ("/measured", "/findings"):
        assert read_back(other, entity).equals(read_back(recording, entity), null_equal=True)


def test_findings_stand_at_their_first_row_and_no_wall_clock_is_written(recording: Path) -> None:
    from rerun.chunk import RrdReader

    back = read_back(recording, "/findings")
    told = dict(zip(back["TextLog:level"], back["t"].to_physical(), strict=True))
    assert {level: told[level] for level in ("ERROR", "WARN")} == {
        "ERROR": 250_000_000,
        "WARN": 270_000_000,
    }
    (gap,) = [text for text in back["TextLog:text"] if "missing" in text]
    assert gap.startswith("rows 400–412: 12 samples are missing")
    series = make_evidence(make_capture())[0].series[0]
    worst = int(np.argmax(np.abs(series.measured - series.fitted)))
    assert told["INFO"] == round(float(series.x[worst]) * 1e9)
    names = {
        name
        for chunk in RrdReader(str(recording)).stream()
        for name in chunk.to_record_batch().schema.names
    }
    assert "log_time" not in names
    assert not any("start_time" in name for name in names)


def test_equal_work_has_an_equal_id_and_equal_content(recording: Path, tmp_path: Path) -> None:
    from rerun.chunk import RrdReader

    capture = make_capture()
    again = tmp_path / "again.rrd"
    write_recording(capture, make_evidence(capture), again, make_sheet(), FINDINGS)
    ids = [RrdReader(str(p)).recordings()[0].recording_id for p in (recording, again)]
    assert ids == [digest(identity(capture, make_sheet()))] * 2
    for entity in ("/measured", "/model/step/0_0", "/findings"):
        assert read_back(recording, entity).equals(read_back(again, entity), null_equal=True)


def test_every_planned_curve_exists_in_the_data_and_every_column_is_planned() -> None:
    capture = make_capture()
    traces = list(capture_traces(capture))
    fits = list(fit_traces(own_evidence(capture, make_evidence(capture))))
    held = {(t.entity, name) for t in [*traces, *(f.trace for f in fits)] for name in t.columns}
    main = main_views(traces, fits)
    further = further_views(traces, fits, main)
    drawn = {(line.entity, line.component) for view in (*main, *further) for line in view.lines}
    assert drawn <= held
    assert held - drawn == {("/model/step/0_0", "measured")}
    assert [line.name for line in main[0].lines] == ["measured", "model"]
    residual = fits[0].trace.frame["residual"].to_numpy()
    assert main[1].reach is not None
    assert main[1].reach > np.abs(residual).max()
    assert main[1].reach >= 0.01 * np.abs(capture.tables[0]["ia_a"].to_numpy()).max()
    both, left = loupe_views(fits)
    assert both.around_s == left.around_s == pytest.approx(0.005)
    assert {(line.entity, line.component) for line in (*both.lines, *left.lines)} <= held


def test_value_axes_reach_over_all_values_and_do_not_magnify_the_noise_of_a_held_one() -> None:
    """The viewer would set them by what has come so far."""
    capture = make_capture()
    traces = list(capture_traces(capture))
    fits = list(fit_traces(own_evidence(capture, make_evidence(capture))))
    spans = {plan.name: plan.span for plan in main_views(traces, fits)}
    current, held = spans["Step: i_a [A]"], spans["v_ab [V]"]
    assert current is not None
    assert held is not None
    shown = [traces[0].frame["ia_a"].to_numpy(), fits[0].trace.frame["fitted"].to_numpy()]
    least, most = min(a.min() for a in shown), max(a.max() for a in shown)
    assert least - 0.1 * (most - least) < current[0] < least
    assert most < current[1] < most + 0.1 * (most - least)
    assert held == pytest.approx((6.2 - 0.31, 6.2 + 0.31))


def test_a_table_without_time_goes_by_row(tmp_path: Path) -> None:
    table = pl.DataFrame({"theta_elec_deg": [0.0, 15.0, 30.0], "lab_h": [1e-4, 2e-4, 3e-4]})
    capture = Capture("lcr.csv", "cd" * 32, "verified", CaptureMeta("m", "lcr"), (table,))
    found = Finding("lcr.csv", "warning", "odd", "odd", "ask", (2, 2))
    write_recording(capture, (), tmp_path / "lcr.rrd", None, (found,))
    back = read_back(tmp_path / "lcr.rrd", "/measured")
    assert back["row"].to_list() == [0, 1, 2]
    assert back["theta_elec_deg"].to_list() == [0.0, 15.0, 30.0]
    assert read_back(tmp_path / "lcr.rrd", "/findings")["row"].to_list() == [2]


def test_an_empty_capture_still_makes_a_recording(tmp_path: Path) -> None:
    capture = Capture("e.csv", "ef" * 32, "verified", CaptureMeta("m", "drive"), ())
    write_recording(capture, (), tmp_path / "e.rrd", make_sheet(), FINDINGS)
    assert read_back(tmp_path / "e.rrd", "/findings").height == 2
    verify(tmp_path / "e.rrd")


def test_a_refusing_disk_is_a_machine_error_and_leaves_nothing(tmp_path: Path) -> None:
    """Fault: the folder's place is taken by a file. Reaction: one MachineError, nothing written."""
    (tmp_path / "taken").write_text("")
    with pytest.raises(MachineError, match="cannot write"):
        write_recording(make_capture(), (), tmp_path / "taken" / "x.rrd")
    assert [p.name for p in tmp_path.iterdir()] == ["taken"]


def test_a_disk_that_fills_up_is_a_machine_error_and_leaves_nothing(tmp_path: Path) -> None:
    """Fault: no file may grow past 100 kB. Reaction: one MachineError, no part of a recording."""
    resource = pytest.importorskip("resource")
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, hard))
    try:
        with pytest.raises(MachineError, match=r"cannot write x\.rrd"):
            write_recording(make_capture(), (), tmp_path / "x.rrd")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert list(tmp_path.iterdir()) == []


def test_no_temporary_file_is_left(recording: Path) -> None:
    assert sorted(p.name for p in recording.parent.iterdir()) == ["step.rrd", "step.rrd.sha256"]
    assert seal_of(recording).read_text().endswith("  step.rrd\n")


def test_the_sheet_escapes_what_markdown_would_read() -> None:
    text = sheet_markdown(make_sheet(), ())
    assert text.startswith("# a\\|b \\*x\\*: provisional\n")
    row = "| ✗ fail | kt\\_vs\\_ke | 1.15 | 0.01 | x \\| y; suspect: 2/sqrt\\(3\\) |"
    assert row in text
    assert "| r\\_phase\\_ohm | 310.00 ± 0.80 mΩ | step |" in text
    assert text.index("## Other constants") < text.index("## Checks")


def test_the_page_beside_a_capture_shows_nothing_that_changes_without_it() -> None:
    """Approved, revoked or with another verdict on its model: the same page."""
    approved = replace(make_sheet(), status="released", why=())
    text = capture_markdown(make_sheet(), PATH)
    assert text == capture_markdown(approved, PATH)
    assert text.startswith("# a\\|b \\*x\\*\n")
    assert text.index("## Constants from this capture") < text.index("## Checks")
