"""Resistance of each terminal pair from settled direct-current plateaus, at 25 degC."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from pipeline.estimation.electrical.direct_current import (
    POINT_OPTIONS,
    STEP,
    TEST,
    WARMED,
    Point,
    captures_of,
    direct_current_points,
    shifted,
    uncertainties_of,
)
from pipeline.estimation.electrical.terminals import PAIRS
from pipeline.estimation.method import Method, over_x
from pipeline.estimation.protocol import Estimator, Fit
from pipeline.estimation.uncertainty.instruments import (
    Shift,
    contributions,
    current_source,
    unstated_note,
    voltage_source,
)
from pipeline.numerics.least_squares import linear_fit
from pipeline.numerics.quantisation import covariance_alike
from pipeline.physics.copper import COPPER_COEFFICIENT_25_1_K
from pipeline.physics.glossary import Term
from pipeline.physics.windings import phase_from_line, phase_resistances_ohm
from pipeline.records.capture import Array, Campaign, Capture
from pipeline.records.constants import Constants
from pipeline.records.estimate import Conditions, Estimate
from pipeline.records.evidence import Evidence
from pipeline.records.uncertainty import Contribution

EXPERIMENT = (
    "record a resistance capture a terminal pair: settled direct-current plateaus of both signs "
    "and at least two levels, with temp_winding_degc"
)
COPPER_SOURCE = "assumed:temp_coeff_copper_1_k"
RANGE_OF_THREE = 3.314 / (1.960 * math.sqrt(2.0))

TERMS = (
    *(
        Term(f"r_{p}_ohm", "ohm", f"between terminals {p[0]} and {p[1]}, at 25 degC", "constant", 0)
        for p in PAIRS
    ),
    *(
        Term(f"r_{p}_ohm", "ohm", f"wye-equivalent resistance of phase {p}, at 25 degC",
             "constant", 0)
        for p in "abc"
    ),
    Term("voltage_offset_v", "V", "part of the terminal voltage that follows sign(I)", "constant"),
)  # fmt: skip
GIVES = ("r_phase_ohm", "r_ll_ohm", "resistance_imbalance", *(term.name for term in TERMS))
METHOD = Method("resistance", TERMS)


@dataclass(frozen=True, slots=True)
class Columns:
    """What the coefficients of a fit mean, in their order: R of each pair, the offset of each
    capture that saw both signs, V0 of each voltage source that saw two levels as well.
    """

    pairs: tuple[str, ...]
    offsets: tuple[int, ...]
    drops: tuple[str, ...]

    @property
    def drop_start(self) -> int:
        """Index of the first V0."""
        return len(self.pairs) + len(self.offsets)

    @property
    def size(self) -> int:
        """How many, without the copper coefficient's correction that comes last."""
        return self.drop_start + len(self.drops)


def terminal_voltage(point: Point, columns: Columns, alpha_1_k: float) -> Array:
    """The derivatives of one pair's voltage by what is fitted: it is linear in all but alpha.

    Parameters
    ----------
    point
        Means of a settled plateau: current [A], voltage [V], winding temperature [degC].
    columns
        What is fitted.
    alpha_1_k
        Coefficient of copper at 25 degC [1/K] about which the voltage is linearised.

    Returns
    -------
    array [k + 1]
        dV/dR25 of each pair [A], dV/dV_off of each capture [1], dV/dV0 of each voltage source [1],
        and dV by a relative change of alpha of two [V].

    Notes
    -----
    V = V_off + V0 sign(I) + R25 (1 + α (T - 25)) I

    dV/dR25 = (1 + α (T - 25)) I, dV/dα = R25 (T - 25) I, in which R25 I is read off the point
    itself, V / (1 + α (T - 25)); so linearised, a few rounds find alpha.

    References
    ----------
    IEEE Std 112-2017, 5.4 (resistance and temperature of copper: R ∝ 234.5 + T).

    """
    excess = point.temp_degc - 25.0
    factor = 1.0 + alpha_1_k * excess
    row = np.zeros(columns.size + 1)
    row[columns.pairs.index(point.pair)] = factor * point.i_a
    row[-1] = 2.0 * COPPER_COEFFICIENT_25_1_K * excess * point.v_v / factor
    if point.capture in columns.offsets:
        row[len(columns.pairs) + columns.offsets.index(point.capture)] = 1.0
    if (source := voltage_source(point.meta)) in columns.drops:
        row[columns.drop_start + columns.drops.index(source)] = math.copysign(1.0, point.i_a)
    return row


@dataclass(frozen=True, slots=True)
class DirectCurrentFit:
    """R at 25 degC of each pair and the rest of `Columns` [k], with the covariance of the scatter.

    `alpha_1_k` is the copper coefficient found; `residuals` [n] are those of the points. `dof` is
    that of the scatter: infinite where it is what the plateaus' own noise makes, else the points'.
    """

    coefficients: Array
    covariance: Array
    alpha_1_k: float
    u_alpha_1_k: float
    residuals: Array
    full_rank: bool
    dof: float


