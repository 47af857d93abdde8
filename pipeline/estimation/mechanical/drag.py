"""Inertia and drag from weak-form rows: Coulomb and viscous where that holds, a free curve else."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.special import fdtrc

from pipeline.estimation.mechanical.drag_fit import Design, DragFit, over_inertia, torque_fit
from pipeline.estimation.mechanical.drag_forms import (
    CURVE,
    DRAG_NAMES,
    FORMS,
    KNOTS,
    LOW_KNOTS,
    STRIBECK,
    WINDAGE,
    low_end,
)
from pipeline.estimation.mechanical.drive_windows import coasts_decide, drive_columns, freedom
from pipeline.estimation.mechanical.shaft_nuisances import (
    BY_SENSE,
    COAST_LOAD,
    CURRENT_LAG,
    CURVATURE,
    OFFSET,
    SAMPLED,
    TIMING,
    is_of_current,
)
from pipeline.estimation.mechanical.shaft_rows import COAST, CURRENT_NOISE, DRIVE, ShaftRows
from pipeline.estimation.mechanical.torque_share import has_torque_of_its_own, is_of_size
from pipeline.estimation.policy import policy
from pipeline.numerics.clusters import cluster_covariance
from pipeline.numerics.least_squares import (
    Array,
    LinearFit,
    autocorrelation_time,
    fit_by_groups,
    linear_fit,
)
from pipeline.numerics.selection import needed_columns

_STEADY = (
    "the speed is steady in every row, or changes between two; record a drive that accelerates and "
    "brakes over many rows, or a spin_down"
)
_UNSEEN = (
    "the slowest row turns at {:.3g} rad/s, and a drag curve is not drawn on to standstill from "
    "there; record spin_downs down to rest"
)
_UNSUPPORTED = (
    "the drag curve is followed to no low speed: drawn on to standstill it is open by {:.2g} N·m, "
    "more than all drag that was seen; record spin_downs down to rest"
)


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
    first = [law[:, 0], *(-rows.columns[n] for n in CURVE)]
    richest = np.column_stack([*first, *(candidates[n] for n in usable)])
    if rows.disjoint(DRIVE) < richest.shape[1]:
        richest = law
    chosen = _additions(rows, law, candidates, richest, level)
    design = Design.of([law], ("torque", "coulomb", "viscous"), candidates, chosen)
    sigma = _row_sigma(rows, design.columns, y)
    without_forms = [n for n in chosen if n not in FORMS]
    curve = Design.of(first, ("torque", *CURVE), candidates, without_forms)
    free = _form_fails(rows, design, curve, y, level) or _implausible(rows, design, y, sigma)
    if free:
        design = curve
        sigma = _row_sigma(rows, design.columns, y)
    fit = linear_fit(design.columns, y, sigma)
    covariance, dof = _covariance(rows, design.columns, fit, sigma)
    u_form, reasons = _form_allowance(fit.coefficients, free, rows)
    if not free:
        u_form = _shape_allowance(law, candidates, chosen, fit.coefficients, y, sigma)
    return DragFit(
        design.names, fit.coefficients, covariance, fit.residuals, dof, free, u_form, reasons,
        design.columns, sigma, y, rows.fastest_rad_s,
    )  # fmt: skip


def drag_of_motion(
    rows: ShaftRows, law: Array, nuisances: Sequence[str], level: float, kt_nm_a: float
) -> DragFit:
    """The equation of motion fitted to the rows, whichever of its sides the noise is in.

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
    kt_nm_a
        Torque constant [N·m/A].

    """
    noise_nm = kt_nm_a * rows.columns[CURRENT_NOISE]
    by_current = drag_by_current(rows, law, nuisances, level, noise_nm)
    if by_current is not None:
        return by_current
    drag = drag_of(rows, law, nuisances, level)
    if not has_torque_of_its_own(drag):
        # several nuisances of a current of one size are its torque together
        nuisances = [name for name in nuisances if not is_of_size(name)]
        drag = drag_of(rows, law, nuisances, level)
    if OFFSET in drag.names:
        drag = drag_beside_offset(rows, law, nuisances, level)
    drag = drag_beside_lag(rows, drag, kt_nm_a)
    return drag_beside_current(rows, drag, smoothed=not rows.by_angle)


def drag_beside_offset(
    rows: ShaftRows, law: Array, nuisances: Sequence[str], level: float
) -> DragFit:
    """The equation of motion where drives show a torque that is constant.

    Parameters
    ----------
    rows, law, nuisances, level
        As `drag_of` takes them.

    Returns
    -------
    DragFit
        It may be an error of the current, a load, or a friction that differs by sense: in coasts of
        one sense that would be friction. So coasts have a constant torque of their own, and what
        J, T_c and B would change by if viscous drag differed by sense too is in doubt.

    """
    drag = drag_of(rows, law, [*nuisances, COAST_LOAD], level)
    by_sense = drag_of(rows, law, [*nuisances, COAST_LOAD, BY_SENSE], level)
    if BY_SENSE not in by_sense.names:
        return drag
    change = by_sense.constants(by_sense.coefficients) - drag.constants(drag.coefficients)
    return replace(drag, u_form=np.hypot(drag.u_form, change))


def drag_beside_current(rows: ShaftRows, drag: DragFit, smoothed: bool) -> DragFit:
    """The same fit, in doubt by what nuisances of the current move its constants.

    Parameters
    ----------
    rows
        Windows of drives and coast-downs.
    drag
        Their fit.
    smoothed
        Whether the motion is a bench's own speed, which lags.

    Returns
    -------
    DragFit
        With the change of J, T_c and B in `u_form` that each of these nuisances makes, and all do
        together, times √(χ²/χ₀²), χ₀² being that of the drives without it; of the current's instant
        all of it where the motion is smoothed, for that bends as a late current does.

    Notes
    -----
    A column that goes with the current or its instant is much like the torque, and takes its place
    where it follows another error. Where it explains all that the torque leaves, there is none.

    """
    certain = {"torque"} if smoothed else {"torque"} | TIMING
    beside = [k for k, n in enumerate(drag.names) if is_of_current(n) and n not in certain]
    square = drag.u_form**2
    for left_out in {(k,) for k in beside} | {tuple(beside)} - {()}:
        square = square + _moved_by(rows, drag, left_out, smoothed) ** 2
    return replace(drag, u_form=np.sqrt(square))


def drag_beside_lag(rows: ShaftRows, drag: DragFit, kt_nm_a: float) -> DragFit:
    """The same fit, in doubt by what a late current is beyond its rate of change.

    Parameters
    ----------
    rows
        Windows of drives and coast-downs.
    drag
        Their fit.
    kt_nm_a
        Torque constant [N·m/A].

    Returns
    -------
    DragFit
        With the change of J, T_c and B in `u_form` that the next term makes.

    Notes
    -----
    T(t + τ) = T + τ T' + τ² T''/2: without the last, a torque of the frequency ω counts cos(ωτ). It
    is a doubt, since a row that is late may be a sample or a mean, which counts sin(ωτ)/(ωτ).

    """
    if CURRENT_LAG not in drag.names or not drag.coefficients[0]:
        return drag
    late = drag.coefficients[drag.names.index(CURRENT_LAG)] / (drag.coefficients[0] * kt_nm_a)
    design = drag.design.copy()
    design[:, 0] += 0.5 * late**2 * kt_nm_a * rows.columns[CURVATURE]
    others = linear_fit(design, drag.target, drag.sigma).coefficients
    change = drag.constants(others) - drag.constants(drag.coefficients)
    return replace(drag, u_form=np.hypot(drag.u_form, change))


def _moved_by(rows: ShaftRows, drag: DragFit, columns: Sequence[int], smoothed: bool) -> Array:
    """What J, T_c and B [3] change by without some columns, as far as it is in doubt."""
    keep = ~np.isin(np.arange(len(drag.names)), columns)
    others = linear_fit(drag.design[:, keep], drag.target, drag.sigma)
    coefficients = np.zeros(keep.size)
    coefficients[keep] = others.coefficients
    change = drag.constants(coefficients) - drag.constants(drag.coefficients)
    drives = rows.kind == DRIVE
    own, without = (
        float(np.sum((r / drag.sigma)[drives] ** 2)) for r in (drag.residuals, others.residuals)
    )
    if smoothed and TIMING.issuperset(drag.names[k] for k in columns):
        return change
    return change * math.sqrt(min(own / without, 1.0) if without else 1.0)


def drag_by_current(
    rows: ShaftRows, law: Array, nuisances: Sequence[str], level: float, noise_nm: Array
) -> DragFit | None:
    """Fits the rows with all noise in the torque, if that leaves the noise of the current alone.

    Parameters
    ----------
    rows
        Windows of drives.
    law, nuisances, level
        As `drag_of` takes them; nuisances that are made of the current have its noise too, and are
        left out.
    noise_nm
        Standard deviation [w, N·m] that the noise of the current makes in the torque of a row.

    Returns
    -------
    DragFit or None
        None where coasts are among the rows, or something else than noise is left.

    Notes
    -----
    Where a shaft is accelerated gently its torque is friction most of all. Noise of the current is
    then much of what accelerates, and makes 1/J too small by its share of the square.

    References
    ----------
    Fuller, Measurement Error Models, Wiley, 1987, section 1.1. doi:10.1002/9780470316665

    """
    others = [name for name in nuisances if not is_of_current(name)]
    names = [name for name in others if float(np.ptp(rows.columns[name])) > 0.0]
    if np.any(rows.kind == COAST) or rows.disjoint(DRIVE) < len(names) + law.shape[1]:
        return None
    y, torque = rows.acceleration_rad_s2, law[:, 0]
    candidates = {name: rows.columns[name] for name in names}
    base = np.column_stack([y, -law[:, 1:]])
    sigma = np.full(y.size, math.sqrt(float(np.mean(noise_nm**2))))
    chosen = needed_columns(base, candidates, torque, sigma, level, _most_nuisances(rows), 1.0)
    design = Design.of(
        [law], ("torque", "coulomb", "viscous"), {n: -c for n, c in candidates.items()}, chosen
    )
    fit = torque_fit(design.columns, y, sigma)
    inertia = float(fit.coefficients[0])
    if not sigma[0] or fit.chi2_dof > policy().drag.noise_alone:
        return None
    if is_steady(rows, fit):
        return _of_steady_speeds(rows, design, sigma)
    if inertia <= 0.0:
        return None
    covariance, dof = _covariance(rows, np.column_stack([y, -design.columns[:, 1:]]), fit, sigma)
    slope = np.eye(fit.coefficients.size) / inertia
    slope[:, 0] = -over_inertia(fit.coefficients) / inertia
    return DragFit(
        design.names, over_inertia(fit.coefficients), slope @ covariance @ slope.T,
        -fit.residuals / inertia, dof, False, np.zeros(3), ("", "", ""), design.columns,
        sigma / inertia, y, rows.fastest_rad_s, by_current=True,
    )  # fmt: skip


def is_steady(rows: ShaftRows, fit: LinearFit) -> bool:
    """Whether no torque that accelerates is in the rows, and several speeds of both senses are.

    Parameters
    ----------
    rows
        Windows of drives.
    fit
        Their `torque_fit`.

    """
    u_inertia = math.sqrt(float(fit.covariance[0, 0]) * max(fit.chi2_dof, 1.0))
    speeds = np.unique(np.round(rows.speed_rad_s / rows.fastest_rad_s, 1))
    both = float(speeds.min()) < 0.0 < float(speeds.max())
    return both and speeds.size > 2 and fit.coefficients[0] < policy().evidence.sigmas * u_inertia


def _of_steady_speeds(rows: ShaftRows, design: Design, sigma: Array) -> DragFit:
    """Friction alone, T = T_c sign ω + B ω + nuisances: what holds each speed."""
    fit = linear_fit(-design.columns[:, 1:], design.columns[:, 0], sigma)
    inner, dof = _covariance(rows, -design.columns[:, 1:], fit, sigma)
    covariance = np.zeros(2 * [len(design.names)])
    covariance[1:, 1:] = inner
    return DragFit(
        design.names, np.array([1.0, *fit.coefficients]), covariance, -fit.residuals, dof, False,
        np.zeros(3), (_STEADY, "", ""), design.columns, sigma, rows.acceleration_rad_s2,
        rows.fastest_rad_s, by_current=True, steady=True,
    )  # fmt: skip


def _additions(
    rows: ShaftRows, law: Array, candidates: Mapping[str, Array], richest: Array, level: float
) -> list[str]:
    """Names of the candidates that join: nuisances and windage, then one shape of Stribeck's."""
    y = rows.acceleration_rad_s2
    sigma = _row_sigma(rows, richest, y)
    tau = autocorrelation_time(
        linear_fit(richest, y, sigma).residuals / sigma, policy().evidence.memory_rows
    )
    pool = {n: column for n, column in candidates.items() if n not in STRIBECK}
    chosen = needed_columns(law, pool, y, sigma, level, _most_nuisances(rows), tau)
    if not TIMING.isdisjoint(chosen):
        # they take much the same of the torque, and which of them it is chance says
        chosen += sorted(n for n in TIMING.difference(chosen) if n in pool)
    if SAMPLED in pool and SAMPLED not in chosen:
        # no pulse is sampled in its very middle: without it drives say what coasts alone know
        chosen.append(SAMPLED)
    start = np.column_stack([law, *(candidates[n] for n in chosen)])
    shapes = {n: candidates[n] for n in STRIBECK}
    chosen += needed_columns(start, shapes, y, sigma, level, 1, tau)
    if _coefficients(chosen, law, candidates, y, sigma).get(WINDAGE, 0.0) < 0.0:
        # it helps the shaft: it takes up another form
        others = {name: column for name, column in candidates.items() if name != WINDAGE}
        return _additions(rows, law, others, richest, level)
    return _without_negative_excess(chosen, law, candidates, y, sigma)


