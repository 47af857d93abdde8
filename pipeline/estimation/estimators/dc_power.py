"""Motor constant and drag from the supply's side alone: DC power, shaft torque and speed."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from functools import partial

import numpy as np

from pipeline.estimation.electrical.terminals import first_temperature
from pipeline.estimation.method import Method
from pipeline.estimation.policy import policy
from pipeline.estimation.protocol import Estimator, Fit
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
    Partition,
    Regression,
    disagreement,
    halves,
    scatter,
)
from pipeline.numerics.least_squares import LinearFit, autocorrelation_time, linear_fit
from pipeline.numerics.plateaus import block_means, noise_about_cubics
from pipeline.numerics.selection import needed_columns
from pipeline.physics.copper import COPPER_COEFFICIENT_25_1_K
from pipeline.physics.glossary import Term
from pipeline.physics.units import REFERENCE_DEGC
from pipeline.records.capture import Array, Campaign, Capture, Indices
from pipeline.records.constants import Constants
from pipeline.records.estimate import Estimate
from pipeline.records.evidence import Evidence
from pipeline.records.uncertainty import Contribution

STANDBY = Term(
    "standby_w", "W", "power that the drive takes from its supply at rest", "constant", -1e4, 1e4
)
METHOD = Method("dc_power", (STANDBY,))
GIVES = ("motor_constant_nm_sqrt_w", "torque_coulomb_nm", "b_visc_nm_s_rad", STANDBY.name)
EXPERIMENT = (
    "record vdc_v, idc_a, torque_shaft_nm and the speed of a drive at several torques and speeds, "
    "a few seconds each"
)
COLUMNS = ("t_s", "vdc_v", "idc_a", "torque_shaft_nm")


@dataclass(frozen=True, slots=True)
class Blocks:
    """Means [w] of products over blocks of the logs: DC power, shaft power, torque squared, ...

    Attributes
    ----------
    dc_w, shaft_w
        Electrical power in and mechanical power out.
    torque_nm, torque2_nm2
        Means of the torque and of its square.
    speed_rad_s, speed2_rad2_s2
        Means of the speed and of its square.
    kinetic_rad2_s3
        Mean of ω dω/dt.
    warm
        Resistance over that at 25 °C [1].
    torque_noise_nm
        Standard deviation of the noise of a block's mean torque.
    capture
        Index of each block's capture.

    """

    dc_w: Array
    shaft_w: Array
    torque_nm: Array
    torque2_nm2: Array
    speed_rad_s: Array
    speed2_rad2_s2: Array
    kinetic_rad2_s3: Array
    warm: Array
    torque_noise_nm: Array
    capture: Indices


MEANS = tuple(field.name for field in fields(Blocks) if field.name != "capture")


def losses(blocks: Blocks, at: Array) -> tuple[Array, Array]:
    """The power that does not come out, and its derivatives by what is fitted.

    Parameters
    ----------
    blocks
        Means over blocks [w].
    at
        1/Km² [W/(N·m)²], T_c [N·m], B [N·m·s/rad] and the standby power P_0 [W].

    Returns
    -------
    lost : array [w], W
        Electrical power in less mechanical power out.
    slopes : array [w, 4]
        Its derivatives by the four numbers.

    Notes
    -----
    v_dc i_dc = T ω + (T + T_c sign ω + B ω)²/Km² + T_c |ω| + B ω² + P_0, Km = Kt/√(1.5 R): what
    comes in leaves as shaft power, heats the winding, is drag, or feeds the drive.

    References
    ----------
    IEC 60034-2-1:2014, 6 (losses by direct measurement).

    """
    sense, speed = np.sign(blocks.speed_rad_s), blocks.speed_rad_s
    drag_nm = at[1] * sense + at[2] * speed
    squared = blocks.warm * (blocks.torque2_nm2 + 2.0 * drag_nm * blocks.torque_nm + drag_nm**2)
    heating = 2.0 * at[0] * blocks.warm * (blocks.torque_nm + drag_nm)
    pace, power = np.abs(speed), blocks.speed2_rad2_s2
    loss_w = at[0] * squared + at[1] * pace + at[2] * power + at[3]
    by_drag = [pace + heating * sense, power + heating * speed]
    return loss_w, np.column_stack([squared, *by_drag, np.ones(speed.size)])


def fit(campaign: Campaign, known: Constants, options: Mapping[str, float]) -> Fit:
    """Km, T_c, B and the standby power by `losses` over blocks of all drives that have the columns.

    Both sides of the balance are measured, so that the gains of three instruments are in what is
    left; where that is a tenth of the power, one per cent of gain is a tenth of the losses.
    """
    captures = [c for c in campaign.of("drive", "torque_map") if _usable(c)]
    parts = [one for n, c in enumerate(captures) if (one := _blocks(c, n)) is not None]
    if not parts:
        return METHOD.nothing(GIVES, f"no DC power beside torque and speed; {EXPERIMENT}")
    blocks = _joined(parts)
    if blocks.dc_w.size < 2 * policy().evidence.rows:
        return METHOD.nothing(GIVES, f"{blocks.dc_w.size} blocks of a second; {EXPERIMENT}")
    chosen = _chosen(blocks, options["level"])
    solution, design = _solve(blocks, chosen)
    if solution is None:
        return METHOD.nothing(GIVES, f"torque and speed do not change apart; {EXPERIMENT}")
    estimates = _estimates(captures, blocks, chosen, (solution, design), options["level"])
    return Fit(estimates, _plots(captures, blocks, solution))


def _usable(capture: Capture) -> bool:
    return capture.has(*COLUMNS) and _motion(capture) != ""


def _motion(capture: Capture) -> str:
    """The column that gives the speed."""
    names = ("omega_mech_rad_s", "theta_mech_rad")
    return next((name for name in names if capture.has(*COLUMNS, name)), "")


def _blocks(capture: Capture, number: int) -> Blocks | None:
    """Means over blocks of a second, ten rows at the least; None of a log with fewer than one."""
    motion = _motion(capture)
    warm = first_temperature(capture, "winding")
    columns = capture.finite(*COLUMNS, motion, *([warm] if warm else []))
    t_s = columns["t_s"]
    if t_s.size < 20:
        return None
    size = max(10, round(1.0 / float(np.median(np.diff(t_s)))))
    omega = np.gradient(columns[motion], t_s) if motion == "theta_mech_rad" else columns[motion]
    torque = columns["torque_shaft_nm"]
    degc = columns[warm] if warm else np.full(t_s.size, REFERENCE_DEGC)
    power = columns["vdc_v"] * columns["idc_a"]
    count = t_s.size // size
    if count < 1:
        return None
    smooth = np.convolve(omega, np.full(size, 1.0 / size), mode="same")
    means = [
        block_means(one, size)
        for one in (
            power, torque * omega, torque, torque**2, omega, omega**2,
            0.5 * np.gradient(smooth**2, t_s),
            1.0 + COPPER_COEFFICIENT_25_1_K * (degc - REFERENCE_DEGC),
            np.full(t_s.size, noise_about_cubics(t_s, torque) / math.sqrt(size)),
        )
    ]  # fmt: skip
    mean_of = dict(zip(MEANS, means, strict=True))
    return Blocks(**mean_of, capture=np.full(means[0].size, number))


def _joined(parts: Sequence[Blocks]) -> Blocks:
    mean_of = {name: np.concatenate([getattr(one, name) for one in parts]) for name in MEANS}
    return Blocks(**mean_of, capture=np.concatenate([one.capture for one in parts]))


def _pool(blocks: Blocks) -> dict[str, Array]:
    """What may join: the power that a shaft stores which gathers speed."""
    return {"inertia": blocks.kinetic_rad2_s3}


def _chosen(blocks: Blocks, level: float) -> list[str]:
    """Which of `_pool` the losses ask for."""
    base_fit, base = _solve(blocks, ())
    if base_fit is None:
        return []
    loss_w = base @ base_fit.coefficients[:4] + base_fit.residuals
    pool = _pool(blocks)
    rich = np.column_stack([base, *pool.values()])
    residuals = linear_fit(rich, loss_w).residuals
    tau = autocorrelation_time(residuals, policy().evidence.memory_rows)
    return needed_columns(base, pool, loss_w, np.ones(loss_w.size), level, len(pool), tau)


def _solve(blocks: Blocks, chosen: Sequence[str]) -> tuple[LinearFit | None, Array]:
    """The fit by Gauss-Newton, and its columns; None where columns are tied.

    The coefficients are those of `losses` and of the chosen columns, at which it is linearised.
    """
    loss_w = blocks.dc_w - blocks.shaft_w
    further = [_pool(blocks)[name] for name in chosen]
    at = np.zeros(4)
    for _ in range(12):
        modelled_w, slopes = losses(blocks, at)
        design = np.column_stack([slopes, *further])
        # of a linearised equation: coefficients are the numbers themselves, not their steps
        solution = linear_fit(design, loss_w - modelled_w + slopes @ at)
        if not solution.full_rank:
            return None, design
        at = solution.coefficients[:4]
    return solution, design


def attenuation(blocks: Blocks, solution: LinearFit, design: Array) -> Array:
    """What noise of the torque, which is in the losses and in its square, moves each coefficient.

    Parameters
    ----------
    blocks
        With the noise of their torque.
    solution
        The fit.
    design
        Its columns [w, k], those of `losses` first.

    Returns
    -------
    array [k]
        (X'X)⁻¹ X'e to first order, in the units of the coefficients.

    References
    ----------
    Fuller, Measurement Error Models, 1987, 2.2 (errors that are correlated).

    """
    torque, speed = blocks.torque_nm, blocks.speed_rad_s
    drag_nm = solution.coefficients[1] * np.sign(speed) + solution.coefficients[2] * speed
    error = -speed - 2.0 * solution.coefficients[0] * blocks.warm * (torque + drag_nm)
    moment = np.zeros(design.shape[1])
    moment[0] = float(np.sum(2.0 * torque * blocks.torque_noise_nm**2 * error))
    size = np.linalg.norm(design, axis=0)
    gram = (design / size).T @ (design / size)
    return np.linalg.solve(gram, moment / size) / size


def _constants(coefficients: Array) -> Array:
    """Km, T_c, B and the standby power [4]; Km is not a number where no loss grows with torque."""
    per_km2 = float(coefficients[0])
    km = 1.0 / math.sqrt(per_km2) if per_km2 > 0.0 else math.nan
    return np.array([km, *coefficients[1:4]])


def _moved(
    blocks: Blocks, captures: Sequence[Capture], chosen: Sequence[str], shift: Mapping[str, float]
) -> Array:
    """The constants with instruments off by `shift`."""
    volts, amps, force = shifted_gains(
        shift, captures, blocks.capture, "voltage", "current", "torque"
    )
    warmer = shifted_offsets(shift, map(_thermometer, captures), blocks.capture)
    moved = Blocks(
        volts * amps * blocks.dc_w, force * blocks.shaft_w, force * blocks.torque_nm,
        force**2 * blocks.torque2_nm2, blocks.speed_rad_s, blocks.speed2_rad2_s2,
        blocks.kinetic_rad2_s3, blocks.warm + COPPER_COEFFICIENT_25_1_K * warmer,
        blocks.torque_noise_nm, blocks.capture,
    )  # fmt: skip
    solution, _ = _solve(moved, chosen)
    return np.full(4, np.nan) if solution is None else _constants(solution.coefficients)


def _thermometer(capture: Capture) -> str:
    """Source of the winding's temperature in a capture."""
    return temperature_source(capture.meta) if _warm(capture) else "assumed:temp_winding_degc"


def _warm(capture: Capture) -> bool:
    """Whether the winding's temperature was logged."""
    return first_temperature(capture, "winding") is not None


def _estimates(
    captures: Sequence[Capture],
    blocks: Blocks,
    chosen: Sequence[str],
    solved: tuple[LinearFit, Array],
    level: float,
) -> tuple[Estimate, ...]:
    solution, design = solved
    loss_w = blocks.dc_w - blocks.shaft_w
    linear = design @ solution.coefficients + solution.residuals
    cluster = np.arange(loss_w.size) // 5
    regression = Regression(design, linear, np.ones(loss_w.size), cluster)
    deviation, dof = scatter(regression, solution, 0.0)
    bias = attenuation(blocks, solution, design)
    gains = instrument_uncertainties(captures, ("voltage", "current", "torque"))
    gains |= {_thermometer(c): policy().magnet.unlogged_k for c in captures if not _warm(c)}
    shared = contributions(lambda shift: _moved(blocks, captures, chosen, shift), gains)
    values = _constants(solution.coefficients)
    slopes = [-0.5 * float(values[0]) ** 3, 1.0, 1.0, 1.0]
    notes, estimates = _notes(captures, blocks, chosen), []
    at = {"omega_mech_rad_s": float(np.max(np.abs(blocks.speed_rad_s)))}
    for k, name in enumerate(GIVES):
        u_scatter = abs(slopes[k]) * float(deviation[k])
        parts = [METHOD.scatter(name, u_scatter, float(dof[k])), *shared[k]]
        parts.append(Contribution("assumed:noise_of_columns", slopes[k] * float(bias[k]), "B"))
        doubt = disagreement(regression, k, partial(_partitions, blocks), level)
        words = []
        if doubt is not None and math.isfinite(values[k]):
            relative = 0.5 if k == 0 else 1.0
            parts.append(doubt.part(f"{METHOD.name}:{name}", relative * float(values[k])))
            words.append(doubt.words("the loss" if k == 0 else "the value"))
        u = math.sqrt(sum(part.u**2 for part in parts))
        significant = values[k] > policy().evidence.sigmas * u
        if not (significant or (name == STANDBY.name and u < abs(float(np.mean(loss_w))))):
            note = f"no more than its uncertainty beside the rest of the losses; {EXPERIMENT}"
            estimates.append(METHOD.missing(name, note))
            continue
        words += notes
        estimates.append(METHOD.measured(name, float(values[k]), parts, captures, at, words))
    return tuple(estimates)


def _notes(captures: Sequence[Capture], blocks: Blocks, chosen: Sequence[str]) -> list[str]:
    loss_w = blocks.dc_w - blocks.shaft_w
    share = float(np.sum(loss_w)) / max(float(np.sum(blocks.dc_w)), 1e-300)
    return [
        f"{loss_w.size} blocks, {100.0 * share:.2g} % of the power lost; iron loss counts as drag, "
        "what the drive loses with its current as the winding's",
        allowed_for(chosen),
        unstated_note(captures, ("voltage", "current", "torque")),
    ]


def _partitions(blocks: Blocks, weights: Array) -> list[Partition]:
    """Regimes by torque and by speed."""
    every = np.ones(weights.size, dtype=bool)
    return [
        halves("torque", np.abs(blocks.torque_nm), "small", "large", weights, every),
        halves("speed", np.abs(blocks.speed_rad_s), "slow", "fast", weights, every),
    ]


def _plots(
    captures: Sequence[Capture], blocks: Blocks, solution: LinearFit
) -> tuple[Evidence, ...]:
    loss_w = blocks.dc_w - blocks.shaft_w
    title = "Power that does not leave by the shaft, W"
    number = np.concatenate(
        [np.arange(np.count_nonzero(blocks.capture == n)) for n in range(len(captures))]
    ).astype(float)
    columns = blocks.capture, number, loss_w, loss_w - solution.residuals
    return tuple(METHOD.traces(captures, title, STANDBY.name, columns, "means over blocks"))


ESTIMATOR = Estimator(
    name=METHOD.name,
    gives=GIVES,
    tests=("drive", "torque_map"),
    experiment=EXPERIMENT,
    fit=fit,
    rank=50,
    terms=(STANDBY,),
    clock_powers={"b_visc_nm_s_rad": 1},
    options={
        # False alarm of a further loss or of a regime, over all that are tried.
        "level": 0.001,
    },
)
