"""Back-EMF constant and resistance from the voltages of an everyday drive log, or a torque map."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Literal

import numpy as np

from pipeline.estimation.electrical.link import link_voltage_v
from pipeline.estimation.electrical.operating_points import pole_pairs_of
from pipeline.estimation.electrical.sample_hold import hold_s
from pipeline.estimation.electrical.voltage_rows import (
    D_FLUX,
    LATE,
    NEAR_ZERO,
    VoltageRows,
    voltage_rows,
)
from pipeline.estimation.electrical.voltage_turn import (
    SPEED2_CURRENT,
    TURNED,
    Turn,
    voltage_turn,
)
from pipeline.estimation.method import Method
from pipeline.estimation.policy import policy
from pipeline.estimation.protocol import Estimator, Fit
from pipeline.estimation.thermal.magnet_coefficient import magnet_coefficient
from pipeline.estimation.uncertainty.instruments import (
    contributions,
    instrument_uncertainties,
    shifted_gains,
    shifted_offsets,
    temperature_source,
    unstated_note,
)
from pipeline.estimation.uncertainty.nuisances import allowed_for
from pipeline.estimation.uncertainty.regimes import (
    Disagreement,
    Partition,
    Regression,
    disagreement,
    halves,
    signs,
)
from pipeline.numerics.clusters import cluster_covariance
from pipeline.numerics.least_squares import LinearFit, autocorrelation_time, linear_fit
from pipeline.numerics.selection import needed_columns
from pipeline.physics.copper import COPPER_COEFFICIENT_25_1_K
from pipeline.records.capture import Array, Campaign
from pipeline.records.constants import Constants
from pipeline.records.estimate import Estimate
from pipeline.records.evidence import Evidence
from pipeline.records.uncertainty import Budget, Contribution, propagate

METHOD = Method("drive_voltage")
GIVES = ("ke_phase_peak_v_s_rad", "r_phase_ohm")
PLACE = dict(zip(GIVES, ("temp_magnet_degc", "temp_winding_degc"), strict=True))
"""Thermometer of what each constant is of."""
EXPERIMENT = (
    "record a drive with vq_v, iq_a and theta_mech_rad over a wide range of speed and current, or "
    "better an open_circuit and a resistance test"
)
HOLD = "assumed:voltage_hold"
DROP = "drop"
CANDIDATES = ("zero", LATE, TURNED, "cross flux", NEAR_ZERO)


def fit(campaign: Campaign, known: Constants, options: Mapping[str, float]) -> Fit:
    """Ke and R by `q_voltage` over the windows of all drives, or of torque maps without a drive.

    The weak form takes w and di_q/dt without differentiating; w is the angle's own rate, since a
    bench's speed estimate lags. The flux of the d current stands in the equation wherever i_d is
    logged and parts from the speed. Lateness of the voltage against the angle shows as Ke tau dw/dt
    and joins, as a zero error and a turned frame do, where the data demand it. Voltages of maps are
    turned back first (`voltage_turn`): at a held speed their turn is one column with R. Without
    temperatures the values hold for those of the log.
    """
    pole_pairs = pole_pairs_of(known, campaign.nameplate("pole_pairs"))
    rows = voltage_rows(campaign.of("drive") or campaign.of("torque_map"), pole_pairs)
    if rows is None or rows.voltage_v.size < 20 or float(np.ptp(rows.speed_rad_s)) == 0.0:
        return METHOD.nothing(GIVES, EXPERIMENT)
    magnet, magnet_parts = magnet_coefficient(known)
    turn = None if campaign.of("drive") else _turn(rows, magnet)
    if turn is not None:
        rows = _turned_back(rows, turn)
    rows, drop_v = _plausible_drop(rows, magnet)
    chosen = _chosen(rows, magnet, options["level"])
    design = q_voltage(rows, magnet, chosen, {})
    solution = linear_fit(design, rows.voltage_v)
    if not solution.full_rank:
        return METHOD.nothing(GIVES, f"speed and current of the log go together; {EXPERIMENT}")
    sigma = np.ones(rows.voltage_v.size)
    covariance, dof = cluster_covariance(design, solution.residuals, sigma, rows.cluster)
    regression = Regression(design, rows.voltage_v, sigma, rows.cluster)
    split = partial(_partitions, rows)
    doubts = [disagreement(regression, k, split, options["level"]) for k in range(len(GIVES))]
    moved = _moved(rows, solution.coefficients, magnet, chosen, pole_pairs or 1)
    scatter = np.sqrt(np.diag(covariance)[: len(GIVES)])
    estimates = _estimates(
        rows, solution, (scatter, dof), (magnet, magnet_parts), chosen, (moved, doubts), turn
    )
    if drop_v:
        estimates = _without_drop(estimates, linear_fit(design, rows.columns[DROP]), drop_v)
    return Fit(estimates, _evidence(rows, solution))


def _plausible_drop(rows: VoltageRows, magnet: float) -> tuple[VoltageRows, float]:
    """The rows, and 0; or, where a fit gives the inverter a drop that none has, the rows to be
    fitted without one, and its standard uncertainty [V].

    Where the size of the current is the same throughout, as with a d current of one size, V_0 and R
    are one column but for what any other error of the model follows.
    """
    first = linear_fit(q_voltage(rows, magnet, [], {}), rows.voltage_v)
    most = policy().inverter.most_drop * max(link_voltage_v(c) for c in rows.captures)
    if abs(float(first.coefficients[3])) <= most:
        return rows, 0.0
    return replace(rows, has_drop=False), most / np.sqrt(3.0)


def _without_drop(
    estimates: tuple[Estimate, ...], along: LinearFit, drop_v: float
) -> tuple[Estimate, ...]:
    """The estimates with what a drop that was not fitted may make of Ke and R; R is given up where
    that is as large as itself.
    """
    words = (
        "resistance and a drop are one column where the current has one size: a fit gave one that "
        f"no inverter has, and a drop of the inverter's is taken as 0 ± {drop_v:.2g} V"
    )
    widened = []
    for one, slope in zip(estimates, along.coefficients.tolist(), strict=False):
        part = Contribution("assumed:inverter_drop", abs(slope) * drop_v, "B")
        if one.known and one.number <= 2.0 * part.u:
            note = f"{one.number:.3g} ± {part.u:.2g} {METHOD.unit(one.name)}: {words}"
            widened.append(METHOD.missing(one.name, f"{note}; {EXPERIMENT}"))
        elif one.known:
            widened.append(replace(one, budget=(*one.budget, part), note=f"{one.note}; {words}"))
        else:
            widened.append(one)
    return tuple(widened)


def _partitions(rows: VoltageRows, information: Array) -> list[Partition]:
    """Regimes of the rows by speed, senses, current and capture."""
    every = np.ones(rows.voltage_v.size, dtype=bool)
    speed, current = rows.speed_rad_s, rows.current_a
    files = tuple(f"in {capture.path}" for capture in rows.captures)
    return [
        halves("speed", np.abs(speed), "slow", "fast", information, every),
        halves("current", np.abs(current), "small", "large", information, every),
        signs("sense of rotation", speed, "backward", "forward", every),
        signs("sense of torque", current, "negative", "positive", every),
        Partition("capture", rows.capture, files),
    ]


def _gains(rows: VoltageRows, shift: Mapping[str, float]) -> tuple[Array, Array, Array]:
    voltage, current = shifted_gains(shift, rows.captures, rows.capture, "voltage", "current")
    sources = (temperature_source(c.meta) for c in rows.captures)
    return voltage, current, shifted_offsets(shift, sources, rows.capture)


def q_voltage(
    rows: VoltageRows, magnet: float, chosen: Sequence[str], shift: Mapping[str, float]
) -> Array:
    """The derivatives of the q voltage's window means by what is fitted: it is linear in all.

    Parameters
    ----------
    rows
        Window means [w] of speed [rad/s], current [A] and of what else stands in the equation.
    magnet
        Coefficient of the magnet's flux at 25 degC [1/K].
    chosen
        Nuisances that the data demand.
    shift
        By how much each instrument is off: gains relative, thermometers [K].

    Returns
    -------
    array [w, 4 or more]
        Columns of Ke [rad/s], R at 25 degC [A], L_q [A/s], V_0 [1] if the rows have a drop, then
        L_d where i_d was logged and parts from the speed, then the chosen ones.

    Notes
    -----
    v_q = Ke (1 + α_m (T_m - 25)) ω + R (1 + α_cu (T_w - 25)) i_q + L_q di_q/dt + V_0 sign(i_q)
    + p ω L_d i_d. A window's derivative stands for that of the current, so none is taken.

    References
    ----------
    IEEE Std 1812-2014 (dq equations).
    Messenger and Bortz, Multiscale Model. Simul. 19(3), 2021, 1474, doi:10.1137/20M1343166 (weak
    form).

    """
    _, current, warmer = _gains(rows, shift)
    cold = (
        rows.current_a * (1.0 + COPPER_COEFFICIENT_25_1_K * warmer)
        + COPPER_COEFFICIENT_25_1_K * rows.warm_current_k_a
    )
    speed = rows.speed_rad_s * (1.0 + magnet * warmer) + magnet * rows.warm_speed_k_rad_s
    extra = [rows.columns[name] for name in chosen]
    columns = [speed, cold * current, rows.columns["inductive"] * current]
    columns += [rows.columns[DROP]] if rows.has_drop else []
    flux = rows.columns.get(D_FLUX)
    if flux is not None and linear_fit(np.column_stack([*columns, flux]), flux).full_rank:
        columns.append(flux)
    return np.column_stack([*columns, *extra])


def _chosen(rows: VoltageRows, magnet: float, level: float) -> list[str]:
    """The nuisances of a fit: what the data demand, and the lateness of an observer's speed.

    On a free shaft that lateness reads as resistance, and no remainder shows it.
    """
    sure = [LATE] if any(not c.has("theta_mech_rad") for c in rows.captures) else []
    base = q_voltage(rows, magnet, sure, {})
    candidates = {name: rows.columns[name] for name in CANDIDATES if name in rows.columns}
    taken = {*sure} if rows.has_drop else {*sure, NEAR_ZERO}
    candidates = {name: column for name, column in candidates.items() if name not in taken}
    candidates = {n: c for n, c in candidates.items() if n == "zero" or float(np.ptp(c)) > 0.0}
    sigma = np.ones(rows.voltage_v.size)
    rich = np.column_stack([base, *candidates.values()])
    tau = autocorrelation_time(linear_fit(rich, rows.voltage_v).residuals, 200)
    return sure + needed_columns(base, candidates, rows.voltage_v, sigma, level, None, tau)


def _unlogged_flux(rows: VoltageRows, residuals: Array, along: Array) -> float:
    """Standard uncertainty of Ke [V s/rad] or R [ohm] for the flux of a d current that was not
    logged.

    What of it varies is in the remainder. As large as that, the part of it may be that goes `along`
    the speed [w, rad/s], which reads as Ke, or along the q current [w, A], which reads as R.
    """
    if all(c.has("id_a") for c in rows.captures) or not np.any(along):
        return 0.0
    return float(np.sqrt(np.mean(residuals**2) / np.mean(along**2)))


def _estimates(
    rows: VoltageRows,
    fit: LinearFit,
    scatter: tuple[Array, int],
    coefficient: tuple[float, Budget],
    chosen: Sequence[str],
    model: tuple[Array, Sequence[Disagreement | None]],
    turn: Turn | None,
) -> tuple[Estimate, ...]:
    (deviation, dof), (moved, doubts) = scatter, model
    magnet, magnet_parts = coefficient

    def values(shift: Mapping[str, float]) -> Array:
        voltage = _gains(rows, shift)[0] * rows.voltage_v
        warm = magnet + shift.get("magnet", 0.0)
        return linear_fit(q_voltage(rows, warm, chosen, shift), voltage).coefficients[:2]

    gains = instrument_uncertainties(rows.captures, ("voltage", "current", "temperature"))
    type_b = contributions(values, gains)
    apart_s = _apart_s(rows)
    instant = _of_instant(rows, fit, magnet, chosen, apart_s)
    turned = [] if turn is None else _of_turn(rows, fit, magnet, chosen, turn)
    per_alpha = (values({"magnet": 1e-4}) - values({"magnet": -1e-4})) / 2e-4
    paths = sorted(c.path for c in rows.captures)
    words = [
        f"{rows.voltage_v.size} windows, {np.std(fit.residuals):.2g} V left",
        allowed_for(chosen),
        unstated_note(rows.captures, ("voltage", "current")),
        _apart_note(apart_s, rows.period_s) if np.any(instant) else "",
    ]
    estimates = []
    for i, name in enumerate(GIVES):
        value, u = float(fit.coefficients[i]), float(deviation[i])
        if value <= 2.0 * u:
            note = f"{value:.3g} ± {u:.2g} {METHOD.unit(name)} from this log; {EXPERIMENT}"
            estimates.append(METHOD.missing(name, note))
            continue
        parts = [METHOD.scatter(name, u, dof), *type_b[i]]
        parts += propagate([(float(per_alpha[i]), magnet_parts)])
        parts.append(Contribution(f"assumed:{METHOD.name}:nuisances", float(moved[i]), "B"))
        parts.append(Contribution("assumed:voltage_instant", float(instant[i]), "B"))
        parts += [Contribution(source, float(u[i]), kind) for source, u, kind in turned]
        doubt = doubts[i]
        parts += [] if doubt is None else [doubt.part(f"{METHOD.name}:{name}", value)]
        remarks = [] if doubt is None else [doubt.words("the value")]
        assumed, assumptions = _unlogged(rows, fit, name, value, magnet)
        notes = [*remarks, *words, *assumptions]
        at = {PLACE[name]: 25.0, "omega_mech_rad_s": float(np.max(np.abs(rows.speed_rad_s)))}
        estimates.append(METHOD.measured(name, value, [*parts, *assumed], paths, at, notes))
    return tuple(estimates)


def _unlogged(
    rows: VoltageRows, fit: LinearFit, name: str, value: float, magnet: float
) -> tuple[list[Contribution], list[str]]:
    """What is assumed for what is not logged: temperatures, d current, an inverter's drop; and in
    words.
    """
    parts, words, kelvin = [], [], policy().magnet.unlogged_k
    if not all(c.has(PLACE[name]) for c in rows.captures):
        per_kelvin = abs(magnet) if name == GIVES[0] else COPPER_COEFFICIENT_25_1_K
        parts.append(Contribution(f"assumed:{PLACE[name]}", value * per_kelvin * kelvin, "B"))
        words.append(f"{PLACE[name]} not logged, taken as 25 ± {kelvin:g} K")
    if name == GIVES[0]:
        parts.append(Contribution(HOLD, value * rows.hold_doubt, "B"))
    elif switches := _switches_ohm(rows):
        parts.append(Contribution("assumed:inverter_resistance", switches, "B"))
        words.append("of commanded voltages: with switches and leads of the inverter")
    along = rows.speed_rad_s if name == GIVES[0] else rows.current_a
    if flux := _unlogged_flux(rows, fit.residuals, along):
        parts.append(Contribution("assumed:id_a:flux", flux, "B"))
        words.append("id_a not logged, taken as 0 but for what varies")
    return parts, words


def _switches_ohm(rows: VoltageRows) -> float:
    """Standard uncertainty of R [ohm] for the switches and leads between a commanded voltage and
    the terminals; what of their drop only follows the current's sign is fitted.
    """
    commanded = [c for c in rows.captures if c.meta.voltage_kind != "measured"]
    if not commanded:
        return 0.0
    drop_v = policy().inverter.conduction_share * max(link_voltage_v(c) for c in commanded)
    return drop_v / max(float(np.nanmax(np.abs(c.arrays("iq_a")["iq_a"]))) for c in commanded)


def _moved(
    rows: VoltageRows, values: Array, magnet: float, chosen: Sequence[str], pole_pairs: int
) -> Array:
    """How far Ke and R [2] move with one of the nuisances left out, at most.

    On a free shaft q current goes with acceleration, and R with the lateness of the voltage: what
    little parts them is also what any other error of the model follows. So a nuisance counts
    unless it is what it stands for: a lateness that drives have, Ke tau dw/dt and p tau w v_d, of
    periods of the inverter, however long the rows of a slower log. A voltage that is measured has
    none.
    """
    commanded = any(c.meta.voltage_kind != "measured" for c in rows.captures)
    held_s = max(hold_s(c.meta, rows.period_s, 0.0) for c in rows.captures)
    latest = policy().inverter.latest_periods * held_s * commanded
    most = {LATE: abs(float(values[0])) * latest, TURNED: pole_pairs * latest}
    moved = np.zeros(len(GIVES))
    for name, size in zip(chosen, values[len(values) - len(chosen) :], strict=True):
        if abs(float(size)) <= most.get(name, 0.0):
            continue
        design = q_voltage(rows, magnet, [n for n in chosen if n != name], {})
        without = linear_fit(design, rows.voltage_v).coefficients[: len(GIVES)]
        moved = np.maximum(moved, np.abs(without - values[: len(GIVES)]))
    return moved


def _of_instant(
    rows: VoltageRows, fit: LinearFit, magnet: float, chosen: Sequence[str], apart_s: float
) -> Array:
    """Standard uncertainties of Ke and R [2] for the instant that a voltage is of.

    On a free shaft R i and Ke tau dw/dt are nearly one column. A label says where in its hold a
    commanded voltage is meant, and no label fits a log that keeps every n-th row: within half a
    hold either way (rectangular, GUM 4.3.7). And where the currents stand `apart_s` from the motion
    that they make, as those of a log do that averages its rows, the voltages may do so too.
    """
    if LATE in chosen:
        return np.zeros(len(GIVES))
    held_s = max(hold_s(c.meta, rows.period_s, 0.0) for c in rows.captures)
    measured = all(c.meta.voltage_kind == "measured" for c in rows.captures)
    labelled_s = 0.0 if measured else 0.5 * held_s / np.sqrt(3.0)
    late_v_s = float(fit.coefficients[0]) * np.hypot(labelled_s, apart_s)
    along = linear_fit(q_voltage(rows, magnet, chosen, {}), rows.columns[LATE])
    return late_v_s * along.coefficients[: len(GIVES)]


def _apart_s(rows: VoltageRows) -> float:
    """How far currents stand from the motion that they make, before it or after it, more than
    scatter says [s]; 0 where something else than they moves the shaft.

    Kt i_q = J dw/dt + b w + T_c sign(w) + T_0, with i_q taken from another instant by its rate.
    """
    speed = rows.speed_rad_s
    columns = rows.columns["inductive"], rows.columns[LATE], speed, np.sign(speed)
    design = np.column_stack([*columns, np.ones(speed.size)])
    free = linear_fit(design, rows.current_a)
    explained = np.std(free.residuals) < policy().inverter.free_share * np.std(rows.current_a)
    if not (explained and free.full_rank):
        return 0.0
    sigma = np.ones(speed.size)
    covariance, _ = cluster_covariance(design, free.residuals, sigma, rows.cluster)
    beyond = float(free.coefficients[0]) ** 2 - float(covariance[0, 0])
    return float(np.sqrt(max(beyond, 0.0)))


def _apart_note(apart_s: float, period_s: float) -> str:
    """The note on `_apart_s`; empty for a small part of a row."""
    if apart_s < policy().inverter.least_apart_rows * period_s:
        return ""
    return (
        f"currents are {1e3 * apart_s:.2g} ms off the motion that they make; whether voltages are "
        "so too is not known: log voltage, current and angle of one instant"
    )


def _turn(rows: VoltageRows, magnet: float) -> Turn | None:
    """The turn of the voltages at held speeds, by the Ke of a first fit."""
    first = linear_fit(q_voltage(rows, magnet, [], {}), rows.voltage_v)
    return voltage_turn(rows.columns, rows.speed_rad_s, float(first.coefficients[0]))


def _turned_back(rows: VoltageRows, turn: Turn) -> VoltageRows:
    """The rows in the frame in which the magnet's voltage is on the q axis."""
    columns = {name: column for name, column in rows.columns.items() if name != TURNED}
    return replace(rows, voltage_v=rows.voltage_v + turn.q_voltage_v, columns=columns)


