"""How much of the torque is in an equation of motion, beside what else goes with the current."""

from __future__ import annotations

import numpy as np

from pipeline.estimation.mechanical.drag_fit import DragFit
from pipeline.estimation.mechanical.shaft_nuisances import TIMING, is_of_current
from pipeline.estimation.mechanical.shaft_rows import DRIVE, ShaftRows
from pipeline.estimation.policy import policy
from pipeline.numerics.least_squares import linear_fit
from pipeline.records.capture import Array


def is_apart(rows: ShaftRows, driving_nm: Array, name: str) -> bool:
    """Whether a nuisance of the current is another column than the torque.

    Where the d current has one size, its square times the q current is not: it would take the
    torque's place, and J with it.

    Parameters
    ----------
    rows
        Windows of drives and coast-downs.
    driving_nm
        Torque [w, N·m].
    name
        Of the nuisance.

    """
    if not is_of_current(name) or name not in rows.columns:
        return True
    column = rows.columns[name]
    own = linear_fit(driving_nm[:, None], column).residuals
    return bool(np.linalg.norm(own) > policy().drag.least_own_share * np.linalg.norm(column))


def has_torque_of_its_own(drag: DragFit) -> bool:
    """Whether nuisances of the current's size leave the torque a part of what friction and the
    current's timing leave of it.

    Parameters
    ----------
    drag
        A fit with nuisances.

    """
    torque, others = drag.design[:, 0], np.array([False, *(True for _ in drag.names[1:])])
    of_size = np.array([is_of_size(name) for name in drag.names])
    own, beside_friction = (
        float(np.linalg.norm(linear_fit(drag.design[:, columns], torque).residuals))
        for columns in (others, others & ~of_size)
    )
    return own > policy().drag.least_own_share * beside_friction


def is_of_size(name: str) -> bool:
    """Whether a nuisance goes with the size of the current, and not with its instant.

    Parameters
    ----------
    name
        Of the nuisance.

    """
    return is_of_current(name) and name not in TIMING


def share_of_no_torque(rows: ShaftRows, drag: DragFit) -> float:
    """Share of the drives' acceleration, squared, that follows the torque in no way.

    Parameters
    ----------
    rows
        Windows of drives and coast-downs.
    drag
        Their fit.

    Returns
    -------
    float
        What is left over what no column of the current explains [1], less the current's noise where
        the fit has it; 0 of steady speeds. Where the d current has one size, its square times the q
        current is the torque.

    Notes
    -----
    A torque that is not logged is an error of the driving torque, and where a speed loop fights it
    the current goes with it: it makes g too small, and J too large, by this share
    (`Doubts.middle`).

    References
    ----------
    Fuller, Measurement Error Models, Wiley, 1987, section 1.1. doi:10.1002/9780470316665

    """
    if drag.steady:
        return 0.0
    drives = rows.kind == DRIVE
    others = [k for k, name in enumerate(drag.names) if not is_of_current(name)]
    without = linear_fit(drag.design[:, others], drag.target, drag.sigma)
    costs = [float(np.sum(r[drives] ** 2)) for r in (drag.residuals, without.residuals)]
    if drag.by_current:
        costs[0] = max(costs[0] - float(np.sum(drag.sigma[drives] ** 2)), 0.0)
    return min(costs[0] / costs[1], 1.0) if costs[1] > 0.0 else 1.0


def words_of_no_torque(share: float) -> str:
    """Why there is no inertia of a shaft that may carry a load, in words.

    Parameters
    ----------
    share
        Of the acceleration, squared, that follows no torque [1].

    """
    return (
        f"no drive logs its load, and {100.0 * share:.2g} % of the square of the acceleration "
        "does not follow the current, as with a load"
    )
