"""A fit that was kept is the fit that was made, in every field."""

from __future__ import annotations

from dataclasses import fields

import numpy as np

from pipeline.estimation.protocol import Fit
from pipeline.execution.caches.fits import _decoded, _encoded
from pipeline.records.estimate import Estimate, Order
from pipeline.records.evidence import Evidence, Series
from pipeline.records.uncertainty import type_b

ESTIMATE = Estimate(
    name="cogging_amplitude_nm",
    value=np.float64(0.006),
    unit="N·m",
    status="measured",
    method="cogging",
    budget=type_b("torque@bench", 1e-5),
    at={"temp_magnet_degc": 25.0},
    captures=("a.mcap", "b.csv"),
    note="60 of 7 orders",
    bounds=(0.0, 1.0),
    at_bound=True,
    orders=(Order(60, 0.006, 1e-5, 0.7),),
    impossible=True,
    settled=True,
)
X = np.linspace(0.0, 1.0, 5)


def test_every_field_of_an_estimate_comes_back():
    blank = Estimate("cogging_amplitude_nm", 1.0, "N·m", "measured", "cogging")
    told = [f.name for f in fields(Estimate) if getattr(ESTIMATE, f.name) != getattr(blank, f.name)]
    same = {"name", "unit", "status", "method"}
    assert set(told) | same == {f.name for f in fields(Estimate)}, "the example sets all of them"
    evidence = Evidence("cogging", "t", "t_s", "vq_v", "line", (Series("s", X, 2 * X, 3 * X),), "a")
    found = _decoded(*_encoded(Fit((ESTIMATE,), (evidence,))))
    assert found.estimates == (ESTIMATE,)
    assert type(found.estimates[0].orders[0]) is Order
    (back,) = found.evidence
    assert (back.estimator, back.capture, back.series[0].label) == ("cogging", "a", "s")
    assert np.array_equal(back.series[0].fitted, 3 * X)
