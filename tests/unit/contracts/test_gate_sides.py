"""Shares, limits and counts of the gates from both sides, a few per cent away; the rest by hand."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from pipeline.contracts import duplicates, motor, waveform
from pipeline.contracts.clocks import _slow_columns
from pipeline.contracts.duplicates import _finding, _holds, once
from pipeline.contracts.gates import saturation, torque_sign
from pipeline.contracts.gates.phase_sum import sum_share
from pipeline.contracts.schemas import broken, check_metadata
from pipeline.physics.glossary import COLUMNS, METADATA
from pipeline.records.capture import Campaign, CaptureMeta
from pipeline.records.errors import CaptureError
from tests.unit.contracts.test_gate_limits import GATES, TURN, capture, noise, said, step

OPTIONS = {name: GATES[name].options for name in GATES}


def findings(code: str, *captures) -> list:
    """Those with a code, of one motor."""
    return [f for f in motor.agree(Campaign("m", captures)) if f.code == code]


# One motor's captures


@pytest.mark.parametrize(
    ("key", "usual", "other", "consequence"),
    [
        ("motor_type", "A", "B", "the most frequent one counts"),
        ("lot", "L1", "L2", "the most frequent one counts"),
        ("winding", "wye", "delta", "the wye equivalent is published"),
        ("pole_pairs", 7, 14, "the count from the data"),
        ("slots", 12, 9, "the most frequent one counts"),
    ],
)
def test_each_key_of_the_nameplate(key, usual, other, consequence) -> None:
    """Two of five say another: the first of the two is named, with how many more."""
    values = (usual, other, usual, other, usual)
    made = [
        capture("drive", path=f"{k}.csv", iq_a=1.0, meta={key: v}) for k, v in enumerate(values)
    ]
    (found,) = findings(f"{key}_contradiction", *made)
    assert found.file == "1.csv"
    assert f"is {other} here and in 1 more captures of m, but {usual} in 0.csv" in found.message
    assert found.message.endswith("and 2 more")
    assert consequence in found.remedy
    assert findings(f"{key}_contradiction", *made[::2]) == []


@pytest.mark.parametrize("factor", [130.0, 1.0 / 130.0])
def test_a_clock_that_is_slow_or_fast_is_the_odd_one(factor: float) -> None:
    made = [step(1e-3, f"{k}.csv") for k in range(3)] + [step(1e-3 * factor, "odd.csv")]
    assert [f.file for f in findings("clock_contradiction", *made)] == ["odd.csv"]


def test_of_two_clocks_apart_both_are_named_where_neither_is_usual() -> None:
    """The geometric mean is usual of two: a factor of 130 is 11.4 from it either way."""
    made = (step(1e-3, "a.csv"), step(0.13, "b.csv"))
    found = findings("clock_contradiction", *made)
    assert [f.file for f in found] == ["a.csv", "b.csv"]
    assert f"{1e-3 * math.sqrt(130.0):.3g} s is usual" in found[0].message


@pytest.mark.parametrize(("share", "enough"), [(0.018, False), (0.0225, True)])
def test_two_rows_of_a_hundred_show_a_current(share: float, enough: bool) -> None:
    """The 2nd percentile counts, not one stray row."""
    current = np.where(np.arange(4000) < round(share * 4000), -5.0, 10.0)
    for sign in (1.0, -1.0):
        made = capture("torque_map", iq_a=sign * current, torque_shaft_nm=current)
        assert (findings("current_coverage", made) == []) is enough


# One recording under two names


def test_the_first_value_may_stand_in_64_places() -> None:
    long = np.arange(100.0)
    for before, found in ((63, True), (64, False)):
        often = np.concatenate([np.tile([40.0, 1.0], before), long])
        assert _holds(often, long[40:60]) is found


def test_what_differs_of_two_recordings_is_named() -> None:
    values = np.arange(50.0)
    plain = capture("drive", path="a.csv", iq_a=values)
    for key, value in (("station", "s"), ("lot", "l"), ("started_at", "2026-01-05T08:00:00Z"),
                       ("pair", "ab"), ("theta_elec_deg", 30.0)):  # fmt: skip
        other = capture("drive", path="b.csv", iq_a=values, meta={key: value})
        assert f"whose {key} differ" in _finding(other, plain).message
    assert "differ" not in _finding(capture("drive", path="b.csv", iq_a=values), plain).message
    longer = capture("drive", path="c.csv", iq_a=np.arange(60.0))
    kept, found = once([plain, longer])
    assert [c.path for c in kept] == ["c.csv"]
    assert found[0].file == "a.csv"
    assert duplicates._rows(replace(plain, tables=())) == 0


# One signal


def test_samples_of_a_time_constant_by_hand() -> None:
    """Three quarters of the way is up and one quarter down; between are 10 to 90 %."""
    rest, top = np.zeros(200), np.ones(200)

    def of(*between: float) -> float:
        return waveform.samples_per_time_constant(np.concatenate([rest, between, top, rest]))

    # two edges; 0.105, 0.5 and 0.89 lie between, 0.095 and 0.91 do not
    assert of(0.095, 0.105, 0.5, 0.89, 0.91) == pytest.approx(3.0 / 2.0 / math.log(9.0))
    # up to 0.77 and back to 0.23 is an edge each; 0.73 and 0.27 are on the way
    assert of(0.77, 0.23) == pytest.approx(2.0 / 4.0 / math.log(9.0))
    assert of(0.73, 0.23) == pytest.approx(2.0 / 2.0 / math.log(9.0))
    assert of(0.77, 0.27) == pytest.approx(2.0 / 2.0 / math.log(9.0))


def test_noise_by_hand() -> None:
    """Bends of 1, -2, 4, 1 and 0.5: the median magnitude is 1."""
    values = np.cumsum(np.cumsum([0.0, 0.0, 1.0, -2.0, 4.0, 1.0, 0.5]))
    assert waveform.noise_of(values) == pytest.approx(1.4826 / math.sqrt(6.0))
    assert waveform.noise_of(np.insert(values, 3, np.nan)) == waveform.noise_of(values)
    assert waveform.noise_of(values[:3]) == pytest.approx(1.4826 / math.sqrt(6.0))


@pytest.mark.parametrize(("slow", "expected"), [(14.0, 0.1), (16.0, 0.15)])
def test_torque_is_promised_by_the_faster_half_of_the_speeds(slow: float, expected: float) -> None:
    """2 V at 30 rad/s promise 0.1 N·m/A; half of the rows at `slow` would promise 0.2."""
    speed = np.array([30.0, -30.0, slow, slow])
    volts = np.array([2.0, -2.0, 0.2 * slow / 1.5, 0.2 * slow / 1.5])
    assert torque_sign._promised_nm_a(volts, speed) == pytest.approx(expected)


def test_one_row_has_no_sum() -> None:
    names = ("ia_a", "ib_a", "ic_a")
    one = pl.DataFrame({name: [1.0] for name in names})
    assert sum_share(one, names, 3.0) == 0.0
    assert sum_share(pl.DataFrame({name: [1.0] * 50 for name in names}), names, 3.0) > 0.9
    assert sum_share(pl.DataFrame({name: [math.nan] * 9 for name in names}), names, 3.0) == 0.0


# Stops and rest


def test_a_signal_that_rests_at_zero_is_not_cut() -> None:
    wave = np.maximum(np.sin(np.arange(2000) * 0.0123456), 0.0)
    assert not saturation.clipped_rows(wave, OPTIONS["saturation"]).any()
    shifted = saturation.clipped_rows(wave + 1.0, OPTIONS["saturation"])
    assert shifted.any() == saturation.clipped_rows(-wave - 1.0, OPTIONS["saturation"]).any()


@pytest.mark.parametrize(("rows", "found"), [(49, False), (50, True)])
def test_fifty_samples_can_be_cut(rows: int, found: bool) -> None:
    values = np.random.default_rng(0).uniform(-1.0, 1.0, rows)
    values[20:30] = 2.0
    cut = saturation.clipped_rows(values, OPTIONS["saturation"])
    assert np.count_nonzero(cut) == (10 if found else 0)


def test_a_step_may_not_be_cut_at_all() -> None:
    """In a drive a fiftieth of the rows is set aside; the words name the stop that is reached."""
    values = np.random.default_rng(0).uniform(-1.0, 1.0, 2000)
    values[500:540] = -2.5
    assert said("saturation", capture("drive", ia_a=values)) == "warned"
    assert said("saturation", capture("current_step", ia_a=values)) == "refused"
    (finding,) = (
        GATES["saturation"].check(capture("drive", ia_a=values), OPTIONS["saturation"]).findings
    )
    assert "cut flat at -2.5 in 40 of 2000 rows" in finding.message
    assert finding.rows == (500, 539)
    # a commanded voltage stands at the inverter's limit, a measured one at the probe's
    for kind, expected in (("measured", "warned"), (None, "warned"), ("commanded", "")):
        made = capture("drive", vab_v=values, meta={"voltage_kind": kind})
        assert said("saturation", made) == expected


# Rows and angles


@pytest.mark.parametrize(("intervals", "expected"), [(1.46, ""), (1.54, "warned")])
def test_a_gap_nearer_to_two_intervals_than_to_one_lost_a_sample(
    intervals: float, expected: str
) -> None:
    rows = np.arange(1000.0)
    made = capture("drive", t_s=rows + (intervals - 1.0) * (rows > 499), iq_a=rows)
    assert said("dropped_samples", made) == expected


@pytest.mark.parametrize(("share", "expected"), [(0.193, "warned"), (0.207, "refused")])
def test_a_fifth_of_the_samples_may_be_lost(share: float, expected: str) -> None:
    """So many of the rows that are there and those that are not."""
    rows = np.arange(1000.0)
    lost = share / (1.0 - share) * 1000.0
    made = capture("drive", t_s=rows + lost * (rows > 499), iq_a=rows)
    assert said("dropped_samples", made) == expected
    (words,) = ([str(f.message) for f in GATES["dropped_samples"].check(
        made, OPTIONS["dropped_samples"]).findings] if expected == "warned" else [""])  # fmt: skip
    if words:
        assert f"about {lost:.0f} samples are missing in 1 gaps, {100.0 * share:.2g} %" in words


def test_a_rig_may_log_its_levels_alone() -> None:
    """A third of the rows is missing, all of them where the level changes."""
    t = np.arange(300.0)
    kept = np.flatnonzero(np.arange(300) % 30 < 20)
    made = capture("torque_map", t_s=t[kept], iq_a=(t // 30.0)[kept])
    assert said("dropped_samples", made) == "warned"
    assert said("dropped_samples", capture("drive", t_s=t[kept], iq_a=t[kept])) == "refused"


@pytest.mark.parametrize(("usual", "expected"), [(0.95, "refused"), (1.05, "")])
def test_steps_of_a_radian_leave_the_direction_open(usual: float, expected: str) -> None:
    angle = np.arange(90.0) * usual
    angle[50:] -= TURN
    assert said("wrapped_angle", capture("drive", theta_mech_rad=angle)) == expected


@pytest.mark.parametrize(("share", "expected"), [(0.045, "refused"), (0.055, "")])
def test_the_coldest_twentieth_is_left_aside(share: float, expected: str) -> None:
    values = np.where(np.arange(2000) < round(share * 2000), 20.0, 290.0)
    made = capture("resistance", temp_winding_degc=values, meta={"ambient_degc": 20.0})
    assert said("temperature_unit", made) == expected


@pytest.mark.parametrize(("rise", "expected"), [(4.9, "warned"), (5.1, "")])
def test_a_rise_is_counted_less_two_of_the_thermometers_noise(rise: float, expected: str) -> None:
    ramp, low, high = np.linspace(0.0, 1.0, 1000), 0.0, 20.0

    def counted(values: np.ndarray) -> float:
        return float(np.ptp(values)) - 2.0 * waveform.noise_of(values)

    while high - low > 1e-6:
        middle = 0.5 * (low + high)
        values = 0.5 * noise(1000) + middle * ramp
        low, high = (middle, high) if counted(values) < rise else (low, middle)
    assert counted(values) == pytest.approx(rise, abs=1e-4)
    assert waveform.noise_of(values) == pytest.approx(0.5, rel=0.02)
    made = capture("heat_run", iq_a=5.0, id_a=0.0, temp_winding_degc=25.0 + values)
    assert said("current_coverage", made) == expected


@pytest.mark.parametrize(
    ("currents", "expected"),
    [([1.0, 1.0009], "refused"), ([1.0, 1.0012], "warned"), ([-1.0, 1.0], ""),
     ([0.0, 1.0], "warned"), ([-1.0, -2.0], "warned"), ([0.0, 0.0], "refused")],
)  # fmt: skip
def test_levels_of_a_torque_table(currents: list[float], expected: str) -> None:
    made = capture("torque_table", iq_a=np.array(currents), torque_shaft_nm=1.0)
    assert said("current_coverage", made) == expected


def test_a_channel_is_slow_from_two_values_on() -> None:
    """One value has no interval; neighbours in a part of the rows are no slow stream."""
    t_s = np.arange(100.0)
    for places, slow in (([7], False), ([7, 9], True), ([7, 8], False), ([7, 8, 10], True)):
        values = np.full(100, np.nan)
        values[places] = 1.0
        table = pl.DataFrame({"t_s": t_s, "iq_a": t_s, "temp_case_degc": values})
        assert [*_slow_columns(table, 0.5)] == ["temp_case_degc"] * slow


# Ranges of the glossary


RANGED = [name for name, term in COLUMNS.items() if term.low is not None and term.high is not None]


@pytest.mark.parametrize("name", [n for n in RANGED if n != "t_s"])
def test_both_ends_of_a_columns_range_are_in_it(name: str) -> None:
    low, high = COLUMNS[name].low, COLUMNS[name].high
    inside = pl.LazyFrame({name: [low, high, None, math.nan]})
    assert broken(inside, (name,)) == []
    for out in (np.nextafter(low, -np.inf), np.nextafter(high, np.inf)):
        assert broken(pl.LazyFrame({name: [out]}), (name,)) == [(name, "implausible_value")]


@pytest.mark.parametrize("key", [t.name for t in METADATA.values() if t.low is not None])
def test_both_ends_of_a_statements_range_are_in_it(key: str) -> None:
    term = METADATA[key]
    plain = CaptureMeta(motor_id="m", test="drive")
    if not hasattr(plain, key) or term.high is None:
        pytest.skip("not a number of a capture")
    for value in (term.low, term.high, None):
        check_metadata(replace(plain, **{key: value}))
    for out in (np.nextafter(term.low, -np.inf), np.nextafter(term.high, np.inf)):
        with pytest.raises(CaptureError, match=f"{key} is"):
            check_metadata(replace(plain, **{key: float(out)}))
