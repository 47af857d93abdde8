"""By how much recorded voltages are turned against the magnet's, from the d voltage at speed.

At a held speed three things are one column of the q voltage, ω² i_q: R, a voltage that is late, and
current that the iron takes beside the magnet's flux. The last two turn the magnet's own voltage off
the q axis, and R does not: v_d shows by how much.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from pipeline.numerics.least_squares import linear_fit
from pipeline.records.capture import Array

Q_FLUX, SPEED2, SPEED2_CURRENT = "q flux", "speed^2", "speed^2 current"
V_D, TURNED = "v_d", "turned"
AXIS_D = ("d current", "d inductive", Q_FLUX)


@dataclass(frozen=True, slots=True)
class Turn:
    """The turn of the voltages, and what is not known of it.

    Attributes
    ----------
    q_voltage_v
        What the turn adds to the q voltage [w, V].
    late_s
        Turn by speed [s, of mechanical radians].
    u_late_s
        Its scatter [s].
    flux_q_wb_a
        p L_q, by the same regression [Wb/A].

    """

    q_voltage_v: Array
    late_s: float
    u_late_s: float
    flux_q_wb_a: float


def voltage_turn(
    columns: Mapping[str, Array], speed_rad_s: Array, ke_v_s_rad: float
) -> Turn | None:
    """The turn of the voltages at held speeds; None where v_d or i_d were not logged.

    Parameters
    ----------
    columns
        Window means [w] of v_d [V], i_d [A] and its rate [A/s], and of their products with speed.
    speed_rad_s
        Window means [w].
    ke_v_s_rad
        Back-EMF constant.

    Returns
    -------
    Turn or None

    Notes
    -----
    v_d = Ke (δ + τ ω) ω + R i_d + L_d di_d/dt - p ω L_q i_q: δ is the frame's angle and τ the
    lateness that the magnet's voltage shows. Turned back, v_q gains (δ + τ ω) v_d. Iron that takes
    the current G dψ/dt has τ = p L_q G, with its sign.

    """
    if not {V_D, TURNED, SPEED2, *AXIS_D} <= columns.keys():
        return None
    wanted = [columns[name] for name in (SPEED2, *AXIS_D)]
    design = np.column_stack([column for column in wanted if np.any(column)])
    both = linear_fit(np.column_stack([design, speed_rad_s]), columns[V_D])
    fit = both if both.full_rank else linear_fit(design, columns[V_D])
    if not fit.full_rank:
        return None
    late, rest = float(fit.coefficients[0]), float(fit.coefficients[-1]) if fit is both else 0.0
    added = (rest * columns[V_D] + late * columns[TURNED]) / ke_v_s_rad
    u_late = float(np.sqrt(fit.covariance[0, 0] * fit.chi2_dof))
    flux_q = -float(fit.coefficients[design.shape[1] - 1])
    return Turn(added, late / ke_v_s_rad, u_late / ke_v_s_rad, flux_q)
