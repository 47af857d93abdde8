"""Coast-downs written out in closed form: what comes before them, and which sensor sees them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.estimation.estimators.spin_down import ESTIMATOR, Motion, _coasts
from pipeline.estimation.mechanical.shaft_rows import shaft_rows
from pipeline.numerics.coasting import coast_down, coasting_rows
from pipeline.numerics.least_squares import central_jacobian
from pipeline.records.capture import Capture
from pipeline.records.constants import Constants
from pipeline.simulator.bench import CAMPAIGN, campaign
from pipeline.simulator.design import EXACT, Bench
from tests.simulated import campaign_of, design
from tests.unit.estimation.signals import capture, estimates

COULOMB_RAD_S2, VISCOUS_1_S = 20.0, 0.5


def coast(held_s: float, *, angle: bool) -> Capture:
    """From 100 rad/s to rest after `held_s` at that speed; dw/dt = -20 - 0.5 w."""
    rng = np.random.default_rng(2)
    t = np.arange(0.0, 6.0 + held_s, 1e-3)
    free = np.maximum(t - held_s, 0.0)
    theta, omega = coast_down(free, 100.0, lambda w: COULOMB_RAD_S2 + VISCOUS_1_S * w)
    theta = theta + 100.0 * np.minimum(t, held_s)
    columns = {"t_s": t, "omega_mech_rad_s": omega + 0.05 * rng.standard_normal(t.size)}
    if angle:
        columns["theta_mech_rad"] = theta + 1e-4 * rng.standard_normal(t.size)
    return capture("spin_down", **columns)


@pytest.mark.parametrize("held_s", [0.0, 1.0])
@pytest.mark.parametrize("angle", [True, False])
def test_the_coast_alone_counts_by_encoder_or_tachometer(held_s: float, angle: bool) -> None:
    """A zero error of the tachometer would be T_c/B in disguise: it is not fitted."""
    found = estimates(ESTIMATOR, coast(held_s, angle=angle))
    truths = {"coast_coulomb_rad_s2": COULOMB_RAD_S2, "coast_viscous_1_s": VISCOUS_1_S}
    for name, truth in truths.items():
        assert abs(found[name].number - truth) < 4.0 * found[name].u
        assert found[name].u < 2e-3 * truth


def test_a_shaft_that_is_held_shows_no_drag_to_the_inertia() -> None:
    """Every row that is left obeys the coast's own law; those of a second at speed are dropped."""
    rows = shaft_rows((coast(1.0, angle=True),), {})
    whole = shaft_rows((coast(0.0, angle=True),), {})
    assert rows is not None
    assert whole is not None
    law = -COULOMB_RAD_S2 - VISCOUS_1_S * rows.speed_rad_s
    assert rows.acceleration_rad_s2 == pytest.approx(law, rel=0.01)
    assert rows.dropped > whole.dropped


def test_every_coast_of_a_record_begins_where_its_speed_is_last_the_highest() -> None:
    """Up, held, down to rest; then the other way round; then too slow to be a coast."""
    up, held = np.linspace(0.0, 1.0, 101), np.ones(50)
    once = np.concatenate([up, held, up[::-1], np.zeros(10)])
    found = coasting_rows(np.concatenate([80.0 * once, -100.0 * once, 3.0 * once]))
    assert found == [(slice(151, 251), 1), (slice(413, 513), -1)]
    assert coasting_rows(np.zeros(9)) == []


def test_derivatives_are_those_of_what_is_predicted() -> None:
    """Two coasts, shared drag with a bump, own starts and ripples: each column by differences."""
    coasts = [one for held in (0.0, 1.0) for one in _coasts(coast(held, angle=True))]
    motion = Motion(("stribeck gauss 0.008",), ("cos", "sin 2"), 100.0)
    parameters = np.array([20.0, 0.5, 3.0, 0.1, 99.0, 0.02, 0.01, -0.2, 101.0, 0.03, -0.01])

    def predict(values: np.ndarray) -> np.ndarray:
        return np.concatenate([motion.predict(i, one, values) for i, one in enumerate(coasts)])

    width = np.array([1e-3, 1e-5, 1e-3, *[1e-3, 1e-3, 1e-3, 1e-3] * 2])
    found = motion.jacobian(coasts, parameters, width)
    assert found == pytest.approx(central_jacobian(predict, parameters, width), abs=1e-7)


