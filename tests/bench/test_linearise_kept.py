"""What a linearisation costs at a point of a fit that was asked for before."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest

from pipeline.criticism.library.registry import effects
from pipeline.criticism.machine.model import EARLY_S, EARLY_SHARES, Model
from pipeline.criticism.regression import noise_propagation
from pipeline.criticism.regression.fit import Fit, floors
from pipeline.criticism.regression.linear_system import LinearSystem, linear_system
from pipeline.criticism.regression.noise_propagation import noise_growth
from pipeline.criticism.selection.candidates import candidates
from pipeline.criticism.signals.true_state import on_true_clock
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


def test_noise_is_drawn_once_for_all_fits_that_are_tried(monkeypatch: pytest.MonkeyPatch) -> None:
    """Drawing it was a fifth of what a floor at a new fit took; that floor is the same."""
    drawn = []
    noisy = noise_propagation._noisy
    monkeypatch.setattr(
        noise_propagation, "_noisy", lambda *given: drawn.append(given) or noisy(*given)
    )
    segment, elsewhere = log(n=4000, noise=1.0), {**BASE, "r_ohm": 1.5 * BASE["r_ohm"]}
    noise_growth(segment, MODEL, {**BASE, "ld_h": 1.1 * BASE["ld_h"]}, BASE, 3)
    first = len(drawn)
    after_others = noise_growth(segment, MODEL, elsewhere, BASE, 3)
    assert len(drawn) == first > 0
    segment.cache.clear()
    np.testing.assert_array_equal(after_others, noise_growth(segment, MODEL, elsewhere, BASE, 3))


def test_the_true_clock_of_a_point_is_made_once() -> None:
    """State, reading and prediction ask for it; copying a segment was a fiftieth of a diagnosis."""
    segment, values = log(n=4000), {**BASE, "gain_clock": 1e-3}
    paced = on_true_clock(segment, "log", MODEL, values)
    assert paced is on_true_clock(segment, "log", MODEL, values)
    assert paced is not on_true_clock(segment, "log", MODEL, {**BASE, "gain_clock": 2e-3})
    moved = replace(segment, ts_s=2.0 * segment.ts_s)
    assert on_true_clock(moved, "log", MODEL, values).ts_s == 2.0 * paced.ts_s
