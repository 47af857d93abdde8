"""What the instants of samples leave open of the inertia and the drag of a shaft."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from pipeline.estimation.mechanical.drag_fit import DragFit
from pipeline.estimation.mechanical.shaft_nuisances import (
    CURRENT_LAG,
    JUMPS,
    LATE_CURRENT,
    LATE_LOAD,
    RELUCTANCE,
)
from pipeline.estimation.mechanical.shaft_rows import ShaftRows
from pipeline.estimation.policy import policy
from pipeline.numerics.least_squares import Array, autocorrelation_time, linear_fit


def drag_beside_late_samples(
    rows: ShaftRows, drag: DragFit, kt_nm_a: float, reluctance_known: bool
) -> DragFit:
    """The same fit, in doubt by the instants that samples of current and load stand for, and by a
    reluctance torque that nothing shows.

    Parameters
    ----------
    rows
        Windows of drives and coast-downs.
    drag
        Their fit.
    kt_nm_a
        Torque constant [N·m/A].
    reluctance_known
        Whether the torque holds what reluctance adds to it.

    Returns
    -------
    DragFit
        With the change of J, T_c and B in `u_form` that a current or a load makes which is late by
        up to half of its row, to first and to second order, that a jump of the current anywhere
        between two rows makes, and reluctance of up to `most_reluctance`, as far as the rows leave
        it open.

    Notes
    -----
    T(t + τ) = T + τ T' + τ² T''/2, and no capture states whether a row is a sample or a mean.
    Anything up to half a row is as likely (GUM 4.3.7). What accelerates a motor that drives a heavy
    machine is the difference of two torques, as small as these terms.

    """
    if drag.steady:
        return drag
    late = [rows.columns[name] for name in LATE_LOAD]
    if CURRENT_LAG not in drag.names:
        late += [kt_nm_a * rows.columns[name] for name in (*LATE_CURRENT, JUMPS)]
    largest = float(np.max(np.hypot(rows.q_current_a, rows.columns["d current"]), initial=0.0))
    if not reluctance_known and RELUCTANCE not in drag.names and largest > 0.0:
        most = policy().drag.most_reluctance * kt_nm_a / largest
        late.append(most * rows.columns[RELUCTANCE])
    own = drag.constants(drag.coefficients)
    square = drag.u_form**2
    for column in filter(np.any, late):
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
