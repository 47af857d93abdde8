"""An inertia that the drive's torque does not tell."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import polars as pl

from pipeline.estimation.estimators import inertia
from pipeline.estimation.registry import fit_all
from pipeline.records.capture import Campaign
from pipeline.simulator.bench import campaign
from pipeline.simulator.design import Bench
from tests.simulated import campaign_of, design


def test_an_inertia_of_no_known_size_takes_the_friction_with_it() -> None:
    """A current that has nothing to do with the motion: J, T_c and B are not identifiable."""
    found = campaign_of(campaign(design("gimbal-5208"), Bench(), 1))
    rng = np.random.default_rng(5)
    captures = []
    for one in found.captures:
        table, *rest = one.tables
        noise = pl.Series("iq_a", rng.normal(0.0, 1.0, table.height))
        strange = (table.with_columns(noise), *rest)
        captures.append(replace(one, tables=strange) if one.meta.test == "drive" else one)
    constants = fit_all(Campaign("m", tuple(captures)), {})[0]
    for name in inertia.GIVES:
        (own,) = (e for e in constants.all_of(name) if e.method == inertia.METHOD.name)
        assert own.status == "not_identifiable", (name, own.u)
        assert "does not follow the torque" in own.note
    assert constants.best("tau_mech_s") is None
