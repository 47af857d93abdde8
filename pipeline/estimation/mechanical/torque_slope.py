"""The torque per q ampere at small current, where saturation bends the torque."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.estimation.electrical.operating_points import Point
from pipeline.estimation.policy import policy
from pipeline.numerics.least_squares import Array, linear_fit


@dataclass(frozen=True, slots=True)
class Slope:
    """Torque per q ampere at small current.

    Attributes
    ----------
    kt_nm_a
        The slope [N·m/A].
    u_nm_a
        Its standard uncertainty from scatter [N·m/A].
    dof
        Operating points less fitted columns.
    form_nm_a
        Doubt of the form of saturation [N·m/A].

    """

    kt_nm_a: float
    u_nm_a: float
    dof: int
    form_nm_a: float

    def times(self, factor: float) -> Slope:
        """The slope in another unit or convention.

        Parameters
        ----------
        factor
            Of value, scatter and doubt alike; the uncertainties stay positive.

        """
        return replace(
            self,
            kt_nm_a=factor * self.kt_nm_a,
            u_nm_a=abs(factor) * self.u_nm_a,
            form_nm_a=abs(factor) * self.form_nm_a,
        )


def slope_without_d(
    points: Sequence[Point], alpha_1_k: float, turned: bool, rubbing: bool
) -> Slope | None:
    """K from the points without d current by odd powers of i_q; None where those are too few.

    T(0, i_q) = 1.5 p psi_d(0, i_q) i_q with psi_d even in i_q, so nothing that saturation does to
    the reluctance torque leaks into K. Odd powers join one by one while the last is significant;
    what the next one would move K by is the doubt of the form, or half of what the last did where
    the currents allow no further one. `turned` frames add an even power (reluctance at the d
    current that a wrong angle makes), `rubbing` load friction. K is that of a magnet at 25 degC.


    Parameters
    ----------
    points
        Settled points.
    alpha_1_k
        Coefficient of the magnet's flux at 25 degC [1/K].
    turned
        Whether the frame may be turned.
    rubbing
        Whether friction may go with torque.

    Returns
    -------
    Slope or None
        [N·m/A].

    """
    largest = max(abs(p.iq_a) for p in points)
    rows = [p for p in points if abs(p.id_a) < policy().flux_pairs.same_current * largest]
    groups = sorted({p.group for p in rows})
    levels = len(
        {round(abs(p.iq_a) / (policy().flux_pairs.same_current * largest)) for p in rows} - {0}
    )
    if levels < 3 or len(rows) < len(groups) + 6:
        return None
    i_q = np.array([p.iq_a for p in rows])
    warm = 1.0 + alpha_1_k * (np.array([p.temp_magnet_degc for p in rows]) - 25.0)
    columns = [np.array([p.group == g for p in rows], dtype=float) for g in groups]
    if turned:
        columns.append((i_q / largest) ** 2)
    if rubbing:
        columns.append(np.abs(i_q) * np.sign([p.omega_mech_rad_s for p in rows]))
    columns.append(i_q * warm)
    return _ladder(
        columns, i_q / largest, rows, min(2 * levels - 3, policy().torque_slope.highest_power)
    )


def _ladder(
    columns: list[Array], share: Array, rows: Sequence[Point], highest: int
) -> Slope | None:
    """The slope with as many odd powers as the torque needs; `columns` end with that of K."""
    from scipy.special import fdtrc

    at = len(columns) - 1
    torque = np.array([p.torque_of_means_nm for p in rows])
    counts = np.array([p.rows for p in rows], dtype=float)
    best: Slope | None = None
    for power in range(1, highest + 1, 2):
        wider = columns + [share**k for k in range(3, power + 1, 2)]
        fit = linear_fit(np.column_stack(wider), torque, np.sqrt(counts.mean() / counts))
        if fit.dof < 3:
            break
        covariance = fit.covariance * fit.chi2_dof
        value, u = float(fit.coefficients[at]), float(np.sqrt(covariance[at, at]))
        if best is None:
            best = Slope(value, u, fit.dof, 0.0)
            continue
        step = abs(value - best.kt_nm_a)
        added = float(fit.coefficients[-1]) ** 2 / max(float(covariance[-1, -1]), 1e-300)
        if fdtrc(1.0, fit.dof, added) > policy().torque_slope.level:
            return replace(best, form_nm_a=step)
        best = Slope(value, u, fit.dof, step / 2.0)
    return best
