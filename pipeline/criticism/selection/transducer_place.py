"""Where a transducer of torque sits: in the shaft, or at the stator, which no metadata state.

In the shaft it reads T − drags − J θ″, at the stator the reaction torque T − drags: the bearings
are inside, and the inertia of the rotor is not. The same captures cannot fit both where the shaft
gathers speed under load, as another test knows the inertia.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pipeline.criticism.data.segment import Segment
from pipeline.criticism.regression.gauss_newton import gauss_newton
from pipeline.criticism.regression.goodness import significant_groups
from pipeline.criticism.regression.linear_system import LinearSystem
from pipeline.criticism.selection.score_test import clears

TORQUE = "torque_shaft_nm"
_STATOR = (
    "torque_shaft_nm of {} captures is read at the stator (a reaction torque): no inertia of the "
    "rotor is in it; in the shaft it would miss by more"
)


def at_better_place(system: LinearSystem) -> LinearSystem:
    """The fit by the place of the transducer that explains its torque better.

    Parameters
    ----------
    system
        A fit with the transducer at either place.

    Returns
    -------
    LinearSystem
        The same where no torque is over its floor, or the other place does not lower the deviance
        by `policy.selection.tie` or leaves most of the torque's excess: what neither place explains
        is an effect's, and no coupling shows at the stator.

    """
    significant = significant_groups(system)
    torques = np.array([channel == TORQUE for _, channel, _ in system.labels])
    if not significant[torques].any():
        return system
    segments = tuple(_at_other_place(s) if _reads_torque(s) else s for s in system.segments)
    # only the inertia's column is another there
    kept = np.flatnonzero([column.name != "j_kgm2" for column in system.columns])
    other = gauss_newton(replace(system.fit, segments=segments), before=system.only(kept))
    before, after = (one.reduced_chi2(one.residual) for one in (system, other))
    explains = other.deviance < system.deviance - system.policy.selection.tie
    return other if explains and clears(system, significant & torques, before, after) else system


def place_notes(segments: Sequence[Segment]) -> tuple[str, ...]:
    """A note on torque that is read at the stator.

    Parameters
    ----------
    segments
        The segments of a fit.

    Returns
    -------
    tuple of str
        Empty where there is none.

    """
    captures = {segment.capture for segment in segments if segment.instrument.stator}
    return (_STATOR.format(len(captures)),) if captures else ()


def _reads_torque(segment: Segment) -> bool:
    return TORQUE in segment.recorded and TORQUE in segment.channels


def _at_other_place(segment: Segment) -> Segment:
    instrument = segment.instrument
    return replace(segment, instrument=replace(instrument, stator=not instrument.stator))
