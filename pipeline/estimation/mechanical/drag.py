"""Inertia and drag from weak-form rows: Coulomb and viscous where that holds, a free curve else."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import fdtrc

from pipeline.estimation.mechanical.shaft_rows import COAST, DRIVE, ShaftRows
from pipeline.estimation.policy import policy
from pipeline.estimation.uncertainty.nuisances import allowed_for
from pipeline.numerics.clusters import cluster_covariance
from pipeline.numerics.least_squares import Array, LinearFit, autocorrelation_time, linear_fit
from pipeline.numerics.selection import needed_columns

# Shares of the highest speed, denser where friction bends. Chords of a square of speed are off by
# a quarter of the square of their width: by 1.2 % of the largest drag at most, within
# `drag.material_share`.
KNOTS = (0.0, 0.03, 0.06, 0.1, 0.16, 0.24, 0.34, 0.46, 0.6, 0.78, 1.0)
# Widths of Stribeck's excess, from what the slowest rows resolve (`SLOWEST_SHARE`) to where it is
# as good as viscous drag. A fifth apart, the nearest one is off by 7 % of the excess at most.
BUMPS = tuple(float(f"{0.008 * 1.2**k:.3g}") for k in range(19))
SHAPES: dict[str, Callable[[Array], Array]] = {
    "gauss": lambda x: np.asarray(np.exp(-(x**2))),
    "exponential": lambda x: np.asarray(np.exp(-np.abs(x))),
    "rational": lambda x: np.asarray(1.0 / (1.0 + x**2)),
}
CURVE = tuple(f"knot {k}" for k in range(len(KNOTS)))


def _hat(index: int) -> Callable[[Array], Array]:
    """Odd function of speed that is 1 at one knot and falls linearly to 0 at its neighbours."""
    heights = [1.0 if k == index else 0.0 for k in range(len(KNOTS))]
    return lambda x: np.sign(x) * np.interp(np.abs(x), KNOTS, heights)


def _bump(shape: str, width: float) -> Callable[[Array], Array]:
    """Stribeck's excess in one of the shapes in use (Armstrong-Hélouvry, Control of Machines with
    Friction, 1991, 2.3), falling over a speed `width`.
    """
    return lambda x: np.sign(x) * SHAPES[shape](x / width)


_BUMPS = {f"stribeck {shape} {width:g}": _bump(shape, width) for shape in SHAPES for width in BUMPS}
DRAG_FORMS: dict[str, Callable[[Array], Array]] = {
    "windage": lambda x: x * np.abs(x),
    **_BUMPS,
    **{f"knot {k}": _hat(k) for k in range(len(KNOTS))},
}
STRIBECK = tuple(_BUMPS)
FORMS = ("windage", *STRIBECK)


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
        level, slope = _low_end(coefficients[1 : 1 + len(KNOTS)], self.fastest_rad_s)
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
        drag_columns = [k for k, name in enumerate(self.names) if name in _DRAG_NAMES]
        modelled = self.design[:, drag_columns] @ self.coefficients[drag_columns]
        keep = slice(None, None, -(-rows.count // 2000))
        order = np.argsort(rows.speed_rad_s[keep], kind="stable")
        _, level, slope = self.constants(self.coefficients)
        speed = rows.speed_rad_s[keep][order]
        drag = (-(modelled + self.residuals) * inertia)[keep][order]
        return speed, drag, level * np.sign(speed) + slope * speed


_DRAG_NAMES = ("coulomb", "viscous", *FORMS, *CURVE)


def drag_of(rows: ShaftRows, law: Array, nuisances: Sequence[str], level: float) -> DragFit:
    """Fits the rows: Coulomb and viscous first, then what the data demand, then a free curve.

    Parameters
    ----------
    rows
        Windows of drives and coast-downs.
    law : array [w, 3]
        Columns of 1/J, T_c/J and B/J (`estimators.inertia.acceleration`).
    nuisances
        Names of columns of the rows that may join.
    level
        Chance of a false alarm over all that may join.

    Notes
    -----
    The rows' noise, and how many of them count as one, are judged on what the richest model
    leaves: what a poor one leaves is large and correlated because it is poor.

    """
    y = rows.acceleration_rad_s2
    usable = [n for n in nuisances if float(np.ptp(rows.columns[n])) > 0.0]
    candidates = {name: -rows.columns[name] for name in [*usable, *FORMS]}
    base, driving_nm = law, law[:, 0]
    curve_columns = [-rows.columns[n] for n in CURVE]
    rich = np.column_stack([driving_nm, *curve_columns, *(candidates[n] for n in usable)])
    if rows.disjoint(DRIVE) < rich.shape[1]:
        rich = base
    sigma = _balanced(rows, rich, y)
    tau = autocorrelation_time(
        linear_fit(rich, y, sigma).residuals / sigma, policy().evidence.memory_rows
    )
    pool = {n: candidates[n] for n in [*usable, "windage"]}
    chosen = needed_columns(base, pool, y, sigma, level, _most_nuisances(rows), tau)
    start = np.column_stack([base, *(candidates[n] for n in chosen)])
    bumps = {n: candidates[n] for n in STRIBECK}
    chosen += needed_columns(start, bumps, y, sigma, level, 1, tau)
    chosen = _without_dip(chosen, base, candidates, y, sigma)
    design = Design.of([base], ("torque", "coulomb", "viscous"), candidates, chosen)
    sigma = _balanced(rows, design.columns, y)
    without_forms = [n for n in chosen if n not in FORMS]
    first = [driving_nm, *curve_columns]
    curve = Design.of(first, ("torque", *CURVE), candidates, without_forms)
    free = _form_fails(rows, design, curve, y, level) or _implausible(rows, design, y, sigma)
    if free:
        design = curve
        sigma = _balanced(rows, design.columns, y)
    fit = linear_fit(design.columns, y, sigma)
    covariance, dof = _covariance(rows, design.columns, fit, sigma)
    u_form, reasons = _form(fit.coefficients, free, rows)
    if not free:
        u_form = _shape_doubt(base, candidates, chosen, fit.coefficients, y, sigma)
    return DragFit(
        design.names, fit.coefficients, covariance, fit.residuals, dof, free, u_form, reasons,
        design.columns, sigma, y, rows.fastest_rad_s,
    )  # fmt: skip


def _most_nuisances(rows: ShaftRows) -> int:
    """How many nuisances the disjoint drive windows can carry."""
    carried = rows.disjoint(DRIVE) // policy().drag.rows_a_column - _drive_columns(rows)
    return min(policy().drag.most_nuisances, max(0, carried))


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
    return rows.disjoint(DRIVE) - _drive_columns(rows)


def _drive_columns(rows: ShaftRows) -> int:
    """Columns that drives determine: g, and drag's two where no coast-down fixes them."""
    return 1 if coasts_decide(rows) else 3


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
        f"which the shaft turns, {least + _drive_columns(rows)} are needed to know how "
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


