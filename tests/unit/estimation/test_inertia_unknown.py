"""An inertia that the drive's torque does not tell."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from pipeline.estimation.estimators import inertia
from pipeline.estimation.registry import fit_all
from pipeline.records.capture import Campaign
from pipeline.records.constants import Constants
from pipeline.simulator.bench import CAMPAIGN, campaign
from pipeline.simulator.design import Bench
from tests.simulated import campaign_of, design
from tests.unit.estimation.signals import known_value

MECHANICAL = ("resistance", "open_circuit", "torque_map", "spin_down", "drive")


def test_an_inertia_of_no_known_size_takes_the_friction_with_it() -> None:
    """A current that has nothing to do with the motion: J, T_c and B are not identifiable."""
    plan = tuple(step for step in CAMPAIGN if step[1] in MECHANICAL)
    found = campaign_of(campaign(design("gimbal-5208"), Bench(), 1, plan))
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


@pytest.mark.parametrize(("u", "known"), [(0.45, True), (0.6, False)])
def test_friction_goes_with_an_inertia_that_its_interval_leaves_open(u: float, known: bool) -> None:
    """1 ± 0.6 kg·m² is published by nobody, and so is no friction that it scales."""
    made = tuple(
        inertia.METHOD.measured(name, 1.0, [inertia.METHOD.scatter(name, u, 50.0)], ("a",))
        for name in inertia.GIVES
    )
    assert all(e.known is known for e in inertia._of_a_known_sign(made))


def test_a_torque_constant_may_be_stated_and_magnets_unlogged_are_said_to_be() -> None:
    """Drives of current and motion alone, with a torque constant and without."""
    found = campaign_of(campaign(design("gimbal-5208"), Bench(), 1))
    drives = tuple(
        replace(c, tables=tuple(t.drop("vd_v", "vq_v", "temp_magnet_degc", strict=False)
                                for t in c.tables))
        for c in found.captures if c.meta.test == "drive"
    )  # fmt: skip
    without = inertia.fit(Campaign("m", drives), Constants(()), inertia.ESTIMATOR.options)
    assert all("state kt_peak_nm_a" in e.note for e in without.estimates)
    stated = Constants((known_value("kt_peak_nm_a", 0.4), known_value("kt_reluctance_nm_a2", 0.0)))
    given = inertia.fit(Campaign("m", drives), stated, inertia.ESTIMATOR.options)
    assert all("temp_magnet_degc not logged" in e.note for e in given.estimates)
