"""Torque constant and reluctance torque from a dynamometer's torque against currents."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from pipeline.estimation.electrical.magnet_temperature import magnet_uncertainties, unlogged_note
from pipeline.estimation.electrical.operating_points import (
    Point,
    PointTable,
    operating_points,
    pole_pairs_of,
    table_points,
    turning_tables,
)
from pipeline.estimation.electrical.ripple_torque import RIPPLE
from pipeline.estimation.mechanical.locked_rotor import HARMONICS, angle_doubt, standstill_words
from pipeline.estimation.mechanical.map_drag import MapDrag, map_drag
from pipeline.estimation.mechanical.other_current import (
    not_along_q,
    reluctance_counts,
    unlogged_share,
)
from pipeline.estimation.mechanical.sampled_current import sampling_drag
from pipeline.estimation.mechanical.torque_slope import Slope, slope_without_d
from pipeline.estimation.method import Method, over_x
from pipeline.estimation.policy import policy
from pipeline.estimation.protocol import Estimator, Fit
from pipeline.estimation.thermal.magnet_coefficient import SOURCE, magnet_coefficient
from pipeline.estimation.uncertainty.instruments import (
    contributions,
    instrument_uncertainties,
    unstated_note,
)
from pipeline.estimation.uncertainty.nuisances import allowed_for
from pipeline.numerics.least_squares import linear_fit
from pipeline.numerics.selection import needed_columns
from pipeline.physics.glossary import Term
from pipeline.records.capture import Array, Campaign, Capture
from pipeline.records.constants import Constants
from pipeline.records.estimate import Estimate
from pipeline.records.evidence import Evidence
from pipeline.records.uncertainty import Budget, Contribution, propagate

RELUCTANCE = Term(
    "kt_reluctance_nm_a2",
    "N·m/A²",
    "torque per product of d and q current, 1.5 p (Ld - Lq), from the torque test",
    "constant",
    -1e4,
    1e4,
)
DRAG = ("torque_coulomb_nm", "b_visc_nm_s_rad")
GIVES = ("kt_peak_nm_a", RELUCTANCE.name, *DRAG)
METHOD = Method("torque_map", (RELUCTANCE,))
EXPERIMENT = (
    "record a torque_map: the dynamometer holds a speed while positive and negative q currents "
    "are stepped, at two or more d currents, in both senses of rotation"
)
ONE_D_CURRENT = "at one d current the torque of the magnet is not apart from that of reluctance"
TURNED = ("id", "id sense", "iq^2 - id^2", "id speed", "iq^2 - id^2 speed")
BENDING = ("iq^3", "iq^5", "id^2 iq", "id iq^3", "id^3 iq", "id^2 iq^3")


@dataclass(frozen=True, slots=True)
class Regression:
    """Fitted torque: coefficients by column name, their covariance, residuals [n, N·m]."""

    names: tuple[str, ...]
    coefficients: Array
    covariance: Array
    residuals: Array
    dof: int

    def index(self, name: str) -> int:
        """Position of a column."""
        return self.names.index(name)

    @property
    def kt_nm_a(self) -> float:
        """Slope at small current in the true frame.

        A frame off by e shows K cos(e) i_q + K sin(e) i_d; an eccentric encoder makes
        e = A sin(theta + phi), so K i_d A appears once a turn and the mean of cos(e) is 1 - A²/4.
        """
        kt = self.of("iq")
        wobble = (self.of("id cos") ** 2 + self.of("id sin") ** 2) / kt**2 if kt else 0.0
        return float(np.copysign(np.hypot(kt, self.of("id")), kt)) * (1.0 + wobble / 4.0)

    def of(self, name: str) -> float:
        """Coefficient of a column, 0 where it did not join."""
        return float(self.coefficients[self.index(name)]) if name in self.names else 0.0


def fit(campaign: Campaign, known: Constants, options: Mapping[str, float]) -> Fit:
    """K and K_rel by `torque` of the settled points, and drag by the offsets of the speeds.

    Each constant-speed stretch, or angle of a locked rotor, has an offset of its own, so friction,
    iron loss at no current, cogging at rest and the transducer's zero never reach K. Points at
    standstill join where those at speed do not suffice. Columns of saturation and of sensor faults
    join only where the data demand them, so K is the slope at small current, 1.5 p psi at 25 degC.
    """
    captures = [c for c in campaign.of("torque_map") if c.has("t_s", "iq_a", "torque_shaft_nm")]
    pairs = pole_pairs_of(known, campaign.nameplate("pole_pairs"))
    table = operating_points(captures, pairs, known.best("r_phase_ohm"))
    tables = turning_tables(campaign)
    if tables:
        table = table.beside(table_points(tables))
        captures += tables
    points = [
        p
        for p in table.points
        if np.isfinite([p.torque_nm, p.omega_mech_rad_s, p.temp_magnet_degc]).all()
    ]
    turning = [p for p in points if not p.standing]
    if _enough(turning):
        points = turning
    if not _enough(points):
        return METHOD.nothing(GIVES, _too_few(table, points))
    alpha, _ = magnet_coefficient(known)
    chosen = _chosen(points, alpha, options["level"])
    model = _regress(points, alpha, chosen)
    still = angle_doubt(points, model.kt_nm_a, pairs, known)
    note = _note(captures, table, points, chosen)
    estimates = _estimates(points, model, chosen, still, known, note)
    if model.dof + len(model.names) > len(points):
        why = f"{ONE_D_CURRENT}; {EXPERIMENT}"
        estimates = (*(METHOD.missing(name, why) for name in GIVES[:2]), *estimates[2:])
    return Fit(estimates, _evidence(points, model, alpha, chosen))


def _too_few(table: PointTable, points: Sequence[Point]) -> str:
    """What the torque maps lack: levels that last, torque, or enough of them."""
    if 2 * table.settled_rows < table.rows:
        return (
            f"{len(table.points)} levels of current hold still for {policy().evidence.rows} rows "
            "once settled: hold each level for longer, or log at a higher rate; if every row is a "
            "settled point or a mean of one, state test: torque_table"
        )
    groups = len({p.group for p in points})
    return f"{len(points)} settled points at {groups} speeds; {EXPERIMENT}"


def _enough(points: Sequence[Point]) -> bool:
    """Whether offsets and slopes leave a point over, and the q current moves."""
    groups = len({p.group for p in points})
    return len(points) >= groups + 3 and bool(np.ptp([p.iq_a for p in points]) != 0.0)


def torque(points: Sequence[Point], alpha_1_k: float) -> tuple[dict[str, Array], dict[str, Array]]:
    """The derivatives of the shaft's torque at held speeds by what is fitted.

    Parameters
    ----------
    points
        Settled operating points: currents [A], magnet temperature [degC], speed [rad/s].
    alpha_1_k
        Coefficient of the magnet's flux at 25 degC [1/K].

    Returns
    -------
    base : dict of array [n]
        Columns of the offset T0 of each group [1], of K [A], and of K_rel [A²] where there is an
        i_d.
    candidates : dict of array [n]
        Columns that enter where a test asks for them: saturation (odd powers of i_q, even and odd
        ones of i_d), a frame that is turned (i_d, i_q² - i_d²), the more the faster where currents
        are late (the same times ω), or wobbles (an eccentric encoder: i_d cos θ, i_d sin θ),
        friction in proportion to torque, of the magnet and of reluctance, and the acceleration of a
        shaft that the dynamometer lets give way, whose coefficient is -J.

    Notes
    -----
    T = T0(speed) + K (1 + α (T_m - 25)) i_q + K_rel i_d i_q + T_h + ...,
    K = 1.5 p ψ at 25 degC and K_rel = 1.5 p (L_d - L_q). T_h is what the harmonics of voltages and
    currents make (`ripple_torque`), taken off before.

    References
    ----------
    IEEE Std 1812-2014, 4.4 (torque against current).

    """
    i_d, i_q = _column(points, "id_a"), _column(points, "iq_a")
    group, omega = _column(points, "group"), _column(points, "omega_mech_rad_s")
    sense = np.sign(omega)
    warm = 1.0 + alpha_1_k * (_column(points, "temp_magnet_degc") - 25.0)
    base = {f"speed {g}": (group == g).astype(float) for g in sorted({p.group for p in points})}
    base["iq"] = i_q * warm
    candidates = {"iq^3": i_q**3, "iq^5": i_q**5, "|iq| sense": np.abs(i_q) * sense}
    alpha = _column(points, "alpha_mech_rad_s2")
    if np.ptp(alpha) > 0.0:
        candidates["acceleration"] = alpha
    if reluctance_counts(i_d, i_q):
        base["id iq"] = i_d * i_q
        candidates |= {
            "id": i_d,
            "id sense": i_d * sense,
            "id cos": i_d * _column(points, "cos_turn"),
            "id sin": i_d * _column(points, "sin_turn"),
            "|iq| id sense": np.abs(i_q) * i_d * sense,
            "id^2 iq": i_d**2 * i_q,
            "id iq^3": i_d * i_q**3,
            "id^3 iq": i_d**3 * i_q,
            "id^2 iq^3": i_d**2 * i_q**3,
            "iq^2 - id^2": i_q**2 - i_d**2,
            "id speed": i_d * omega,
            "iq^2 - id^2 speed": (i_q**2 - i_d**2) * omega,
        }
    return base, candidates


def _chosen(points: Sequence[Point], alpha_1_k: float, level: float) -> list[str]:
    base, candidates = torque(points, alpha_1_k)
    design, sigma = np.column_stack([*base.values()]), _sigma(points)
    apart = {n: c for n, c in candidates.items() if n not in BENDING or _is_apart(design, c)}
    return needed_columns(design, apart, _column(points, "torque_of_means_nm"), sigma, level)


def _is_apart(design: Array, column: Array) -> bool:
    """Whether a bend of the torque [n] is another column than K and K_rel have.

    A square or cube of d currents of two sizes is not: it would take K_rel's place.
    """
    own = linear_fit(design, column).residuals
    return bool(np.linalg.norm(own) > policy().drag.least_own_share * np.linalg.norm(column))


def _regress(points: Sequence[Point], alpha_1_k: float, chosen: Sequence[str]) -> Regression:
    base, candidates = torque(points, alpha_1_k)
    design = np.column_stack([*base.values(), *(candidates[name] for name in chosen)])
    sigma = _sigma(points)
    solution = linear_fit(design, _column(points, "torque_of_means_nm"), sigma)
    scale = max(solution.chi2_dof, 0.0) if solution.dof > 0 else np.inf
    return Regression(
        (*base, *chosen),
        solution.coefficients,
        solution.covariance * scale,
        solution.residuals,
        solution.dof,
    )


def _sigma(points: Sequence[Point]) -> Array:
    """Relative weights: the noise of a mean falls with the root of its rows."""
    rows = _column(points, "rows")
    return np.sqrt(rows.mean() / rows)


def _estimates(
    points: Sequence[Point],
    model: Regression,
    chosen: Sequence[str],
    still: Budget,
    known: Constants,
    note: str,
) -> tuple[Estimate, ...]:
    alpha, alpha_parts = magnet_coefficient(known)
    used = list({p.capture.path: p.capture for p in points}.values())
    slope_k = _slope(points, alpha, chosen, model)
    type_b = _type_b(points, chosen, alpha, instrument_uncertainties(used, ("current", "torque")))
    type_b[0] += propagate([(_per_alpha(points, chosen, alpha), alpha_parts)])
    type_b[0] += [Contribution("assumed:torque_form", slope_k.form_nm_a, "B"), *still]
    unlogged, why = _unlogged_d(points, model, slope_k.kt_nm_a)
    type_b[0] += unlogged
    paths = sorted({p.capture.path for p in points})
    at = {"temp_magnet_degc": 25.0, "iq_a": float(np.max(np.abs(_column(points, "iq_a"))))}

    def estimate(
        name: str, value: float, u: float, dof: int, parts: Sequence[Contribution]
    ) -> Estimate:
        return METHOD.measured(name, value, [METHOD.scatter(name, u, dof), *parts], paths, at, note)

    u = np.sqrt(np.diag(model.covariance))
    estimates = [
        METHOD.missing(GIVES[0], why)
        if why
        else estimate(GIVES[0], slope_k.kt_nm_a, slope_k.u_nm_a, slope_k.dof, type_b[0])
    ]
    if "id iq" in model.names:
        u_rel = float(u[model.index("id iq")])
        estimates.append(estimate(GIVES[1], _reluctance(model), u_rel, model.dof, type_b[1]))
    else:
        why = f"d current did not vary enough to show reluctance torque; {EXPERIMENT}"
        estimates.append(METHOD.missing(GIVES[1], why))
    drag = _drag(points, model)
    type_b[3] += sampling_drag(used, slope_k.kt_nm_a, known)
    if drag.why:
        return (*estimates, *(METHOD.missing(name, drag.why) for name in DRAG))
    note = f"{note}; beside a drag by the square of speed" if drag.windage else note
    for index, name in enumerate(DRAG):
        u_drag = float(np.sqrt(drag.covariance[index, index]))
        parts = [*type_b[2 + index], *_untested_form(points, model, index)]
        estimates.append(estimate(name, float(drag.values[index]), u_drag, drag.dof, parts))
    return tuple(estimates)


def _unlogged_d(
    points: Sequence[Point], model: Regression, kt_nm_a: float
) -> tuple[tuple[Contribution, ...], str]:
    """What a d current that is not logged adds to u of Kt, and why Kt is then not published."""
    if _d_logged(points):
        return (), ""
    share = unlogged_share(model.residuals, kt_nm_a * _column(points, "iq_a"))
    return (Contribution("assumed:id_a", share * kt_nm_a, "B"),), not_along_q(share)


def _values(
    points: Sequence[Point], chosen: Sequence[str], alpha: float, shift: Mapping[str, float]
) -> Array:
    """K, K_rel and both drags [4] with gains and the magnet's coefficient shifted by so much."""
    shifted, alpha = [p.shifted(shift) for p in points], alpha + shift.get(SOURCE, 0.0)
    refitted = _regress(shifted, alpha, chosen)
    bent = _slope(shifted, alpha, chosen, refitted)
    return np.array([bent.kt_nm_a, _reluctance(refitted), *_drag(points, refitted).values])


