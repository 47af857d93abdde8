"""The ladder's recording holds the document's numbers; a comparison's holds its traces."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from pipeline.io.recordings.comparison import (
    comparison_bytes,
    entity_of,
    loupes,
    planned,
    table_of,
)
from pipeline.io.recordings.error_map import CELL, diverging, map_labels, map_picture
from pipeline.io.recordings.ladder import error_scale, ladder_bytes, map_reach, step_markdown
from pipeline.io.recordings.seal import write_checksummed
from pipeline.records.comparison import Comparison, SignalError, Trace
from pipeline.views.ladder import ladder_view, mapped_signals
from tests.unit.ladders import make_diagnosis, make_map


def rows(path: Path, entity: str, index: str = "step") -> Iterator[tuple[int, dict[str, Any]]]:
    """Every row of an entity that is not static: its place and its components."""
    from rerun.chunk import RrdReader

    for chunk in RrdReader(str(path)).stream().filter(content=entity, is_static=False):
        batch = chunk.to_record_batch()
        for row in batch.to_pylist():
            yield row[index], row


@pytest.fixture(scope="module")
def ladder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("recordings") / "ladder.rrd"
    write_checksummed(path, ladder_bytes(make_diagnosis()))
    return path


def component(row: dict[str, Any], name: str) -> Any:
    (found,) = [value for key, value in row.items() if key.endswith(name)]
    return found


def numbers(tensor: Any) -> np.ndarray:
    """The numbers of a tensor component in its own shape."""
    one = tensor[0]
    return np.array(one["buffer"], dtype=float).reshape(one["shape"])


def test_the_map_read_back_is_the_documents(ladder: Path) -> None:
    told = make_diagnosis().document()["ladder"]
    seen = dict(rows(ladder, "/map/vq_v/values"))
    assert sorted(seen) == [0, 1]
    for place, row in seen.items():
        expected = np.array(told[place]["maps"][0]["mean"], dtype=float)
        np.testing.assert_array_equal(numbers(component(row, "Tensor:data")), expected)


def test_error_bars_grow_step_by_step_and_hold_the_documents_errors(ladder: Path) -> None:
    result = make_diagnosis()
    unit = 10.0 ** error_scale(result, "vq_v").exponent
    assert unit == 1e-3
    seen = dict(rows(ladder, "/errors/vq_v"))
    first, last = (numbers(component(seen[n], "BarChart:values")) for n in (0, 1))
    assert first * unit == pytest.approx([0.13, 0.0])
    assert last * unit == pytest.approx([0.13, 0.0026])
    floor = dict(rows(ladder, "/floor/vq_v"))
    assert numbers(component(floor[1], "BarChart:values")) * unit == pytest.approx([2e-3, 2e-3])


def test_the_picture_shows_the_map_upside_up_with_its_gap_hatched(ladder: Path) -> None:
    one = make_map(1.0)
    picture = map_picture(one, one.reach)
    assert picture.shape == (3 * CELL, 4 * CELL, 3)
    # the largest current is on top: red at the left, a hatched gap at the right
    assert (picture[5, 5] == diverging(np.array(0.2 / one.reach))).all()
    assert len({tuple(p) for p in picture[:CELL, 3 * CELL :].reshape(-1, 3)}) == 2
    assert (picture[-5, -5] == diverging(np.array(-1.0))).all()
    for _, row in rows(ladder, "/map/vq_v/picture"):
        (buffer,) = component(row, "Image:buffer")
        assert len(buffer) == picture.size


def test_colours_of_all_steps_share_one_scale() -> None:
    result = make_diagnosis()
    assert map_reach(result, "vq_v") == pytest.approx(0.21)
    quiet = map_picture(make_map(0.02), 0.21)
    assert (np.abs(quiet[: CELL // 2, : CELL // 2].astype(int) - 247) < 8).all()
    labels = map_labels(make_map(1.0), 0.21, ("speed [rad/s]", "iq [A]"))
    assert {"+210", "-210", "mV", "speed [rad/s]"} <= set(labels.texts)


def test_the_page_of_a_step_says_what_came_and_every_error_so_far(ladder: Path) -> None:
    result = make_diagnosis(unknown=True)
    view = ladder_view(result)
    assert view.steps[0].came == ()
    assert view.steps[1].came == ("dead_time",)
    text = step_markdown(result, 1).replace("\\", "")
    for words in ("+ dead_time", "179.90 ± 0.24 mV", "130 mV", "2.60 mV", "(−98 %)", "noise floor"):
        assert words in text
    assert "dead_time could as well be phase_imbalance: low-speed current steps" in text
    assert "Left over in vq_v: odd in iq_a" in text
    pages = dict(rows(ladder, "/sheet"))
    (page,) = component(pages[1], "TextDocument:text")
    assert page == step_markdown(make_diagnosis(), 1)


def test_a_signal_stands_beside_the_model_before_and_after(tmp_path: Path) -> None:
    """Both residuals on one axis that holds the larger; in the loupe what is left, large."""
    from rerun.chunk import RrdReader

    result = make_comparison(added=True)
    write_checksummed(tmp_path / "c.rrd", comparison_bytes(result))
    stream = RrdReader(str(tmp_path / "c.rrd")).stream()
    chunks = stream.filter(content=entity_of(result.traces[0]), is_static=False)
    back = pl.concat([pl.from_arrow(c.to_record_batch()) for c in chunks]).sort("t")
    back = back.explode("measured", "model", "before", "residual_before").drop_nans("model")
    far = (back["measured"] - back["before"]).to_numpy()
    assert far == pytest.approx(back["residual_before"].to_numpy(), abs=1e-6)
    assert far == pytest.approx(2.01, rel=1e-3)
    signal, left = planned(result, "a/drive 0.mcap")[:2]
    assert [line.component for line in signal.lines] == ["measured", "before", "model"]
    assert [line.component for line in left.lines] == ["residual_before", "residual"]
    assert left.reach == pytest.approx(1.1 * 2.01, rel=1e-3)
    assert loupes(result, "a/drive 0.mcap")[1].reach == pytest.approx(0.011, rel=1e-3)


def test_the_signal_farthest_over_its_floor_comes_first_and_one_without_map_last() -> None:
    assert mapped_signals(make_diagnosis()) == ("vq_v", "v_pair_v")
    assert mapped_signals(replace(make_diagnosis(), ladder=())) == ()


def test_equal_work_has_equal_content_and_no_wall_clock(ladder: Path, tmp_path: Path) -> None:
    from rerun.chunk import RrdReader

    again = tmp_path / "again.rrd"
    write_checksummed(again, ladder_bytes(make_diagnosis()))
    ids = [RrdReader(str(p)).recordings()[0].recording_id for p in (ladder, again)]
    assert ids[0] == ids[1]
    for chunk in RrdReader(str(ladder)).stream().filter(is_static=False):
        assert "log_time" not in chunk.to_record_batch().schema.names


def make_comparison(*, added: bool = False) -> Comparison:
    """A model 10 mA or mV off; 2 more without what was `added`."""
    t = np.arange(500) * 1e-4
    told = np.sin(40 * t)
    made = told - 0.01
    told[100] = made[100] = np.nan
    traces = (
        Trace("a/drive 0.mcap", "iq_a", "free_run", "held_out", t, told, made),
        Trace("a/drive 0.mcap", "vq_v", "equation", "held_out", t, told, made),
    )
    if added:
        traces = tuple(replace(one, before=made - 2.0) for one in traces)
    error = SignalError("iq_a", "a/drive 0.mcap", "held_out", 0.01, 0.002, 5, 4.0, "A", "free_run")
    return Comparison("m", "standard", (), {}, (error,), 5.0, (), traces=traces)


def test_a_comparisons_traces_come_back_with_their_gaps(tmp_path: Path) -> None:
    from rerun.chunk import RrdReader

    result = make_comparison()
    write_checksummed(tmp_path / "c.rrd", comparison_bytes(result))
    trace = result.traces[0]
    assert entity_of(trace) == "/a_drive_0.mcap/free_run/iq_a"
    stream = RrdReader(str(tmp_path / "c.rrd")).stream()
    chunks = stream.filter(content=entity_of(trace), is_static=False)
    back = pl.concat([pl.from_arrow(c.to_record_batch()) for c in chunks]).sort("t")
    back = back.explode("measured", "model", "residual")
    expected = table_of(trace).frame
    for name in ("measured", "model", "residual"):
        np.testing.assert_array_equal(back[name].to_numpy(), expected[name].to_numpy())
    assert np.isnan(back["model"].to_numpy()).sum() == 1
    assert back["t"].to_physical().to_list() == (np.arange(500) * 100_000).tolist()


def test_every_planned_curve_of_a_comparison_is_in_its_data() -> None:
    result = make_comparison()
    held = {(entity_of(t), n) for t in result.traces for n in ("measured", "model", "residual")}
    views = planned(result, "a/drive 0.mcap")
    assert {(line.entity, line.component) for view in views for line in view.lines} == held
    assert [view.reach for view in views][1] == pytest.approx(0.011, rel=1e-3)


def test_the_signal_farthest_over_its_floor_has_the_first_loupe_of_a_comparison() -> None:
    """It shows a hundredth of the capture on each side of the cursor."""
    views = loupes(make_comparison(), "a/drive 0.mcap")
    assert [view.lines[0].entity.rsplit("/", 1)[-1] for view in views] == ["iq_a"] * 2 + [
        "vq_v"
    ] * 2
    assert {view.around_s for view in views} == {5e-4}
    assert views[0].name.startswith("Loupe ±500 µs: i_q [A]")
    assert loupes(make_comparison(), "another.mcap") == ()