def _most_nuisances(rows: ShaftRows) -> int:
    """How many nuisances the disjoint drive windows can carry."""
    carried = rows.disjoint(DRIVE) // policy().drag.rows_a_column - drive_columns(rows)
    return min(policy().drag.most_nuisances, max(0, carried))


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


def _row_sigma(rows: ShaftRows, design: Array, y: Array) -> Array:
    """Standard deviation [w] of each row: one for drives, one for coast-downs, from the fit."""
    return fit_by_groups(design, y, rows.kinds(), 3)[1]


def _form_fails(rows: ShaftRows, design: Design, curve: Design, y: Array, level: float) -> bool:
    """Whether a free drag curve explains the rows better, beyond chance and beyond what matters.

    Chance is judged by F with correlation counted. The curve must also move the drag by more than
    `drag.material_share` of itself (rms over the rows; over the coast-downs where there are enough
    of them, since they show drag alone).
    """
    sigma = _row_sigma(rows, curve.columns, y)
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
    judged = rows.kind == COAST if coasts_decide(rows) else np.ones(y.size, dtype=bool)
    apart, whole = (curved - straight)[judged], curved[judged]
    return bool(np.std(apart) > policy().drag.material_share * np.sqrt(np.mean(whole**2)))


def _without_negative_excess(
    chosen: list[str], base: Array, candidates: Mapping[str, Array], y: Array, sigma: Array
) -> list[str]:
    """The columns without Stribeck's where it came out below Coulomb friction: it is an excess."""
    values = _coefficients(chosen, base, candidates, y, sigma)
    return [n for n in chosen if n not in STRIBECK or values[n] > 0.0]


