"""Pole pairs, phase order and angle of the open-circuit spin, from its back-EMF and its encoder."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.estimation.electrical.back_emf import StretchFlux, electrical_per_mechanical
from pipeline.estimation.electrical.spin import Spin
from pipeline.estimation.electrical.steady_speed import Stretch
from pipeline.estimation.method import Method
from pipeline.physics.pole_pairs import pole_pairs_from
from pipeline.records.capture import Capture
from pipeline.records.estimate import Estimate


@dataclass(frozen=True, slots=True)
class Group:
    """One steady speed of one capture.

    Attributes
    ----------
    capture, spin, stretch
        The capture, its voltages, and the rows of this speed.
    flux
        Flux linkage and harmonics.
    temp_degc
        Temperature of the magnets, recorded or assumed.

    """

    capture: Capture
    spin: Spin
    stretch: Stretch
    flux: StretchFlux
    temp_degc: float


def count_pole_pairs(method: Method, groups: Sequence[Group]) -> tuple[Estimate, Estimate]:
    """P and the phase order from electrical over mechanical speed of each capture.

    Parameters
    ----------
    method
        The estimator whose results these are.
    groups
        Steady speeds of all captures.

    Returns
    -------
    pole_pairs, phase_order : Estimate
        Either `not_identifiable` where the captures do not say, or disagree.

    """
    ratios: list[float] = []
    senses: set[int] = set()
    words = ""
    paths = []
    for capture in dict.fromkeys(g.capture.path for g in groups):
        spins = [g for g in groups if g.capture.path == capture]
        ratio, by_angle = electrical_per_mechanical(spins[0].spin, [g.stretch for g in spins])
        if math.isfinite(ratio):
            ratios.append(ratio)
            paths.append(capture)
            if len(spins[0].spin.channels) > 1:
                senses.add(1 if ratio > 0.0 else -1)
            words = "theta_mech_rad" if by_angle else "omega_mech_rad_s"
    missing = (
        "record theta_mech_rad or omega_mech_rad_s in the open_circuit capture, or a hand_turn"
    )
    if not ratios:
        return method.missing("pole_pairs", missing), method.missing("phase_order", missing)
    counts = [pole_pairs_from(abs(r), 1.0).number for r in ratios]
    listed = ", ".join(f"{abs(r):.5f}" for r in ratios)
    if counts[0] is None or len(set(counts)) > 1:
        note = (
            f"electrical cycles a turn of {words} are {listed}: no whole number within 0.02; check "
            "for a gear or slip between motor and angle sensor, then repeat the open_circuit"
        )
        pairs = method.missing("pole_pairs", note)
    else:
        worst = max(abs(abs(r) - counts[0]) for r in ratios)
        note = f"electrical cycles a turn of {words}: {listed}; {worst:.1g} from the whole number"
        pairs = method.measured("pole_pairs", counts[0], captures=paths, notes=note)
    if not senses:
        note = "one voltage does not show it; record two line voltages in the open_circuit capture"
        return pairs, method.missing("phase_order", note)
    if len(senses) > 1:
        note = "captures disagree on the phase order; check which leads were exchanged"
        return pairs, method.missing("phase_order", note)
    return pairs, method.measured("phase_order", senses.pop(), captures=paths, notes=words)


def angle_offset(
    method: Method, groups: Sequence[Group], pairs: Estimate, order: Estimate
) -> Estimate:
    """Circular mean over all speeds of the d axis less s p theta, both senses of rotation alike.

    v leads the d axis by a quarter turn in the sense of rotation. The spread between speeds is
    the standard error: a delay shows as a drift with speed, and is not averaged away by chance.

    Parameters
    ----------
    method
        The estimator whose result it is.
    groups
        Steady speeds of all captures.
    pairs, order
        As `count_pole_pairs` gives them.

    Returns
    -------
    Estimate
        [rad, electrical].

    Notes
    -----
    θ_0 = arg mean exp j(phase - s π/2 - order p θ), s the sense of rotation.

    """
    name = "angle_offset_elec_rad"
    with_angle = [g for g in groups if g.spin.theta_rad is not None]
    if not with_angle or not pairs.known or not order.known:
        return method.missing(name, "record theta_mech_rad in the open_circuit capture")
    vectors = []
    for group in with_angle:
        theta = group.spin.theta_rad
        if theta is None:
            continue
        sense = math.copysign(1.0, group.flux.speed_elec_rad_s)
        axis = group.stretch.phase_rad - sense * math.pi / 2.0
        offset = axis - order.number * pairs.number * theta[group.stretch.rows]
        vectors.append(complex(np.nanmean(np.exp(1j * offset))))
    mean = complex(np.mean(vectors))
    apart = np.angle(np.array(vectors) / mean)
    count = len(vectors)
    u = float(np.std(apart, ddof=1)) / math.sqrt(count) if count > 1 else float(math.pi / 100)
    scatter = method.scatter(name, u, float(max(count - 1, 1)))
    paths = dict.fromkeys(g.capture.path for g in groups)
    note = "of the angle sensor as mounted on this bench, not of the motor"
    return method.measured(name, float(np.angle(mean)), [scatter], paths, notes=note)
