"""What would part two effects: predicted power against what follows from theory."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import ncx2

from pipeline.criticism.data.segment import row_index
from pipeline.criticism.design import experiments
from pipeline.criticism.design.experiments import PLANNED, planned, separations
from pipeline.criticism.library.registry import effects
from pipeline.criticism.machine.model import Model
from pipeline.criticism.parameter import Parameter
from pipeline.criticism.policy.policy import DEFAULT
from pipeline.criticism.regression.fit import Fit, floors
from pipeline.criticism.regression.noise_propagation import noise_floor
from pipeline.criticism.residuals.residual import residual
from pipeline.criticism.selection.candidates import candidates, widened
from tests.unit.criticism.machines import BASE, log, machine

ALL = effects()


def state(name, size, others, segments):
    """A fit at known values with one effect, and the system with its alternatives' columns."""
    effect = ALL[name] if isinstance(name, str) else name
    model = Model(machine(), (effect,))
    parameter = effect.parameters[0]
    values = {**dict.fromkeys(c.name for c in _base()), **BASE}
    values = {k: 0.0 if v is None else v for k, v in values.items()}
    values |= {f"{effect.name}.{p.name}": p.scan[0] for p in effect.parameters if p.choice}
    values[f"{effect.name}.{parameter.name}"] = size
    fit = Fit(segments, model, values, floors(segments, model, values), values)
    offered = candidates({other: ALL[other] for other in others}, model)
    return effect, widened(fit, offered), offered


def _base():
    from pipeline.criticism.machine.model import BASE as CONSTANTS

    return CONSTANTS


def told(name, size, other, segments=None):
    segments = segments or (log(noise=1.0),)
    effect, wide, offered = state(name, size, (other,), segments)
    return separations(effect, wide, offered, {other: "as declared"})


def test_power_is_that_of_a_chi_square_test_at_one_per_cent():
    limit = ncx2.ppf(0.99, 2, 1e-12)
    for noncentrality in (0.5, 4.0, 20.0):
        expected = ncx2.sf(limit, 2, noncentrality)
        assert experiments._power(noncentrality, 2, DEFAULT.design) == pytest.approx(
            expected, rel=1e-4
        )
    assert experiments._power(0.0, 1, DEFAULT.design) == pytest.approx(0.01, rel=1e-6)


def test_what_the_others_leave_of_a_vector_is_its_part_off_their_plane():
    rng = np.random.default_rng(1)
    plane, d = rng.normal(size=(40, 3)), rng.normal(size=40)
    both = np.column_stack([d, plane])
    off = d - plane @ np.linalg.lstsq(plane, d, rcond=None)[0]
    assert experiments._noncentrality(both.T @ both) == pytest.approx(off @ off, rel=1e-9)


def test_a_twin_under_another_name_is_parted_by_nothing():
    """No figure is given where none can be predicted; what the effect declares is told instead."""
    segments = (log(noise=1.0),)
    effect, wide, _ = state("torque_scale", 0.02, (), segments)
    twin = replace(effect, name="twin")
    offered = candidates({"twin": twin}, wide.fit.model)
    wide = widened(wide.fit, offered)
    found = separations(effect, wide, offered, {"twin": "a lever"})
    assert [(one.against, one.experiment, one.power) for one in found] == [
        ("twin", "a lever", None)
    ]


def test_windage_and_eddy_drag_are_parted_by_more_speeds():
    found = told("windage", 2e-3, "iron_eddy")
    assert found
    assert all(one.against == "iron_eddy" and 0.0 < one.power <= 1.0 for one in found)
    assert [one.power for one in found] == sorted((one.power for one in found), reverse=True)
    assert any("spin_down" in one.experiment or "torque" in one.experiment for one in found)


@pytest.mark.slow
def test_a_larger_effect_is_parted_with_more_power():
    small, large = (told("windage", size, "iron_eddy") for size in (1e-4, 2e-4))
    power = {one.experiment: one.power for one in small}
    both = [one for one in large if one.experiment in power]
    assert both
    for one in both:
        assert one.power > power[one.experiment]


@pytest.mark.slow
def test_a_choice_is_no_degree_of_freedom():
    """A power for three parameters would be told where one is fitted."""
    plain = ALL["windage"]
    choices = tuple(
        Parameter(name, "1", 1.0, 0.0, scan=(1.0, 0.0), choice=True) for name in ("here", "there")
    )
    choosing = replace(plain, parameters=(*plain.parameters, *choices))
    without, with_choices = (told(one, 1e-4, "iron_eddy") for one in (plain, choosing))
    assert without
    assert [(one.experiment, one.power) for one in with_choices] == [
        (one.experiment, pytest.approx(one.power, rel=1e-9)) for one in without
    ]


@pytest.mark.parametrize("test", sorted(PLANNED))
def test_a_planned_test_obeys_the_model_it_is_planned_with(test):
    model = Model(machine(), (ALL["coulomb_friction"],))
    values = {c.name: BASE.get(c.name, 0.0) for c in _base()}
    values["coulomb_friction.torque_nm"] = 0.01
    segments = (log(),)
    fit = Fit(segments, model, values, floors(segments, model, values), values)
    for segment in planned(test, fit):
        left = residual(segment, model, values)
        assert segment.weak is not None
        assert segment.weak.starts.size
        weak = segment.weak.project(left)[:, :, 0]
        floor = noise_floor(segment, model, values, 1)
        _, _, _, groups = row_index(segment)
        plain = {channel: floor[n] for n, (channel, order) in enumerate(groups) if order == 0}
        for place, channel in enumerate(segment.channels):
            assert np.abs(weak[place]).max() < 3.0 * plain[channel]
