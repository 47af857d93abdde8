"""Whether flux and inductances, read without torque, predict the dynamometer's torque."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from pipeline.crosscheck.judge import Ratio, judge_deviation, judge_ratio, not_evaluated
from pipeline.crosscheck.protocol import Rule
from pipeline.records.capture import Campaign
from pipeline.records.constants import Constants
from pipeline.records.datasheet import Check
from pipeline.records.estimate import Estimate
from pipeline.records.uncertainty import propagate

NAME = "torque_equation"
BENT = "saturation or cross-saturation: torque agrees at no d current, and inductances are of steps"


def check(constants: Constants, campaign: Campaign, options: Mapping[str, float]) -> Check:
    """Torque per q ampere at the strongest d current: dynamometer over psi, Ld, Lq.

    Notes
    -----
    (Kt + k_r i_d)/(1.5 p [ψ + (L_d − L_q) i_d]), with Kt and k_r fitted to the torque map and ψ,
    L_d, L_q from back-EMF and steps: both terms of the torque equation at once, where the
    reluctance term weighs most. The option `allowance` [1] covers the map's own saturation. A
    convention would be in the torque at no d current too: where that agrees, none is suspected.

    References
    ----------
    IEEE Std 1812-2014 (tests of permanent magnet machines).

    """
    names = ("kt_peak_nm_a", "kt_reluctance_nm_a2", "kt_from_ke_nm_a", "ld_h", "lq_h")
    known = {name: constants.best(name) for name in (*names, "pole_pairs")}
    present = {name: estimate for name, estimate in known.items() if estimate is not None}
    if len(present) < len(known):
        missing = ", ".join(name for name in known if name not in present)
        return not_evaluated(NAME, f"needs {missing}: a torque_map with d currents, steps, a spin")
    id_a = _strongest_d_current_a(campaign)
    if id_a == 0.0:
        return not_evaluated(NAME, "needs a torque_map with d currents")
    pairs = round(present["pole_pairs"].number)
    judged = judge_ratio(
        NAME,
        _ratio(present, pairs, id_a),
        options["allowance"],
        f"torque at i_d = {id_a:.3g} A, dynamometer over magnet and reluctance terms",
        "coupling",
        pairs,
        "inductances or torque of other conditions, or a sensor's gain",
    )
    magnet = _ratio(present, pairs, 0.0)
    of_magnet = judge_deviation(magnet.value - 1.0, magnet.u, options["allowance"])
    return replace(judged, suspect=BENT) if judged.suspect and of_magnet == "pass" else judged


def _strongest_d_current_a(campaign: Campaign) -> float:
    """The d current [A] of largest size that a torque map held, 0 where none was."""
    levels = [
        float(np.nanpercentile(capture.arrays("id_a")["id_a"], share))
        for capture in campaign.of("torque_map")
        if capture.has("id_a")
        for share in (2.0, 98.0)
    ]
    return max(levels, key=abs, default=0.0)


def _ratio(estimates: Mapping[str, Estimate], pairs: int, id_a: float) -> Ratio:
    """The ratio of torques per q ampere."""
    reluctance = 1.5 * pairs * id_a
    measured = estimates["kt_peak_nm_a"].number + estimates["kt_reluctance_nm_a2"].number * id_a
    saliency_h = estimates["ld_h"].number - estimates["lq_h"].number
    predicted = estimates["kt_from_ke_nm_a"].number + reluctance * saliency_h
    ratio = measured / predicted
    terms = [
        (1.0 / predicted, estimates["kt_peak_nm_a"].budget),
        (id_a / predicted, estimates["kt_reluctance_nm_a2"].budget),
        (-ratio / predicted, estimates["kt_from_ke_nm_a"].budget),
        (-ratio * reluctance / predicted, estimates["ld_h"].budget),
        (ratio * reluctance / predicted, estimates["lq_h"].budget),
    ]
    return Ratio.of(ratio, propagate(terms))


RULE = Rule(
    NAME,
    check,
    {"allowance": 0.02},
    tests=("torque_map", "open_circuit", "current_step"),
    quantities=("p·psi", "ld_h", "lq_h"),
)
