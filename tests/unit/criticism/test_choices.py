"""Choices that were made while another effect was missing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.criticism.library.registry import effects
from pipeline.criticism.machine.model import Model, zero
from pipeline.criticism.regression.fit import Fit, floors
from pipeline.criticism.regression.gauss_newton import gauss_newton
from pipeline.criticism.residuals.residual import residual
from pipeline.criticism.selection.choices import reconsidered
from tests.unit.criticism.machines import BASE, log, machine

WAVES = effects()["bemf_harmonics"]
MODEL = Model(machine(), (WAVES,))
TRUE = {
    **BASE,
    **zero(WAVES, MODEL),
    "bemf_harmonics.q6_sin": 0.02,
    "bemf_harmonics.ripple_share": 1.0,
}


def rippling(seed: int):
    """A log whose torque has all of the ripple of a back-EMF's sixth order, its voltage too."""
    segment = log(seed=seed, noise=1.0)
    more = residual(segment, Model(machine(), ()), BASE) - residual(segment, MODEL, TRUE)
    added = dict(zip(segment.channels, more, strict=True))
    return replace(
        segment,
        recorded={n: column + added.get(n, 0.0) for n, column in segment.recorded.items()},
    )


@pytest.mark.parametrize(("chosen", "moved"), [(0.0, True), (1.0, False)])
def test_a_choice_that_no_longer_holds_is_made_again(chosen, moved):
    segments = (rippling(1), rippling(2))
    start = {**TRUE, "bemf_harmonics.ripple_share": chosen}
    ended = gauss_newton(Fit(segments, MODEL, start, floors(segments, MODEL, start), start))
    system = reconsidered(ended)
    assert system.fit.values["bemf_harmonics.ripple_share"] == 1.0
    assert (system.deviance < ended.deviance - 12.0) is moved
    assert (system is ended) is not moved


def test_choices_are_left_where_nothing_is_left_over_the_floor(monkeypatch):
    segments = (rippling(1), rippling(2))
    loud = tuple(np.full_like(sigma, 1e3) for sigma in floors(segments, MODEL, TRUE))
    start = {**TRUE, "bemf_harmonics.ripple_share": 0.0}
    ended = gauss_newton(Fit(segments, MODEL, start, loud, start))
    monkeypatch.setattr("pipeline.criticism.selection.choices.gauss_newton", None)
    assert reconsidered(ended) is ended


def test_a_choice_that_falls_far_short_to_first_order_is_not_fitted(monkeypatch):
    segments = (rippling(1), rippling(2))
    ended = gauss_newton(Fit(segments, MODEL, TRUE, floors(segments, MODEL, TRUE), TRUE))
    over = np.ones(len(ended.labels), dtype=bool)
    monkeypatch.setattr("pipeline.criticism.selection.choices.significant_groups", lambda _: over)
    monkeypatch.setattr("pipeline.criticism.selection.choices.gauss_newton", None)
    assert reconsidered(ended) is ended
