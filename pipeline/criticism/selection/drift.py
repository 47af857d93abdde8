"""Slow drift of the instruments in time: taken as noise where it explains all that is left.

A random walk of a voltage, current or torque is a sum of sines of independent size, of which the
slowest few hold nearly all. What repeats with the machine's state, at every step of a torque map or
at every turn, is no such sum.

Reference: Papoulis & Pillai, Probability, Random Variables and Stochastic Processes, 4th ed.
(2002), section 11.2, the Karhunen-Loève expansion of a Wiener process.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pipeline.criticism.data.segment import Segment, clock, with_lines
from pipeline.criticism.machine.model import Model
from pipeline.criticism.operating import Array, Values
from pipeline.criticism.regression.fit import Fit
from pipeline.criticism.regression.gauss_newton import gauss_newton
from pipeline.criticism.regression.goodness import remainder
from pipeline.criticism.regression.parallel import on_each
from pipeline.criticism.residuals.residual import disturbed
from pipeline.records.diagnosis import Remainder

_DRIFTING = ("v", "i", "torque")
"""Beginnings of the names of signals that drift: voltages, currents and torque."""


def drifting_segments(fit: Fit, remainders: Sequence[Remainder]) -> tuple[Segment, ...] | None:
    """The segments, knowing the drift that their instruments may have.

    Parameters
    ----------
    fit
        Without drift.
    remainders
        What it leaves over the floor.

    Returns
    -------
    tuple of Segment or None
        None if a fit with that drift leaves anything large over the floor, or if `remainders` are
        in captures of one test alone: instruments drift in every test, while a machine that warms
        up changes slowly in one.

    """
    captures = {one.capture for one in remainders}
    tests = {segment.test for segment in fit.segments if segment.capture in captures}
    if len(tests) < fit.policy.selection.drift_tests:
        return None
    arguments = [(fit.model, fit.values)] * len(fit.segments)
    drifting = on_each(with_drift, fit.segments, arguments)
    system = gauss_newton(replace(fit, segments=drifting))
    return None if remainder(system, large=True) else drifting


def with_drift(segment: Segment, model: Model, values: Values) -> Segment:
    """A segment with the slowest sines of a random walk of each of its sensors.

    Parameters
    ----------
    segment
        The segment.
    model
        The model, which determines what a sensor's error does to the residual.
    values
        Parameters by full name.

    Returns
    -------
    Segment
        The same for a table, and where no voltage, current or torque was recorded.

    """
    if segment.weak is None:
        return segment
    policy = model.policy.selection
    sines = policy.drift_size * slowest(clock(segment), policy.drift_terms)
    known = segment.disturbances.lines
    lines = [] if known is None else [known]
    lines += [
        disturbed(segment, segment.weak, model, values, name, sigma * sines)
        for name, sigma in segment.sensors.noise.items()
        if sigma > 0.0 and name.startswith(_DRIFTING) and name in segment.recorded
    ]
    return with_lines(segment, np.concatenate(lines)) if lines else segment


def slowest(time_s: Array, terms: int) -> Array:
    """The slowest sines of a random walk that ends at a standard deviation of one.

    Parameters
    ----------
    time_s
        Instants [n, s], rising.
    terms
        How many sines.

    Returns
    -------
    array [terms, n]
        Each of standard size; their sum with independent normal factors is nearly the random walk.

    Notes
    -----
    √2 sin((k − ½) π t)/((k − ½) π) for k = 1, 2, ... and t from 0 to 1 (Karhunen-Loève).

    References
    ----------
    Papoulis and Pillai, Probability, Random Variables and Stochastic Processes, 4th ed.,
    McGraw-Hill,
    2002, section 11.2.

    Examples
    --------
    >>> round(float((slowest(np.linspace(0.0, 1.0, 9), 200)[:, -1] ** 2).sum()), 2)
    1.0

    """
    time = (time_s - time_s[0]) / max(float(time_s[-1] - time_s[0]), 1e-300)
    rates = (np.arange(terms)[:, None] + 0.5) * math.pi
    return math.sqrt(2.0) * np.sin(rates * time) / rates