def _covariance(rows: ShaftRows, design: Array, fit: LinearFit, sigma: Array) -> tuple[Array, int]:
    """Covariance of the coefficients and its degrees of freedom.

    Under any correlation inside clusters where the drives fill enough of them; with few, the
    clusters' scores all but cancel (one alone: exactly, as least squares makes their sum zero),
    so that the residual variance and the number of windows that count as one stand in.
    Reference: Cameron and Miller, J. Human Resources 50(2), 2015, VI.
    """
    if np.unique(rows.cluster[rows.kind == DRIVE]).size >= policy().evidence.clusters:
        return cluster_covariance(design, fit.residuals, sigma, rows.cluster)
    tau = max(
        autocorrelation_time(fit.residuals / sigma, policy().evidence.memory_rows),
        1.0 / (1.0 - policy().shaft_rows.overlap),
    )
    return fit.covariance * fit.chi2_dof * tau, max(freedom(rows), 1)


def _balanced(rows: ShaftRows, design: Array, y: Array) -> Array:
    """Standard deviation [w] of each row: one for drives, one for coast-downs, from the fit.

    Each kind starts from what a fit of its own leaves, so that the better one leads.
    """
    sigma = np.ones(y.size)
    floor = max(1e-6 * float(np.std(y)), 1e-300)
    kinds = [of_kind for of_kind in (rows.kind == DRIVE, rows.kind == COAST) if np.any(of_kind)]
    for of_kind in kinds:
        residuals = linear_fit(design[of_kind], y[of_kind]).residuals
        sigma[of_kind] = max(float(np.sqrt(np.mean(residuals**2))), floor)
    for _ in range(3):
        residuals = linear_fit(design, y, sigma).residuals
        for of_kind in kinds:
            sigma[of_kind] = max(float(np.sqrt(np.mean(residuals[of_kind] ** 2))), floor)
    return sigma


def _form_fails(rows: ShaftRows, design: Design, curve: Design, y: Array, level: float) -> bool:
    """Whether a free drag curve explains the rows better, beyond chance and beyond what matters.

    Coast-downs show drag alone, so where there are enough of them they decide: the form fails if
    it leaves more than `drag.material_share` of their deceleration (they see a millionth of it).
    Else chance is judged by F with correlation counted, and a free curve must also move the drag
    by more than that share of itself (rms over the rows).
    """
    coasting = rows.kind == COAST
    if coasts_decide(rows):
        straight_fit = linear_fit(design.columns, y, _balanced(rows, design.columns, y))
        rms = np.sqrt(np.mean(straight_fit.residuals[coasting] ** 2))
        return bool(rms > policy().drag.material_share * np.sqrt(np.mean(y[coasting] ** 2)))
    sigma = _balanced(rows, curve.columns, y)
    loose, strict = linear_fit(curve.columns, y, sigma), linear_fit(design.columns, y, sigma)
    costs = [float(np.sum((f.residuals / sigma) ** 2)) for f in (loose, strict)]
    tau = autocorrelation_time(loose.residuals / sigma, policy().evidence.memory_rows)
    dof = y.size - len(curve.names)
    free = max(dof / tau, 1.0)
    extra = max(len(CURVE) - 2, 1)
    statistic = (costs[1] - costs[0]) / extra / tau / (costs[0] / dof)
    if fdtrc(extra, free, max(statistic, 0.0)) >= level:
        return False
    curved, straight = _drag_part(curve, loose), _drag_part(design, strict)
    return bool(
        np.std(curved - straight) > policy().drag.material_share * np.sqrt(np.mean(curved**2))
    )


