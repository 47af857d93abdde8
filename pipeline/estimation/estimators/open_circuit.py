"""Magnet flux, back-EMF constants and harmonics, pole pairs from the open-circuit spin."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from scipy.special import fdtrc

from pipeline.estimation.electrical.back_emf import by_angle, electrical_per_mechanical, flux_of
from pipeline.estimation.electrical.magnet_temperature import (
    assumed_temperature,
    magnet_column,
    magnet_source,
    magnet_uncertainties,
    unlogged_note,
)
from pipeline.estimation.electrical.spin import read_spin
from pipeline.estimation.electrical.spin_angle import Group, angle_offset, count_pole_pairs
from pipeline.estimation.electrical.steady_speed import steady_stretches
from pipeline.estimation.electrical.voltage_filter import behind_filter, left_by_filter
from pipeline.estimation.method import Method
from pipeline.estimation.policy import DEFAULT, policy
from pipeline.estimation.protocol import Estimator, Fit
from pipeline.estimation.thermal.magnet_coefficient import SOURCE
from pipeline.estimation.uncertainty.instruments import (
    in_shares,
    instrument_uncertainties,
    unstated_note,
    voltage_source,
)
from pipeline.numerics.least_squares import LinearFit, linear_fit
from pipeline.physics.coupling import COUPLINGS, CouplingName, coupling_as
from pipeline.physics.glossary import Term
from pipeline.records.capture import Array, Campaign, Capture
from pipeline.records.constants import Constants
from pipeline.records.estimate import Estimate
from pipeline.records.evidence import Evidence, Series
from pipeline.records.uncertainty import Contribution, propagate

EXPERIMENT = (
    "record an open_circuit capture: shaft driven at three or more speeds, two line voltages, "
    "theta_mech_rad, temp_magnet_degc"
)
WARM = "repeat an open_circuit capture with the magnets at least 10 K warmer, temp_magnet_degc in"
ORDERS = (5, 7, 11, 13)
KE_NAMES: tuple[CouplingName, ...] = (
    "ke_phase_peak_v_s_rad",
    "ke_ll_peak_v_s_rad",
    "ke_ll_rms_v_s_rad",
    "ke_ll_peak_v_krpm",
    "kv_ll_peak_rpm_v",
)

TERMS = (
    *(
        Term(f"bemf_harmonic_{k}", "1", f"order {k} of the back-EMF over its fundamental",
             "constant", 0.0, 1.0)
        for k in ORDERS
    ),
    Term("angle_offset_elec_rad", "rad", "d axis less pole pairs times theta_mech_rad", "constant",
         -math.pi, math.pi),
    Term("phase_order", "1", "1: positive rotation runs a, b, c; -1: it runs a, c, b", "constant",
         -1, 1, True),
)  # fmt: skip
GIVES = (
    "psi_pm_wb",
    "temp_coeff_magnet_1_k",
    *KE_NAMES,
    "pole_pairs",
    *(term.name for term in TERMS),
)
METHOD = Method("open_circuit", TERMS)


_FILTERED = (
    "the voltage has {:.2g} % less flux in it at {:.0f} rad/s (electrical) than at standstill, as "
    "behind a filter, and the flux is that of a standstill"
)


def flux_linkage(temp_degc: Array) -> Array:
    """The derivatives of the magnet's flux linkage by what is fitted: it is linear in both.

    Parameters
    ----------
    temp_degc : array [n], degC
        Magnet temperature at each steady speed.

    Returns
    -------
    array [n, 2]
        dψ/dψ25 [1] and dψ/d(slope) [K].

    Notes
    -----
    ψ = |v| / ω_e of the fundamental, and ψ(T) = ψ25 + s (T - 25) = ψ25 (1 + α (T - 25)), so that
    α = s / ψ25. Ke and Kv in every convention are p ψ25 times that convention's factor
    (`coupling.coupling_as`).

    References
    ----------
    IEEE Std 1812-2014, 4.2 (open-circuit test).

    """
    return np.column_stack([np.ones(temp_degc.size), temp_degc - 25.0])


def fit_open_circuit(campaign: Campaign, known: Constants, options: Mapping[str, float]) -> Fit:
    """Psi of every steady speed of every capture, brought to 25 degC together (`flux_linkage`).

    Alpha is fitted where the magnets were at two temperatures, else assumed with its own
    uncertainty.
    """
    captures = campaign.of("open_circuit")
    groups, notes = _groups(captures, options)
    if not groups:
        return METHOD.nothing(GIVES, "; ".join([*notes, EXPERIMENT]))
    used = tuple(c for c in captures if any(g.capture is c for g in groups))
    notes.append(unstated_note(used, ("voltage", "temperature")))
    estimates = _flux_estimates(_of_known_temperature(groups), notes, options)
    pairs, order = count_pole_pairs(METHOD, groups)
    estimates["pole_pairs"] = pairs
    estimates["phase_order"] = order
    estimates |= _couplings(estimates["psi_pm_wb"], pairs)
    estimates |= _harmonics(groups, used)
    estimates["angle_offset_elec_rad"] = angle_offset(METHOD, groups, pairs, order)
    return Fit(
        tuple(estimates[name] for name in GIVES), tuple(_evidence(groups, estimates["psi_pm_wb"]))
    )


def _groups(
    captures: Sequence[Capture], options: Mapping[str, float]
) -> tuple[list[Group], list[str]]:
    groups: list[Group] = []
    notes: list[str] = []
    for capture in captures:
        column = magnet_column(capture)
        fallback = assumed_temperature(capture, options["temp_assumed_degc"])
        try:
            spin = read_spin(capture, column)
            stretches = steady_stretches(spin, options["speed_change"])
        except (KeyError, ValueError):
            notes.append(f"{capture.path}: needs a line voltage")
            continue
        if not stretches:
            least = policy().back_emf.least_cycles
            notes.append(f"{capture.path}: no steady stretch of {least} electrical cycles found")
        ratio = electrical_per_mechanical(spin, stretches)[0]
        for stretch in stretches:
            flux = flux_of(spin, stretch, ORDERS)
            other = by_angle(spin, stretch, ratio)
            if other is not None and stretch.change > options["speed_change"]:
                flux = min(flux, flux_of(spin, other, ORDERS), key=lambda one: one.u_psi_wb)
            temp = fallback if flux.temp_degc is None else flux.temp_degc
            groups.append(Group(capture, spin, stretch, flux, temp))
    return groups, notes


def _of_known_temperature(groups: Sequence[Group]) -> list[Group]:
    """The groups of captures with a thermometer at the magnets; all where there is none."""
    logged = [g for g in groups if magnet_column(g.capture) == "temp_magnet_degc"]
    return logged or list(groups)


def _flux_estimates(
    groups: Sequence[Group], notes: Sequence[str], options: Mapping[str, float]
) -> dict[str, Estimate]:
    used = tuple({g.capture.path: g.capture for g in groups}.values())
    psi = np.array([g.flux.psi_wb for g in groups])
    sigma = np.array([max(g.flux.u_psi_wb, 1e-9 * g.flux.psi_wb) for g in groups])
    design = flux_linkage(np.array([g.temp_degc for g in groups]))
    excess = design[:, 1]
    free = linear_fit(design, psi, sigma)
    alpha, u_alpha = _slope(free)
    wide = float(np.ptp(excess)) >= options["least_span_k"]
    logged = all(magnet_column(c) == "temp_magnet_degc" for c in used)
    measured = logged and wide and free.full_rank and u_alpha <= options["worst_u_alpha_1_k"]
    gains, offsets_k = _instrument_shares(groups, used)
    at = _conditions(groups, excess)
    extra: list[Contribution] = []
    words = [*notes, unlogged_note(used)]
    if measured:
        chosen, filtered = _by_speed(groups, design, psi, sigma)
        value = float(chosen.coefficients[0])
        alpha, u_alpha = _slope(chosen)
    else:
        alpha = options["alpha_assumed_1_k"]
        factor = 1.0 + alpha * excess
        chosen, filtered = _by_speed(groups, factor[:, None], psi, sigma)
        value = float(chosen.coefficients[0])
        lever = _lever(excess, factor, sigma)
        extra = [Contribution(SOURCE, -value * lever * options["u_alpha_assumed_1_k"], "B")]
        words.append(f"magnet coefficient {alpha:g} 1/K assumed to reach 25 degC")
    words.append(filtered)
    widened, dof = _birge(chosen)
    parts = [METHOD.scatter("psi", chosen.u(0) * math.sqrt(widened), dof), *extra]
    parts += [Contribution(source, value * u, "B") for source, u in gains.items()]
    parts += [Contribution(source, -value * alpha * u, "B") for source, u in offsets_k.items()]
    psi_25 = METHOD.measured("psi_pm_wb", value, parts, used, at, words)
    name = "temp_coeff_magnet_1_k"
    if not measured:
        return {psi_25.name: psi_25, name: METHOD.missing(name, WARM)}
    scatter = METHOD.scatter("alpha", u_alpha * math.sqrt(widened), dof)
    offset = [Contribution(s, alpha**2 * u, "B") for s, u in offsets_k.items()]
    coefficient = METHOD.measured(name, alpha, [scatter, *offset], used, at, words)
    return {psi_25.name: psi_25, name: coefficient}


def _by_speed(
    groups: Sequence[Group], design: Array, psi: Array, sigma: Array
) -> tuple[LinearFit, str]:
    """The flux by its design, and why it is that of a standstill where the speeds differ as behind
    a filter of the voltage. Where they differ otherwise, noise says nothing of their weights.
    """
    plain = linear_fit(design, psi, sigma)
    if not _beyond_chance(plain.chi2_dof, plain.dof):
        return plain, ""
    alike = linear_fit(design, psi, np.full(psi.size, float(np.mean(sigma))))
    speed = np.array([g.flux.speed_elec_rad_s for g in groups])
    filtered = behind_filter(design, psi, sigma, speed)
    if filtered is None:
        return alike, ""
    ratio = plain.dof * plain.chi2_dof / (filtered.dof * filtered.chi2_dof)
    if fdtrc(1.0, filtered.dof, filtered.dof * (ratio - 1.0)) > policy().back_emf.filter_level:
        return alike, ""
    top = float(np.abs(speed).max())
    lost = 1.0 - float(left_by_filter(np.array([top]), filtered.coefficients[-1])[0])
    return filtered, _FILTERED.format(100.0 * lost, top)


def _lever(excess_k: Array, factor: Array, sigma: Array) -> float:
    """Mean excess temperature [K] by the weights with which a fit of `factor` [n] has its rows."""
    weight = 1.0 / sigma**2
    return float(np.sum(weight * excess_k * factor) / np.sum(weight * factor**2))


def _conditions(groups: Sequence[Group], excess_k: Array) -> dict[str, float]:
    """Where the flux was measured: temperatures over 25 degC [n, K] and electrical speeds."""
    speeds = [abs(g.flux.speed_elec_rad_s) for g in groups]
    return {
        "temp_magnet_degc": 25.0,
        "temp_measured_low_degc": round(float(excess_k.min()) + 25.0, 3),
        "temp_measured_high_degc": round(float(excess_k.max()) + 25.0, 3),
        "speed_elec_low_rad_s": min(speeds),
        "speed_elec_high_rad_s": max(speeds),
    }


def _slope(fit: LinearFit) -> tuple[float, float]:
    """Alpha = slope/intercept and its standard uncertainty from the scatter."""
    value, slope = (float(c) for c in fit.coefficients[:2])
    alpha = slope / value
    gradient = np.array([-alpha / value, 1.0 / value])
    return alpha, math.sqrt(max(float(gradient @ fit.covariance[:2, :2] @ gradient), 0.0))


def _birge(fit: LinearFit) -> tuple[float, float]:
    """Variance factor where the speeds scatter more than their noise (Birge), else 1; and its dof.

    The noise of a speed is known from all its rows; what widens it, from the few speeds alone.
    """
    wide = _beyond_chance(fit.chi2_dof, fit.dof)
    return (fit.chi2_dof, float(fit.dof)) if wide else (1.0, math.inf)


def _beyond_chance(chi2_dof: float, dof: int) -> bool:
    """Whether chi squared per degree of freedom lies three of its standard deviations over 1."""
    return dof >= 1 and chi2_dof > 1.0 + 3.0 * math.sqrt(2.0 / dof)


def _instrument_shares(
    groups: Sequence[Group], used: Sequence[Capture]
) -> tuple[dict[str, float], dict[str, float]]:
    """Each source's standard uncertainty times the share of the weight read through it."""
    weights = np.array([1.0 / max(g.flux.u_psi_wb, 1e-150) ** 2 for g in groups])
    gains = instrument_uncertainties(used, ("voltage",))
    voltmeters = [voltage_source(g.capture.meta) for g in groups]
    thermometers = [magnet_source(g.capture) for g in groups]
    return (
        in_shares(gains, voltmeters, weights),
        in_shares(magnet_uncertainties(used), thermometers, weights),
    )


