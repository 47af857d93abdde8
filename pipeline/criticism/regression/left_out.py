"""What a fit loses without some of its parameters, from its normal matrices."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.criticism.operating import Array, Indices
from pipeline.criticism.regression.linear_system import LinearSystem
from pipeline.criticism.regression.normal_equations import NormalEquations
from pipeline.criticism.residuals.channels import of_acceleration


def loss_at(
    system: LinearSystem,
    known: NormalEquations,
    left_out: Indices,
    move: Array,
    instead: Sequence[int] | Indices = (),
    starts: Sequence[float] = (1.0, 0.5, 0.0),
    rounds: int | None = None,
) -> float:
    """Rise of the deviance when some parameters move and the others of the model are refitted.

    Parameters
    ----------
    system
        The fit.
    known
        Normal equations of all its columns.
    left_out
        Places of the parameters' columns [k].
    move
        Change of each [k].
    instead
        Places of columns that are fitted in their stead.
    starts
        As `NormalEquations.best` has them.
    rounds
        Likewise.

    Returns
    -------
    float
        To first order around where the parameters have moved to.

    Notes
    -----
    A free shaft knows torques over its inertia alone, α = −T/J. So its column of J is T/J², and T
    is that without what has gone: as J changes, what is not there cannot. By the column of before,
    all torques and J would go to zero together at no cost, and with them any that is asked after.

    """
    stay = np.setdiff1d(system.model_columns, left_out)
    kept = np.concatenate([stay, np.asarray(instead, dtype=int)])
    every = np.concatenate([kept, left_out])
    ends = np.arange(kept.size, every.size)
    there = known.only(every).moved(ends, move)
    (inertia,) = np.flatnonzero(np.isin(every, system.place(("j_kgm2",))))
    by = np.outer(_free(system), -move * _drags(system, left_out) / system.fit.values["j_kgm2"])
    if np.any(by):
        there = there.sheared(int(inertia), ends, by)
    return there.only(np.arange(kept.size)).best(starts, rounds).deviance - known.deviance()


def _free(system: LinearSystem) -> Array:
    """1 for the groups [G] that are accelerations of a free shaft, else 0."""
    free = [of_acceleration(system.segments[n], channel) for n, channel, _ in system.labels]
    return np.array(free, dtype=float)


def _drags(system: LinearSystem, places: Indices) -> Array:
    """1 for columns [k] of effects that drag at the shaft, else 0."""
    effects = [system.columns[n].effect for n in places.tolist()]
    return np.array([e is not None and e.hook == "torque" for e in effects], dtype=float)
