"""What a current induces in the voltage of the other axis at speed: pole pairs times inductance.

An inductance at speed is that over the pole pairs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from pipeline.estimation.electrical.operating_points import pole_pairs_of
from pipeline.estimation.electrical.voltage_rows import (
    CROSS_FLUX,
    D_BEHIND,
    D_DROP,
    D_FLUX,
    D_FLUX_BENT,
    Q_BEHIND,
    Q_FLUX_BENT,
    Q_TURNED,
    VoltageRows,
    voltage_rows,
)
from pipeline.estimation.electrical.voltage_turn import Q_FLUX, TURNED, V_D
from pipeline.estimation.method import Method
from pipeline.estimation.policy import policy
from pipeline.estimation.protocol import Fit
from pipeline.estimation.uncertainty.instruments import (
    contributions,
    current_source,
    instrument_uncertainties,
    unstated_note,
    voltage_source,
)
from pipeline.numerics.clusters import cluster_covariance
from pipeline.numerics.least_squares import linear_fit
from pipeline.records.capture import Array, Campaign, Capture
from pipeline.records.constants import Constants
from pipeline.records.uncertainty import Budget, Contribution, propagate

WARM_FLUX, WARM_DROP, DRIFT = "warm speed", "warm current", "flux that drifts"
UNMODELLED = "assumed:unmodelled_voltage"
STANDSTILL = ("current_step", "lcr")
"""Methods that give inductances at standstill."""
# What is looked for comes first; each nuisance counts where no column before it holds it.
COLUMNS = {
    "q": (
        (Q_FLUX, "d current", "d inductive"),
        ("q voltage", Q_TURNED, D_DROP, Q_FLUX_BENT, CROSS_FLUX, "zero"),
    ),
    "d": (
        (D_FLUX, "speed", "current", "inductive"),
        (V_D, TURNED, "drop", D_FLUX_BENT, "cross flux", "zero", WARM_FLUX, WARM_DROP, DRIFT),
    ),
}


class Slope(NamedTuple):
    """Pole pairs times an inductance, as voltages at speed have it.

    Attributes
    ----------
    value_h, u_h, dof
        Value and scatter [H], and degrees of freedom.
    rows
        What it is from.
    share
        Of the voltage, rms, that this inductance alone explains [1].
    behind_h_s2
        What a frame makes of it that is behind by an electrical angle over the acceleration of the
        shaft [H/s²].

    """

    value_h: float
    u_h: float
    dof: int
    rows: VoltageRows
    share: float = np.inf
    behind_h_s2: float = 0.0

    @property
    def unmodelled(self) -> float:
        """What effects that are not modelled make of it [1]: those of the voltage over its share.

        Of the q inductance none: its voltage is most of the d voltage.
        """
        return policy().at_speed.unmodelled / self.share if self.share > 0.0 else np.inf


def rows_of_slope(captures: Sequence[Capture], pole_pairs: int | None) -> VoltageRows | None:
    """The window means of the captures that `flux_slope` can use.

    Parameters
    ----------
    captures
        Drives or torque maps.
    pole_pairs
        As `voltage_rows` has them.

    Returns
    -------
    VoltageRows or None
        Of captures with both axes, of drives those with an encoder's angle alone.

    Notes
    -----
    An observer's frame is behind by α/ω_n² as the shaft gathers speed. On a free shaft α goes with
    the q current, so that reads as p ψ Kt/(J ω_n²) of inductance, and no remainder shows it.

    """
    both = [c for c in captures if c.has("vd_v", "id_a")]
    return voltage_rows(
        [c for c in both if c.meta.test != "drive" or c.has("theta_mech_rad")], pole_pairs
    )


def flux_slope(rows: VoltageRows, axis: str) -> Slope | None:
    """Pole pairs times the inductance of one axis, by the voltage of the other one.

    Parameters
    ----------
    rows
        Window means of both voltages.
    axis
        `d` or `q`: of the inductance.

    Returns
    -------
    Slope or None
        At small current, where iron does not bend yet; None where the current of this axis does not
        change, or goes together with something else.

    Notes
    -----
    v_d = R i_d + L_d di_d/dt - p L_q ω i_q and v_q = R i_q + L_q di_q/dt + p L_d ω i_d + Ke ω, ω of
    the shaft: nothing else in them knows p. A frame that is turned by δ + τ ω mixes δ + τ ω of the
    other voltage into each. Beside L_d the flux of the magnet makes most of v_q, and it changes
    with temperature, which may not be logged: its drift with time is fitted beside.

    References
    ----------
    IEEE Std 1812-2014 (dq equations).

    """
    columns = {
        **rows.columns,
        "speed": rows.speed_rad_s,
        "current": rows.current_a,
        "q voltage": rows.voltage_v,
        WARM_FLUX: rows.warm_speed_k_rad_s,
        WARM_DROP: rows.warm_current_k_a,
        DRIFT: rows.speed_rad_s * (rows.time_s - np.mean(rows.time_s)),
    }
    if V_D not in columns or _spans(columns, axis) < policy().aligned.least_d_share:
        return None
    main, nuisances = ([columns[name] for name in names] for names in COLUMNS[axis])
    chosen = [column for column in main if np.any(column)]
    for column in nuisances:
        beside = linear_fit(np.column_stack(chosen), column).residuals
        if np.linalg.norm(beside) > policy().pole_pairs.least_own_share * np.linalg.norm(column):
            chosen.append(column)
    voltage = rows.voltage_v if axis == "d" else columns[V_D]
    design = np.column_stack(chosen)
    solution = linear_fit(design, voltage)
    if not solution.full_rank or solution.dof < 1:
        return None
    sigma = np.ones(voltage.size)
    covariance, dof = cluster_covariance(design, solution.residuals, sigma, rows.cluster)
    value = (1.0 if axis == "d" else -1.0) * float(solution.coefficients[0])
    behind = linear_fit(design, columns[Q_BEHIND if axis == "q" else D_BEHIND]).coefficients[0]
    share = np.inf
    if axis == "d":
        alone = linear_fit(design[:, 1:], design[:, 0]).residuals
        share = abs(value) * float(np.linalg.norm(alone) / np.linalg.norm(voltage))
    return Slope(value, float(covariance[0, 0] ** 0.5), dof, rows, share, abs(float(behind)))


def _spans(columns: Mapping[str, Array], axis: str) -> float:
    """The span of this axis's current over that of the other one [1]."""
    spans = {a: float(np.ptp(columns[n])) for a, n in (("d", "d current"), ("q", "current"))}
    own, other = spans.pop(axis), sum(spans.values())
    if other == 0.0:
        return np.inf if own > 0.0 else 0.0
    return own / other


