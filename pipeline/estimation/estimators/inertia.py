"""Rotor inertia, Coulomb and viscous friction from everyday drives and coast-downs together."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.estimation.electrical.magnet_temperature import (
    magnet_source,
    magnet_uncertainties,
    unlogged_note,
)
from pipeline.estimation.electrical.operating_points import pole_pairs_of
from pipeline.estimation.electrical.ripple_torque import RIPPLE, winding_of
from pipeline.estimation.mechanical.drag import drag_of_motion
from pipeline.estimation.mechanical.drag_fit import DragFit, drag_description
from pipeline.estimation.mechanical.drag_forms import DRAG_FORMS, DRAG_NAMES
from pipeline.estimation.mechanical.drag_over_time import DragOverTime, drag_over_time
from pipeline.estimation.mechanical.drive_windows import (
    coasts_decide,
    too_short,
    torque_is_separable,
)
from pipeline.estimation.mechanical.late_samples import drag_beside_late_samples
from pipeline.estimation.mechanical.sampled_current import in_step, lagging_inertia, sampling_drag
from pipeline.estimation.mechanical.setups import another_setup, setups_of
from pipeline.estimation.mechanical.shaft_doubts import DRAGS, Doubts
from pipeline.estimation.mechanical.shaft_nuisances import (
    CURRENT_LAG,
    NUISANCES,
    RELUCTANCE,
    SAMPLED,
)
from pipeline.estimation.mechanical.shaft_regimes import drag_disagreements
from pipeline.estimation.mechanical.shaft_rows import (
    COAST,
    DRIVE,
    ShaftRows,
    shaft_rows,
)
from pipeline.estimation.mechanical.slow_turns import leading_order
from pipeline.estimation.mechanical.torque_constant import UNKNOWN, USES, torque_constant
from pipeline.estimation.mechanical.torque_share import (
    is_apart,
    share_of_no_torque,
    words_of_no_torque,
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
    unstated_note,
)
from pipeline.numerics.coast_setups import Setup, setup_words
from pipeline.numerics.identifiability import within
from pipeline.records.capture import Array, Campaign, Capture
from pipeline.records.constants import Constants
from pipeline.records.estimate import Estimate
from pipeline.records.evidence import Evidence, Series
from pipeline.records.uncertainty import Budget, Contribution, propagate

METHOD = Method("inertia")
GIVES = DRAGS
EXPERIMENT = (
    "record a drive with iq_a and theta_mech_rad that accelerates and brakes hard in both senses "
    "(torque_shaft_nm if a load is coupled), and a spin_down from full speed"
)
LONGER = (
    "record a drive of at least a second and a turn that accelerates and brakes in both senses, "
    "with iq_a and theta_mech_rad"
)
LOAD = "log torque_shaft_nm in the drives, or record them with nothing coupled to the shaft"
AIDS = (
    "kt_reluctance_nm_a2",
    "temp_coeff_magnet_1_k",
    "ld_h",
    "lq_h",
    "pole_pairs",
    "r_phase_ohm",
)


@dataclass(frozen=True, slots=True)
class Torque:
    """What turns currents into torque, and whose uncertainty the inertia inherits.

    Where `reluctance_known` is false the drives' own rows say what it adds.
    """

    kt_nm_a: float
    kt_budget: Budget
    reluctance_nm_a2: float
    reluctance_budget: Budget
    magnet_1_k: float
    magnet_budget: Budget
    words: str
    reluctance_known: bool = True


def acceleration(rows: ShaftRows, driving_nm: Array) -> Array:
    """The derivatives of the shaft's acceleration by what is fitted: it is linear in all three.

    Parameters
    ----------
    rows
        Window means [w] of speed [rad/s] and of its sign.
    driving_nm : array [w], N·m
        Torque that drives the shaft, `driving_torque`.

    Returns
    -------
    array [w, 3]
        Columns of 1/J [N·m], T_c/J [1] and B/J [rad/s], as `drag_of` takes them.

    Notes
    -----
    J dω/dt = T - T_c sign(ω) - B ω. A window's second derivative stands for that of the angle
    (weak form), so none is taken of the data.

    References
    ----------
    IEEE Std 115-2019, 4.4 (retardation test).
    Messenger and Bortz, Multiscale Model. Simul. 19(3), 2021, 1474, doi:10.1137/20M1343166.

    """
    return np.column_stack([driving_nm, -rows.sense, -rows.speed_rad_s])


def driving_torque(rows: ShaftRows, torque: Torque, shift: Mapping[str, float]) -> Array:
    """Electromagnetic less load torque [w, N·m], as it would be with instruments off by `shift`.

    Parameters
    ----------
    rows
        Window means of i_q, i_q (T_m - 25), i_d i_q and of the shaft torque, and torque of ripple.
    torque
        What turns currents into torque.
    shift
        Gains of current and torque [1, relative], thermometers [K], and the moves of `kt`
        [1, relative], `reluctance` [N·m/A²] and `magnet` [1/K]; of the torque of ripple, in its
        standard uncertainties.

    Notes
    -----
    T = K (1 + α (T_m - 25)) i_q + K_rel i_d i_q + T_h - T_load, T_h by `ripple_torque`.

    """
    current, load = shifted_gains(shift, rows.captures, rows.capture, "current", "torque")
    warmer = shifted_offsets(shift, map(magnet_source, rows.captures), rows.capture)
    kt = torque.kt_nm_a * (1.0 + shift.get("kt", 0.0))
    reluctance = torque.reluctance_nm_a2 + shift.get("reluctance", 0.0)
    magnet = torque.magnet_1_k + shift.get("magnet", 0.0)
    warm = rows.warm_current_k_a + rows.q_current_a * warmer
    return (
        kt * current * (rows.q_current_a + magnet * warm)
        + reluctance * current**2 * rows.product_a2
        + (rows.ripple_nm + shift.get(RIPPLE, 0.0) * rows.u_ripple_nm)
        - load * rows.load_nm
    )


def fit(campaign: Campaign, known: Constants, options: Mapping[str, float]) -> Fit:
    """J, T_c and B by `acceleration` under `driving_torque`.

    Rows of drives and coast-downs (`shaft_rows`) are regressed together on g = 1/J, T_c/J, B/J:
    coast-downs fix the ratios, drives the scale. Where drag has another form, J comes from the
    drag curve left free, T = J (a_driven - a_coasting) at each speed. Coasts whose drag is not that
    of drives with a transducer turn something else as well, and are left out.
    """
    estimates = _fit(campaign, known, options)
    drives = replace(campaign, captures=campaign.of("drive"))
    if not campaign.of("spin_down") or not any(c.has("torque_shaft_nm") for c in drives.captures):
        return estimates
    alone = _fit(drives, known, options)
    words = another_setup(estimates.estimates, alone.estimates)
    if not words:
        return estimates
    noted = tuple(replace(e, note=f"{words}; {e.note}") for e in alone.estimates)
    return replace(alone, estimates=noted)


def _fit(campaign: Campaign, known: Constants, options: Mapping[str, float]) -> Fit:
    """J, T_c and B of drives and coasts taken as one set-up, if the coasts are."""
    torque = _torque(known)
    setups = setups_of(campaign.of("spin_down"))
    if len(setups) > 1:
        campaign = replace(campaign, captures=campaign.of("drive"))
    rows = _rows(known, campaign) if torque is not None else None
    if torque is None or rows is None or not np.any(rows.kind == DRIVE):
        missing = UNKNOWN if torque is None else "no usable drive log"
        missing = f"{missing}; {_setups_reason(setups)}" if len(setups) > 1 else missing
        return METHOD.nothing(GIVES, f"{missing}; {EXPERIMENT}")
    nuisances = [*NUISANCES, *(n for n in rows.columns if n.startswith("order "))]
    nuisances += [] if torque.reluctance_known else [RELUCTANCE]
    nuisances += [SAMPLED] if coasts_decide(rows) and in_step(rows.captures) else []
    y, driving = rows.acceleration_rad_s2, driving_torque(rows, torque, {})
    if float(np.ptp(driving)) == 0.0:
        return METHOD.nothing(GIVES, f"the drive log holds no torque; {EXPERIMENT}")
    nuisances = [name for name in nuisances if is_apart(rows, driving, name)]
    if short := too_short(rows):
        return METHOD.nothing(GIVES, f"{short}; {LONGER}")
    law = acceleration(rows, driving)
    drag = drag_of_motion(rows, law, nuisances, options["level"], torque.kt_nm_a)
    known_torque = torque.kt_nm_a, torque.reluctance_known
    drag = drag_beside_late_samples(rows, drag, *known_torque)
    if not (drag.steady or torque_is_separable(drag.design, drag.sigma)):
        note = f"the drive's torque cannot be separated from its friction; {EXPERIMENT}"
        return METHOD.nothing(GIVES, note)
    strange = share_of_no_torque(rows, drag)
    if strange > policy().drag.loaded_share and not _load_logged(rows):
        return METHOD.nothing(GIVES, f"{words_of_no_torque(strange)}; {LOAD}")
    doubts = Doubts(strange, (None, None, None))
    if not drag.steady:
        regimes = drag_disagreements(rows, drag, options["level"])
        doubts = Doubts(strange, regimes, _over_time(rows, driving, drag, options["level"]))
    sampled = sampling_drag(rows.captures, torque.kt_nm_a, known)
    sampled = () if SAMPLED in drag.names else sampled
    estimates = _estimates(rows, torque, drag, doubts, _left_out(rows, campaign), sampled)
    if strange > policy().drag.unexplained_share and not _load_logged(rows):
        drags = METHOD.nothing(GIVES[1:], f"{words_of_no_torque(strange)}; {LOAD}").estimates
        estimates = (estimates[0], *drags)
    if len(setups) > 1:
        words = _setups_reason(setups)
        estimates = tuple(replace(e, note=f"{words}; {e.note}") for e in estimates)
    return Fit(_of_a_known_sign(estimates), _evidence(rows, y, drag))


def _over_time(
    rows: ShaftRows, driving_nm: Array, drag: DragFit, level: float
) -> DragOverTime | None:
    """The change of the drag with time, where drives and coasts show one."""
    beside = [k for k, n in enumerate(drag.names) if n != "torque" and n not in DRAG_NAMES]
    law = acceleration(rows, driving_nm)
    return drag_over_time(rows, law, drag.design[:, beside], (drag.design,), level)


def _of_a_known_sign(estimates: tuple[Estimate, ...]) -> tuple[Estimate, ...]:
    """The estimates; none where the inertia, which comes first and scales the others, may be zero,
    and no drag beside one below zero.

    What is not known to its own size is published by nobody (`estimation.registry`), nor is an
    inertia below zero. A current or a torque of the wrong sign makes one, and turns the drag's too.
    """
    inertia = estimates[0]
    sized = inertia.known and within(np.array(inertia.u), np.array(abs(inertia.number)))
    if not inertia.known or (sized and inertia.number > 0.0):
        return estimates
    note = (
        f"the acceleration does not follow the torque: the inertia came out as "
        f"{inertia.number:.3g} ± {inertia.u:.2g} kg·m²; look at the signs of iq_a and "
        f"torque_shaft_nm, else {EXPERIMENT}"
    )
    drags = METHOD.nothing(GIVES[1:], note).estimates
    return (inertia, *drags) if sized else METHOD.nothing(GIVES, note).estimates


def _setups_reason(setups: Sequence[Setup]) -> str:
    """Why coasts were not used, in words."""
    return f"{setup_words(setups)}, so none is used beside the drives"


def _rows(known: Constants, campaign: Campaign) -> ShaftRows | None:
    """Rows of the drives that log their load, of all drives where none does; and of coast-downs."""
    pairs = pole_pairs_of(known, campaign.nameplate("pole_pairs"))
    winding = winding_of(pairs, known.best("r_phase_ohm"))
    forms = DRAG_FORMS, *_orders(known, campaign, pairs), winding
    logged = [c for c in campaign.of("drive", "spin_down") if not _loadless(c)]
    rows = shaft_rows(logged, *forms)
    if rows is not None and np.any(rows.kind == DRIVE):
        return rows
    return shaft_rows(campaign.of("drive", "spin_down"), *forms)


def _loadless(capture: Capture) -> bool:
    """Whether this is a drive that does not say what loads the shaft."""
    return capture.meta.test == "drive" and not capture.has("torque_shaft_nm")


def _load_logged(rows: ShaftRows) -> bool:
    return not any(_loadless(capture) for capture in rows.captures)


def _left_out(rows: ShaftRows, campaign: Campaign) -> tuple[str, ...]:
    """Paths of drives that do not log their load, beside ones that do."""
    if not _load_logged(rows):
        return ()
    return tuple(capture.path for capture in campaign.of("drive") if _loadless(capture))


def _torque(known: Constants) -> Torque | None:
    kt = torque_constant(known)
    if kt is None:
        return None
    magnet = magnet_coefficient(known)
    words = f"torque constant from {kt.method}"
    reluctance = known.best("kt_reluctance_nm_a2")
    if reluctance is not None:
        return Torque(
            kt.number, kt.budget, reluctance.number, reluctance.budget, *magnet, words
        )  # fmt: skip
    ld, lq, pairs = known.best("ld_h"), known.best("lq_h"), known.best("pole_pairs")
    if ld is not None and lq is not None and pairs is not None:
        scale = 1.5 * pairs.number
        budget = propagate([(scale, ld.budget), (-scale, lq.budget)])
        value = scale * (ld.number - lq.number)
        return Torque(kt.number, kt.budget, value, budget, *magnet, words)
    words += ", reluctance torque unknown"
    return Torque(kt.number, kt.budget, 0.0, (), *magnet, words, reluctance_known=False)


def _orders(
    known: Constants, campaign: Campaign, pairs: int | None
) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Orders a turn of cogging, and of the torque ripple that six-fold back-EMF harmonics make."""
    order = leading_order(campaign, known)
    cogging = () if order is None else (order,)
    return cogging, () if pairs is None else (6 * pairs,)