def columns_of(points: Sequence[Point]) -> Columns:
    """The coefficients that these plateaus can separate."""
    pairs = tuple(p for p in PAIRS if any(point.pair == p for point in points))
    offsets, drops = [], set()
    for index in sorted({p.capture for p in points}):
        of_capture = [p for p in points if p.capture == index]
        signs = {math.copysign(1.0, p.i_a) for p in of_capture}
        levels = sorted(abs(p.i_a) for p in of_capture)
        if len(signs) == 2:
            offsets.append(index)
        if len(levels) > len(signs) and levels[-1] > 1.2 * levels[0]:
            drops.add(voltage_source(of_capture[0].meta))
    return Columns(pairs, tuple(offsets), tuple(sorted(drops)))


def fit_direct_current(
    points: Sequence[Point], columns: Columns, u_alpha_rel: float, alpha_rel: float = 0.0
) -> DirectCurrentFit:
    """Weighted least squares of `terminal_voltage` over the plateaus of all pairs.

    Parameters
    ----------
    points
        Plateaus of all captures.
    columns
        What is fitted beside the copper coefficient.
    u_alpha_rel
        How well copper's 1/259.5 K is known beforehand [1, relative]; inf: not at all.
    alpha_rel
        By how much that prior is moved [1, relative].

    Notes
    -----
    Weights from all standard errors, u² = u_V² + (R u_I)² + (α V u_T)² (York 1966, for errors
    small against the span), and from what rounding leaves in the means, which is one error in all
    plateaus of one step of a converter (GUM F.2.2.1). The covariance holds these and the scatter
    alone, widened where the points scatter more than that explains (Birge 1932); the prior's share
    is for the caller to add.

    References
    ----------
    York, Can. J. Phys. 44, 1966, 1079, doi:10.1139/p66-090.
    Birge, Phys. Rev. 40, 1932, 207, doi:10.1103/PhysRev.40.207.

    """
    prior = COPPER_COEFFICIENT_25_1_K * (1.0 + alpha_rel)
    alpha = prior
    width = columns.size + 1
    v = np.array([p.v_v for p in points])
    root = cholesky(_covariance_v2(points, prior), lower=True)
    slack = np.append(np.ones(v.size), 0.5 * max(u_alpha_rel, 1e-9))
    for _ in range(4):
        design = np.array([terminal_voltage(p, columns, alpha) for p in points])
        rows = np.vstack([_whitened(root, design), np.eye(1, width, width - 1)])
        prior_row = 0.5 * (prior - alpha) / COPPER_COEFFICIENT_25_1_K
        fit = linear_fit(rows, np.append(_whitened(root, v), prior_row), slack)
        alpha += 2.0 * float(fit.coefficients[-1]) * COPPER_COEFFICIENT_25_1_K
    last = fit.covariance[:, -1]
    scatter = fit.covariance - np.outer(last, last) / slack[-1] ** 2
    whitened = fit.residuals[:-1]
    dof = len(points) - fit.rank + (1 if math.isfinite(u_alpha_rel) else 0)
    factor = _birge(whitened, dof)
    scatter = scatter * factor
    u_alpha = 2.0 * COPPER_COEFFICIENT_25_1_K * math.sqrt(max(float(scatter[-1, -1]), 0.0))
    size = columns.size
    return DirectCurrentFit(
        fit.coefficients[:size],
        scatter[:size, :size],
        alpha,
        u_alpha,
        root @ whitened,
        fit.full_rank,
        float(dof) if factor > 1.0 else math.inf,
    )


def _whitened(root: Array, values: Array) -> Array:
    """Values [n] or rows [n, k] over the root [n, n] of their covariance."""
    over: Array = solve_triangular(root, values, lower=True)
    return over


def _covariance_v2(points: Sequence[Point], alpha_1_k: float) -> Array:
    """Covariance [n, n; V²] of the plateaus' voltages: noise of each, and what is rounded alike."""
    covariance = np.diag([_noise_v(p, alpha_1_k) ** 2 for p in points])
    for name, lever, source in (
        ("rounded_v", np.ones(len(points)), voltage_source),
        ("rounded_i", np.array([p.v_v / p.i_a for p in points]), current_source),
    ):
        left = [getattr(p, name) for p in points]
        cells = [(source(p.meta), one.cell) for p, one in zip(points, left, strict=True)]
        covariance += covariance_alike(lever * np.array([one.u for one in left]), cells)
    return covariance


