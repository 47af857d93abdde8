"""What the instants of a load's samples leave open of the inertia and the drag of a shaft."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from pipeline.estimation.mechanical.drag_fit import DragFit
from pipeline.estimation.mechanical.shaft_nuisances import LATE_LOAD
from pipeline.estimation.mechanical.shaft_rows import ShaftRows
from pipeline.estimation.policy import policy
from pipeline.numerics.least_squares import Array, autocorrelation_time, linear_fit


def drag_beside_late_load(rows: ShaftRows, drag: DragFit) -> DragFit:
    """The same fit, in doubt by the instants that the samples of a load stand for.

    Parameters
    ----------
    rows
        Windows of drives and coast-downs.
    drag
        Their fit.

    Returns
    -------
    DragFit
        With the change of J, T_c and B in `u_form` that a load makes which is late by up to half of
        its row, to first and to second order, as far as the rows leave it open.

    Notes
    -----
    What accelerates is the difference of two torques, and no capture states whether a row of each
    is a sample or a mean. T(t + τ) = T + τ T' + τ² T''/2: of a motor that drives a heavy machine
    the difference is as small as these terms. Anything up to half a row is as likely (GUM 4.3.7).

    """
    late = [rows.columns[name] for name in LATE_LOAD]
    if drag.steady or not np.any(late[1]):
        return drag
    own = drag.constants(drag.coefficients)
    square = drag.u_form**2
    for column in late:
        size = open_size(drag, column)
        moved = [drag.constants(drag.refit(drag.design[:, 0] + k * column)) for k in (-size, size)]
        square = square + np.max(np.abs(np.array(moved) - own), axis=0) ** 2
    return replace(drag, u_form=np.sqrt(square))


def open_size(drag: DragFit, torque_nm: Array) -> float:
    """How much of a torque a fit may lack that holds between -1 and 1 of it.

    Parameters
    ----------
    drag
        A fit.
    torque_nm
        The torque [w, N·m].

    Returns
    -------
    float
        Root mean square [1] of what the rows say beside the rectangular prior of 1/√3.

    """
    design, target, sigma = drag.design, drag.target, drag.sigma
    column = drag.coefficients[0] * torque_nm
    if drag.by_current:
        design, target = np.column_stack([target, -design[:, 1:]]), design[:, 0]
        column, sigma = torque_nm, sigma / drag.coefficients[0]
    fit = linear_fit(np.column_stack([design, column]), target, sigma)
    tau = max(
        autocorrelation_time(fit.residuals / sigma, policy().evidence.memory_rows),
        1.0 / (1.0 - policy().shaft_rows.overlap),
    )
    precision = 1.0 / max(float(fit.covariance[-1, -1]) * fit.chi2_dof * tau, 1e-12)
    variance = 1.0 / (3.0 + precision)
    return math.hypot(math.sqrt(variance), variance * precision * float(fit.coefficients[-1]))