def _estimates(
    rows: ShaftRows,
    torque: Torque,
    drag: DragFit,
    doubts: Doubts,
    left_out: Sequence[str],
    sampled: Budget,
) -> tuple[Estimate, ...]:
    """J, T_c and B with their budgets; that of B with what a `sampled` current makes."""

    def values(shift: Mapping[str, float]) -> Array:
        return drag.constants(drag.refit(driving_torque(rows, torque, shift)))

    gains = instrument_uncertainties(rows.captures, ("current", "torque"))
    gains |= magnet_uncertainties(c for c in rows.captures if c.meta.test == "drive")
    gains |= {RIPPLE: 1.0} if np.any(rows.u_ripple_nm) else {}
    type_b = contributions(values, gains)
    per_kt, per_rel, per_alpha = _slopes(values, torque)
    logged = _load_logged(rows) or drag.by_current
    constants = doubts.middle(logged) * drag.constants(drag.coefficients)
    scatter = drag.scatter()
    paths = sorted(c.path for c in rows.captures)
    words = (*_words(rows, torque, drag), *_load_words(rows, doubts.share, left_out))
    notes = [*doubts.words(logged), *words]
    at = {"omega_mech_rad_s": rows.fastest_rad_s, "temp_magnet_degc": 25.0}
    estimates = []
    for i, name in enumerate(GIVES):
        if reason := doubts.reason(i) or drag.reasons[i]:
            estimates.append(METHOD.missing(name, reason))
            continue
        parts = [METHOD.scatter(f"{k}", float(u), drag.dof) for k, u in enumerate(scatter[i])]
        parts.append(Contribution("assumed:drag_form", float(drag.u_form[i]), "B"))
        parts += doubts.parts(i, float(constants[i]), float(constants[0]), logged)
        parts += sampled if name == "b_visc_nm_s_rad" else ()
        if name == "j_rotor_kgm2" and CURRENT_LAG not in drag.names:
            parts.append(lagging_inertia(rows.captures, float(constants[2])))
        parts += _of_a_speed(rows, float(constants[i]))
        parts += _of_a_d_current(rows, float(per_kt[i]) * torque.kt_nm_a)
        slopes = [float(slope[i]) for slope in (per_kt, per_rel, per_alpha)]
        budgets = (torque.kt_budget, torque.reluctance_budget, torque.magnet_budget)
        budget = propagate([(1.0, (*parts, *type_b[i])), *zip(slopes, budgets, strict=True)])
        estimates.append(METHOD.measured(name, float(constants[i]), budget, paths, at, notes))
    return tuple(estimates)


