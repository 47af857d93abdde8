"""Whether the windows of drive logs can carry an inertia with its uncertainty."""

from __future__ import annotations

import numpy as np

from pipeline.estimation.mechanical.shaft_rows import COAST, DRIVE, ShaftRows
from pipeline.estimation.policy import policy
from pipeline.numerics.least_squares import Array


def drive_columns(rows: ShaftRows) -> int:
    """Columns that drives determine: 1/J, and drag's two where no coast-down fixes them.

    Parameters
    ----------
    rows
        Windows of drives and coast-downs.

    """
    return 1 if coasts_decide(rows) else 3


def freedom(rows: ShaftRows) -> int:
    """Disjoint drive windows beyond the columns that drives alone must determine.

    Parameters
    ----------
    rows
        Rows of the equation of motion.

    Returns
    -------
    int
        Degrees of freedom; negative where there are too few windows.

    """
    return rows.disjoint(DRIVE) - drive_columns(rows)


def coasts_decide(rows: ShaftRows) -> bool:
    """Whether there are coasts enough to show drag by themselves.

    Parameters
    ----------
    rows
        Windows of drives and coast-downs.

    """
    return bool(np.count_nonzero(rows.kind == COAST) >= policy().drag.enough_coasting_rows)


def too_short(rows: ShaftRows) -> str:
    """Why the drive windows cannot carry an inertia with its uncertainty.

    Parameters
    ----------
    rows
        Windows of drives and coast-downs.

    Returns
    -------
    str
        Empty where they can.

    Notes
    -----
    The scatter s of ν degrees of freedom is itself known to 1/√(2ν): a quarter at
    `drag.least_freedom`. Fewer show neither how sure J is nor whether a nuisance is there.

    References
    ----------
    JCGM 100:2008 (GUM), E.4.3.

    """
    least = policy().drag.least_freedom
    if freedom(rows) >= least:
        return ""
    return (
        f"the drive logs hold only {rows.disjoint(DRIVE)} windows that share no sample and in "
        f"which the shaft turns, {least + drive_columns(rows)} are needed to know how "
        "sure the inertia is"
    )


def torque_is_separable(design: Array, sigma: Array) -> bool:
    """Whether the torque is no linear combination of the other columns.

    Parameters
    ----------
    design
        Columns of the regression [w, k], the torque first.
    sigma
        Standard deviation of each row [w].

    Returns
    -------
    bool
        By the rank of the columns, scaled to unit length.

    """
    scaled = design / sigma[:, None]
    norm = np.linalg.norm(scaled, axis=0)
    scaled = scaled / np.where(norm > 0.0, norm, 1.0)
    drags = scaled[:, 1:]
    ranks = [int(np.linalg.matrix_rank(m, tol=1e-8)) for m in (scaled, drags)]
    return ranks[0] > ranks[1]
