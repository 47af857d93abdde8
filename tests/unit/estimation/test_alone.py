"""What a capture says by itself: its scatter, its way, and what an inverter leaves unknown."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.stats import t as student

from pipeline.estimation import alone, registry
from pipeline.estimation.electrical.step_budget import LD as LD_PLACE
from pipeline.estimation.electrical.step_budget import LQ as LQ_PLACE
from pipeline.estimation.electrical.step_budget import birge_ratio
from pipeline.estimation.estimators import current_step
from pipeline.estimation.protocol import Estimator, Fit
from pipeline.records.capture import Campaign
from pipeline.records.constants import Constants
from pipeline.records.estimate import Estimate
from pipeline.records.uncertainty import COVERAGE, Contribution, type_b
from tests.unit.estimation.mechanical import recorded
from tests.unit.estimation.signals import capture
from tests.unit.estimation.test_steps_on_a_scope import LD, LQ, on_a_scope

N = 1000
T = np.arange(N) * 1e-3


def test_scatter_is_the_captures_own_and_few_degrees_of_freedom_widen_it() -> None:
    """Four degrees of freedom widen it as they do the interval; gains keep their names."""
    budget = (Contribution("scatter:x", 0.3, "A", 4.0), *type_b("voltage@s", 0.2))
    scatter, gain = alone._own_scatter(budget, 1.0 / 1.5, "a.csv")
    wider = student.ppf(0.5 + COVERAGE / 2.0, 4.0) / student.ppf(0.5 + COVERAGE / 2.0, 1e9)
    assert (scatter.source, gain.source) == ("scatter:x#a.csv", "voltage@s")
    assert scatter.u == pytest.approx(0.2 * wider, rel=1e-6)
    assert gain.u == pytest.approx(0.2 / 1.5, rel=1e-6)
    assert scatter.dof == gain.dof == math.inf


def of_voltage(name: str, value: float, unit: str, source: str = "voltage_commanded@s") -> Estimate:
    return Estimate(name, value, unit, "measured", "x", type_b(source, 1e-3))


def test_an_inverter_s_unknown_voltage_over_what_the_constant_makes_up() -> None:
    """The link's share of a resistance goes by current, of a back-EMF constant by speed."""
    drive = capture(
        "drive",
        t_s=T,
        vq_v=np.full(N, 6.0),
        vdc_v=np.full(N, 24.0),
        iq_a=np.full(N, -4.0),
        theta_mech_rad=-50.0 * T,
    )
    ohm, ke = of_voltage("r_phase_ohm", 0.5, "ohm"), of_voltage("ke", 0.1, "V·s/rad")
    by_current, by_speed = alone._inverter(drive, ohm), alone._inverter(drive, ke)
    assert by_current > 0.0
    assert by_speed / by_current == pytest.approx((0.5 * 4.0) / (0.1 * 50.0), rel=1e-3)
    bare = capture("drive", t_s=T, vq_v=np.full(N, 6.0), iq_a=np.full(N, -4.0))
    less = alone._inverter(bare, ohm) / by_current
    assert less == pytest.approx(math.sqrt(3.0) * 6.0 / 24.0, rel=1e-9)
    assert alone._inverter(bare, ke) == math.inf
    assert alone._inverter(bare, of_voltage("r", 0.5, "ohm", "voltage@s")) == 0.0


def test_the_fastest_of_an_angle_over_pieces_of_a_hundredth() -> None:
    """A quarter of the record at 80 rad/s, noise of the encoder a hundred times that a row."""
    angle = np.where(T < 0.75, 20.0 * T, 15.0 + 80.0 * (T - 0.75))
    jitter = 1e-2 * (-1.0) ** np.arange(N)
    log = capture("drive", t_s=T, theta_mech_rad=angle + jitter)
    assert alone._fastest_rad_s(log) == pytest.approx(80.0, rel=1e-3)
    short = capture("drive", t_s=T[:3], theta_mech_rad=angle[:3])
    assert alone._fastest_rad_s(short) == pytest.approx(20.0, rel=1e-9)