def slope_budget(method: Method, axis: str, slope: Slope) -> Budget:
    """Uncertainty of a slope: its scatter, gains of voltage and current, and unmodelled effects.

    Parameters
    ----------
    method
        In whose name its scatter counts.
    axis
        `d` or `q`: of the inductance.
    slope
        By `flux_slope`.

    Returns
    -------
    tuple of Contribution
        In H.

    """
    captures = slope.rows.captures
    metas = [c.meta for c in captures]

    def scaled(shift: Mapping[str, float]) -> Array:
        volts = np.mean([1.0 + shift.get(voltage_source(m), 0.0) for m in metas])
        amps = np.mean([1.0 + shift.get(current_source(m), 0.0) for m in metas])
        return np.array([slope.value_h * volts / amps])

    gains = contributions(scaled, instrument_uncertainties(captures, ("voltage", "current")))[0]
    other = abs(slope.value_h) * slope.unmodelled
    unmodelled = (Contribution(f"{UNMODELLED}:{axis}", other, "B"),) if other > 0.0 else ()
    return (method.scatter(axis, slope.u_h, slope.dof), *gains, *unmodelled)


TESTS = ("drive", "torque_map")


def inductance_at_speed(
    method: Method, axis: str, campaign: Campaign, known: Constants, experiment: str
) -> Fit:
    """L = (p L) / p, p L by `flux_slope` of the drives, else of the torque maps.

    A test at standstill knows it better; with one, nothing is published. A drive may turn its frame
    by a loop that is behind as the shaft gathers speed. Where the current makes that acceleration,
    on a free shaft, no regression separates the two: it is in the uncertainty.

    Parameters
    ----------
    method
        In whose name.
    axis
        `d` or `q`.
    campaign
        With drives or torque maps.
    known
        `ld_h` or `lq_h`, and `pole_pairs`, as far as known.
    experiment
        What to record where it is not determined.

    """
    name = f"l{axis}_h"
    pole_pairs = pole_pairs_of(known, campaign.nameplate("pole_pairs"))
    if any(known.by(other, name) is not None for other in STANDSTILL):
        return method.nothing((name,), "a test at standstill gives it")
    if pole_pairs is None:
        return method.nothing((name,), f"state pole_pairs, or record an open_circuit; {experiment}")
    slopes = _slopes(campaign, axis, pole_pairs)
    doubts = [_doubt(slope, axis) for slope in slopes]
    slope = next((s for s, doubt in zip(slopes, doubts, strict=True) if not doubt), None)
    if slope is None:
        return method.nothing((name,), "; ".join([*doubts[:1], experiment]))
    value = slope.value_h / pole_pairs
    parts = propagate([(1.0 / pole_pairs, slope_budget(method, axis, slope))])
    limits = policy().at_speed
    iron = Contribution(f"assumed:{name}_at_speed", value * limits.share, "B")
    # p of the angle, and one over p of the inductance
    behind = Contribution(f"assumed:{name}_frame", limits.behind_s2 * slope.behind_h_s2, "B")
    captures = slope.rows.captures
    counted = known.best("pole_pairs") is not None
    rests = "" if counted else f"rests on the {pole_pairs} pole pairs that the captures state"
    notes = [rests, unstated_note(captures, ("voltage", "current"))]
    paths = [capture.path for capture in captures]
    return Fit((method.measured(name, value, [*parts, iron, behind], paths, None, notes),))


def _slopes(campaign: Campaign, axis: str, pole_pairs: int) -> list[Slope]:
    """Of the drives and of the torque maps, where a current of this axis changes."""
    slopes = []
    for test in TESTS:
        rows = rows_of_slope(campaign.of(test), pole_pairs)
        slope = flux_slope(rows, axis) if rows else None
        if slope is not None and slope.value_h > 0.0:
            slopes.append(slope)
    return slopes


def _doubt(slope: Slope, axis: str) -> str:
    """Why a slope does not determine the inductance; empty where it does."""
    limits, scatter = policy().at_speed, slope.u_h / slope.value_h
    if scatter > limits.most_scatter:
        return f"it scatters by {100.0 * scatter:.0f} % over the windows"
    if slope.unmodelled > limits.most_unmodelled:
        return (
            f"the {axis} current alone explains {100.0 * slope.share:.1g} % of the voltage, near "
            "what effects make that are not modelled: let it change more, at speed"
        )
    return ""
