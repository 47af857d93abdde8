"""What changes no verdict: tables and channels beside, a few holes, another origin of time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from pipeline.contracts.gates import clock_jump, current_coverage
from pipeline.contracts.rotation import line_voltage_vector, turning
from pipeline.contracts.schemas import check_tables
from pipeline.contracts.waveform import noise_of
from pipeline.numerics.plateaus import block_means
from pipeline.records.capture import Capture
from pipeline.records.errors import CaptureError
from tests.unit.contracts.test_gate_limits import GATES, TURN, capture, noise, said

ROWS = np.arange(1000.0)
SLOW = 0.05 * ROWS
VOLTS = ("vab_v", "vbc_v", "vca_v")
AMPS = ("ia_a", "ib_a", "ic_a")


def three(names: tuple[str, ...], phase: np.ndarray, size: float = 10.0) -> dict[str, np.ndarray]:
    """Signals of a vector that turns forward."""
    return {n: size * np.cos(phase - k * TURN / 3.0) for k, n in enumerate(names)}


def with_one(values: np.ndarray, row: int, value: float) -> np.ndarray:
    """The values with one of them replaced."""
    made = np.array(values, dtype=float)
    made[row] = value
    return made


def frozen() -> np.ndarray:
    """Noise that stands still for a tenth of the rows."""
    made = noise(1000)
    made[300:400] = made[300]
    return made


def clipped() -> np.ndarray:
    """A sine that is cut flat over a fiftieth of the rows."""
    wave = np.sin(ROWS * 0.0123456)
    return np.minimum(wave, np.quantile(wave, 0.98))


FAULTS: list[tuple[str, Capture, str]] = [
    (
        "clock_jump",
        capture("drive", t_s=ROWS + 9.0 * (ROWS > 499), theta_mech_rad=ROWS * 0.01),
        "refused",
    ),
    ("dropped_samples", capture("drive", t_s=ROWS + 9.0 * (ROWS > 499), iq_a=ROWS), "warned"),
    ("dropped_samples", capture("drive", t_s=ROWS + 300.0 * (ROWS > 499), iq_a=ROWS), "refused"),
    ("stuck_channel", capture("drive", iq_a=frozen(), vq_v=noise(1000, 2)), "warned"),
    ("stuck_channel", capture("drive", iq_a=np.ones(1000), vq_v=noise(1000)), "refused"),
    ("saturation", capture("drive", iq_a=clipped(), vq_v=noise(1000)), "warned"),
    ("isolated_readings", capture("drive", omega_mech_rad_s=with_one(50.0 + 0.01 * ROWS, 200, 0.0)),
     "warned"),
    ("phase_sum", capture("drive", **three(AMPS, SLOW) | {"ia_a": -10.0 * np.cos(SLOW)}),
     "refused"),
    ("phase_sum", capture("drive", **three(AMPS, SLOW) | {"ia_a": 10.5 * np.cos(SLOW)}), "warned"),
    ("temperature_unit", capture("drive", iq_a=ROWS, temp_winding_degc=300.0), "refused"),
    ("wrapped_angle", capture("drive", theta_mech_rad=np.mod(ROWS * 0.01, TURN)), "refused"),
    ("missing_values", capture("drive", iq_a=with_one(with_one(ROWS, 7, np.nan), 8, np.nan),
                               vq_v=1.0, theta_mech_rad=ROWS), "warned"),
    ("speed_against_angle", capture("drive", theta_mech_rad=ROWS * 0.05, omega_mech_rad_s=550.0),
     "warned"),
    ("speed_against_angle", capture("drive", theta_mech_rad=ROWS * 0.05, omega_mech_rad_s=700.0),
     "refused"),
    ("speed_coverage", capture("drive", theta_mech_rad=ROWS * 0.001), "warned"),
    ("speed_coverage", capture("spin_down", omega_mech_rad_s=100.0 - 0.02 * ROWS), "refused"),
    ("phase_order", capture("open_circuit", theta_mech_rad=ROWS * 0.05,
                            **three(VOLTS, -0.2 * ROWS)), "refused"),
    ("phase_order", capture("drive", theta_mech_rad=ROWS * 0.05, **three(AMPS, -0.2 * ROWS),
                            meta={"pole_pairs": 4}), "refused"),
    ("pole_pairs", capture("open_circuit", theta_mech_rad=ROWS * 0.05, **three(VOLTS, 0.22 * ROWS)),
     "warned"),
    ("torque_sign", capture("torque_map", iq_a=np.sin(ROWS * 0.01),
                            torque_shaft_nm=-np.sin(ROWS * 0.01)), "refused"),
    ("power_sign", capture("resistance", vab_v=1.0, ia_a=-np.ones(1000)), "refused"),
    ("angle_coverage", capture("cogging", theta_mech_rad=ROWS * 0.001), "refused"),
    ("sampling_rate", capture("open_circuit", theta_mech_rad=ROWS * 0.4,
                              **three(VOLTS, 2.0 * ROWS)), "warned"),
    ("current_coverage", capture("heat_run", iq_a=5.0, id_a=0.0,
                                 temp_winding_degc=np.linspace(25.0, 27.0, 1000)), "warned"),
    ("plausible_terminals", capture("resistance", vab_v=np.full(1000, 1e-4), ia_a=1.0), "warned"),
]  # fmt: skip
BESIDE: dict[str, Callable[[Capture], tuple[pl.DataFrame, ...]]] = {
    "another stream before": lambda made: (STREAM, *made.tables),
    "another stream behind": lambda made: (*made.tables, STREAM),
    "one row before": lambda made: (STREAM.head(1), *made.tables),
    "one row behind": lambda made: (*made.tables, STREAM.head(1)),
    "no row before": lambda made: (made.tables[0].clear().select("t_s"), *made.tables),
}
STREAM = pl.DataFrame({"t_s": np.arange(20.0) * 0.005, "temp_case_degc": 25.0 + np.arange(20.0)})


@pytest.mark.parametrize("beside", BESIDE)
@pytest.mark.parametrize(("gate", "made", "verdict"), FAULTS, ids=lambda v: str(v)[:20])
def test_a_table_beside_changes_no_verdict(
    gate: str, made: Capture, verdict: str, beside: str
) -> None:
    """A gate looks at every table that has its columns, wherever it stands."""
    assert said(gate, made) == verdict
    assert said(gate, replace(made, tables=BESIDE[beside](made))) == verdict


@pytest.mark.parametrize(("gate", "made", "verdict"), FAULTS, ids=lambda v: str(v)[:20])
def test_the_origin_of_time_changes_no_verdict(gate: str, made: Capture, verdict: str) -> None:
    later = made.tables[0].with_columns(t_s=pl.col("t_s") + 1024.0)
    assert said(gate, replace(made, tables=(later,))) == verdict


HOLED = [one for one in FAULTS if one[0] not in ("missing_values", "wrapped_angle")]


@pytest.mark.parametrize(("gate", "made", "verdict"), HOLED, ids=lambda v: str(v)[:20])
def test_a_few_holes_in_one_channel_change_no_verdict(
    gate: str, made: Capture, verdict: str
) -> None:
    """Three rows of a thousand without a value, in each column in turn."""
    for name in made.tables[0].columns:
        if name == "t_s":
            continue
        values = made.tables[0][name].to_numpy().copy()
        values[[20, 640, 980]] = np.nan
        holed = made.tables[0].with_columns(**{name: pl.Series(values)})
        assert said(gate, replace(made, tables=(holed,))) == verdict, name


def test_rows_are_those_of_the_table_they_stand_in() -> None:
    """A mask names its table, whichever it is, and so do values that are no readings."""
    for gate in ("stuck_channel", "saturation", "missing_values"):
        made = next(m for g, m, verdict in FAULTS if g == gate and verdict == "warned")
        alone = GATES[gate].check(made, GATES[gate].options).masks
        behind = replace(made, tables=(STREAM, *made.tables))
        masks = GATES[gate].check(behind, GATES[gate].options).masks
        assert [m.table for m in alone] == [0]
        assert [m.table for m in masks] == [1]
        assert np.array_equal(masks[0].keep, alone[0].keep)
    gate = GATES["isolated_readings"]
    made = next(m for g, m, verdict in FAULTS if g == gate.name and verdict == "warned")
    behind = replace(made, tables=(STREAM, *made.tables))
    (alone,), (lost,) = (gate.check(one, gate.options).lost for one in (made, behind))
    assert (alone.table, lost.table, lost.column) == (0, 1, alone.column)
    assert np.array_equal(lost.rows, alone.rows)


# Channels beside


@pytest.mark.parametrize("beside", ["ib_a", "ic_a"])
def test_a_line_without_a_step_leaves_the_step_to_the_others(beside: str) -> None:
    """The third line of a pair is open: its noise is no step, and takes none away."""
    t = np.arange(-200, 2000)
    current = np.where(t > 0, -np.expm1(-t / 12.0), 0.0)
    for lines in ({"ia_a": 10.0 * current, beside: 0.001 * noise(2200)},
                  {"ia_a": 0.001 * noise(2200), beside: 10.0 * current},
                  {"ia_a": 10.0 * current, beside: np.zeros(2200)}):  # fmt: skip
        made = capture("current_step", vab_v=1.0, **lines)
        assert said("sampling_rate", made) == ""
        assert said("current_coverage", made) == ""
    quiet = capture("current_step", ia_a=0.001 * noise(2200), **{beside: 0.001 * noise(2200, 3)})
    assert said("current_coverage", quiet) == "refused"
    # with a second line that steps, the shorter time constant counts
    fast = np.where(t > 0, -np.expm1(-t / 5.0), 0.0)
    for lines in ({"ia_a": current, beside: fast}, {"ia_a": fast, beside: current}):
        assert said("sampling_rate", capture("current_step", **lines)) == "warned"


def test_a_skip_that_two_witnesses_see_is_one_skip() -> None:
    """1 s at a relative 1e-3: one skip of 0.6 ms beyond its interval is within it, two are not."""
    rows = np.arange(1001.0)
    made = capture("drive", t_s=(rows + 0.6 * (rows >= 300)) * 1e-3, theta_mech_rad=rows * 0.01,
                   theta_elec_rad=rows * 0.07, meta={"u_rel_clock": 1e-3})  # fmt: skip
    (finding,) = GATES["clock_jump"].check(made, GATES["clock_jump"].options).findings
    assert "theta_mech_rad goes on" in finding.message
    assert finding.rows == (299, 300)


def test_the_second_witness_is_asked_where_the_first_says_nothing() -> None:
    rows = np.arange(200.0)
    t_s = np.where(rows < 100, rows, rows + 9.0) * 1e-3
    made = capture("drive", t_s=t_s, theta_mech_rad=np.full(200, np.nan), theta_elec_rad=rows)
    assert said("clock_jump", made) == "refused"
    # an angle that went on with the clock is no witness of a skip, wherever its gap is
    honest = capture("drive", t_s=t_s, theta_mech_rad=t_s * 10.0)
    assert said("clock_jump", honest) == ""
    gap = np.where(rows < 50, rows, rows + 9.0)
    both = gap + np.where(rows < 150, 0.0, 9.0)
    moved = np.where(rows < 150, gap, gap)
    second = capture("drive", t_s=both * 1e-3, theta_mech_rad=moved * 0.01)
    with pytest.raises(CaptureError) as found:
        GATES["clock_jump"].check(second, GATES["clock_jump"].options)
    assert found.value.rows == (149, 150)


def test_two_hundred_gaps_are_looked_at() -> None:
    """Gaps that the angle follows, and a last one across which it goes on as if there were none."""
    for honest, verdict in ((clock_jump.GAPS_LOOKED_AT - 1, "refused"),
                            (clock_jump.GAPS_LOOKED_AT, "")):  # fmt: skip
        starts = 30 * np.arange(1, honest + 2)
        jumps = np.zeros(30 * (honest + 2))
        jumps[starts] = 9.0
        t_s = np.arange(jumps.size) + np.cumsum(jumps)
        jumps[starts[-1]] = 0.0
        angle = np.arange(jumps.size) + np.cumsum(jumps)
        made = capture("drive", t_s=t_s * 1e-3, theta_mech_rad=angle * 0.01)
        assert said("clock_jump", made) == verdict


# Shares


@pytest.mark.parametrize(("share", "expected"), [(0.055, ""), (0.045, "warned")])
def test_a_second_level_is_one_of_a_twentieth_of_the_rows(share: float, expected: str) -> None:
    """At the top or at the bottom: the 5th and 95th percentiles."""
    other = round(share * 2000)
    for level in (1.3, 0.7):
        current = np.full(2000, 1.0)
        current[-other:] = level
        made = capture("resistance", ia_a=current, vab_v=current)
        assert said("current_coverage", made) == expected


@pytest.mark.parametrize(("times", "expected"), [(19.5, "refused"), (20.5, "")])
def test_a_range_of_twenty_times_the_noise_is_a_signal(times: float, expected: str) -> None:
    """In a step of its rows, in a torque map of means over ten of a thousand rows."""
    step = np.repeat([0.0, 1.0], 500)
    for size, test, column in ((1, "current_step", "ia_a"), (10, "torque_map", "iq_a")):
        height = 10.0
        for _ in range(30):
            current = noise(1000) + height * step
            reach = np.ptp(block_means(current, size)) * np.sqrt(size) / noise_of(current)
            height *= times / reach
        assert reach == pytest.approx(times, rel=1e-3)
        assert said("current_coverage", capture(test, **{column: -current})) == expected


@pytest.mark.parametrize(("times", "expected"), [(9.7, "refused"), (10.3, "")])
def test_a_current_of_ten_times_its_noise_flows(times: float, expected: str) -> None:
    """Of its own level: the white noise of a channel that carries a steady current."""
    white = noise(1000)
    current = white + times - white.max()
    assert np.abs(current).max() / noise_of(current) == pytest.approx(times)
    heat = capture("heat_run", ia_a=-current, temp_winding_degc=np.linspace(25.0, 45.0, 1000))
    assert said("current_coverage", heat) == expected
    both = capture("resistance", ia_a=np.concatenate([current, -current]), ib_a=0.0)
    assert (said("current_coverage", both) == "refused") == (expected == "refused")


def test_half_of_the_rows_make_a_dense_channel() -> None:
    """In one with fewer values blanks are the rule; in one with half, they are holes."""
    rows = np.arange(400)
    for first, expected in ((0, "warned"), (1, "")):
        values = np.where((rows % 2 == 0) & (rows >= first), 1.0 * rows, np.nan)
        made = capture("drive", iq_a=values, vq_v=1.0 * rows, theta_mech_rad=1.0 * rows)
        assert said("missing_values", made) == expected
    for count, expected in ((1, "refused"), (2, "")):
        few = np.where(rows < count, 1.0, np.nan)
        made = capture("drive", iq_a=1.0 * rows, vq_v=few, theta_mech_rad=1.0 * rows)
        assert said("missing_values", made) == expected


def test_a_back_emf_of_one_cycle_is_enough_of_a_spin() -> None:
    for cycles, expected in ((0.97, "refused"), (1.03, "")):
        phase = np.linspace(0.0, cycles * TURN, 2000)
        made = capture("open_circuit", theta_mech_rad=phase / 5.0, **three(VOLTS, phase))
        assert said("angle_coverage", made) == expected
        no_angle = capture("open_circuit", **three(VOLTS, phase))
        assert said("angle_coverage", no_angle) == expected


def test_a_vector_with_a_hole_is_of_the_three_that_are_there() -> None:
    """Voltages with a common part: the third is not minus the sum of the others."""
    phase = np.linspace(0.0, 12.0, 900)
    lines = {n: v + 4.0 for n, v in three(VOLTS, phase).items()}
    lines["vca_v"] = with_one(lines["vca_v"] + 3.0, 450, np.nan)
    found = line_voltage_vector(capture("open_circuit", **lines))
    assert found is not None
    a, b, c = (lines[n] for n in VOLTS)
    turn = np.exp(1j * TURN / 3.0)
    expected = 2.0 / 3.0 * (a + turn * b + turn**2 * c)
    there = np.isfinite(expected)
    assert np.count_nonzero(there) == 899
    assert found[1][there] == pytest.approx(expected[there], abs=1e-12)


def test_a_record_of_400_rows_has_50_blocks() -> None:
    angle = np.linspace(0.0, 20.0, 400)
    phase = 3.0 * angle + 0.05 * np.sin(2.3 * angle)
    found = turning(capture("open_circuit", theta_mech_rad=angle, **three(VOLTS, phase)))
    edges = np.unique(np.linspace(0, 399, 51).astype(int))
    electrical, mechanical = np.diff(phase[edges]), np.diff(angle[edges])
    slope = float(mechanical @ electrical / (mechanical @ mechanical))
    left = electrical - slope * mechanical
    u = np.sqrt(left @ left / 49.0 / (mechanical @ mechanical))
    assert found is not None
    assert found.cycles_per_turn == pytest.approx(slope, rel=1e-9)
    assert found.u == pytest.approx(u, rel=1e-6)
    rates = np.abs(np.diff(phase)) / 1e-4 / TURN
    assert found.top_hz == pytest.approx(np.percentile(rates, 99.0), rel=1e-6)


def test_only_finite_values_of_columns_with_any_are_looked_at() -> None:
    two = np.array([1.0, np.nan, np.nan, 3.0])
    made = capture("drive", iq_a=two, id_a=np.full(4, np.nan))
    found = current_coverage._finite(made, "iq_a", "id_a", "ia_a")
    assert {name: values.tolist() for name, values in found.items()} == {"iq_a": [1.0, 3.0]}


@pytest.mark.parametrize(("turns", "expected"), [(0.05, ""), (0.97, ""), (1.03, "refused")])
def test_a_speed_of_noise_is_none_while_the_angle_passes_less_than_a_turn(
    turns: float, expected: str
) -> None:
    """Integrated, its noise makes turns of its own; a shaft that turned on would be another."""
    speed = 4e4 * noise(2000)
    made = capture(
        "drive", theta_mech_rad=np.linspace(0.0, turns * TURN, 2000), omega_mech_rad_s=speed
    )
    edges = np.linspace(0, 1999, 21).astype(int)
    travel = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * 1e-4)])[edges]
    assert np.abs(np.diff(travel)).sum() > 2.0 * TURN
    assert said("speed_against_angle", made) == expected


@pytest.mark.parametrize(("count", "words"), [(2, "(inf, inf)"), (9, "(inf, inf, inf)")])
def test_a_fault_shows_three_of_its_values(count: int, words: str) -> None:
    with pytest.raises(CaptureError) as found:
        check_tables(capture("drive", iq_a=np.where(np.arange(20) < count, np.inf, 1.0)))
    assert words in str(found.value)
