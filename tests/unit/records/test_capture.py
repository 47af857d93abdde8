"""Columns of several clocks put on one."""

from __future__ import annotations

import numpy as np
import polars as pl

from pipeline.records.capture import Capture, CaptureMeta, Mask


def test_a_stream_of_which_every_row_is_set_aside_is_missing() -> None:
    """Its column is blank on the other clock, as a value beyond its span is."""
    fast = pl.DataFrame({"t_s": np.arange(6.0), "iq_a": np.ones(6)})
    slow = pl.DataFrame({"t_s": [0.0, 5.0], "temp_winding_degc": [20.0, 21.0]})
    aside = Mask("gate", 1, np.zeros(2, dtype=bool))
    capture = Capture("c", "0" * 64, "verified", CaptureMeta("m", "drive"), (fast, slow), (aside,))
    data = capture.arrays("iq_a", "temp_winding_degc")
    assert np.isnan(data["temp_winding_degc"]).all()
    assert data["iq_a"].size == 6
