"""An encoder off its centre beside an inductance that is many times too large."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.criticism.library.registry import effects
from pipeline.criticism.regression.fit import Fit
from pipeline.criticism.regression.goodness import significant_groups
from pipeline.criticism.selection import starts
from pipeline.criticism.selection.candidates import candidates, widened
from pipeline.criticism.selection.score_test import Score, score_all
from pipeline.criticism.selection.starts import _round_rotor, with_round_rotor_start
from tests.unit.criticism.machines import BASE, fitted, in_frame_of, log

NAME = "angle_eccentricity"
LIBRARY = {name: effects()[name] for name in (NAME, "current_offset")}


def eccentric(size_rad: float, seed: int):
    """The log of an encoder that shows θ + ε sin θ."""
    plain = log(noise=1.0, seed=seed)
    theta = plain.recorded["theta_mech_rad"]
    recorded = in_frame_of(theta + size_rad * np.sin(theta), plain.recorded)
    return replace(plain, capture=f"log_{seed}", recorded=recorded)


def scores_at(fit: Fit) -> tuple[Score, Score]:
    """Those of the eccentricity by the tangent, and by the start from a round rotor."""
    offered = candidates(LIBRARY, fit.model)
    wide = widened(fit, offered)
    significant = significant_groups(wide)
    tangents = score_all(wide, offered, significant)
    started = with_round_rotor_start(wide, offered, tangents, significant)
    first, then = (
        next(s for s in scores if s.candidate.effect.name == NAME) for scores in (tangents, started)
    )
    return first, then


def bent(size_rad: float) -> Fit:
    """A fit of two such logs that has ended at an L_d of forty times the true one."""
    fit = fitted([eccentric(size_rad, seed) for seed in (5, 6)])
    return replace(fit, values={**fit.values, "ld_h": 40.0 * BASE["ld_h"]})


@pytest.mark.parametrize("size_rad", [0.004, pytest.param(0.02, marks=pytest.mark.slow)])
def test_an_error_of_the_angle_is_found_from_a_round_rotor(size_rad):
    tangent, started = scores_at(bent(size_rad))
    assert not tangent.passes
    assert started.passes
    assert started.step[f"{NAME}.sine_rad"] == pytest.approx(size_rad, rel=0.03)
    assert started.moves["ld_h"] == pytest.approx(-39.0 * BASE["ld_h"], rel=0.01)
    assert started.fall > tangent.fall + 100.0


def test_a_start_has_no_error_and_the_smaller_inductance_twice():
    fit = bent(0.004)
    offered = candidates(LIBRARY, fit.model)
    begun = _round_rotor(fit, next(c for c in offered if c.effect.name == NAME))
    assert begun.values["ld_h"] == begun.values["lq_h"] == fit.values["lq_h"]
    assert begun.model.effects[-1].name == NAME
    assert all(v == 0.0 for name, v in begun.values.items() if name.startswith(NAME))


def test_a_tangent_that_passes_is_believed():
    tangent, started = scores_at(fitted([eccentric(0.004, seed) for seed in (5, 6)]))
    assert tangent.passes
    assert started is tangent


def test_nothing_is_tried_where_all_is_explained(monkeypatch):
    monkeypatch.setattr(starts, "gauss_newton", None)
    tangent, started = scores_at(fitted([eccentric(0.0, seed) for seed in (5, 6)]))
    assert not tangent.passes
    assert started is tangent


def test_nothing_is_tried_where_another_capture_tells_the_inductances(monkeypatch):
    fit = bent(0.004)
    other = fit.segments[1]
    monkeypatch.setattr(starts, "observes", lambda segment, _: segment is not other)
    monkeypatch.setattr(starts, "gauss_newton", None)
    tangent, started = scores_at(fit)
    assert started is tangent