def _type_b(
    points: Sequence[Point], chosen: Sequence[str], alpha: float, gains: Mapping[str, float]
) -> list[list[Contribution]]:
    """What instruments and the magnet's temperature do to K, K_rel and both drags."""
    magnet = magnet_uncertainties({p.capture.path: p.capture for p in points}.values())
    sources = {**gains, **magnet}
    if any(p.u_ripple_nm for p in points):
        sources[RIPPLE] = 1.0
    return contributions(partial(_values, points, chosen, alpha), sources)


def _per_alpha(points: Sequence[Point], chosen: Sequence[str], alpha: float) -> float:
    """Change of K by the magnet's coefficient [N·m K/A]."""
    step = _values(points, chosen, alpha, {SOURCE: 1e-4}) - _values(points, chosen, alpha, {})
    return float(step[0]) / 1e-4


def _drag(points: Sequence[Point], model: Regression) -> MapDrag:
    """Coulomb and viscous drag from the offsets of the speeds.

    A shaft that stands has no drag: its offset is cogging and static friction.
    """
    turning = sorted({p.group for p in points if not p.standing})
    speeds = np.array(
        [np.mean([p.omega_mech_rad_s for p in points if p.group == g]) for g in turning]
    )
    rows = [model.index(f"speed {g}") for g in turning]
    offsets, block = model.coefficients[rows], model.covariance[np.ix_(rows, rows)]
    return map_drag(speeds, offsets, block, model.dof, EXPERIMENT)