def test_captures_are_alike_by_test_pair_and_height() -> None:
    steps = [on_a_scope("d", volts, n) for n, volts in enumerate((2.4, 2.4, 12.0))]
    other = on_a_scope("q", 2.4, 7)
    alike = alone.repeated(Campaign("m", (*steps, other)))
    assert [c.path for c in alike] == [steps[0].path, steps[1].path]


def test_each_capture_by_itself_gives_what_it_determines() -> None:
    """A step on d says Ld and one on q Lq; neither says the other, and each has its own path."""
    steps = (on_a_scope("d", 12.0, 1, rate_hz=2e4), on_a_scope("q", 12.0, 2, rate_hz=2e4))
    found = {(r.path, r.quantity): r for r in alone.readings(Campaign("m", steps), steps, {})}
    inductances = {k: r for k, r in found.items() if k[1] in ("ld_h", "lq_h")}
    assert set(inductances) == {(steps[0].path, "ld_h"), (steps[1].path, "lq_h")}
    for (_, name), reading in inductances.items():
        assert reading.value == pytest.approx({"ld_h": LD, "lq_h": LQ}[name], rel=5e-3)
        assert any(part.source.endswith(f"#{reading.path}") for part in reading.budget)


def test_estimators_that_no_reading_depends_on_are_not_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """The readings are those of all estimators, to the last bit; a spin-down costs none."""
    log, tests = recorded(), ("drive", "open_circuit", "spin_down")
    captures = tuple(one for test in tests for one in log.of(test)[:1])
    ran: list[str] = []

    def counted(one: Estimator) -> Estimator:
        def fit(*given: Any) -> Fit:
            ran.append(one.name)
            return one.fit(*given)

        return replace(one, fit=fit)

    def read() -> object:
        ran.clear()
        return alone.readings(log, captures, {})

    every = tuple(map(counted, registry.estimators()))
    needed = {one.name for one in registry.estimators_of(frozenset(alone.QUANTITIES))}
    few = tuple(one for one in every if one.name in needed)
    monkeypatch.setattr(registry, "estimators_of", lambda _: every)
    of_all, ran_of_all = read(), set(ran)
    monkeypatch.setattr(registry, "estimators_of", lambda _: few)
    assert read() == of_all != ()
    assert {"spin_down", "inertia"} <= ran_of_all
    assert set(ran) == ran_of_all & needed
    assert not {"spin_down", "inertia"} & needed


def test_readings_run_what_they_need_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """A kt is held against that of the EMF, which is therefore fitted as well."""
    asked: list[frozenset[str]] = []
    monkeypatch.setattr(registry, "estimators_of", lambda names: asked.append(names) or ())
    steps = (on_a_scope("d", 12.0, 1),)
    assert alone.readings(Campaign("m", steps), steps, {}) == ()
    assert asked == [frozenset(alone.QUANTITIES)]
    monkeypatch.undo()
    given = {name for one in registry.estimators_of(asked[0]) for name in one.gives}
    assert given >= {*alone.QUANTITIES, "kt_from_ke_nm_a"}


def test_the_plot_of_steps_shows_the_inductance_between_the_terminals() -> None:
    """Twice the axis' own, in henry, whatever the fit of it: by the integrated form."""
    steps = [on_a_scope("d", volts, n, rate_hz=2e4) for n, volts in enumerate((2.4, 12.0))]
    fit = current_step.ESTIMATOR.fit(
        Campaign("m", tuple(steps)), Constants(), current_step.ESTIMATOR.options
    )
    plot = next(e for e in fit.evidence if "largest current" in e.title)
    for series in plot.series:
        assert series.measured == pytest.approx(2.0 * LD, rel=0.02)


def test_one_step_an_axis_cannot_disagree() -> None:
    free = np.ones(2 + max(LD_PLACE, LQ_PLACE), dtype=bool)
    few = SimpleNamespace(free=free, model=SimpleNamespace(records=(1, 2)), fit=None)
    assert birge_ratio(few) == 1.0  # type: ignore[arg-type]