def _of_turn(
    rows: VoltageRows, fit: LinearFit, magnet: float, chosen: Sequence[str], turn: Turn
) -> list[tuple[str, Array, Literal["A", "B"]]]:
    """Standard uncertainties of Ke and R [2] for what is not known of a turn: its scatter, and
    whether the voltages are late or iron takes current.

    Turned back, a lateness is gone. Of iron p² ω² G L_q (L_d - L_q) i_q is left, with p L_q G = τ:
    between none and all of τ (rectangular, GUM 4.3.7).
    """
    design = q_voltage(rows, magnet, chosen, {})
    flux_d = float(fit.coefficients[4]) if design.shape[1] > 4 + len(chosen) else turn.flux_q_wb_a
    along = linear_fit(design, rows.columns[SPEED2_CURRENT]).coefficients[: len(GIVES)]
    iron = turn.late_s * (flux_d - turn.flux_q_wb_a) / np.sqrt(3.0)
    scatter = turn.u_late_s * turn.flux_q_wb_a
    return [
        ("assumed:iron_current", iron * along, "B"),
        (f"scatter:{METHOD.name}:turn", scatter * along, "A"),
    ]


def _evidence(rows: VoltageRows, fit: LinearFit) -> tuple[Evidence, ...]:
    title = "Drive voltage and its parts"
    columns = rows.capture, rows.time_s, rows.voltage_v, rows.voltage_v - fit.residuals
    return tuple(METHOD.traces(rows.captures, title, "vq_v", columns, "window means"))


ESTIMATOR = Estimator(
    name=METHOD.name,
    gives=GIVES,
    tests=("drive", "torque_map"),
    experiment=EXPERIMENT,
    fit=fit,
    uses=("pole_pairs", "temp_coeff_magnet_1_k"),
    rank=30,
    clock_powers={"ke_phase_peak_v_s_rad": 1},
    options={"level": 0.001},
)