def _of_a_speed(rows: ShaftRows, value: float) -> list[Contribution]:
    """What a bench's own speed, lagging or smoothed, may make of J, T_c or B without an angle."""
    if rows.by_angle:
        return []
    return [Contribution("assumed:speed_estimate", policy().drag.speed_share * value, "B")]


def _of_a_d_current(rows: ShaftRows, per_torque: float) -> list[Contribution]:
    """What the reluctance torque of a d current that was not logged may add to a constant."""
    if all(c.has("id_a") for c in rows.captures if c.meta.test == "drive"):
        return []
    share = policy().torque_map.unlogged_d_share
    return [Contribution("assumed:id_a:torque", per_torque * share, "B")]


def _slopes(
    values: Callable[[Mapping[str, float]], Array], torque: Torque
) -> tuple[Array, Array, Array]:
    """What J, T_c and B [3] change by the torque constant, the reluctance and the magnet's law."""
    step = max(abs(torque.reluctance_nm_a2), 1e-9) * 1e-2
    return (
        (values({"kt": 1e-3}) - values({"kt": -1e-3})) / (2e-3 * torque.kt_nm_a),
        (values({"reluctance": step}) - values({"reluctance": -step})) / (2.0 * step),
        (values({"magnet": 1e-4}) - values({"magnet": -1e-4})) / 2e-4,
    )


