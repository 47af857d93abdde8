"""A spin of which each probe of the scope has a zero of its own."""

from __future__ import annotations

from dataclasses import replace

import polars as pl

import pipeline

SHARES = {"vab_v": 0.01, "vbc_v": -0.02}
"""Zero of each probe over the largest voltage."""


def spins():
    """Two spins, each voltage off zero by its share."""
    whole = pipeline.simulate("gimbal-5208", [], seed=5)
    (campaign,) = whole.only(tests=("open_circuit",)).campaigns.values()

    def off(table: pl.DataFrame) -> pl.DataFrame:
        zeros = [
            pl.col(name) + share * pl.col(name).max()
            for name, share in SHARES.items()
            if name in table.columns
        ]
        return table.with_columns(zeros)

    captures = tuple(replace(one, tables=tuple(map(off, one.tables))) for one in campaign.captures)
    return pipeline.Recordings({campaign.motor_id: replace(campaign, captures=captures)})


def test_zeros_of_probes_are_no_effect_of_a_sound_motor():
    """They were waves of the electrical angle in the rotor's frame, and the motor unknown."""
    (found,) = pipeline.diagnose(spins()).motors.values()
    assert found.missing == ()
    assert found.verdict != "unknown"
