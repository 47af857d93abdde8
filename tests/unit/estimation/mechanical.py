"""Mechanical tests of simulated motors by exact instruments, and what estimators find in them."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import polars as pl

from pipeline.estimation.protocol import Estimator, Fit
from pipeline.records.capture import Campaign
from pipeline.records.constants import Constants
from pipeline.simulator.bench import CAMPAIGN, campaign
from pipeline.simulator.catalogue import with_effects
from pipeline.simulator.design import EXACT, Bench
from tests.simulated import campaign_of, design

MECHANICAL = ("torque_map", "cogging", "spin_down", "drive", "holding_current")
EXACT_BENCH = Bench(instruments=EXACT)


@cache
def recorded(
    effects: str = "", motor: str = "gimbal-5208", tests: tuple[str, ...] = MECHANICAL
) -> Campaign:
    """Mechanical tests of one motor, its own cogging replaced by `effects`; exact instruments."""
    machine = replace(design(motor), effects={})
    machine = with_effects(machine, effects) if effects else machine
    plan = tuple(step for step in CAMPAIGN if step[1] in tests)
    return campaign_of(campaign(machine, EXACT_BENCH, 11, plan))


def fitted(estimator: Estimator, captures: Campaign, known: Constants | None = None) -> Fit:
    return estimator.fit(captures, known or Constants(), estimator.options)


def chain(captures: Campaign, *estimators: Estimator, known: Constants | None = None) -> Constants:
    """Estimators one after the other, each seeing what is known and what those before it found."""
    known = known or Constants()
    for estimator in estimators:
        known = known.adding(fitted(estimator, captures, known).estimates)
    return known


def number(known: Constants, method: str, name: str) -> float:
    found = known.by(method, name)
    assert found is not None, known.all_of(name)
    return found.number


def without_some_angles(captures: Campaign, test: str) -> Campaign:
    """The campaign with every tenth row of one test without an angle, the first row too."""

    def holed(table: pl.DataFrame) -> pl.DataFrame:
        blind = pl.Series(np.arange(table.height) % 10 == 0)
        angle = pl.when(blind).then(float("nan")).otherwise(pl.col("theta_mech_rad"))
        return table.with_columns(angle.alias("theta_mech_rad"))

    damaged = (
        replace(c, tables=tuple(holed(t) for t in c.tables)) if c.meta.test == test else c
        for c in captures.captures
    )
    return Campaign("m", tuple(damaged))
