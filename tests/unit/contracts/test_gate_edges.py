"""What gates compute inside, by hand: lines across a gap, sums clear of their scatter, runs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from pipeline.contracts.gates import clock_jump, stuck_channel, wrapped_angle
from pipeline.contracts.gates.phase_sum import sum_share
from pipeline.contracts.rotation import turning
from pipeline.contracts.schemas import table_schema
from pipeline.contracts.validate import validate
from pipeline.records.errors import CaptureError
from tests.unit.contracts.test_gate_limits import GATES, TURN, capture, said


@pytest.mark.parametrize(("moved", "expected"), [(0.0, "refused"), (2.7, "refused"), (2.9, "")])
def test_a_signal_that_went_on_by_one_interval(moved: float, expected: str) -> None:
    """One a row, ten rows skipped: |m - 1| < |m - 10|/4 ends at 2.8."""
    rows = np.arange(200.0)
    t_s = np.where(rows < 100, rows, rows + 9.0) * 1e-3
    angle = np.where(rows < 100, rows, rows - 1.0 + moved) * 0.01
    made = capture("drive", t_s=t_s, theta_mech_rad=angle)
    assert said("clock_jump", made) == expected


def test_a_line_through_noise_by_hand() -> None:
    t_s = np.array([0.0, 1.0, 2.0, 4.0, 5.0, 7.0, 8.0])
    values = np.array([1.0, 3.5, 4.0, 9.5, 11.0, np.nan, 17.0])
    good = np.isfinite(values)
    slope, level = np.polyfit(t_s[good], values[good], 1)
    left = values[good] - level - slope * t_s[good]
    found = clock_jump._line(t_s, values, 10.0)
    expected = (level + 10.0 * slope, slope, np.sqrt(left @ left / (6 - 2)))
    assert found == pytest.approx(expected)
    assert clock_jump._line(t_s[:5], values[:5], 10.0) is None


@pytest.mark.parametrize(("gap", "expected"), [(1.4, ""), (1.6, "warned")])
@pytest.mark.parametrize("amps", [1.0, 20.0])
def test_a_sample_is_lost_beyond_one_and_a_half_intervals(
    gap: float, expected: str, amps: float
) -> None:
    """Where the current moves by less than a tenth of the step meanwhile, and else refused."""
    rows = np.arange(400.0)
    t_s = np.where(rows < 200, rows, rows - 1.0 + gap) * 1e-4
    for share, end in ((0.08, expected), (0.12, "refused" if expected else "")):
        current = amps * np.where(rows < 200, 1.0 - share, 1.0) * (rows > 50)
        made = capture("current_step", t_s=t_s, ia_a=current, vab_v=current)
        assert said("dropped_samples", made) == end


@pytest.mark.parametrize(("levels", "expected"), [((1.0, 1.04), "warned"), ((1.0, 1.07), "")])
@pytest.mark.parametrize("amps", [0.1, 20.0])
def test_levels_a_twentieth_apart_of_any_current(
    amps: float, levels: tuple[float, float], expected: str
) -> None:
    current = amps * np.repeat(levels, 500)
    made = capture("resistance", ia_a=current, vab_v=current)
    assert said("current_coverage", made) == expected


def test_only_columns_with_holes_are_named() -> None:
    current = np.ones(100)
    current[3:5] = np.nan
    made = capture("drive", iq_a=current, vq_v=1.0, theta_mech_rad=np.arange(100.0))
    (finding,) = GATES["missing_values"].check(made, GATES["missing_values"].options).findings
    assert "2 of 100 rows miss a value (iq_a 2)" in finding.message
    assert finding.rows == (3, 4)


@pytest.mark.parametrize(("whole", "refused"), [(2, False), (1, True), (0, True)])
def test_rows_of_which_none_holds_all_columns(whole: int, refused: bool) -> None:
    """Two clocks in one table: each row held one of them, and all were set aside with a warning."""
    odd = np.arange(400) // 4 % 2 == 1
    odd[:whole] = True
    current, voltage = np.where(odd, 1.0, np.nan), np.where(~odd, 1.0, np.nan)
    voltage[:whole] = 1.0
    made = capture("drive", iq_a=current, vq_v=voltage, theta_mech_rad=np.arange(400.0))
    if refused:
        with pytest.raises(CaptureError, match=r"rows miss a value \(.*; put columns of different"):
            GATES["missing_values"].check(made, GATES["missing_values"].options)
        return
    (mask,) = GATES["missing_values"].check(made, GATES["missing_values"].options).masks
    assert np.count_nonzero(mask.keep) == whole


def test_a_single_row_without_a_value_is_read_between_its_neighbours() -> None:
    """A third of the rows went, and most windows with them, where eight columns lacked one in
    twenty each; an edge of a step is between two rows, and is not drawn.
    """
    wave = np.sin(np.arange(400) / 9.0)
    blank = np.where(np.arange(400) % 7 == 3, np.nan, wave)
    blank[202:205] = np.nan
    made = capture("drive", iq_a=blank, vq_v=wave, theta_mech_rad=np.arange(400.0))
    passed = GATES["missing_values"].check(made, GATES["missing_values"].options)
    assert [np.flatnonzero(~m.keep).tolist() for m in passed.masks] == [[202, 203, 204]]
    (finding,) = passed.findings
    assert "60 of 400 rows miss a value (iq_a 60); 57 are read between the rows" in finding.message
    read = made.with_masks(*passed.masks).arrays("iq_a", "vq_v")
    assert read["iq_a"] == pytest.approx(read["vq_v"], abs=6e-3)
    phases = capture("drive", ia_a=blank, ib_a=wave, ic_a=-wave, theta_mech_rad=np.arange(400.0))
    assert np.isnan(phases.arrays("ia_a")["ia_a"]).sum() == 60
    step = capture("current_step", ia_a=blank, vab_v=wave)
    (mask,) = GATES["missing_values"].check(step, GATES["missing_values"].options).masks
    assert np.count_nonzero(~mask.keep) == 60


@pytest.mark.parametrize(("ripple", "clear"), [(0.88, True), (0.90, False)])
def test_a_sum_stands_six_of_its_scatters_out(ripple: float, clear: bool) -> None:
    """A sum of c ± d in turn: neighbours give c² - d², of c² + d², and 10,000 rows a hundredth."""
    n = 10_000
    total = 0.01 * (1.0 + np.sqrt(ripple) * (-1.0) ** np.arange(n))
    wave = np.sin(np.arange(n) * 0.1)
    table = pl.DataFrame({"ia_a": wave + total, "ib_a": -wave, "ic_a": np.zeros(n)})
    assert (sum_share(table, ("ia_a", "ib_a", "ic_a"), 0.0) > 0.0) == clear


@pytest.mark.parametrize(("length", "stuck"), [(20, False), (21, True)])
def test_a_run_of_twenty_costs_a_fit_nothing(length: int, stuck: bool) -> None:
    rng = np.random.default_rng(3)
    values = rng.standard_normal(5000)
    values[1000 : 1000 + length] = 0.5
    rows = stuck_channel.frozen_rows(values, GATES["stuck_channel"].options)
    assert np.count_nonzero(rows) == (length if stuck else 0)


def test_a_step_over_two_intervals_is_no_step_of_an_angle() -> None:
    """A clock of powers of two: one row lost is exactly two intervals."""
    t_s = np.array([0.0, 1.0, 2.0, 3.0, 5.0, 6.0, 7.0]) / 1024.0
    made = capture("drive", t_s=t_s, theta_mech_rad=np.array([0.0, 1.0, 2.0, 3.0, 9.0, 9.5, 10.0]))
    assert wrapped_angle._steps(made, "theta_mech_rad").tolist() == [1, 1, 1, 0, 0.5, 0.5]


def test_pole_pairs_and_their_u_by_hand() -> None:
    """Blocks of a turning vector against the shaft's angle: slope through zero, n - 1 dof."""
    rows = 4000
    angle = np.linspace(0.0, 20.0, rows)
    phase = 7.0 * angle + 0.02 * np.sin(3.0 * angle)
    lines = {
        name: 10.0 * np.cos(phase - shift)
        for name, shift in (("vab_v", 0.0), ("vbc_v", TURN / 3), ("vca_v", 2 * TURN / 3))
    }
    found = turning(capture("open_circuit", theta_mech_rad=angle, **lines))
    assert found is not None
    blocks = np.unique(np.linspace(0, rows - 1, 201).astype(int))
    electrical, mechanical = np.diff(phase[blocks]), np.diff(angle[blocks])
    slope = mechanical @ electrical / (mechanical @ mechanical)
    left = electrical - slope * mechanical
    u = np.sqrt(left @ left / (left.size - 1) / (mechanical @ mechanical))
    assert found.cycles_per_turn == pytest.approx(slope, rel=1e-9)
    assert found.u == pytest.approx(u, rel=1e-4)
    assert found.cycles == pytest.approx(abs(electrical).sum() / TURN, rel=1e-9)


def test_a_schema_holds_for_sound_tables_alone() -> None:
    schema = table_schema(("t_s", "iq_a"))
    sound = pl.DataFrame({"t_s": [0.0, 1.0], "iq_a": [1.0, None], "other": ["a", "b"]})
    assert schema.validate(sound).equals(sound)
    for wrong in ({"t_s": [1.0, 0.0]}, {"iq_a": [np.inf, 1.0]}):
        with pytest.raises(Exception, match="rules"):
            schema.validate(sound.with_columns(**{n: pl.Series(v) for n, v in wrong.items()}))


def test_one_value_of_a_column_is_no_stream_of_its_own() -> None:
    size = 400
    lonely = np.full(size, np.nan)
    lonely[7] = 25.0
    made = capture(
        "drive",
        iq_a=np.sin(np.arange(size)),
        vq_v=np.cos(np.arange(size)),
        theta_mech_rad=0.1 * np.arange(size),
        temp_winding_degc=lonely,
    )
    try:
        kept, _ = validate(made, {})
    except CaptureError as error:
        assert error.code == "missing_values"
        return
    assert len(kept.tables) == 1
    assert kept.tables[0].height == replace(made).tables[0].height
