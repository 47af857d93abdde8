"""What a linearisation costs at a point of a fit that was asked for before."""

from __future__ import annotations

import time
from dataclasses import replace

from pipeline.criticism.library.registry import effects
from pipeline.criticism.machine.model import Model
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
