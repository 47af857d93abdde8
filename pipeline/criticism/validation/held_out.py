"""Captures predicted by a model that was fitted without them: simulated, and traced for looking."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pipeline.criticism.data.segment import Segment, clock
from pipeline.criticism.data.traces import smoothed
from pipeline.criticism.operating import Array
from pipeline.criticism.regression.cross_validation import HeldOut
from pipeline.criticism.regression.linear_system import LinearSystem
from pipeline.criticism.residuals.residual import residual
from pipeline.criticism.validation.error_maps import disjoint
from pipeline.criticism.validation.free_run import Run, beside, free_run
from pipeline.physics.glossary import unit_of
from pipeline.records.comparison import SignalError, Trace

Split = Literal["fit", "held_out"]


@dataclass(frozen=True, slots=True)
class Simulated:
    """The free run of one capture.

    Attributes
    ----------
    number
        Of the segment.
    split
        `held_out` where its parameters were fitted without that capture.
    values
        Parameters by full name.
    run
        The free run.

    """

    number: int
    split: Split
    values: Mapping[str, float]
    run: Run


def values_without(
    number: int, system: LinearSystem, held_out: HeldOut
) -> tuple[dict[str, float], Split]:
    """Parameters fitted without a capture.

    Parameters
    ----------
    number
        Of the capture's segment.
    system
        Around the full fit.
    held_out
        How far the parameters move without each capture.

    Returns
    -------
    values, split
        `held_out`; those of the full fit, `fit`, where the capture alone determines a parameter.

    """
    step = held_out.steps.get(number)
    if step is None:
        return system.fit.values, "fit"
    return system.fit.moved(system.columns[: step.size], step).values, "held_out"


def simulate(system: LinearSystem, held_out: HeldOut) -> tuple[Simulated, ...]:
    """Free runs of every capture that allows one.

    Parameters
    ----------
    system
        The fit.
    held_out
        Its held-out residual, with the parameters that each capture is predicted by.

    """
    runs = []
    for number, segment in enumerate(system.segments):
        values, split = values_without(number, system, held_out)
        run = free_run(segment, system.fit.model, values)
        if run is not None:
            runs.append(Simulated(number, split, values, run))
    return tuple(runs)


def run_errors(simulated: Sequence[Simulated]) -> Iterator[SignalError]:
    """Errors of simulated signals as window means beside their noise floor.

    Parameters
    ----------
    simulated
        Free runs.

    """
    for one in simulated:
        for signal in one.run.signals:
            error = one.run.errors(signal)
            yield SignalError(
                signal,
                one.run.capture,
                one.split,
                math.sqrt(float((error**2).mean())),
                one.run.floor[signal],
                int(error.size),
                effective(error),
                unit_of(signal),
                "free_run",
            )


def effective(residual: Array) -> float:
    """Independent samples in autocorrelated ones.

    Parameters
    ----------
    residual
        In order of time [n].

    Returns
    -------
    float
        n (1 − r)/(1 + r) with the lag-one autocorrelation r, not below 0; n for fewer than four.

    References
    ----------
    Bayley and Hammersley, J. R. Statist. Soc. Suppl. 8(2), 1946, 184, doi:10.2307/2983560.

    Examples
    --------
    >>> effective(np.array([1.0, -1.0, 1.0, -1.0]))
    4.0

    """
    n = residual.size
    if n < 4:
        return float(n)
    centred = residual - residual.mean()
    power = float(centred @ centred)
    r = float(centred[1:] @ centred[:-1]) / power if power > 0 else 0.0
    return n * (1.0 - max(r, 0.0)) / (1.0 + max(r, 0.0))


@dataclass(frozen=True, slots=True)
class Before:
    """The model without what was added, with its held-out parameters, for the same segments."""

    system: LinearSystem
    held: HeldOut

    def values(self, number: int) -> Mapping[str, float]:
        """The parameters that predict a segment, of its number."""
        return values_without(number, self.system, self.held)[0]


def traces(
    system: LinearSystem,
    held_out: HeldOut,
    simulated: Sequence[Simulated],
    before: Before | None = None,
) -> Iterator[Trace]:
    """Recorded and predicted signals of captures, window by window.

    Parameters
    ----------
    system
        The fit.
    held_out
        Its held-out residual, with the parameters that each capture is predicted by.
    simulated
        Free runs.
    before
        The model without what was added; None where nothing was.

    Yields
    ------
    Trace
        Of a drive's logs what the equations predict, averaged over a millisecond, whether their
        rows are close enough for a free run or not; and signals of the free runs.

    """
    runs = {one.number: one for one in simulated}
    for number, segment in enumerate(system.segments):
        if segment.instrument.name == "drive":
            yield from _equations(segment, number, system, held_out, before)
        if number in runs:
            yield from _free_run(segment, runs[number], before)


def _free_run(segment: Segment, simulated: Simulated, before: Before | None) -> Iterator[Trace]:
    """What a free run predicts."""
    run = simulated.run
    known: Mapping[str, Array] = {}
    if before is not None:
        model = before.system.fit.model
        known = beside(run, segment, model, before.values(simulated.number))
    for signal in run.signals:
        columns = (run.t_s, run.recorded[signal], run.simulated[signal], known.get(signal))
        yield _trace(segment, signal, "free_run", simulated.split, columns)


def _equations(
    segment: Segment, number: int, system: LinearSystem, held_out: HeldOut, before: Before | None
) -> Iterator[Trace]:
    """What the equations predict from the recorded state, averaged over a millisecond.

    Without the mean, the noise of the angle's second difference would cover the torque.
    """
    weak, fit = segment.weak, system.fit
    if weak is None:
        return
    values, split = values_without(number, system, held_out)
    residuals = residual(segment, fit.model, values)
    baseline = None
    if before is not None:
        baseline = residual(segment, before.system.fit.model, before.values(number))
    width = max(2 * round(fit.policy.validation.look_s / segment.ts_s / 2) + 1, 1)
    starts = disjoint(weak.starts, weak.length)
    rows = starts[:, None] + np.arange(width // 2, weak.length, max(width // 2, 1))[None, :]
    for place, channel in enumerate(segment.channels):
        if channel not in segment.recorded:
            # an acceleration, which no column holds
            continue
        recorded = smoothed(segment.recorded[channel], width)[rows]
        model = recorded - smoothed(residuals[place], width)[rows]
        without = None if baseline is None else recorded - smoothed(baseline[place], width)[rows]
        time = clock(segment)[rows]
        yield _trace(segment, channel, "equation", split, (time, recorded, model, without))


def _trace(
    segment: Segment,
    signal: str,
    kind: Literal["equation", "free_run"],
    split: Split,
    columns: tuple[Array, Array, Array, Array | None],
) -> Trace:
    """Time, recorded and predicted signal, and as predicted before; windows [W, N] one after the
    other with a gap behind each [W (N + 1)].
    """
    time, recorded, predicted, before = columns
    gap = np.full((time.shape[0], 1), np.nan)
    after = np.hstack([time, time[:, -1:] + segment.ts_s])
    return Trace(
        segment.capture,
        signal,
        kind,
        split,
        after.ravel(),
        np.hstack([recorded, gap]).ravel(),
        np.hstack([predicted, gap]).ravel(),
        None if before is None else np.hstack([before, gap]).ravel(),
    )