def _words(rows: ShaftRows, torque: Torque, drag: DragFit) -> list[str]:
    words = [torque.words, drag_description(drag)]
    words += ["all that brakes the shaft counts to friction"] if drag.steady else []
    words.append("what iron loss there is under the magnet's flux counts as drag")
    words.append(f"{rows.count} windows, {rows.dropped} near standstill left out")
    if _of_a_speed(rows, 1.0):
        words.append("motion by the bench's own speed, which may lag or be smoothed")
    if _of_a_d_current(rows, 1.0):
        words.append("id_a not logged, its torque taken as none")
    if not np.any(rows.kind == COAST):
        words.append("no spin_down: friction from driven motion alone")
    drives = [c for c in rows.captures if c.meta.test == "drive"]
    return [*words, unlogged_note(drives), unstated_note(rows.captures, ("current", "torque"))]


def _load_words(rows: ShaftRows, strange: float, left_out: Sequence[str]) -> list[str]:
    """What is not known of the load, in words."""
    if left_out:
        return [f"without {', '.join(left_out)}, whose load is not logged (torque_shaft_nm)"]
    if _load_logged(rows):
        return []
    return [
        f"no drive logs its load: all but {100.0 * strange:.2g} % of the square of the "
        "acceleration follows the current, so the shaft is taken as free",
        "what turns with it counts to the inertia, and what brakes it to friction",
    ]


def _evidence(rows: ShaftRows, measured: Array, drag: DragFit) -> tuple[Evidence, ...]:
    curve = METHOD.plot(
        "Drag against speed", ("omega_mech_rad_s", "torque_coulomb_nm"), "scatter",
        (Series("drag", *drag.curve(rows)),),
        "driving torque less J times acceleration; line: Coulomb and viscous",
    )  # fmt: skip
    if drag.steady:
        return (curve,)
    words = ["coast" if c.meta.test == "spin_down" else "drive" for c in rows.captures]
    titles = [f"Acceleration in the {word}" for word in words]
    columns = rows.capture, rows.time_s, measured, measured - drag.residuals
    caption = "window means, no derivative taken"
    plots = METHOD.traces(rows.captures, titles, "acceleration_rad_s2", columns, caption)
    return (*plots, curve)


ESTIMATOR = Estimator(
    name=METHOD.name,
    gives=GIVES,
    tests=("drive", "spin_down"),
    experiment=EXPERIMENT,
    fit=fit,
    uses=(*USES, *AIDS),
    either=USES,
    aids=AIDS,
    rank=0,
    clock_powers={"j_rotor_kgm2": 2, "b_visc_nm_s_rad": 1},
    options={"level": 0.001},
)
