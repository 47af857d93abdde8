"""Measured torque constant against the one that follows from the back-EMF."""

from __future__ import annotations

from collections.abc import Mapping

from pipeline.crosscheck.judge import judge_ratio, not_evaluated, ratio_of
from pipeline.crosscheck.protocol import Rule
from pipeline.records.capture import Campaign
from pipeline.records.constants import Constants
from pipeline.records.datasheet import Check

NAME = "kt_vs_ke"


def check(constants: Constants, campaign: Campaign, options: Mapping[str, float]) -> Check:
    """Kt from the dynamometer over 1.5 p psi from the open-circuit spin.

    Notes
    -----
    Power that leaves the electrical side, 1.5 e_q i_q = 1.5 p ω ψ i_q, arrives as T ω, so that
    T/i_q = 1.5 p ψ in the amplitude-invariant frame. The option `allowance` [1] covers torque lost
    in iron, which the back-EMF does not see.

    """
    measured, promised = constants.best("kt_peak_nm_a"), constants.best("kt_from_ke_nm_a")
    if measured is None or promised is None or measured.method == promised.method:
        return not_evaluated(NAME, "needs a torque_map for Kt and an open_circuit spin for Ke")
    pairs = constants.best("pole_pairs")
    return judge_ratio(
        NAME,
        ratio_of(measured, promised),
        options["allowance"],
        "torque per peak q ampere over 1.5 p psi from the back-EMF",
        "coupling",
        None if pairs is None else round(pairs.number),
        "gain of the torque, current or voltage sensor, the time base, or captures of two motors",
    )


RULE = Rule(
    NAME, check, {"allowance": 0.01}, tests=("torque_map", "open_circuit"), quantities=("p·psi",)
)