def _coefficients(
    chosen: Sequence[str], base: Array, candidates: Mapping[str, Array], y: Array, sigma: Array
) -> dict[str, float]:
    """The coefficients of chosen columns beside those of a base."""
    design = np.column_stack([base, *(candidates[n] for n in chosen)])
    coefficients = linear_fit(design, y, sigma).coefficients[base.shape[1] :]
    return dict(zip(chosen, coefficients.tolist(), strict=True))


def _shape_allowance(
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
    places = [k for k, name in enumerate(design.names) if name in DRAG_NAMES]
    return design.columns[:, places] @ fit.coefficients[places] / fit.coefficients[0]


def _form_allowance(
    coefficients: Array, free: bool, rows: ShaftRows
) -> tuple[Array, tuple[str, str, str]]:
    """Allowance for the form of drag, and why a constant of it has no meaning.

    Knots at speeds that no row has are at zero, and say nothing of standstill.
    """
    if not free:
        return np.zeros(3), ("", "", "")
    inertia = 1.0 / coefficients[0]
    curve = coefficients[1 : 1 + len(KNOTS)] * inertia
    slope = np.diff(curve) / (np.diff(KNOTS) * rows.fastest_rad_s)
    level = low_end(curve, rows.fastest_rad_s)[0]
    beyond = float(curve[1] - (curve[2] - curve[1]) * KNOTS[1] / (KNOTS[2] - KNOTS[1]))
    spread = max(abs(float(curve[0]) - level), abs(beyond - level))
    unsupported = "" if spread <= np.median(np.abs(curve)) else _UNSUPPORTED.format(spread)
    slowest = float(np.min(np.abs(rows.speed_rad_s)))
    if slowest > LOW_KNOTS[-1] * rows.fastest_rad_s:
        unsupported = _UNSEEN.format(slowest)
    why = (
        "drag is not Coulomb and viscous: its slope runs from "
        f"{slope.min():.2g} to {slope.max():.2g} N·m·s/rad over the speeds; see the drag curve, "
        "and record spin_downs with and without the suspected drag"
    )
    return np.array([0.0, spread, 0.0]), ("", unsupported, why)
