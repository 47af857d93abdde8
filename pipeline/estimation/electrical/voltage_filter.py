"""Flux linkage behind a filter of the voltage, which takes more of it the faster a spin is."""

from __future__ import annotations

import numpy as np
from scipy.optimize import least_squares

from pipeline.numerics.least_squares import LinearFit, linear_fit
from pipeline.records.capture import Array


def left_by_filter(speed_elec_rad_s: Array, tau2_s2: float) -> Array:
    """What a filter of first order leaves of a voltage's amplitude.

    Parameters
    ----------
    speed_elec_rad_s : array [n], rad/s
        Electrical speeds.
    tau2_s2
        Square of its time constant [s²]; negative of one that resonates above.

    Returns
    -------
    array [n]
        1/√(1 + ω²τ²) [1].

    """
    return np.maximum(1.0 + tau2_s2 * speed_elec_rad_s**2, 1e-3) ** -0.5


def behind_filter(
    design: Array, psi_wb: Array, sigma_wb: Array, speed_elec_rad_s: Array
) -> LinearFit | None:
    """Flux linkages at several speeds, as a filter of the voltmeter leaves them.

    Parameters
    ----------
    design : array [n, k]
        Flux by its coefficients, such as those of temperature.
    psi_wb, sigma_wb : array [n], Wb
        Flux linkages, and their standard deviations.
    speed_elec_rad_s : array [n], rad/s
        Electrical speeds.

    Returns
    -------
    LinearFit or None
        About its end: the coefficients of the design, and last τ² [s²]. None where the speeds do
        not determine them with one to spare.

    Notes
    -----
    ψ = (design · c)/√(1 + ω²τ²), by nonlinear least squares.

    """
    top = float(np.abs(speed_elec_rad_s).max(initial=0.0))
    if psi_wb.size <= design.shape[1] + 1 or top == 0.0:
        return None
    share = speed_elec_rad_s / top
    start = linear_fit(design, psi_wb, sigma_wb).coefficients

    def residual(c: Array) -> Array:
        return (design @ c[:-1] * left_by_filter(share, c[-1]) - psi_wb) / sigma_wb

    end = least_squares(residual, np.append(start, 0.0), x_scale="jac", method="lm")
    columns, unit = end.jac * sigma_wb[:, None], np.append(np.ones(start.size), top**2)
    target = columns @ end.x - sigma_wb * residual(end.x)
    fit = linear_fit(columns * unit, target, sigma_wb)
    return fit if end.success and fit.full_rank and fit.dof >= 1 else None