def _noise_v(p: Point, alpha_1_k: float) -> float:
    # No meter resolves more than a millionth; a smaller weight lets rounding outweigh the prior.
    noise_v = math.hypot(p.u_v, p.v_v / p.i_a * p.u_i, alpha_1_k * p.v_v * p.u_temp_k)
    return max(noise_v, 1e-12 + 1e-6 * abs(p.v_v))


def _birge(normalised: Array, dof: int) -> float:
    """Variance factor of points that scatter more than they should, 1 where chance explains it."""
    if dof < 3:
        return 1.0
    chi2_dof = float(normalised @ normalised) / dof
    return chi2_dof if chi2_dof > 1.0 + 3.0 * math.sqrt(2.0 / dof) else 1.0


def _results(columns: Columns, coefficients: Array) -> dict[str, float]:
    """The published values from the coefficients [k]; all are linear in these."""
    r_pairs = coefficients[: len(columns.pairs)]
    by_pair = dict(zip(columns.pairs, (float(r) for r in r_pairs), strict=True))
    r_ll = float(np.mean(r_pairs))
    constants = {"r_phase_ohm": phase_from_line(r_ll), "r_ll_ohm": r_ll}
    constants |= {f"r_{pair}_ohm": r for pair, r in by_pair.items()}
    if len(by_pair) == 3:
        phases = phase_resistances_ohm(by_pair["ab"], by_pair["bc"], by_pair["ca"])
        constants |= {f"r_{name}_ohm": r for name, r in phases._asdict().items()}
    if columns.drops:
        constants["voltage_offset_v"] = float(np.mean(coefficients[columns.drop_start :]))
    return constants


def fit_resistance(campaign: Campaign, known: Constants, options: Mapping[str, float]) -> Fit:
    """R of each pair by the plateaus of all captures at once, brought to 25 degC by copper's law.

    The published values are linear in the pairs' (`windings.phase_resistances_ohm`), and so is
    their scatter.
    """
    points, notes = direct_current_points(campaign, options)
    if not points:
        return METHOD.nothing(GIVES, f"no settled plateau with current; {EXPERIMENT}")
    columns = columns_of(points)
    fit = fit_direct_current(points, columns, options["u_rel_copper"])
    if not fit.full_rank:
        return METHOD.nothing(GIVES, f"the plateaus do not part R from the offset; {EXPERIMENT}")
    used = captures_of(campaign, points)

    def evaluate(shift: Shift) -> Array:
        alpha_rel = shift.get(COPPER_SOURCE, 0.0)
        moved = fit_direct_current(
            shifted(points, shift), columns, options["u_rel_copper"], alpha_rel
        )
        return np.array(list(_results(columns, moved.coefficients).values()))

    uncertainties = uncertainties_of(points, used) | {COPPER_SOURCE: options["u_rel_copper"]}
    shared = contributions(evaluate, uncertainties)
    matrix = np.column_stack([[*_results(columns, row).values()] for row in np.eye(columns.size)])
    covariance = matrix @ fit.covariance @ matrix.T
    values = _results(columns, fit.coefficients)
    allowances = _allowances(points, columns, tuple(values), matrix, options)
    notes.append(unstated_note(used))
    estimates = {}
    for k, (name, value) in enumerate(values.items()):
        u = math.sqrt(max(float(covariance[k, k]), 0.0))
        parts = [METHOD.scatter(name, u, fit.dof), *shared[k], *allowances[name]]
        estimates[name] = METHOD.measured(name, value, parts, used, _conditions(points), notes)
    if len(columns.pairs) == 3:
        warmed = _warmed(values, shared)
        estimates["resistance_imbalance"] = _imbalance(
            values, covariance, fit.dof, points, used, warmed
        )
    return Fit(
        tuple(estimates.get(n) or _absent(n) for n in GIVES), (_plot(points, fit.residuals),)
    )


def _allowances(
    points: Sequence[Point],
    columns: Columns,
    names: Sequence[str],
    matrix: Array,
    options: Mapping[str, float],
) -> dict[str, list[Contribution]]:
    """Type B allowances for what the captures do not determine: V0 and the pairs not measured.

    `matrix` [names, columns] holds the published values' shares of the pairs. V0 is that of one
    inverter and one set of leads, so what it adds to the pairs adds up in what is made of them.
    """
    parts: dict[str, list[Contribution]] = {name: [] for name in names}
    if len(columns.pairs) < 3:
        r_scale = float(np.mean([abs(p.v_v / p.i_a) for p in points]))
        for name, share in (("r_phase_ohm", 0.5), ("r_ll_ohm", 1.0)):
            u = share * r_scale * options["u_rel_imbalance"]
            parts[name].append(Contribution("assumed:resistance_imbalance", u, "B"))
    drops = np.array([_unknown_drop_ohm(points, columns, pair, options) for pair in columns.pairs])
    for name, shares in zip(names, matrix[:, : drops.size], strict=True):
        if u := float(shares @ drops):
            parts[name].append(Contribution("assumed:voltage_offset_v", u, "B"))
    return parts


