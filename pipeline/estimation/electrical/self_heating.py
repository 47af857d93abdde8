"""How far a winding warms within a capture of direct current, by its own resistance."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from pipeline.estimation.policy import policy
from pipeline.numerics.integrals import trapezoid
from pipeline.numerics.least_squares import linear_fit
from pipeline.numerics.plateaus import Plateau
from pipeline.records.capture import Array


def warming(columns: Mapping[str, Array], plateaus: Sequence[Plateau]) -> float:
    """The rise of resistance within a capture, relative to its start [1].

    Parameters
    ----------
    columns
        `t_s`, `v_v` and `i_a` [n] of a terminal pair.
    plateaus
        Settled stretches of the current.

    Returns
    -------
    float
        With its standard uncertainty added in quadrature; 0 where the plateaus do not part it from
        resistance and offsets.

    Notes
    -----
    V = V_off + V_0 sign(I) + R (1 + g E) I, dE/dt = I² - E/τ: a body of one heat capacity, which
    the current heats, E = 0 at the start. Of a few τ, shares of the capture's length, the one that
    leaves least counts. A thermometer is not asked.

    References
    ----------
    Incropera, DeWitt, Bergman and Lavine, Fundamentals of Heat and Mass Transfer, 6th ed., 5.1
    (lumped capacitance).

    """
    how = policy().self_heating
    shares = [np.inf, *(how.cooling_step**-k for k in range(how.cooling_times))]
    t, current = columns["t_s"], columns["i_a"]
    rows = [part for plateau in plateaus for part in np.array_split(_rows_of(plateau), how.parts)]
    rows = [part for part in rows if part.size]
    volts, amps = (np.array([float(columns[n][p].mean()) for p in rows]) for n in ("v_v", "i_a"))
    weights = 1.0 / np.sqrt([float(part.size) for part in rows])
    best, rise = np.inf, 0.0
    for share in shares:
        heat = _heat(t, current**2, share * float(t[-1] - t[0]))
        over = np.array([float(heat[part].mean()) for part in rows])
        design = np.column_stack([amps, amps * over])
        for column in (np.sign(amps), np.ones(amps.size)):
            wider = np.column_stack([design, column])
            design = wider if linear_fit(wider, volts).full_rank else design
        fit = linear_fit(design, volts, weights)
        left = float(np.sum((fit.residuals / weights) ** 2))
        if fit.full_rank and fit.dof > 0 and left < best:
            size = float(heat.max()) / float(fit.coefficients[0])
            found, u = fit.coefficients[1] * size, fit.u(1) * fit.chi2_dof**0.5 * size
            best, rise = left, float(np.hypot(max(float(found), 0.0), u))
    return rise


def _rows_of(plateau: Plateau) -> Array:
    return np.arange(plateau.rows.start, plateau.rows.stop)


def _heat(t_s: Array, power: Array, tau_s: float) -> Array:
    """E [n] of dE/dt = power - E/τ."""
    if not np.isfinite(tau_s):
        return trapezoid(t_s, power)
    place = (t_s - t_s[0]) / tau_s
    return trapezoid(t_s, power * np.exp(place)) * np.exp(-place)
