"""Pole pairs, phase order and angle of the open-circuit spin, from its back-EMF and its encoder."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.estimation.electrical.back_emf import (
    Spin,
    Stretch,
    StretchFlux,
    electrical_per_mechanical,
)
from pipeline.estimation.uncertainty.instruments import budget_of
from pipeline.physics.conventions import pole_pairs_from
from pipeline.records.capture import Capture
from pipeline.records.estimate import Estimate, not_identifiable
from pipeline.records.uncertainty import Contribution

METHOD = "open_circuit"


@dataclass(frozen=True, slots=True)
class Group:
    """One steady speed of one capture."""

    capture: Capture
    spin: Spin
    stretch: Stretch
    flux: StretchFlux
    temp_degc: float


def count_pole_pairs(groups: Sequence[Group]) -> tuple[Estimate, Estimate]:
    """P and the phase order from electrical over mechanical speed of each capture."""
    ratios: list[float] = []
    words = ""
    paths = []
    for capture in dict.fromkeys(g.capture.path for g in groups):
        own = [g for g in groups if g.capture.path == capture]
        ratio, by_angle = electrical_per_mechanical(own[0].spin, [g.stretch for g in own])
        if math.isfinite(ratio):
            ratios.append(ratio)
            paths.append(capture)
            words = "theta_mech_rad" if by_angle else "omega_mech_rad_s"
    missing = (
        "record theta_mech_rad or omega_mech_rad_s in the open_circuit capture, or a hand_turn"
    )
    if not ratios:
        absent = [not_identifiable(n, "1", METHOD, missing) for n in ("pole_pairs", "phase_order")]
        return absent[0], absent[1]
    counts = [pole_pairs_from(abs(r), 1.0).number for r in ratios]
    found = ", ".join(f"{abs(r):.5f}" for r in ratios)
    if counts[0] is None or len(set(counts)) > 1:
        note = (
            f"electrical cycles a turn of {words} are {found}: no whole number within 0.02; check "
            "for a gear or slip between motor and angle sensor, then repeat the open_circuit"
        )
        pairs = not_identifiable("pole_pairs", "1", METHOD, note)
    else:
        worst = max(abs(abs(r) - counts[0]) for r in ratios)
        note = f"electrical cycles a turn of {words}: {found}; {worst:.1g} from the whole number"
        pairs = Estimate(
            "pole_pairs", counts[0], "1", "measured", METHOD, captures=tuple(paths), note=note
        )
    senses = {1 if r > 0.0 else -1 for r in ratios}
    if len(senses) > 1:
        note = "captures disagree on the phase order; check which leads were exchanged"
        return pairs, not_identifiable("phase_order", "1", METHOD, note)
    order = Estimate(
        "phase_order", senses.pop(), "1", "measured", METHOD, captures=tuple(paths), note=words
    )
    return pairs, order


def angle_offset(
    groups: Sequence[Group], pairs: Estimate, order: Estimate, used: Sequence[Capture]
) -> Estimate:
    """Circular mean over all speeds of the d axis less s p theta, both senses of rotation alike.

    v leads the d axis by a quarter turn in the sense of rotation. The spread between speeds is
    the standard error: a delay shows as a drift with speed, and is not averaged away by chance.
    """
    name = "angle_offset_elec_rad"
    own = [g for g in groups if g.spin.theta_rad is not None]
    if not own or not pairs.known or not order.known:
        note = "record theta_mech_rad in the open_circuit capture"
        return not_identifiable(name, "rad", METHOD, note)
    vectors = []
    for group in own:
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
    kind = Contribution(f"scatter:{METHOD}:{name}", u, "A", float(max(count - 1, 1)))
    return Estimate(
        name,
        float(np.angle(mean)),
        "rad",
        "measured",
        METHOD,
        budget_of([kind]),
        {},
        tuple(c.path for c in used),
        "of the angle sensor as mounted on this bench, not of the motor",
    )
