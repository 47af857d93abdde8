"""What a fit and the records beside it answer."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from pipeline.criticism.data.segment import row_index
from pipeline.criticism.library.registry import effects
from pipeline.criticism.machine.model import Model, zero
from pipeline.criticism.regression.columns import Column
from pipeline.criticism.regression.cross_validation import HeldOut
from pipeline.criticism.regression.fit import Fit
from pipeline.criticism.regression.noise_floors import Floor, reading_error
from pipeline.criticism.regression.noise_propagation import noise_floor
from pipeline.criticism.regression.normal_equations import Prior
from tests.unit.criticism.machines import BASE, log, machine

WINDAGE = effects()["windage"]
MODEL = Model(machine(), (WINDAGE,))


def fit() -> Fit:
    return Fit((), MODEL, {**BASE, **zero(WINDAGE, MODEL)}, (), BASE)


@pytest.mark.parametrize("far", [1e9, -1e9])
def test_a_step_ends_at_a_bound(far: float) -> None:
    (parameter,) = WINDAGE.parameters_of(fit().machine)
    bound = parameter.high if far > 0.0 else parameter.low
    moved = fit().moved(
        [Column("windage.drag_nm", 1.0), Column("r_ohm", 1.0)], np.array([far, 0.1])
    )
    assert moved.values["windage.drag_nm"] == bound * machine().scale(parameter)
    assert moved.values["r_ohm"] == BASE["r_ohm"] + 0.1


def test_a_fit_without_an_effect_has_none_of_its_values() -> None:
    less = fit().without("windage")
    assert less.model.effects == ()
    assert less.values == BASE


def test_a_prior_costs_the_squared_distance_from_its_centre() -> None:
    """Of two parameters of u 0.5 and 1, at 0.5 and 3 from their centres."""
    prior = Prior(np.array([4.0, 1.0]), np.array([2.0, 3.0]), elsewhere=7.0)
    assert prior.cost() == pytest.approx(1.0 + 9.0)
    assert prior.cost(np.array([-0.5, -1.0])) == pytest.approx(0.0 + 4.0)
    assert prior.only(np.array([0])).elsewhere == pytest.approx(7.0 + 9.0)


def test_what_is_always_in_the_fit_keeps_the_fit_s_error() -> None:
    held = HeldOut(np.array([1.0, np.nan]), 1.0)
    system = SimpleNamespace(residual=np.array([5.0, 6.0]))
    assert held.or_fit(system).tolist() == [1.0, 6.0]  # type: ignore[arg-type]


def test_a_tolerance_of_form_joins_the_scale_and_not_the_noise() -> None:
    segment, plain = log(), Model(machine(), ())
    sigma = noise_floor(segment, plain, BASE, 1)
    group, _, valid, _ = row_index(segment)
    rows = group[valid], reading_error(segment, plain, BASE)[valid]
    noise, same = Floor(sigma, BASE).noise_and_scale(*rows)
    wrong = Floor(sigma, BASE, np.full(sigma.size, 0.25))
    still, scale = wrong.noise_and_scale(*rows)
    assert np.array_equal(noise, same) and np.array_equal(noise, still)
    assert scale == pytest.approx(np.hypot(noise, 0.25))