def _without_dip(
    chosen: list[str], base: Array, candidates: Mapping[str, Array], y: Array, sigma: Array
) -> list[str]:
    """The columns without Stribeck's where it came out below Coulomb friction: it is an excess."""
    design = np.column_stack([base, *(candidates[n] for n in chosen)])
    coefficients = linear_fit(design, y, sigma).coefficients[base.shape[1] :]
    values = dict(zip(chosen, coefficients, strict=True))
    return [n for n in chosen if n not in STRIBECK or values[n] > 0.0]


def _shape_doubt(
    base: Array,
    candidates: Mapping[str, Array],
    chosen: Sequence[str],
    coefficients: Array,
    y: Array,
    sigma: Array,
) -> Array:
    """Half of how far T_c and B move with the next best shape of Stribeck's excess; 0 for J."""
    bumps = [n for n in chosen if n in STRIBECK]
    if not bumps:
        return np.zeros(3)
    used = bumps[0].split()[1]
    without_bump = np.column_stack([base, *(candidates[n] for n in chosen if n not in STRIBECK)])
    others = [
        np.column_stack([without_bump, candidates[n]]) for n in STRIBECK if n.split()[1] != used
    ]
    fits = [linear_fit(design, y, sigma) for design in others]
    second = min(fits, key=lambda f: f.chi2_dof).coefficients
    apart = [
        abs(second[k] / second[0] - coefficients[k] / coefficients[0]) if k else 0.0
        for k in range(3)
    ]
    return np.array(apart) / 2.0


def _implausible(rows: ShaftRows, design: Design, y: Array, sigma: Array) -> bool:
    """Whether the fitted drag is no friction: a negative Coulomb or viscous part."""
    fit = linear_fit(design.columns, y, sigma)
    u = np.sqrt(np.diag(_covariance(rows, design.columns, fit, sigma)[0]))
    parts = [design.names.index("coulomb"), design.names.index("viscous")]
    return any(fit.coefficients[k] < -policy().evidence.sigmas * u[k] for k in parts)


def _drag_part(design: Design, fit: LinearFit) -> Array:
    """Drag [w] in torque that a fit gives each row: its drag columns over g."""
    places = [k for k, name in enumerate(design.names) if name in _DRAG_NAMES]
    return design.columns[:, places] @ fit.coefficients[places] / fit.coefficients[0]


def _low_end(curve: Array, fastest: float) -> tuple[float, float]:
    """Drag extrapolated to standstill from the slowest knots, and the mean slope of the curve."""
    speeds = np.array(KNOTS) * fastest
    level = float(np.polyfit(speeds[:3], curve[:3], 1)[1])
    slope = float(np.polyfit(speeds, curve, 1)[0])
    return level, slope


def _form(coefficients: Array, free: bool, rows: ShaftRows) -> tuple[Array, tuple[str, str, str]]:
    """Allowance for the form of drag, and why a constant of it has no meaning."""
    if not free:
        return np.zeros(3), ("", "", "")
    inertia = 1.0 / coefficients[0]
    curve = coefficients[1 : 1 + len(KNOTS)] * inertia
    slope = np.diff(curve) / (np.diff(KNOTS) * rows.fastest_rad_s)
    level = _low_end(curve, rows.fastest_rad_s)[0]
    beyond = float(curve[1] - (curve[2] - curve[1]) * KNOTS[1] / (KNOTS[2] - KNOTS[1]))
    spread = max(abs(float(curve[0]) - level), abs(beyond - level))
    why = (
        "drag is not Coulomb and viscous: its slope runs from "
        f"{slope.min():.2g} to {slope.max():.2g} N·m·s/rad over the speeds; see the drag curve, "
        "and record spin_downs with and without the suspected drag"
    )
    return np.array([0.0, spread, 0.0]), ("", "", why)


def drag_words(fit: DragFit) -> str:
    """What the fit holds beside Coulomb and viscous drag, in words.

    Parameters
    ----------
    fit
        The fit.

    """
    added = [n for n in fit.names if n not in ("torque", "coulomb", "viscous", *CURVE)]
    words = "drag curve left free, its form is not Coulomb and viscous" if fit.free else ""
    return "; ".join(w for w in (words, allowed_for(added)) if w) or "Coulomb and viscous drag hold"
