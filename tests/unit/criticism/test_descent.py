"""Where fits begin again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.criticism.descent import first_fit, gauss_newton, rough_anew
from pipeline.criticism.model import Model
from pipeline.criticism.registry import effects
from pipeline.criticism.selection import _floored_anew
from pipeline.criticism.system import Fitted, floors, system
from tests.unit.criticism.machines import BASE, log, machine

STRIBECK = Model(machine(), (effects()["stribeck"],))


def astray(segments) -> Fitted:
    """A fit with a thousandth of the inertia, and floors as they are with that."""
    values = {
        **BASE,
        "j_kgm2": 1e-3 * BASE["j_kgm2"],
        "stribeck.excess_nm": 0.5,
        "stribeck.speed_rad_s": 9.0,
        "stribeck.exponent": 2.0,
        "stribeck.tail": 0.0,
    }
    return Fitted(STRIBECK, values, floors(segments, STRIBECK, values), values)


def test_a_fit_begun_anew_forgets_its_constants_and_keeps_its_shapes(monkeypatch):
    segments = tuple(log(seed=n, noise=1.0) for n in (1, 2))
    lost = replace(astray(segments), tolerance=tuple(np.full(12, 1e-3) for _ in segments))
    begun = []

    def watched(found, start, *more, **other):
        begun.append(start.values)
        return gauss_newton(found, start, *more, **other)

    monkeypatch.setattr("pipeline.criticism.descent.gauss_newton", watched)
    fitted, around = first_fit(segments, rough_anew(segments, lost))
    assert begun[0]["stribeck.speed_rad_s"] == 9.0
    assert begun[0]["stribeck.excess_nm"] == 0.0
    assert begun[0]["j_kgm2"] != lost.values["j_kgm2"]
    assert fitted.values["j_kgm2"] == pytest.approx(BASE["j_kgm2"], rel=0.02)
    assert fitted.tolerance is lost.tolerance
    assert around.around.sigma is fitted.sigma


def test_whichever_end_is_better_stays(monkeypatch):
    segments = tuple(log(seed=n, noise=1.0) for n in (1, 2))
    lost = astray(segments)
    monkeypatch.setattr(
        "pipeline.criticism.selection.gauss_newton",
        lambda found, start: (
            start,
            system(found, start),
        ),
    )
    found = _floored_anew(segments, lost)
    assert found.values["j_kgm2"] == pytest.approx(BASE["j_kgm2"], rel=0.02)
    assert _floored_anew(segments, found).values is found.values


@pytest.mark.parametrize(("share", "times"), [(1e-3, 1), (0.7, 0), (3.0, 1)])
def test_a_fit_is_begun_anew_only_from_another_inertia(monkeypatch, share, times):
    """What is left over the floor may be no fault of the fit: two seconds a rung for nothing."""
    segments = tuple(log(seed=n, noise=1.0) for n in (1, 2))
    values = {**astray(segments).values, "j_kgm2": share * BASE["j_kgm2"]}
    lost = Fitted(STRIBECK, values, floors(segments, STRIBECK, values), values)
    begun = []
    monkeypatch.setattr(
        "pipeline.criticism.selection.first_fit",
        lambda found, near: begun.append(near) or first_fit(found, near),
    )
    monkeypatch.setattr(
        "pipeline.criticism.selection.gauss_newton",
        lambda found, start: (start, system(found, start)),
    )
    _floored_anew(segments, lost)
    assert len(begun) == times
