"""Columns that are kept from an earlier fit are those that would be made anew."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.criticism.data.segment import Cache, row_index
from pipeline.criticism.library.registry import effects
from pipeline.criticism.machine.model import Model, zero
from pipeline.criticism.regression.columns import effect_columns
from pipeline.criticism.regression.fit import Fit, floors
from pipeline.criticism.regression.linear_system import (
    _reusable_columns,
    linear_system,
    model_columns,
)
from pipeline.criticism.regression.linearise import absorb, whitened_anew
from pipeline.criticism.regression.noise_floors import offsets
from pipeline.criticism.regression.sampler import Sampler
from pipeline.criticism.residuals.residual import operate, residual
from pipeline.criticism.selection.candidates import candidates
from tests.unit.criticism.machines import BASE, coasting, log, machine

PLAIN = Model(machine(), ())
LIBRARY = effects()
WINDAGE = zero(LIBRARY["windage"], PLAIN)


def test_rows_over_another_noise_have_their_offsets_absorbed_by_that():
    """What a louder noise hides of an offset is more: the rows are no multiple of those before."""
    one, rng = log(noise=1.0), np.random.default_rng(2)
    _, _, valid, _ = row_index(one)
    count = int(valid.sum())
    bare = 1.0 + rng.normal(size=(count, 3))
    before, after = 300.0 * rng.uniform(1.0, 9.0, (2, count))
    was, expected = bare * before[:, None], bare * after[:, None]
    absorb(was, offsets(one, valid, before, machine()))
    absorb(expected, offsets(one, valid, after, machine()))
    assert whitened_anew(one, was, before, after, machine()) == pytest.approx(expected, rel=1e-9)
    assert not np.allclose(was * (after / before)[:, None], expected, rtol=0.1)


def test_candidates_columns_survive_a_tolerance_of_form():
    """Scaled by the floors alone, a gain of the transducer was no longer a gain once any effect had
    been found, and another gain was named for it.
    """
    segments = (log(noise=1.0),)
    values = {**BASE}
    start = Fit(segments, PLAIN, values, floors(segments, PLAIN, values), values)
    gain = effect_columns(effects()["torque_scale"], PLAIN)
    before = linear_system(start, gain)
    wrong = tuple(40.0 * sigma for sigma in start.sigma)
    doubted = replace(start, tolerance=wrong)
    kept, made = (linear_system(doubted, gain, b).matrix for b in (before, None))
    assert kept == pytest.approx(made, rel=1e-6, abs=1e-9 * np.abs(made).max())
    names = [column.name for column in model_columns(PLAIN)]
    pair = kept[:, names.index("gain_torque")], kept[:, -1]
    assert pair[1] == pytest.approx(pair[0], rel=1e-6, abs=1e-9 * np.abs(pair[0]).max())


def test_candidates_columns_survive_other_floors():
    """A sensor's error that was found changes the floors, and little that other effects do."""
    segments = (log(noise=1.0),)
    start = Fit(segments, PLAIN, {**BASE}, floors(segments, PLAIN, BASE), BASE)
    offered = [
        c for name in ("windage", "torque_scale") for c in effect_columns(LIBRARY[name], PLAIN)
    ]
    before = linear_system(start, offered)
    louder = replace(start, sigma=tuple(3.0 * sigma for sigma in start.sigma), values={**BASE})
    kept, made = (linear_system(louder, offered, b) for b in (before, None))
    assert kept.matrix == pytest.approx(made.matrix, rel=1e-6, abs=1e-9 * np.abs(made.matrix).max())
    assert all(kept.made_at[c.key] is before.made_at[c.key] for c in offered)


def test_what_turns_the_angle_is_made_anew_where_another_error_of_it_was_found():
    segments = (log(noise=1.0),)
    start = Fit(segments, PLAIN, {**BASE}, floors(segments, PLAIN, BASE), BASE)
    off, late = LIBRARY["angle_eccentricity"], LIBRARY["angle_offset"]
    drag = effect_columns(LIBRARY["windage"], PLAIN)
    before = linear_system(start, [*effect_columns(late, PLAIN), *drag])
    model = PLAIN.with_effects(off)
    found = {**BASE, **zero(off, model), "angle_eccentricity.sine_rad": 0.1}
    turned = Fit(segments, model, found, start.sigma, found)
    kept = _reusable_columns(before, turned, before.columns, chord=False)
    assert drag[0].key in kept
    assert not any(name.startswith("angle_offset.") for name, _ in kept)
    again = _reusable_columns(before, start, before.columns, chord=False)
    assert any(name.startswith("angle_offset.") for name, _ in again)


def test_a_sensor_s_column_holds_until_a_parameter_of_the_model_moves():
    """Of a shape or a sensor the residual is bent: near by its column stays, further off not."""
    off = LIBRARY["angle_eccentricity"]
    model = PLAIN.with_effects(off)
    segments, name = (log(noise=1.0),), "angle_eccentricity.sine_rad"
    values = {**BASE, **zero(off, model), name: 0.01}
    here = Fit(segments, model, values, floors(segments, PLAIN, BASE), values)
    before = linear_system(here)
    near, far = (replace(here, values={**values, name: size}) for size in (0.0103, 0.012))
    keys = {column.key for column in effect_columns(off, model)}
    assert keys <= set(_reusable_columns(before, near, before.columns, chord=False))
    assert keys.isdisjoint(_reusable_columns(before, far, before.columns, chord=False))
    assert ("lq_h", ()) in _reusable_columns(before, far, before.columns, chord=False)
    without = Fit(segments, PLAIN, {**BASE}, here.sigma, BASE)
    heat = [c for c in before.columns if c.name == "offset_temp_k"]
    assert _reusable_columns(before, without, heat, chord=False) == {}
    # what is made anew is of the new place, and what stays of the old one
    after = linear_system(far, before=before)
    assert all(after.made_at[key][name] == 0.012 for key in keys)
    assert after.made_at["lq_h", ()][name] == 0.01
    fresh = linear_system(far)
    place = [n for n, c in enumerate(fresh.columns) if c.key in keys]
    assert after.matrix[:, place] == pytest.approx(fresh.matrix[:, place])


