"""How a column was read, where no metadata state it and only the captures show it.

A transducer of torque in the shaft reads T − drags − J θ″; one at the stator reads the reaction
torque T − drags, as the bearings are inside and the inertia of the rotor is not. The same captures
cannot fit both where the shaft gathers speed under load, as another test knows the inertia.

A control loop computes a voltage in the rotor frame of its sampled angle and turns it ahead.
Firmware logs the vector from before or behind that: in the frame of the sampling instant, from
which on it is held, or of the middle of its hold. That is known only where each sample is stated
to be the mean about the middle of one hold.

Telemetry averages currents and voltages over a row, or samples them at its end, where the motion is
read. Means are half a row before it. Of a faster log only some rows may have been kept: a voltage
that was held from one row of that to the next is none that is held between those.

A current that moves fast between slow rows may look as if it had waves of the angle. Where the
captures are better explained by straight lines between rows, it has none.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from operator import attrgetter

import numpy as np

from pipeline.criticism.data.segment import Cache, Segment
from pipeline.criticism.operating import Flags
from pipeline.criticism.parameter import Machine
from pipeline.criticism.regression.fit import Fit
from pipeline.criticism.regression.gauss_newton import gauss_newton
from pipeline.criticism.regression.goodness import significant_groups
from pipeline.criticism.regression.linear_system import LinearSystem
from pipeline.criticism.selection.improvement import clears
from pipeline.criticism.signals.true_current import ripples
from pipeline.criticism.signals.true_state import averaging

TORQUE = "torque_shaft_nm"
_HALF_HOLD = 0.5
"""Of the start of a hold, before its middle; of the middle of a row, before its end."""
_MEANS = (
    "currents and voltages of {} captures are taken as means over the row up to the instant at "
    "which its motion is read, which explains them better than samples; a current_delay of half a "
    "row would look the same"
)
_STATOR = (
    "torque_shaft_nm of {} captures is read at the stator (a reaction torque): no inertia of the "
    "rotor is in it; in the shaft it would miss by more"
)
_SINGLE = (
    "voltages of {} captures, stated as held from one row to the next or as means about a row, are "
    "taken as those of one PWM period each, which explains them better"
)
_SAMPLED = (
    "voltages of {} captures are taken in the rotor frame of the sampling instant, which explains "
    "them better than that of the middle of their PWM period; a sample_delay of half a period "
    "would look the same"
)
_DELAYED = (
    "voltages of {} captures may be in the rotor frame of the sampling instant; sample_delay is "
    "less by half a PWM period then"
)


def by_best_readings(system: LinearSystem) -> LinearSystem:
    """The fit by the readings that explain the captures best.

    Parameters
    ----------
    system
        A fit by either reading of each column.

    Returns
    -------
    LinearSystem
        `system` itself where no other reading lowers the deviance by `policy.selection.tie`.

    Notes
    -----
    In a search they compete with the effects: an encoder off its centre looks like a torque without
    the inertia, and a dead time like another frame, until they are in the model. They compete
    together: half a PWM period of delay explains more than the frame alone, and less than the frame
    with straight lines.

    """
    while True:
        limit = system.deviance - system.policy.selection.tie
        better = (other for other in _refits(system) if other.deviance < limit)
        best = min(better, key=lambda other: other.deviance, default=None)
        if best is None:
            return system
        system = best


def with_usual_readings(system: LinearSystem) -> LinearSystem:
    """The fit by the usual reading of each column that explains as much as the one of the fit.

    Parameters
    ----------
    system
        A fit by either reading of each column.

    Returns
    -------
    LinearSystem
        `system` itself where every reading is usual, or explains more by `policy.selection.tie`.

    Notes
    -----
    A reading that was taken before an effect was in may have stood for a part of it: a delay of one
    PWM period in the usual frame is half a period in that of the sampling instant.

    """
    readings = (
        (attrgetter("instrument.frame"), _in_other_frame),
        (attrgetter("instrument.behind"), _of_other_rows),
        (attrgetter("instrument.single"), partial(_of_other_hold, system.fit.machine)),
    )
    for earlier, other in readings:
        if not any(map(earlier, system.segments)):
            continue
        back = tuple(other(s) if earlier(s) else s for s in system.segments)
        tried = gauss_newton(replace(system.fit, segments=back), before=system)
        if tried.deviance < system.deviance + system.policy.selection.tie:
            system = tried
    return system


def reading_notes(fit: Fit) -> tuple[str, ...]:
    """Notes on columns that are not read as is usual, or of which an effect takes the place.

    Parameters
    ----------
    fit
        The fit.

    Returns
    -------
    tuple of str
        Empty where there are none.

    """
    delayed = fit.values.get("sample_delay.of_speed") == 0.0
    share = fit.policy.cutting.slower_share
    notes = {note: set[str]() for note in (_SAMPLED, _MEANS, _SINGLE, _STATOR, _DELAYED)}
    for segment in fit.segments:
        is_sampled = segment.instrument.frame != 0.0
        for note, applies in (
            (_SAMPLED, is_sampled),
            (_MEANS, segment.instrument.behind != 0.0),
            (_SINGLE, bool(segment.instrument.single)),
            (_STATOR, segment.instrument.stator),
            (_DELAYED, delayed and not is_sampled and _has_held_vectors(segment, share)),
        ):
            if applies:
                notes[note].add(segment.capture)
    return tuple(note.format(len(names)) for note, names in notes.items() if names)


def _refits(system: LinearSystem) -> Iterator[LinearSystem]:
    """The fit by the other reading of each column that may have one."""
    share = system.policy.cutting.slower_share
    others: tuple[tuple[Callable[[Segment, float], bool], Callable[[Segment], Segment]], ...] = (
        (_has_held_vectors, _in_other_frame),
        (_may_hold_means, _of_other_rows),
        (_may_be_single, partial(_of_other_hold, system.fit.machine)),
    )
    for may_be, other in others:
        which = [may_be(segment, share) for segment in system.segments]
        if any(which):
            each = zip(system.segments, which, strict=True)
            read = tuple(other(segment) if its_own else segment for segment, its_own in each)
            yield gauss_newton(replace(system.fit, segments=read), before=system)
    if any(ripples(segment) for segment in system.segments):
        other_lines = tuple(map(_other_lines, system.segments))
        yield gauss_newton(replace(system.fit, segments=other_lines), before=system)
    elsewhere = at_other_place(system)
    # what neither place explains is an effect's, and no coupling shows at the stator; the
    # deviance is logarithmic, so what it spoils in other captures counts by its power
    if elsewhere is not None and clears(
        system,
        _of_torque(system),
        *(one.reduced_chi2(one.residual) for one in (system, elsewhere)),
    ):
        yield elsewhere


def at_other_place(system: LinearSystem) -> LinearSystem | None:
    """The fit with every torque read at the other place: at the stator, or in the shaft.

    Parameters
    ----------
    system
        A fit.

    Returns
    -------
    LinearSystem or None
        None where no torque is missed.

    """
    if not np.any(_of_torque(system) & significant_groups(system)):
        return None
    moved = (_at_other_place(s) if _reads_torque(s) else s for s in system.segments)
    # only the inertia's column is another there
    kept = np.flatnonzero([column.name != "j_kgm2" for column in system.columns])
    fit = replace(system.fit, segments=tuple(moved))
    return gauss_newton(fit, before=system.only(kept))


def _has_held_vectors(segment: Segment, slower_share: float) -> bool:
    """Whether a segment has voltage vectors that are held while the rotor turns, in a frame that no
    metadata state: those held from a sample on, and those of a drive whose PWM period is known, but
    for means about the middle of one.

    A PWM period below `slower_share` of the sample period is one of many in a sample.
    """
    timing, pwm_s = segment.instrument.timing, segment.fixed.get("pwm_s", 0.0)
    commanded = segment.instrument.commanded and pwm_s > 0.0
    is_open = commanded and (timing == "instant" or pwm_s < slower_share * segment.ts_s)
    return "vd_v" in segment.channels and (timing == "held" or is_open)


def _may_hold_means(segment: Segment, slower_share: float) -> bool:
    """Whether the rows of a segment may be means up to their instant: those of a log that is slower
    than its PWM, but where a sample is stated to be the mean about its instant.
    """
    pwm_s, centred = segment.fixed.get("pwm_s", 0.0), segment.instrument.timing == "centred"
    slow = 0.0 < pwm_s < slower_share * segment.ts_s
    return slow and not centred and "iq_a" in segment.recorded


def _may_be_single(segment: Segment, slower_share: float) -> bool:
    """Whether voltages that are stated as held from row to row, or as means about a row, may be of
    one PWM period each: in a log that is slower than its PWM.
    """
    instrument, pwm_s = segment.instrument, segment.fixed.get("pwm_s", 0.0)
    slow = 0.0 < pwm_s < slower_share * segment.ts_s
    return "vd_v" in segment.channels and (
        bool(instrument.single) or (slow and instrument.timing != "instant")
    )


def _in_other_frame(segment: Segment) -> Segment:
    instrument = segment.instrument
    return replace(segment, instrument=replace(instrument, frame=_HALF_HOLD - instrument.frame))


def _of_other_rows(segment: Segment) -> Segment:
    instrument = segment.instrument
    return replace(segment, instrument=replace(instrument, behind=_HALF_HOLD - instrument.behind))


def _of_other_hold(machine: Machine, segment: Segment) -> Segment:
    stated, timing = segment.instrument.single, segment.instrument.timing
    single, timing = ("", stated) if stated else (timing, "instant")
    instrument = replace(
        segment.instrument, single=single, timing=timing, points=1, snapshots=False
    )
    other = replace(segment, instrument=instrument, cache=Cache())
    return replace(other, instrument=averaging(other, machine))


def _other_lines(segment: Segment) -> Segment:
    instrument = segment.instrument
    return replace(segment, instrument=replace(instrument, waves=not instrument.waves))


def _of_torque(system: LinearSystem) -> Flags:
    """Which groups of rows [G] are of a transducer's torque."""
    return np.array([channel == TORQUE for _, channel, _ in system.labels], dtype=bool)


def _reads_torque(segment: Segment) -> bool:
    return TORQUE in segment.recorded and TORQUE in segment.channels


def _at_other_place(segment: Segment) -> Segment:
    instrument = segment.instrument
    return replace(segment, instrument=replace(instrument, stator=not instrument.stator))
