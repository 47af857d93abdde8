"""A constant that changed within a log is told with its size, the time and the later captures."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.criticism.discovery.changed_within import _Rows, _scanned, changed_within
from pipeline.criticism.machine.model import Model
from pipeline.criticism.regression.columns import Column
from pipeline.criticism.regression.fit import Fit
from pipeline.criticism.regression.gauss_newton import first_fit, rough_fit
from pipeline.criticism.regression.linear_system import LinearSystem
from tests.unit.criticism.machines import BASE, log, machine

P, TS, N = 7, 5e-5, 8000


def changed(segment, share, name="psi_wb"):
    """A log in which a constant is another by shares [n] of it at each sample."""
    s = dict(segment.recorded)
    omega = np.gradient(s["theta_mech_rad"], segment.ts_s)
    moved = share * BASE[name]
    if name == "r_ohm":
        s["vq_v"] = s["vq_v"] + moved * s["iq_a"]
        s["vd_v"] = s["vd_v"] + moved * s["id_a"]
    else:
        s["vq_v"] = s["vq_v"] + P * omega * moved
        s["torque_shaft_nm"] = s["torque_shaft_nm"] + 1.5 * P * moved * s["iq_a"]
    return replace(segment, recorded=s)


def logs(shares, name="psi_wb"):
    """Logs with the shares of each, a number or one a sample."""
    made = []
    for n, share in enumerate(shares):
        one = replace(log(seed=n, noise=1.0), capture=f"log_{n}")
        made.append(changed(one, share * np.ones(N), name))
    return tuple(made)


def found(segments):
    return changed_within(first_fit(rough_fit(segments, Model(machine(), ()))))


def from_on(time_s, share):
    return np.where(TS * np.arange(N) >= time_s, share, 0.0)


@pytest.mark.parametrize(
    ("name", "share", "time_s", "rest", "after"),
    [
        pytest.param("psi_wb", -0.05, 0.23, (0.0, -0.05, 0.0), ("log_2",), marks=pytest.mark.slow),
        pytest.param("psi_wb", 0.03, 0.12, (0.0, 0.0, 0.0), (), marks=pytest.mark.slow),
        ("r_ohm", 0.08, 0.29, (0.08, 0.08, 0.0), ("log_1", "log_2")),
    ],
)
def test_the_constant_its_size_and_the_time_are_told(name, share, time_s, rest, after):
    one = found(logs([from_on(time_s, share), *rest], name))
    assert one is not None
    assert one.name == name
    assert one.capture == "log_0"
    assert one.after == after
    assert one.difference == pytest.approx(share * BASE[name], rel=0.05)
    assert abs(one.difference - share * BASE[name]) < 4.0 * one.u
    assert one.at_s[0] <= time_s <= one.at_s[1]
    assert one.at_s[1] - one.at_s[0] < 0.1
    assert ("higher" if share > 0.0 else "lower") in one.words


def test_a_constant_that_stays_a_slow_drift_and_a_change_between_are_none_of_it():
    assert found(logs((0.0, 0.0, 0.0))) is None
    assert found(logs((np.linspace(0.0, -0.06, N), 0.0, 0.0))) is None
    assert found(logs((-0.05, 0.0, 0.0))) is None


def scanned(shown, missed):
    """The change in the first of two captures of twenty windows; `shown` [20] is how much of the
    inertia its windows show, `missed` [20] by what the fit misses them.
    """
    n = 40
    system = LinearSystem(
        columns=(Column("j_kgm2", 1e-3),),
        residual=np.concatenate([missed, np.zeros(20)]),
        matrix=np.concatenate([shown, np.ones(20)])[:, None],
        group=np.repeat([0, 1], 20),
        window=np.tile(np.arange(20), 2),
        unit=np.ones(n),
        noise_ratio=np.ones(n),
        row_weight=np.ones(n),
        labels=((0, "torque_shaft_nm", 0), (1, "torque_shaft_nm", 0)),
        prior_precision=np.zeros(1),
        prior_gradient=np.zeros(1),
        fit=Fit((log(), log()), Model(machine(), ()), dict(BASE), (), BASE),
        model_column_count=1,
        made_at={},
    )
    times = np.arange(20.0)
    rows = _Rows(np.repeat(["one", "other"], 20), np.tile(times, 2), np.zeros(n))
    return _scanned(system, rows, np.arange(n) < 20, 0, times, 4)


def test_what_one_window_shows_is_an_event_and_no_other_value_from_then_on():
    """A shaft that accelerates once, while it breaks away, shows its inertia in that window."""
    once = np.where(np.arange(20) == 5, 1.0, 0.01)
    assert scanned(once, 50.0 * (np.arange(20) == 5)) is None
    found_change = scanned(np.ones(20), 50.0 * (np.arange(20) >= 5))
    assert found_change is not None
    assert found_change[0] == 4


def test_windows_that_hardly_show_a_constant_do_not_count_as_many():
    """An event in a window that shows next to nothing, before all those that do: what one side
    knows is summed from its own end, since as a difference of two sums its square rounds to nothing
    and it would count as infinitely many windows.
    """
    shown = np.repeat([1e-8, 1e-5, 1.0], [3, 1, 16])
    change = scanned(shown, 4.0 * (np.arange(20) == 3))
    assert change is not None
    assert change[0] >= 7, "four windows that show it are no earlier than the eighth"