def _untested_form(
    points: Sequence[Point], model: Regression, index: int
) -> tuple[Contribution, ...]:
    """Allowance for drag of another form where no speed is left over to test it.

    A share of the drag at the slowest speed may be Stribeck's, iron's or windage. Two speeds in
    either sense test the zero of the transducer, and no form; three of one sense each are as many
    as both drags and that zero.
    """
    turning = [p for p in points if not p.standing]
    speeds = _column(turning, "omega_mech_rad_s")
    faster = np.diff(np.log(np.sort(np.abs(speeds)))) > policy().points.same_speed
    left_over = len({p.group for p in turning}) - len(DRAG) - 1
    if np.count_nonzero(faster) >= 2 and left_over > 0:
        return ()
    drag = _drag(points, model).values
    slowest = float(np.min(np.abs(speeds)))
    torque = policy().torque_map.untested_form_share * abs(drag[0] + drag[1] * slowest)
    u = torque if index == 0 else torque / slowest
    return (Contribution("assumed:drag_form", float(u), "B"),)


def _d_logged(points: Sequence[Point]) -> bool:
    return all(p.capture.has("id_a") for p in points)


def _reluctance(model: Regression) -> float:
    return model.of("id iq")


def _form_doubt(points: Sequence[Point], alpha: float, chosen: Sequence[str]) -> float:
    """How far K moves with one of the last two columns that bend the torque: the series may go on.

    Without any the torque is straight and there is no doubt.
    """
    bent = [name for name in chosen if name in BENDING]
    if not bent:
        return 0.0
    full = _regress(points, alpha, chosen).kt_nm_a
    shorter = [
        _regress(points, alpha, [name for name in chosen if name != omitted]).kt_nm_a
        for omitted in bent[-2:]
    ]
    return max(abs(full - value) for value in shorter) / 2.0