def _couplings(psi: Estimate, pairs: Estimate) -> dict[str, Estimate]:
    estimates: dict[str, Estimate] = {}
    for name in KE_NAMES:
        if not pairs.known:
            estimates[name] = METHOD.missing(name, f"needs pole_pairs: {pairs.note}")
            continue
        k = psi.number * pairs.number
        value = coupling_as(name, k)
        slope = COUPLINGS[name].power * value / psi.number
        parts = propagate([(slope, psi.budget)])
        estimates[name] = METHOD.measured(name, value, parts, psi.captures, psi.at, psi.note)
    return estimates


def _harmonics(groups: Sequence[Group], used: Sequence[Capture]) -> dict[str, Estimate]:
    """Weighted mean of the complex ratios, so that noise averages out before the magnitude.

    Speeds that differ by more than their noise widen it, and beyond chance it has their freedom.
    """
    estimates = {}
    for order in ORDERS:
        name = f"bemf_harmonic_{order}"
        with_order = [g for g in groups if order in g.flux.harmonics]
        if not with_order:
            note = f"repeat the open_circuit at a rate above {3 * order} samples a cycle"
            estimates[name] = METHOD.missing(name, note)
            continue
        ratios = np.array([g.flux.harmonics[order] for g in with_order])
        weights = np.array([g.flux.u_harmonic**-2 for g in with_order])
        mean = complex(np.sum(weights * ratios) / weights.sum())
        spread = np.abs(ratios - mean) ** 2 * weights
        free = 2 * len(with_order) - 2
        excess = float(spread.sum()) / max(free, 1)
        u = math.sqrt(max(1.0, excess) / float(weights.sum()))
        dof = float(free) if _beyond_chance(excess, free) else math.inf
        note = "" if abs(mean) > 3.0 * u else "within noise of zero"
        estimates[name] = METHOD.measured(
            name, abs(mean), [METHOD.scatter(name, u, dof)], used, notes=note
        )
    return estimates