@pytest.mark.parametrize("name", [n for n, e in LIBRARY.items() if e.hook == "sensor"])
def test_the_column_of_a_sensor_is_what_the_residual_moves_by(name):
    """Of a voltage or a torque too, for which the machine's state is not computed anew."""
    segment, values = log(), {**BASE, "gain_torque": 0.01}
    with_it = PLAIN.with_effects(LIBRARY[name])
    still = {**values, **zero(LIBRARY[name], PLAIN)}
    sampler = Sampler(segment, PLAIN, values)
    observed = 0
    for column in effect_columns(LIBRARY[name], PLAIN):
        moved = {**still, column.name: column.step}
        expected = residual(segment, with_it, moved) - residual(segment, with_it, still)
        found = sampler.change(column)
        if found is not None:
            observed += 1
            assert found * column.step == pytest.approx(expected, rel=1e-9, abs=1e-12)
    assert observed


def test_a_drag_s_column_has_the_gain_of_the_transducer_in_it():
    """As that of the viscous friction has: else a curve and a friction that grow against each other
    would leave a torque that no shaft feels.
    """
    segment, values = log(), {**BASE, "gain_torque": 0.01}
    (column,) = effect_columns(LIBRARY["windage"], PLAIN)
    with_it = PLAIN.with_effects(LIBRARY["windage"])
    still = {**values, **zero(LIBRARY["windage"], PLAIN)}
    moved = {**still, column.name: column.step}
    expected = residual(segment, with_it, moved) - residual(segment, with_it, still)
    found = Sampler(segment, PLAIN, values).change(column)
    assert found * column.step == pytest.approx(expected, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("one", [log(noise=1.0), coasting()], ids=["log", "coast"])
def test_a_column_at_shapes_that_it_does_not_read_is_the_one_before(one):
    sampler, anew = (Sampler(one, PLAIN, {**BASE}) for _ in range(2))
    changes, twins = {}, []
    for column in (c for offered in candidates(LIBRARY, PLAIN) for c in offered.columns):
        twin = sampler.twin(column)
        if twin is None:
            changes[column.key] = sampler.change(column)
        else:
            assert np.array_equal(changes[twin], anew.change(column))
            twins.append(column.name)
    assert ("current_gain.mean" in twins) is (one.kind == "dq")


def test_a_fit_that_comes_back_to_where_it_was_computes_nothing_again(monkeypatch):
    """Other floors ask for the same columns; elsewhere, or of another model, they are others."""
    segments = (log(noise=1.0),)
    start = Fit(segments, PLAIN, {**BASE}, floors(segments, PLAIN, BASE), BASE)
    offered = effect_columns(LIBRARY["angle_eccentricity"], PLAIN)
    linear_system(start, offered)
    asked, change = [], Sampler.change
    monkeypatch.setattr(
        Sampler, "change", lambda self, one: asked.append(one.name) or change(self, one)
    )
    louder = replace(start, sigma=tuple(3.0 * sigma for sigma in start.sigma))
    again = linear_system(louder, offered)
    assert asked == []
    new = linear_system(replace(louder, segments=(replace(segments[0], cache=Cache()),)), offered)
    assert np.array_equal(again.matrix, new.matrix)
    assert np.array_equal(again.residual, new.residual)
    asked.clear()
    linear_system(replace(start, values={**BASE, "psi_wb": 1.1 * BASE["psi_wb"]}), offered)
    assert "psi_wb" in asked
    asked.clear()
    linear_system(replace(start, model=PLAIN.with_effects(LIBRARY["windage"])).at(WINDAGE), offered)
    assert "psi_wb" in asked


@pytest.mark.parametrize("name", ["current_gain", "angle_eccentricity", "clock_scale"])
def test_a_residual_beside_another_state_is_the_one_without_it(name):
    """What two states have in common is taken over, and nothing else."""
    one, model = log(noise=1.0), PLAIN.with_effects(LIBRARY[name], LIBRARY["unbalance"])
    values = {n: v for effect in model.effects for n, v in zero(effect, model).items()}
    values = {**BASE, **values, "unbalance.cos_nm": 1e-3, "gain_clock": 1e-3}
    state = operate(one, one.recorded, model, values)
    residual(one, model, values, beside=state)
    for parameter in model.parameters():
        moved = {**values, parameter: values[parameter] + 1e-3}
        alone = residual(replace(one, cache=Cache()), model, moved)
        assert np.array_equal(residual(one, model, moved, beside=state), alone)


def test_a_free_shaft_asks_for_no_voltage(monkeypatch):
    """Drops are in no equation of a shaft without current."""
    model = PLAIN.with_effects(LIBRARY["dead_time"])
    values = {**BASE, **zero(LIBRARY["dead_time"], model), "dead_time.loss_v": 1.0}
    asked = []
    counted = replace(LIBRARY["dead_time"], drop=lambda x, _: asked.append(1) or 0.0 * x.i_a)
    model = PLAIN.with_effects(counted)
    residual(coasting(), model, values)
    assert not asked
    residual(log(), model, values)
    assert asked
