"""Choices inside an effect, such as whose sensor has a gain: made again when others are there."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import product

from pipeline.criticism.data.segment import Segment
from pipeline.criticism.effect import Effect, Values
from pipeline.criticism.regression.gauss_newton import gauss_newton
from pipeline.criticism.regression.goodness import told_groups
from pipeline.criticism.regression.linear_system import Fitted, System


def reconsidered(
    segments: Sequence[Segment], fitted: Fitted, around: System
) -> tuple[Fitted, System]:
    """The fit with other choices of its effects, where anything is left over the floor and these
    are better by 12 of −2 log L.

    A choice may have been right only while another effect was missing: a lagging transducer does
    not pass on the torque's ripple, which so seemed not to reach the shaft.
    """
    for effect in fitted.model.effects:
        if not told_groups(around, segments).any():
            break
        if effect.closer is not None:
            continue
        for other in _others(effect, fitted):
            start = replace(fitted, values={**fitted.values, **other})
            tried = gauss_newton(segments, start)
            if tried[1].misfit < around.misfit - fitted.policy.selection.tie:
                fitted, around = tried
    return fitted, around


def _others(effect: Effect, fitted: Fitted) -> Iterator[Values]:
    """Every choice of an effect but that of the fit, by full names."""
    machine = fitted.model.machine
    chosen = [p for p in effect.parameters_of(machine) if p.choice and len(p.scan) > 1]
    grids = [[(f"{effect.name}.{p.name}", v * machine.scale(p)) for v in p.scan] for p in chosen]
    for one in product(*grids):
        values = dict(one)
        if any(fitted.values[name] != value for name, value in values.items()):
            yield values
