"""What the registry lets an estimator say."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pipeline.estimation import registry
from pipeline.estimation.protocol import Estimator, Fit
from pipeline.io.storage.publish import canonical_json
from pipeline.records.capture import Campaign
from pipeline.records.estimate import Estimate
from pipeline.records.uncertainty import type_a
from tests.unit.estimation.signals import capture

SOUND = Estimate("ld_h", 2e-4, "H", "measured", "made_up", type_a("s", 1e-6), captures=("a.csv",))


@pytest.mark.parametrize(
    "odd",
    [
        replace(SOUND, budget=type_a("s", math.nan)),
        replace(SOUND, budget=type_a("s", math.inf)),
        replace(SOUND, budget=type_a("s", 1e200)),
        replace(SOUND, bounds=(0.0, math.inf)),
        replace(SOUND, at={"current_a": math.nan}),
    ],
)
def test_no_estimate_with_a_number_that_is_not_finite_passes(
    monkeypatch: pytest.MonkeyPatch, odd: Estimate
) -> None:
    """It is not identifiable and says why: a document holds no NaN and no infinity."""
    made_up = Estimator("made_up", ("ld_h",), ("drive",), "", lambda *_: Fit((odd,)))
    monkeypatch.setattr(registry, "estimators", lambda: (made_up,))
    campaign = Campaign("m", (capture("drive", "a", t_s=np.arange(3.0)),))
    (estimate,) = registry.fit_all(campaign, {})[0].estimates
    assert (estimate.status, "a.csv" in estimate.note) == ("not_identifiable", True)
    assert canonical_json(estimate.document())


@pytest.mark.parametrize(
    ("name", "value", "u", "status"),
    [
        ("j_rotor_kgm2", 4.8e-3, 1.1e-2, "not_identifiable"),
        ("r_phase_ohm", 0.3, 0.3, "not_identifiable"),
        ("r_phase_ohm", 0.3, 0.15, "measured"),
        ("torque_coulomb_nm", 1e-5, 2e-5, "measured"),
        ("b_visc_nm_s_rad", 1e-6, 2e-6, "measured"),
        ("resistance_imbalance", 1e-5, 1e-4, "measured"),
    ],
)
def test_what_no_motor_is_without_has_a_size(
    name: str, value: float, u: float, status: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An inertia of which u is as large as the value is not told; a small friction is."""
    made = Estimate(name, value, "1", "measured", "made_up", type_a("s", u), captures=("a.csv",))
    made_up = Estimator("made_up", (name,), ("drive",), "", lambda *_: Fit((made,)))
    monkeypatch.setattr(registry, "estimators", lambda: (made_up,))
    campaign = Campaign("m", (capture("drive", "a", t_s=np.arange(3.0)),))
    (found,) = registry.fit_all(campaign, {})[0].estimates
    assert found.status == status


@pytest.mark.parametrize(("rank", "published"), [(0, "sure"), (1, "rough"), (-1, "sure")])
def test_of_equal_rank_the_surer_method_is_published(
    rank: int, published: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two methods that agree, the rough one of rank 0 and the first to be fitted."""
    sizes = {"rough": (0, 4e-6), "sure": (rank, 1e-6)}
    made = {
        name: replace(SOUND, method=name, budget=type_a(name, u)) for name, (_, u) in sizes.items()
    }
    both = tuple(
        Estimator(name, ("ld_h",), ("drive",), "", lambda *_, e=made[name]: Fit((e,)), rank=place)
        for name, (place, _) in sizes.items()
    )
    monkeypatch.setattr(registry, "estimators", lambda: both)
    campaign = Campaign("m", (capture("drive", "a", t_s=np.arange(3.0)),))
    best = registry.fit_all(campaign, {})[0].best("ld_h")
    assert best is not None
    assert best.method == published