@pytest.mark.parametrize(
    ("name", "bits"), [pytest.param("joint-11p", 11, marks=pytest.mark.slow), ("servo-15kw", 10)]
)
def test_friction_of_another_form_below_the_resolution_of_the_encoder(name: str, bits: int) -> None:
    """Stribeck's excess left less than a step of the encoder and moved B/J by 0.3 to 1 % at 6 u."""
    motor = replace(design(name), effects={}).having(stribeck=None)
    coasts = tuple(step for step in CAMPAIGN if step[1] == "spin_down")
    bench = Bench(instruments=EXACT, encoder_bits=bits)
    captures = campaign_of(campaign(motor, bench, 1, coasts))
    found = ESTIMATOR.fit(captures, Constants(), ESTIMATOR.options).estimates
    truths = {
        "coast_coulomb_rad_s2": motor.torque_coulomb_nm / motor.j_rotor_kgm2,
        "coast_viscous_1_s": motor.b_visc_nm_s_rad / motor.j_rotor_kgm2,
    }
    for one in found:
        assert one.number == pytest.approx(truths[one.name], rel=5e-4)
        assert abs(one.number - truths[one.name]) < 3.0 * one.u


@pytest.mark.parametrize("apart", [0.0, 0.35])
def test_each_sense_may_have_a_drag_of_its_own(apart: float) -> None:
    """The mean of both is the odd part; with one drag for both u was forty times the value."""
    rng = np.random.default_rng(4)
    captures = []
    for sense in (1, -1):
        dry, viscous = 213.0 * (1.0 + sense * apart), 0.187 * (1.0 + sense * apart)
        t_s = np.arange(0.0, 1200.0 / dry, 1e-3)
        travel, _ = coast_down(t_s, 1200.0, lambda w, d=dry, v=viscous: d + v * w)
        theta = sense * travel + 1e-4 * rng.standard_normal(t_s.size)
        captures.append(capture("spin_down", f"coast_{sense}", t_s=t_s, theta_mech_rad=theta))
    found = estimates(ESTIMATOR, *captures)
    for name, value in (("coast_coulomb_rad_s2", 213.0), ("coast_viscous_1_s", 0.187)):
        assert found[name].number == pytest.approx(value, rel=1e-3)
        assert found[name].u < 1e-2 * value
        assert ("no one drag" in found[name].note) is (apart > 0.0)


def test_a_coast_of_a_rounded_speed_has_the_law_that_it_has() -> None:
    """Thirty rows of whole revolutions a minute gave nothing, and longer ones 'another form'."""
    step = 2.0 * np.pi / 60.0
    t = np.arange(0.0, 12.0, 0.4)
    speed = (40.0 + 50.0) * np.exp(-t / 20.0) - 50.0
    row = capture("spin_down", t_s=t, omega_mech_rad_s=step * np.rint(speed / step))
    found = estimates(ESTIMATOR, row)
    for name, true in (("coast_coulomb_rad_s2", 2.5), ("coast_viscous_1_s", 0.05)):
        assert found[name].known, found[name].note
        assert abs(found[name].number - true) < 3.0 * found[name].u
        assert found[name].u < 0.1 * true
    assert "another form" not in found["coast_coulomb_rad_s2"].note


def test_a_pendulum_that_swings_out_is_no_coast() -> None:
    """Each swing passed for one, of fewer rows than a coast of a shaft has."""
    t = np.arange(0.0, 20.0, 0.05)
    swing = 1.2 * np.exp(-t / 15.0) * np.cos(2.0 * np.pi * 0.3 * t)
    found = estimates(ESTIMATOR, capture("spin_down", t_s=t, theta_mech_rad=swing))
    assert not any(one.known for one in found.values())
