"""A torque or a current that is logged many samples late: named alone, with its delay."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from pipeline.criticism.data.machine_scale import machine_of
from pipeline.criticism.diagnosis import diagnose
from pipeline.criticism.library.registry import effects
from pipeline.criticism.operating import Recorded, between
from pipeline.criticism.residuals.segments import segments
from pipeline.criticism.signals.true_current import ahead_in
from pipeline.records.capture import Campaign, Capture
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants
from pipeline.simulator.bench import CAMPAIGN, campaign
from pipeline.simulator.design import Bench
from tests.simulated import campaign_of, design

PERIOD_S = 1e-4
LIBRARY = effects()
PLAN = tuple(step for step in CAMPAIGN if step[1] not in ("hand_turn", "holding_current"))
FEW = tuple(step for step in PLAN if step[0] in ("resistance_ab", "torque_map_slow", "drive_0"))
TORQUE, CURRENT = ("torque_shaft_nm",), ("id_a", "iq_a")


def late(capture: Capture, names: tuple[str, ...], samples: int) -> Capture:
    """The capture with columns of a drive's log so many samples late."""

    def shifted(column: pl.Series) -> np.ndarray:
        values = column.to_numpy()
        return np.concatenate([np.full(samples, values[0]), values[:-samples]])

    if not capture.has("vd_v", "t_s"):
        return capture
    tables = (
        t.with_columns(pl.Series(n, shifted(t[n])) for n in names if n in t.columns)
        for t in capture.tables
    )
    return replace(capture, tables=tuple(tables))


def recorded(motor: str, names=(), samples: int = 20, plan=PLAN) -> Campaign:
    plain = replace(design(motor), effects={})
    whole = campaign_of(campaign(plain, Bench(), 3, plan))
    if not names:
        return whole
    return replace(whole, captures=tuple(late(c, names, samples) for c in whole.captures))


def test_what_is_read_between_samples_is_a_cubic():
    """Exact for a parabola, at samples exact for anything, its slope there the central one."""
    at = np.arange(40.0)
    parabola = 0.3 * at**2 - 2.0 * at + 1.0
    inner = at[2:-3] + 0.37
    assert between(parabola, inner) == pytest.approx(0.3 * inner**2 - 2.0 * inner + 1.0)
    noise = np.random.default_rng(1).standard_normal(40)
    assert between(noise, at) == pytest.approx(noise, abs=1e-12)
    small = 1e-7
    slope = (between(noise, at[1:-1] + small) - noise[1:-1]) / small
    assert slope == pytest.approx(0.5 * (noise[2:] - noise[:-2]), abs=1e-5)
    assert between(noise, np.array([-3.0, 50.0])) == pytest.approx(noise[[0, -1]])


def test_a_thinned_log_is_read_where_it_was_not_thinned():
    """Twenty samples later than a window's sample is a sample of the whole log."""
    found = recorded("gimbal-5208", plan=FEW)
    machine = machine_of(found, Constants())
    (log,) = [s for s in segments(found, machine) if s.test == "drive"]
    column = found.of("drive")[0].arrays("iq_a")["iq_a"]
    assert log.size < column.size
    rows = np.rint(log.recorded["t_s"] / PERIOD_S).astype(int)
    current, torque, turned = ahead_in(log, log.recorded, machine.pole_pairs)(20 * log.ts_s)
    inside = rows + 20 < column.size
    assert (log.recorded["iq_a"] + current.imag)[inside] == pytest.approx(
        column[rows[inside] + 20], abs=1e-9
    )
    assert torque.size == turned.size == log.size


@pytest.mark.parametrize("of_phases", [0.0, 1.0])
def test_a_current_that_is_late_is_read_later(of_phases):
    """In the rotor frame as it is, of the phases turned on by what the rotor has turned since."""
    n = np.arange(400.0)
    true = np.sin(0.05 * n) + 1j * np.cos(0.03 * n)
    omega = np.full(n.size, 500.0)
    turn = 500.0 * 20 * PERIOD_S
    told = np.concatenate([np.zeros(20), true[:-20]]) * np.exp(-1j * turn * of_phases)
    r = Recorded(told, n, n, omega, PERIOD_S, True, "drive")
    q = {"delay_s": 20 * PERIOD_S, "of_phases": of_phases}
    found = LIBRARY["current_delay"].current(r, q)
    assert found[20:-20] == pytest.approx(true[20:-20])
    assert np.array_equal(LIBRARY["current_delay"].current(replace(r, inverter=False), q), told)


def test_a_late_stamp_of_a_torque_is_no_lag():
    n = np.arange(400.0)
    true = np.where(n > 200, 1.0, 0.0) + 0.1 * np.sin(0.2 * n)
    told = np.concatenate([np.zeros(20), true[:-20]])
    r = Recorded(told + 0j, told, n, n, PERIOD_S, True, "drive")
    q = {"lag_s": 20 * PERIOD_S, "late": 0.0, "stamped": 1.0}
    assert LIBRARY["torque_lag"].load(r, q)[20:-20] == pytest.approx(true[20:-20])
    lag = LIBRARY["torque_lag"].load(r, {**q, "stamped": 0.0})
    assert lag == pytest.approx(told + 20 * PERIOD_S * np.gradient(told, PERIOD_S))


@pytest.mark.slow
@pytest.mark.parametrize("motor", ["gimbal-5208", "joint-11p"])
@pytest.mark.parametrize(
    ("names", "samples", "effect", "parameter"),
    [
        (TORQUE, 20, "torque_lag", "lag_s"),
        (TORQUE, 7, "torque_lag", "lag_s"),
        (CURRENT, 20, "current_delay", "delay_s"),
        (CURRENT, 45, "current_delay", "delay_s"),
    ],
)
def test_a_delay_of_many_samples_is_named_alone_with_its_size(
    motor, names, samples, effect, parameter
):
    """Twenty samples of torque were told as waves of the angle, or as nothing that is known."""
    result = diagnose(recorded(motor, names, samples), ModelSpec(), Constants())
    assert (result.verdict, result.missing) == ("missing", (effect,))
    found = result.ranking[0]
    assert found.parameters[parameter][0] == pytest.approx(samples * PERIOD_S, rel=0.02)
    assert found.parameters["stamped" if names == TORQUE else "of_phases"][0] == (names == TORQUE)


@pytest.mark.slow
@pytest.mark.parametrize("motor", ["gimbal-5208", "joint-11p"])
def test_without_a_delay_none_is_named(motor):
    result = diagnose(recorded(motor), ModelSpec(), Constants())
    assert (result.verdict, result.missing) == ("adequate", ())
