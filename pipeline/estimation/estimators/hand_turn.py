"""Pole pairs and magnet flux from one mechanical turn by hand."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from pipeline.estimation.electrical.hand_turns import Turn, turns_of
from pipeline.estimation.electrical.magnet_temperature import (
    assumed_temperature,
    magnet_column,
    magnet_source,
    magnet_uncertainties,
    unlogged_note,
)
from pipeline.estimation.electrical.spin import read_spin
from pipeline.estimation.method import Method
from pipeline.estimation.policy import DEFAULT
from pipeline.estimation.protocol import Estimator, Fit
from pipeline.estimation.thermal.magnet_coefficient import SOURCE
from pipeline.estimation.uncertainty.instruments import (
    in_shares,
    instrument_uncertainties,
    unstated_note,
    voltage_source,
)
from pipeline.numerics.plateaus import decimated
from pipeline.physics.pole_pairs import POLE_PAIRS_TOLERANCE, pole_pairs_from
from pipeline.records.capture import Campaign, Capture
from pipeline.records.constants import Constants
from pipeline.records.estimate import Estimate
from pipeline.records.evidence import Evidence, Series
from pipeline.records.uncertainty import (
    Contribution,
    effective_dof,
    propagate,
    standard_uncertainty,
    type_b,
)

METHOD = Method("hand_turn")
GIVES = ("pole_pairs", "psi_pm_wb")
EXPERIMENT = (
    "record a hand_turn: terminals open, shaft turned by hand through exactly one turn from rest "
    "to rest, a line voltage, theta_mech_rad if there is a sensor"
)


def fit_hand_turn(campaign: Campaign, known: Constants, options: Mapping[str, float]) -> Fit:
    """Flux is the integral of the voltage, so the hand's speed does not enter.

    Notes
    -----
    λ(t) = ∫(v - v_0) dt = ψ cos(p θ + φ) + λ_0 of each channel, phase to star point: one whole turn
    runs through p cycles, and ψ is their amplitude.

    Cycles are counted against the angle where there, else by the phase of the flux vector where
    two voltages were read, else by the swings of the one flux; without the angle the capture has
    to be one whole turn. Amplitude by least squares of flux steps on steps of cos(phase), whose
    noise is white though that of the flux itself is not (`electrical.hand_turns`).

    """
    turns: list[tuple[Capture, Turn]] = []
    notes: list[str] = []
    for capture in campaign.of("hand_turn"):
        try:
            spin = read_spin(capture, None)
        except KeyError:
            notes.append(f"{capture.path}: no terminal voltage")
            continue
        hand_turns = turns_of(spin)
        turns += [(capture, turn) for turn in hand_turns]
        if not hand_turns:
            notes.append(
                f"{capture.path}: the voltage does not stand out of the noise, or not for a cycle"
            )
    if not turns:
        return METHOD.nothing(GIVES, "; ".join([*notes, EXPERIMENT]))
    pairs = _pole_pairs(turns)
    psi = _flux(turns, known, options)
    return Fit((pairs, psi), (_evidence(turns),))


def _pole_pairs(turns: Sequence[tuple[Capture, Turn]]) -> Estimate:
    paths = sorted({c.path for c, _ in turns})
    cycles = float(np.median([t.cycles for _, t in turns]))
    number = pole_pairs_from(cycles, 1.0).number
    if number is None:
        note = (
            f"{cycles:.3f} electrical cycles a turn, no whole number within "
            f"{POLE_PAIRS_TOLERANCE}; repeat the hand_turn, exactly once around, from rest to rest"
        )
        return METHOD.missing("pole_pairs", note)
    apart = abs(cycles - number)
    note = f"{cycles:.4f} electrical cycles a turn, {apart:.1g} from the whole number"
    return METHOD.measured("pole_pairs", number, captures=paths, notes=note)


def _flux(
    turns: Sequence[tuple[Capture, Turn]], known: Constants, options: Mapping[str, float]
) -> Estimate:
    """Weighted mean of the channels at 25 degC; its scatter is their own, or how they differ."""
    captures = tuple({c.path: c for c, _ in turns}.values())
    coefficient = known.best("temp_coeff_magnet_1_k")
    alpha = options["alpha_assumed_1_k"] if coefficient is None else coefficient.number
    excesses = [_temperature(c, options["temp_assumed_degc"]) - 25.0 for c, _ in turns]
    values = [t.psi_wb / (1.0 + alpha * e) for (_, t), e in zip(turns, excesses, strict=True)]
    weights = np.array([1.0 / max(turn.u_psi_wb, 1e-12) ** 2 for _, turn in turns])
    share = weights / np.sum(weights)
    value = float(share @ np.array(values))
    scatter = tuple(
        Contribution(f"{k}", float(w) * turn.u_psi_wb, "A", turn.dof)
        for k, (w, (_, turn)) in enumerate(zip(share, turns, strict=True))
    )
    u, dof = standard_uncertainty(scatter), effective_dof(scatter)
    if len(values) > 1:
        spread = math.sqrt(float(share @ (np.array(values) - value) ** 2) / (len(values) - 1))
        u, dof = max((u, dof), (spread, len(values) - 1.0))
    excess = float(share @ np.array(excesses))
    assumed = type_b(SOURCE, options["u_alpha_assumed_1_k"])
    of_alpha = assumed if coefficient is None else coefficient.budget
    parts = [METHOD.scatter("psi", u, dof)]
    parts += propagate([(-value * excess, of_alpha)])
    voltmeters = [voltage_source(c.meta) for c, _ in turns]
    gains = in_shares(instrument_uncertainties(captures, ("voltage",)), voltmeters, weights)
    parts += [Contribution(source, value * u, "B") for source, u in gains.items()]
    thermometers = [magnet_source(c) for c, _ in turns]
    offsets_k = in_shares(magnet_uncertainties(captures), thermometers, weights)
    parts += [Contribution(source, -value * alpha * u, "B") for source, u in offsets_k.items()]
    notes = [unlogged_note(captures), unstated_note(captures, ("voltage", "temperature"))]
    at = {"temp_magnet_degc": 25.0, "temp_measured_degc": round(excess + 25.0, 2)}
    return METHOD.measured("psi_pm_wb", value, parts, captures, at, notes)


def _temperature(capture: Capture, assumed_degc: float) -> float:
    """Mean temperature of the magnet as recorded, else its ambient or what is assumed [degC]."""
    column = magnet_column(capture)
    if column is None:
        return assumed_temperature(capture, assumed_degc)
    return float(np.nanmean(capture.arrays(column)[column]))


def _evidence(turns: Sequence[tuple[Capture, Turn]]) -> Evidence:
    series = []
    for capture, turn in turns:
        rows = decimated(turn.t_s.size)
        fitted = turn.fitted_wb[rows] if turn.fitted_wb.size else turn.fitted_wb
        label = f"{capture.path} {turn.channel}"
        series.append(Series(label, turn.t_s[rows], turn.flux_wb[rows], fitted))
    return METHOD.plot(
        "Flux linkage over one turn by hand", ("t_s", "psi_pm_wb"), "line", series,
        "Integral of the voltage, phase to star point; each cycle is one pole pair.",
    )  # fmt: skip


ESTIMATOR = Estimator(
    METHOD.name,
    GIVES,
    ("hand_turn",),
    EXPERIMENT,
    fit_hand_turn,
    uses=("temp_coeff_magnet_1_k",),
    rank=1,
    clock_powers={"psi_pm_wb": 1},
    options={
        "temp_assumed_degc": 25.0,
        "alpha_assumed_1_k": DEFAULT.magnet.coefficient_1_k,
        "u_alpha_assumed_1_k": DEFAULT.magnet.u_coefficient_1_k,
    },
)
