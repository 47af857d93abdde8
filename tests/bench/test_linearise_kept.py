"""What a linearisation costs at a point of a fit that was asked for before."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from pipeline.criticism.library.registry import effects
from pipeline.criticism.machine.model import EARLY_S, EARLY_SHARES, Model
from pipeline.criticism.regression.fit import Fit, floors
from pipeline.criticism.regression.linear_system import LinearSystem, linear_system
from pipeline.criticism.selection.candidates import candidates
from tests.unit.criticism.machines import BASE, log, machine

MODEL = Model(machine(), ())


def seconds(fit: Fit) -> tuple[float, LinearSystem]:
    columns = [c for one in candidates(effects(), MODEL) for c in one.columns]
    begun = time.process_time()
    system = linear_system(fit, columns)
    return time.process_time() - begun, system


def of_a_time_constant(known: LinearSystem, scale_s: float, *, kept: bool) -> LinearSystem:
    """A friction that may change with time and does not yet, around a `known` fit."""
    fit = known.fit
    free = {**fit.machine.stated_u, **dict.fromkeys((*EARLY_SHARES, EARLY_S), 1.0)}
    model = replace(fit.model, machine=replace(fit.machine, stated_u=free))
    absent = {**dict.fromkeys(EARLY_SHARES, 0.0), EARLY_S: scale_s}
    start = replace(fit, model=model, near={**fit.near, **absent}).at(absent)
    return linear_system(start, before=known if kept else None)


def test_the_columns_of_a_known_point_cost_less_than_half_of_new_ones():
    """A search asks for them again beside other floors; a third of its time went there."""
    segments = (log(n=16000, noise=1.0),)
    fit = Fit(segments, MODEL, {**BASE}, floors(segments, MODEL, BASE), BASE)
    seconds(fit)  # imports
    ratios = []
    for k in range(3):
        elsewhere = replace(fit, values={**BASE, "psi_wb": (1.0 + 1e-3 * (k + 1)) * BASE["psi_wb"]})
        new, _ = seconds(elsewhere)
        again, _ = seconds(replace(elsewhere, sigma=tuple(2.0 * s for s in fit.sigma)))
        ratios.append(again / new)
    assert min(ratios) < 0.5


def test_a_friction_that_does_not_change_yet_costs_less_than_half_of_all_columns():
    """No column but its own has the time constant in it, of which several are tried."""
    plain = log(n=16000, noise=1.0)
    fixed = {**plain.fixed, **dict.fromkeys((*EARLY_SHARES, EARLY_S), 1.0)}
    segments = (replace(plain, fixed=fixed),)
    known = linear_system(Fit(segments, MODEL, {**BASE}, floors(segments, MODEL, BASE), BASE))
    spent: dict[bool, list[float]] = {True: [], False: []}
    for k in range(1, 4):
        matrices = []
        for kept in (True, False):
            begun = time.process_time()
            matrices.append(of_a_time_constant(known, 0.1 * k, kept=kept).matrix)
            spent[kept].append(time.process_time() - begun)
            segments[0].cache.clear()
        np.testing.assert_allclose(*matrices, rtol=1e-9, atol=1e-9)
    assert min(spent[True]) < 0.5 * min(spent[False])