def _slope(
    points: Sequence[Point], alpha: float, chosen: Sequence[str], model: Regression
) -> Slope:
    """K at small current: of all points, or of those without d current where the torque bends."""
    u = float(np.sqrt(model.covariance[model.index("iq"), model.index("iq")]))
    if not any(name in BENDING for name in chosen):
        return Slope(model.kt_nm_a, u, model.dof, 0.0)
    turned = any(name in TURNED for name in chosen)
    without_d = slope_without_d(points, alpha, turned, "|iq| sense" in chosen)
    if without_d is None:
        return Slope(model.kt_nm_a, u, model.dof, _form_doubt(points, alpha, chosen))
    return without_d.times(model.kt_nm_a / model.of("iq"))


def _note(
    captures: Sequence[Capture], table: PointTable, points: Sequence[Point], chosen: Sequence[str]
) -> str:
    words = [table.note()]
    if not _d_logged(points):
        words.append("id_a not logged: the reluctance torque of a d current would be in it")
    words.append(standstill_words(points, table.points))
    words += [allowed_for(chosen), unlogged_note(captures)]
    if np.unique(np.sign(_column(points, "iq_a").round(6))).size < 2:
        words.append("one sign of q current only")
    words.append(unstated_note(captures, ("current", "torque")))
    return "; ".join(filter(None, words))


