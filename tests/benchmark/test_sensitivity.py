"""How large an effect must be to be seen, against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.stats import norm

from pipeline.simulator.design import EXACT
from pipeline.simulator.effects import ALWAYS, FORMS
from tests.benchmark.bench import MOTORS, STEMS, recorded, station
from tests.benchmark.innovation import base_of, innovations
from tests.benchmark.sensitivity import (
    CURVED,
    HERE,
    Sensitivity,
    digest,
    loaded,
    measure,
    needed_noncentrality,
    noncentrality_of,
    saved,
)


def shipped(motor: str) -> Sensitivity:
    return loaded((HERE / f"{motor}.npz").read_bytes())[1]


def test_needed_noncentrality_is_the_sum_of_two_quantiles() -> None:
    """(z₀.₉₉₅ + z₀.₉)² but for the far tail, which has a share of 1e-10."""
    expected = (norm.ppf(0.995) + norm.ppf(0.9)) ** 2
    assert needed_noncentrality() == pytest.approx(expected, rel=1e-6)
    assert needed_noncentrality(0.5, 0.05) == pytest.approx(norm.ppf(0.975) ** 2, rel=1e-3)


def test_a_slope_beside_a_free_level() -> None:
    """λ = a² Σ(t − mean t)² for a slope in white noise of unit variance."""
    t, a = np.linspace(0.0, 3.0, 500), 0.02
    found = noncentrality_of([a * t], [np.ones((500, 1))], np.zeros(1))
    assert found == pytest.approx(a**2 * np.sum((t - t.mean()) ** 2), rel=1e-9)


def test_a_level_beside_a_gain_known_beforehand() -> None:
    """λ = a²/(σ²/n + u²): however many samples, not better than what is known of the gain."""
    n, a, u = 4000, 0.5, 0.3
    found = noncentrality_of([np.full(n, a)], [np.full((n, 1), u)], np.ones(1))
    assert found == pytest.approx(a**2 / (1.0 / n + u**2), rel=1e-9)


def test_two_captures_share_their_nuisance() -> None:
    """An offset that a free level takes in one capture shows in another that lacks the level."""
    parts, fixed = [np.ones(50), np.ones(30)], [np.ones((50, 1)), np.zeros((30, 1))]
    assert noncentrality_of(parts, fixed, np.zeros(1)) == pytest.approx(30.0)


@pytest.mark.parametrize("motor", MOTORS)
def test_torque_offset_in_two_slow_turns(motor: str) -> None:
    """Friction turns its sign with the direction and the offset does not: λ = n a²/σ²."""
    place = station(motor)
    sigma = place.bench.torque_noise_rel * place.motor.torque_rated_nm
    lsb = 2.0 ** math.floor(math.log2(8.0 * place.motor.torque_rated_nm / 2.0**16))
    keep = ("cogging_cw", "cogging_ccw")
    made = recorded(place.motor, place.quiet, place.plan, 1, keep)
    n = sum(r.tables[0]["t_s"].size for r in made)
    size = 0.01 * place.motor.torque_rated_nm
    found = shipped(motor).noncentrality("torque_offset", size, keep)
    assert found == pytest.approx(n * size**2 / (sigma**2 + lsb**2 / 12.0), rel=2e-3)


@pytest.mark.parametrize("motor", MOTORS)
def test_shipped_sensitivities_are_of_this_programme(motor: str) -> None:
    stamp, found = loaded((HERE / f"{motor}.npz").read_bytes())
    assert stamp == digest(motor)
    assert found.stems == STEMS
    assert set(found.effects) == set(FORMS)
    for effect in FORMS:
        if effect in CURVED:
            continue
        model = "ideal" if effect in ALWAYS else "standard"
        at_star = found.noncentrality(effect, found.a_star[effect], model=model)
        assert at_star == pytest.approx(needed_noncentrality(), rel=1e-3)


@pytest.mark.parametrize("motor", MOTORS)
def test_three_gains_are_one_tie_whatever_their_size(motor: str) -> None:
    """Drive logs alone have no second reading of a voltage, a current or a torque."""
    gains = ("voltage_scale", "current_scale", "torque_scale")
    for one in gains:
        others = set(gains) - {one}
        assert set(shipped(motor).rivals(one, 0.02, ("drive_0", "drive_1"))) == others


def test_what_no_supplied_test_excites_leaves_no_trace() -> None:
    found = shipped("gimbal-5208")
    still = ("resistance_ab", "current_step_q_2", "lcr", "heat_run_0")
    for effect in ("angle_offset", "torque_scale", "windage", "bemf_harmonics", "sample_delay"):
        assert found.noncentrality(effect, 10.0 * found.unit[effect], still) < 1e-6 * 14.88


def test_ties_known_from_theory() -> None:
    """One torque map cannot tell a volt from a newton metre; a slow turn parts nothing of it."""
    found = shipped("gimbal-5208")
    (size,) = (0.02,)
    assert "torque_scale" in found.rivals("voltage_scale", size, ("torque_map_0",))
    assert "iron_hysteresis" in found.rivals(
        "iron_eddy", found.unit["iron_eddy"] * 100.0, ("torque_map_0",)
    )
    assert found.rivals("voltage_scale", size) == ()


@pytest.mark.parametrize("motor", MOTORS)
def test_noise_of_a_plain_motor_is_white_with_unit_variance(motor: str) -> None:
    """Noise-free recordings say nothing, noisy ones have variance one, capture by capture."""
    from dataclasses import replace

    place = station(motor)
    base = base_of(place.motor)
    exact = replace(place.bench, instruments=EXACT)
    quiet = recorded(place.motor, place.quiet, place.plan, 5)
    noisy = recorded(place.motor, exact, place.plan, 5)
    for one, two in zip(quiet, noisy, strict=True):
        first = next(iter(one.tables[0]))
        rows = min(one.tables[0][first].size, two.tables[0][first].size)
        told = innovations(one, place.motor, place.bench, base, rows)
        left = innovations(two, place.motor, place.bench, base, rows) - told
        spread = float(np.std(left))
        loose = 6.0 / math.sqrt(left.size)
        assert 0.75 - loose < spread < 1.25 + loose, one.stem


def test_saved_and_loaded_are_one() -> None:
    found = shipped("servo-ipm")
    stamp, again = loaded(saved(found))
    assert stamp == digest("servo-ipm")
    assert again.a_star == found.a_star
    np.testing.assert_array_equal(again.gram, found.gram)


@pytest.mark.slow
def test_shipped_is_what_measuring_gives() -> None:
    """Half a minute: every effect of one motor simulated anew."""
    old, new = shipped("joint-11p"), measure("joint-11p")
    for effect in FORMS:
        assert new.a_star[effect] == pytest.approx(old.a_star[effect], rel=1e-2)
