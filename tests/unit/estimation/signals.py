"""Captures from signals written out by hand, and what an estimator finds in them."""

from __future__ import annotations

import numpy as np
import polars as pl

from pipeline.records.capture import Campaign, Capture, CaptureMeta
from pipeline.records.constants import Constants
from pipeline.records.estimate import Estimate
from pipeline.records.uncertainty import type_b

GAINS = {"station": "s", "u_rel_voltage": 0.001, "u_rel_current": 0.002, "u_temp_degc": 0.5}


def capture(test, path="c", **meta_and_columns):
    """A capture from metadata and columns; arrays are columns."""
    columns = {k: v for k, v in meta_and_columns.items() if isinstance(v, np.ndarray)}
    meta = {k: v for k, v in meta_and_columns.items() if not isinstance(v, np.ndarray)}
    table = pl.DataFrame(columns)
    return Capture(path, "0" * 64, "verified", CaptureMeta("m", test, **GAINS | meta), (table,))


def estimates(estimator, *captures, known=None, **options):
    """What an estimator finds, by name; everything it promises is there once."""
    campaign = Campaign("m", tuple(captures))
    chosen = {**estimator.options, **options}
    fit = estimator.fit(campaign, known or Constants(), chosen)
    assert sorted(e.name for e in fit.estimates) == sorted(estimator.gives)
    return {e.name: e for e in fit.estimates}


def known_value(name, value, u=0.0, unit="1", method="elsewhere"):
    return Estimate(name, value, unit, "measured", method, type_b(f"test:{name}", u))


def near(estimate, value, times=4.0):
    """Within `times` its own type A uncertainty."""
    return abs(estimate.number - value) < times * estimate.u_a