def _evidence(
    points: Sequence[Point], model: Regression, alpha: float, chosen: Sequence[str]
) -> tuple[Evidence, ...]:
    torque = _column(points, "torque_of_means_nm")
    fitted = torque - model.residuals
    i_q = _column(points, "iq_a")
    group = _column(points, "group")
    series = []
    for number in sorted({p.group for p in points}):
        rows = np.flatnonzero(group == number)
        of_group = [points[int(k)] for k in rows[np.argsort(i_q[rows], kind="stable")]]
        speed = float(np.mean([p.omega_mech_rad_s for p in of_group]))
        label = f"{speed:.0f} rad/s" if speed else f"standstill, angle {number}"
        series.append(over_x(label, i_q[rows], torque[rows], fitted[rows]))
    extra = f", {', '.join(chosen)}" if chosen else ""
    caption = f"offset a speed, iq, id iq{extra}; magnet coefficient {alpha:.2g} 1/K"
    title, axes = "Shaft torque against q current", ("iq_a", "torque_shaft_nm")
    return (METHOD.plot(title, axes, "scatter", series, caption),)


def _column(points: Sequence[Point], name: str) -> Array:
    return np.array([getattr(p, name) for p in points], dtype=np.float64)


ESTIMATOR = Estimator(
    name=METHOD.name,
    gives=GIVES,
    tests=("torque_map", "torque_table"),
    experiment=EXPERIMENT,
    fit=fit,
    uses=("pole_pairs", "temp_coeff_magnet_1_k", "lq_h", "r_phase_ohm", *HARMONICS),
    aids=("lq_h", "r_phase_ohm"),
    rank=5,
    terms=(RELUCTANCE,),
    clock_powers={"b_visc_nm_s_rad": 1},
    options={"level": 0.01},
)