def _unknown_drop_ohm(
    points: Sequence[Point], columns: Columns, pair: str, options: Mapping[str, float]
) -> float:
    """What a V0 that was not fitted may add to the resistance of a pair, 0 where it was."""
    of_pair = [p for p in points if p.pair == pair]
    blind = [p for p in of_pair if voltage_source(p.meta) not in columns.drops]
    if not blind:
        return 0.0
    commanded = any(p.meta.voltage_kind == "commanded" for p in blind)
    drop_v = options["drop_commanded_v" if commanded else "drop_measured_v"]
    return drop_v / max(abs(p.i_a) for p in of_pair)


def _conditions(points: Sequence[Point]) -> Conditions:
    return {
        "temp_winding_degc": 25.0,
        "current_a": max(abs(p.i_a) for p in points),
        "temp_measured_degc": round(float(np.mean([p.temp_degc for p in points])), 3),
    }


def _imbalance(
    values: Mapping[str, float],
    covariance: Array,
    dof: float,
    points: Sequence[Point],
    captures: Sequence[Capture],
    warmed: float = 0.0,
) -> Estimate:
    """(max - min)/mean of the phases; the gains cancel, the scatter of the two extremes stays, and
    what the winding `warmed` from pair to pair [1].

    The range of three equal phases exceeds 3.31 of their standard deviations in 5 % of cases, a
    given pair's difference 2.77: their ratio widens u (studentized range, Tukey 1949).
    """
    rows = [list(values).index(f"r_{phase}_ohm") for phase in "abc"]
    phases = np.array([values[f"r_{phase}_ohm"] for phase in "abc"])
    mean = float(phases.mean())
    top, low = rows[int(phases.argmax())], rows[int(phases.argmin())]
    spread = covariance[top, top] + covariance[low, low] - 2.0 * covariance[top, low]
    u = RANGE_OF_THREE * math.sqrt(max(float(spread), 0.0)) / mean
    name, value = "resistance_imbalance", float(np.ptp(phases)) / mean
    note = "read high by chance where the phases differ by less than u"
    parts = [METHOD.scatter(name, u, dof), Contribution(WARMED, RANGE_OF_THREE * warmed, "B")]
    warm = f"the winding's own warming may make {warmed:.2g} of it: log temp_winding_degc"
    words = [note, warm if u < warmed and value < 3.0 * RANGE_OF_THREE * warmed else ""]
    return METHOD.measured(name, value, parts, captures, _conditions(points), words)


def _warmed(values: Mapping[str, float], shared: Sequence[Sequence[Contribution]]) -> float:
    """Standard uncertainty of the imbalance [1] by what the winding warmed from pair to pair: of
    the two phases that differ by it most.
    """
    names = list(values)
    parts = {
        phase: {
            part.source: part.u
            for part in shared[names.index(f"r_{phase}_ohm")]
            if part.source.startswith(WARMED)
        }
        for phase in "abc"
    }
    apart = [
        math.sqrt(sum((parts[one][source] - parts[two][source]) ** 2 for source in parts[one]))
        for one, two in ("ab", "bc", "ca")
    ]
    return max(apart) / float(np.mean([values[f"r_{phase}_ohm"] for phase in "abc"]))


def _absent(name: str) -> Estimate:
    why = {
        "voltage_offset_v": "needs plateaus of two levels of |I| in one capture",
        "resistance_imbalance": "needs a resistance capture on each of the pairs ab, bc and ca",
    }
    return METHOD.missing(name, why.get(name, f"pair not measured; {EXPERIMENT}"))


def _plot(points: Sequence[Point], residuals: Array) -> Evidence:
    series = []
    for pair in sorted({p.pair for p in points}):
        rows = [k for k, p in enumerate(points) if p.pair == pair]
        x, y = (np.array([getattr(points[k], n) for k in rows]) for n in ("i_a", "v_v"))
        series.append(over_x(pair, x, y, y - residuals[rows]))
    return METHOD.plot(
        "Terminal voltage against current", ("current_a", "voltage_v"), "scatter", series,
        "Means over settled plateaus; R is the slope, the zero crossing is left out.",
    )  # fmt: skip


ESTIMATOR = Estimator(
    METHOD.name,
    GIVES,
    (TEST, STEP),
    EXPERIMENT,
    fit_resistance,
    terms=TERMS,
    options={
        **POINT_OPTIONS,
        "u_rel_copper": 0.01,
        "u_rel_imbalance": 0.005,
        "drop_measured_v": 0.0005,
        "drop_commanded_v": 0.3,
    },
)
