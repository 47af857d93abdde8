"""A fit of the equation of motion to weak-form rows, and the constants in it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.estimation.mechanical.drag_forms import CURVE, DRAG_NAMES, KNOTS, low_end
from pipeline.estimation.mechanical.shaft_rows import ShaftRows
from pipeline.estimation.uncertainty.nuisances import allowed_for
from pipeline.numerics.least_squares import Array, LinearFit, linear_fit


@dataclass(frozen=True, slots=True)
class Design:
    """A design matrix and the names of its columns.

    Attributes
    ----------
    columns
        The matrix [w, k].
    names
        Names of the columns [k].

    """

    columns: Array
    names: tuple[str, ...]

    @classmethod
    def of(
        cls,
        first: Sequence[Array],
        names: tuple[str, ...],
        candidates: Mapping[str, Array],
        chosen: Sequence[str],
    ) -> Design:
        """The first columns, and the chosen ones of the candidates behind them.

        Parameters
        ----------
        first
            The first columns, one or more an array.
        names
            Their names.
        candidates
            Further columns [w] by name.
        chosen
            Which of these join.

        """
        columns = np.column_stack([*first, *(candidates[name] for name in chosen)])
        return cls(columns, (*names, *chosen))


@dataclass(frozen=True, slots=True)
class DragFit:
    """The equation of motion A = g T − Σ a_m f_m(ω) − nuisances, fitted to weak-form rows.

    Attributes
    ----------
    names
        Names of the columns.
    coefficients, covariance
        [k] and [k, k]; g = 1/J first.
    residuals
        [w, rad/s²].
    dof
        Degrees of freedom of the covariance.
    free
        Whether the drag curve was left free (columns `CURVE`), because Coulomb and viscous drag
        with the known additions did not hold.
    u_form
        Allowance [3] for the form of drag on J, T_c and B.
    reasons
        Why J, T_c or B is not identifiable; empty for one that is.
    design, sigma, target
        Columns [w, k], standard deviations [w] and accelerations [w] of the fit.
    fastest_rad_s
        Highest speed of the rows.
    by_current
        Whether the noise is in the torque, and the rows were fitted the other way round.
    steady
        Whether the rows show friction alone: g is 1, and the residuals are torques.

    """

    names: tuple[str, ...]
    coefficients: Array
    covariance: Array
    residuals: Array
    dof: int
    free: bool
    u_form: Array
    reasons: tuple[str, str, str]
    design: Array
    sigma: Array
    target: Array
    fastest_rad_s: float
    by_current: bool = False
    steady: bool = False

    def refit(self, driving_nm: Array) -> Array:
        """The coefficients with another driving torque in the same columns.

        Parameters
        ----------
        driving_nm
            Torque [w, N·m].

        Returns
        -------
        array [k]
            As `coefficients`.

        """
        design = self.design.copy()
        design[:, 0] = driving_nm
        if self.by_current:
            return over_inertia(torque_fit(design, self.target, self.sigma).coefficients)
        return linear_fit(design, self.target, self.sigma).coefficients

    def constants(self, coefficients: Array) -> Array:
        """Inertia, Coulomb and viscous friction from coefficients.

        Parameters
        ----------
        coefficients
            In this fit's columns [k].

        Returns
        -------
        array [3]
            J [kg·m²], T_c [N·m], B [N·m·s/rad]; of a free curve T_c is its end at standstill and B
            its mean slope.

        """
        inertia = 1.0 / coefficients[0]
        if not self.free:
            return np.array([inertia, coefficients[1] * inertia, coefficients[2] * inertia])
        level, slope = low_end(coefficients[1 : 1 + len(KNOTS)], self.fastest_rad_s)
        return np.array([inertia, level * inertia, slope * inertia])

    def scatter(self) -> Array:
        """Factor of the covariance of inertia, Coulomb and viscous friction.

        Returns
        -------
        array [3, 3]
            F with F F' the covariance; rows J, T_c, B, columns the sources that they share.

        """
        step = 1e-6 * np.maximum(np.abs(self.coefficients), np.sqrt(np.diag(self.covariance)))
        columns = []
        for k in range(self.coefficients.size):
            moved = self.coefficients.copy()
            moved[k] += step[k]
            columns.append((self.constants(moved) - self.constants(self.coefficients)) / step[k])
        slope = np.column_stack(columns)
        joint = slope @ self.covariance @ slope.T
        scale = np.sqrt(np.maximum(np.diag(joint), 1e-300))
        correlation = joint / np.outer(scale, scale) + 1e-12 * np.eye(3)
        values, vectors = np.linalg.eigh(correlation)
        return vectors * np.sqrt(np.maximum(values, 0.0)) * scale[:, None]

    def curve(self, rows: ShaftRows) -> tuple[Array, Array, Array]:
        """Drag over speed, for a plot.

        Parameters
        ----------
        rows
            The windows that were fitted.

        Returns
        -------
        speed, drag, line
            [rad/s], [N·m] and the published T_c sign ω + B ω [N·m], by speed, at most 2000 windows.

        """
        inertia = 1.0 / self.coefficients[0]
        drag_columns = [k for k, name in enumerate(self.names) if name in DRAG_NAMES]
        modelled = self.design[:, drag_columns] @ self.coefficients[drag_columns]
        keep = slice(None, None, -(-rows.count // 2000))
        order = np.argsort(rows.speed_rad_s[keep], kind="stable")
        _, level, slope = self.constants(self.coefficients)
        speed = rows.speed_rad_s[keep][order]
        drag = (-(modelled + self.residuals) * inertia)[keep][order]
        return speed, drag, level * np.sign(speed) + slope * speed


def torque_fit(design: Array, target: Array, sigma: Array) -> LinearFit:
    """The equation of motion with all noise in the torque: T = J A + Σ J c_m x_m.

    Parameters
    ----------
    design
        Columns of A = g T + Σ c_m x_m [w, k], the torque first.
    target
        Accelerations A [w, rad/s²].
    sigma
        Standard deviation of each row [w], of any unit.

    Returns
    -------
    LinearFit
        Coefficients J and J c_m [k], residuals in torque [w, N·m].

    References
    ----------
    Fuller, Measurement Error Models, Wiley, 1987, section 1.1. doi:10.1002/9780470316665

    """
    return linear_fit(np.column_stack([target, -design[:, 1:]]), design[:, 0], sigma)


def over_inertia(coefficients: Array) -> Array:
    """Coefficients g and c_m [k] from J and J c_m [k].

    Parameters
    ----------
    coefficients
        Of `torque_fit`.

    """
    return np.array([1.0, *coefficients[1:]]) / coefficients[0]


def drag_description(fit: DragFit) -> str:
    """Description of what the fit holds beside Coulomb and viscous drag.

    Parameters
    ----------
    fit
        The fit.

    """
    added = [n for n in fit.names if n not in ("torque", "coulomb", "viscous", *CURVE)]
    words = "drag curve left free, its form is not Coulomb and viscous" if fit.free else ""
    return "; ".join(w for w in (words, allowed_for(added)) if w) or "Coulomb and viscous drag hold"