def _evidence(groups: Sequence[Group], psi: Estimate) -> list[Evidence]:
    alpha = 0.0
    temps = np.array([g.temp_degc for g in groups])
    psis = np.array([g.flux.psi_wb for g in groups])
    if psi.at["temp_measured_low_degc"] != psi.at["temp_measured_high_degc"]:
        alpha = float(linear_fit(flux_linkage(temps), psis / psi.number).coefficients[1])
    amplitude, flux = [], []
    for path in dict.fromkeys(g.capture.path for g in groups):
        of_capture = [g for g in groups if g.capture.path == path]
        of_capture.sort(key=lambda g: g.flux.speed_elec_rad_s)
        speed = np.array([g.flux.speed_elec_rad_s for g in of_capture])
        volts = np.array([g.flux.amplitude_v for g in of_capture])
        model = np.array([psi.number * (1.0 + alpha * (g.temp_degc - 25.0)) for g in of_capture])
        amplitude.append(Series(path, speed, volts, model * np.abs(speed)))
        flux.append(Series(path, speed, np.array([g.flux.psi_wb for g in of_capture]), model))
    return [
        METHOD.plot(
            "Back-EMF amplitude against speed", ("omega_elec_rad_s", "back_emf_phase_peak_v"),
            "scatter", amplitude,
            "Fundamental of the phase voltage; the line is psi times electrical speed.",
        ),
        METHOD.plot(
            "Flux linkage found at each speed", ("omega_elec_rad_s", "psi_pm_wb"), "scatter", flux,
            "Flat where amplitude is proportional to speed; the steps are temperature.",
        ),
    ]  # fmt: skip


ESTIMATOR = Estimator(
    METHOD.name,
    GIVES,
    ("open_circuit",),
    EXPERIMENT,
    fit_open_circuit,
    terms=TERMS,
    clock_powers={"psi_pm_wb": 1, **dict.fromkeys(KE_NAMES, 1), "kv_ll_peak_rpm_v": -1},
    options={
        "speed_change": 0.02,
        "temp_assumed_degc": 25.0,
        "least_span_k": 8.0,
        "worst_u_alpha_1_k": 3e-4,
        "alpha_assumed_1_k": DEFAULT.magnet.coefficient_1_k,
        "u_alpha_assumed_1_k": DEFAULT.magnet.u_coefficient_1_k,
    },
)
