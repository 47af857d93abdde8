"""Drawn benches: a log loses what its name says, and a draw does not know what is hidden."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from pipeline import Recordings, diagnose
from pipeline.contracts.schemas import check_tables
from pipeline.records.capture import Capture, CaptureMeta
from tests.benchmark.worlds import with_drawn
from tests.benchmark.worlds.case import WorldCase
from tests.benchmark.worlds.damage import CURRENTS, KINDS, VOLTAGES, Columns, damaged
from tests.benchmark.worlds.table import cases
from tests.benchmark.worlds.with_drawn import EACH, campaign, draw_of

ROWS, RATE_HZ = 3000, 2000.0


@pytest.fixture
def log() -> Columns:
    rng = np.random.default_rng(1)
    t_s = np.arange(ROWS) / RATE_HZ
    names = ("id_a", "iq_a", "vd_v", "vq_v", "omega_mech_rad_s", "torque_shaft_nm")
    drawn = {name: 10.0 + rng.standard_normal(ROWS) for name in names}
    return {"t_s": t_s, "theta_mech_rad": 3.0 * t_s, **drawn}


def left(log: Columns, group: str, kind: str, test: str = "drive") -> Capture:
    meta = CaptureMeta(motor_id="M", motor_type="unit", test=test)
    whole = Capture("log.csv", "0" * 64, "verified", meta, (pl.DataFrame(log),))
    found = damaged(whole, KINDS[group][kind], np.random.default_rng(2))
    assert found is not None
    return found


@pytest.mark.parametrize(
    ("kind", "lost"),
    [
        ("no voltage", {"vd_v", "vq_v"}),
        ("no current", {"id_a", "iq_a"}),
        ("no d axis", {"id_a", "vd_v"}),
        ("no angle, no speed", {"theta_mech_rad", "omega_mech_rad_s"}),
        ("no voltage, no torque", {"vd_v", "vq_v", "torque_shaft_nm"}),
    ],
)
def test_columns_that_are_lost_are_those_of_the_name(
    log: Columns, kind: str, lost: set[str]
) -> None:
    table = left(log, "columns", kind).tables[0]
    assert set(log) - set(table.columns) == lost
    assert all((table[name].to_numpy() == log[name]).all() for name in table.columns)


@pytest.mark.parametrize(
    ("kind", "rate_hz", "scatter"),
    [("500 Hz", 500.0, 1.0), ("100 Hz", 100.0, 1.0), ("means at 200 Hz", 200.0, 10.0**-0.5)],
)
def test_telemetry_is_single_rows_or_means_of_a_period(
    log: Columns, kind: str, rate_hz: float, scatter: float
) -> None:
    table = left(log, "rows", kind).tables[0]
    t_s = table["t_s"].to_numpy()
    assert np.diff(t_s) == pytest.approx(1.0 / rate_hz)
    assert table["theta_mech_rad"].to_numpy() == pytest.approx(3.0 * t_s)
    assert table["iq_a"].std() == pytest.approx(scatter, rel=0.2)


def test_time_stamps_scatter_or_are_whole_milliseconds_and_still_rise(log: Columns) -> None:
    for kind in ("jitter", "milliseconds"):
        t_s = left(log, "rows", kind).tables[0]["t_s"].to_numpy()
        assert (np.diff(t_s) > 0.0).all()
    assert t_s * 1e3 == pytest.approx(np.round(t_s * 1e3), abs=1e-9)
    assert 0.4 * ROWS < t_s.size <= 0.6 * ROWS


def test_rows_are_lost_at_random_values_one_by_one_and_ends_at_once(log: Columns) -> None:
    lost = left(log, "rows", "rows lost").tables[0]
    assert 0.78 * ROWS < lost.height < 0.9 * ROWS
    assert np.diff(lost["t_s"].to_numpy()).max() > 0.9 * ROWS / 30.0 / RATE_HZ
    holes = left(log, "rows", "values lost").tables[0]
    shares = {name: holes[name].is_nan().sum() / ROWS for name in holes.columns}
    assert shares.pop("t_s") == 0.0
    assert all(0.03 < share < 0.07 for share in shares.values())
    late = left(log, "rows", "begun late").tables[0]["t_s"].to_numpy()
    early = left(log, "rows", "ended early").tables[0]["t_s"].to_numpy()
    assert late[-1] == log["t_s"][-1] and early[0] == 0.0
    for kept in (late, early):
        assert 0.2 * ROWS - 1 <= kept.size <= 0.7 * ROWS
        assert np.diff(kept) == pytest.approx(1.0 / RATE_HZ)


def test_digits_are_lost_of_each_value_or_of_the_largest(log: Columns) -> None:
    log["iq_a"] = np.linspace(-0.012345, 98.765, ROWS)
    of_each = left(log, "digits", "three digits").tables[0]["iq_a"].to_numpy()
    assert of_each[[0, -1]] == pytest.approx([-0.0123, 98.8])
    of_all = left(log, "digits", "few decimals").tables[0]["iq_a"].to_numpy()
    assert of_all * 10.0 == pytest.approx(np.round(of_all * 10.0), abs=1e-9)
    assert np.abs(of_all - log["iq_a"]).max() == pytest.approx(0.05, rel=0.1)


def test_what_a_bus_holds_and_what_a_link_loses_is_found_again(log: Columns) -> None:
    bus = left(log, "links", "torque held").tables[0]["torque_shaft_nm"].to_numpy()
    changes = np.flatnonzero(np.diff(bus))
    assert np.all(np.diff(changes) == 10)
    assert set(bus) <= set(log["torque_shaft_nm"])
    blank = left(log, "links", "slow torque").tables[0]["torque_shaft_nm"].to_numpy()
    assert np.isfinite(blank).mean() == pytest.approx(1 / 7, rel=0.01)
    link = left(log, "links", "readings of zero").tables[0]
    for name in ("iq_a", "torque_shaft_nm"):
        gone = link[name].to_numpy() != log[name]
        assert 0 < gone.sum() < 12
        assert not link[name].to_numpy()[gone].any()
    assert (link["vq_v"].to_numpy() == log["vq_v"]).all()


def test_six_digits_are_those_of_a_print(log: Columns) -> None:
    log["theta_mech_rad"] = np.linspace(-2.0, 1234.56789, ROWS)
    table = left(log, "links", "six digits").tables[0]
    printed = [float(f"{value:.6g}") for value in log["theta_mech_rad"]]
    assert table["theta_mech_rad"].to_numpy() == pytest.approx(printed, rel=1e-9)
    assert (table["t_s"].to_numpy() == log["t_s"]).all()


def test_two_terminals_keep_what_they_are_made_of(log: Columns) -> None:
    volts = {"t_s": log["t_s"], "va_v": log["vd_v"], "ia_a": log["id_a"]}
    for kind in ("no voltage", "no current"):
        assert left(volts, "columns", kind, "resistance").tables[0].columns == list(volts)
    meta = CaptureMeta(motor_id="M", motor_type="unit", test="drive")
    bare = {n: v for n, v in log.items() if n in ("t_s", *CURRENTS, *VOLTAGES)}
    nothing = Capture("log.csv", "0" * 64, "verified", meta, (pl.DataFrame(bare),))
    gone = (*KINDS["columns"]["no voltage"], *KINDS["columns"]["no current"])
    assert damaged(nothing, gone, np.random.default_rng(2)) is None


def test_half_of_the_cases_are_sound_and_no_draw_is_drawn_twice() -> None:
    one, other = cases("drawn", 1), cases("drawn", 2)
    assert len({case.key for case in (*one, *other)}) == 2 * len(one) == 4 * EACH * len(KINDS)
    assert sum(case.line == "nothing" for case in one) == len(one) // 2
    motors = {repr(draw_of(case).motor) for case in (*one, *other)}
    assert len(motors) == 2 * len(one)


def test_what_is_drawn_does_not_hang_on_what_is_hidden_and_comes_again_as_the_same_bytes() -> None:
    case = next(c for c in cases("drawn", 1) if c.effects and draw_of(c).kind == "rows lost")
    sound = replace(case, effects={})
    assert draw_of(sound) == draw_of(case)
    one, again = campaign(case), campaign(case)
    for capture, other in zip(one.captures, again.captures, strict=True):
        assert capture.tables[0].equals(other.tables[0])
        check_tables(capture)
    plain = campaign(sound)
    assert [c.path for c in plain.captures] == [c.path for c in one.captures]
    names = {word for c in one.captures for word in (c.path, *c.meta.extra.values())}
    assert not any(effect in word for effect in case.effects for word in names)


@pytest.mark.slow
def test_an_error_of_a_sensor_without_a_size_is_no_name(monkeypatch: pytest.MonkeyPatch) -> None:
    """An eccentric encoder in one torque map of 1 kHz had a clock 10 % off and a `torque_scale`."""
    case = WorldCase("drawn", "rows", 542, {"angle_eccentricity": 1.0})
    drawn = draw_of(case)
    bench = replace(drawn.bench, encoder_bits=13, encoder_noise_rad=0.0, jitter_s=0.0)
    thinned = replace(drawn, bench=bench, damage=KINDS["rows"]["milliseconds"])
    monkeypatch.setattr(with_drawn, "draw_of", lambda _: thinned)
    found = with_drawn.campaign(case)
    diagnosis = diagnose(Recordings({found.motor_id: found}))[found.motor_id]
    parameters = diagnosis.ladder[-1].parameters
    sized = {name.partition(".")[0] for name, one in parameters.items() if one.value is not None}
    assert set(diagnosis.missing) <= sized
    assert "torque_scale" not in diagnosis.missing


@pytest.mark.slow
def test_what_captures_leave_free_is_no_name() -> None:
    """A slow turn in one sense, a holding current and a coast had a `torque_offset`."""
    found = with_drawn.campaign(WorldCase("drawn", "links", 166, {}))
    diagnosis = diagnose(Recordings({found.motor_id: found}))[found.motor_id]
    assert (diagnosis.verdict, diagnosis.missing) == ("insufficient", ())


@pytest.mark.parametrize(
    ("group", "seed"),
    [
        # no voltage but that of a resistance test: the flux began 200 times too low
        ("columns", 303),
        # a speed that gives way: a lag of the torque's sensor stood in place of the inertia
        ("whole", 385),
        # by chance: the floors of a voltage were larger beside a `torque_offset`
        ("whole", 487),
    ],
)
def test_nothing_is_missing_of_a_sound_motor(group: str, seed: int) -> None:
    found = with_drawn.campaign(WorldCase("drawn", group, seed, {}))
    diagnosis = diagnose(Recordings({found.motor_id: found}))[found.motor_id]
    assert (diagnosis.verdict, diagnosis.missing) == ("insufficient", ())
    assert diagnosis.ladder[-1].held_out < 1.1


def test_two_effects_are_found_where_one_does_nearly_as_much() -> None:
    """A skin effect beside hysteresis was a current sampled 11 µs too early, which left nothing."""
    hidden = {"iron_hysteresis": 1.0, "skin_effect": 0.5}
    found = with_drawn.campaign(WorldCase("drawn", "whole", 321, hidden))
    diagnosis = diagnose(Recordings({found.motor_id: found}))[found.motor_id]
    assert (diagnosis.verdict, set(diagnosis.missing)) == ("missing", set(hidden))
